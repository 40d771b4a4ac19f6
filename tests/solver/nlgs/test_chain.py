"""One interval of the Gauss-Seidel chain: scales, sub-steps and the memory for the next interval."""

from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.bodies.motion import FrameMotion
from rodsight.solver.bodies.packing import Material, Packing
from rodsight.solver.detection.contact_networks import PairProbability, ProbabilityNetwork, ThresholdNetwork
from rodsight.solver.nlgs.chain import ChainSettings, advance_chain, advance_chain_through, force_scale
from rodsight.solver.nlgs.force_memory import ForceMemory
from rodsight.solver.nlgs.interval import Interval

from tests.packings import LENGTH, squeezed_heap

GRAINS, STATE, WALLS = squeezed_heap(np.random.default_rng(8), columns=4, rows=4)
PACKING = Packing(GRAINS, LENGTH, Material(0.3, 0.3, 0.2), np.array([np.nan, np.nan, 5e4, np.nan]))
MOTION = FrameMotion(2.0, STATE, WALLS.endpoints, WALLS.velocity, True, 1e-6)
NEAR = ThresholdNetwork(2e-4)
SETTINGS = ChainSettings(sweeps=6, substeps=3, spin_up=4)


def test_the_force_of_a_grain_is_the_pressure_on_its_face():
    diameter = 2.0 * GRAINS.radius.mean()
    assert force_scale(PACKING, SETTINGS) == pytest.approx(5e4 * LENGTH * diameter)
    free = replace(PACKING, pressure=np.full(4, np.nan))
    assert force_scale(free, ChainSettings(reference_pressure=3e3)) == pytest.approx(3e3 * LENGTH * diameter)


def test_the_papers_time_step_has_a_kinematic_number():
    """κ = m̄ v_rms / (δt f₀), δt that of a sub-step."""
    step = advance_chain(PACKING, MOTION, ForceMemory.empty(), replace(SETTINGS, kappa=None), NEAR)
    rms = np.sqrt(np.mean(np.sum(STATE.velocity**2, axis=1)))
    scale = force_scale(PACKING, SETTINGS)
    assert step.kappa == pytest.approx(GRAINS.mass.mean() * rms / (2.0 / 4 * scale))
    assert advance_chain(PACKING, MOTION, ForceMemory.empty(), SETTINGS, NEAR).kappa == 0.05


def test_a_chain_without_previous_forces_has_more_sub_steps():
    first = advance_chain(PACKING, MOTION, ForceMemory.empty(), SETTINGS, NEAR)
    assert first.sweeps == 4 * 6
    assert np.isnan(first.old_unbalance)
    second = advance_chain(PACKING, MOTION, first.memory, SETTINGS, NEAR)
    assert second.sweeps == 3 * 6
    assert second.old_unbalance > 0
    without_motion = advance_chain(PACKING, replace(MOTION, ends_here=False), ForceMemory.empty(), SETTINGS, NEAR)
    assert without_motion.sweeps == 6 * 3  # one sub-step with the sweeps of an interval


def test_the_next_interval_starts_from_the_forces_found():
    first = advance_chain(PACKING, MOTION, ForceMemory.empty(), SETTINGS, NEAR)
    assert first.memory.recall(first.contacts) == pytest.approx(first.solution.force)
    assert np.abs(first.solution.force).max() > 0


class Spy:
    """A network that records its calls."""

    def __init__(self):
        self.calls = []

    def at(self, fraction, grains, state, walls):
        self.calls.append((fraction, state.position.copy(), walls.endpoints.copy()))
        return NEAR.at(fraction, grains, state, walls)


def test_sub_steps_go_evenly_through_the_interval():
    spy = Spy()
    moving = replace(MOTION, wall_velocity=np.full((4, 2, 2), 1e-6))
    first = advance_chain(PACKING, moving, ForceMemory.empty(), SETTINGS, spy)
    assert [fraction for fraction, *_ in spy.calls] == pytest.approx([0.25, 0.5, 0.75, 1.0])
    for fraction, position, endpoints in spy.calls:
        assert position == pytest.approx(STATE.position - (1.0 - fraction) * 2.0 * STATE.velocity, abs=1e-15)
        assert endpoints == pytest.approx(WALLS.endpoints - (1.0 - fraction) * 2e-6, abs=1e-15)
    assert np.array_equal(first.walls.endpoints, WALLS.endpoints)


def test_chains_share_the_contacts_of_an_interval_and_are_as_each_by_itself():
    spy = Spy()
    interval = Interval(PACKING, MOTION, spy)
    for settings in (SETTINGS, replace(SETTINGS, kappa=0.1), SETTINGS):
        shared = advance_chain_through(interval, ForceMemory.empty(), settings)
        alone = advance_chain(PACKING, MOTION, ForceMemory.empty(), settings, NEAR)
        np.testing.assert_array_equal(shared.solution.force, alone.solution.force)
    assert len(spy.calls) == 4


def test_an_ambiguous_contact_carries_less_force():
    contacts, _ = NEAR.at(1.0, GRAINS, STATE, WALLS)
    ambiguous = contacts.key == contacts.key[np.flatnonzero(~contacts.with_wall)[3]]

    def force(probability):
        pairs = PairProbability(contacts.key, np.where(ambiguous, probability, 1.0))
        fast = replace(MOTION, grains=replace(STATE, velocity=30.0 * STATE.velocity))
        found = advance_chain(PACKING, fast, ForceMemory.empty(), SETTINGS, ProbabilityNetwork(pairs, pairs))
        return found.solution.fn[np.isin(found.contacts.key, contacts.key[ambiguous])][0]

    sure = force(1.0)
    assert sure > 0.0
    assert force(0.3) == sure
    assert force(0.004) < sure
