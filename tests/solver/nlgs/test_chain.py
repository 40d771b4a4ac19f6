"""One interval of the Gauss-Seidel chain: scales, sub-steps and the memory for the next interval."""

from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.bodies.grains import GrainMotion, Grains
from rodsight.solver.bodies.motion import FrameMotion
from rodsight.solver.bodies.packing import Material, Packing
from rodsight.solver.detection.contact_networks import PairProbability, ProbabilityNetwork, ThresholdNetwork
from rodsight.solver.nlgs.chain import ChainSettings, advance_chain, advance_chain_through, force_scale
from rodsight.solver.nlgs.force_memory import ForceMemory
from rodsight.solver.nlgs.interval import Interval
from rodsight.solver.nlgs.problem import with_boundary

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


NARROWING = 1e-6  # [m] that two rods of the boundary seem to approach in an interval


def clamped(error, narrowing=NARROWING, memory=None, kappa=0.05):
    """Chain of a rod between two rods of the boundary whose distance seems to shrink; error: of a position [m]."""
    grains = Grains(np.full(3, 0.01), np.ones(3), np.array([True, False, True]))
    velocity = np.array([[0.0, 0.0], [-narrowing / 4.0, 0.0], [-narrowing / 2.0, 0.0]])
    place = np.array([[0.0, 0.0], [0.02, 0.0], [0.04, 0.0]])
    state = GrainMotion(place, velocity, np.zeros(3), np.ones(3, np.bool_))
    packing = Packing(grains, LENGTH, Material(0.3, 0.3, 0.0), np.empty(0))
    none = np.empty((0, 2, 2))
    motion = FrameMotion(2.0, state, none, none, True, error)
    settings = replace(SETTINGS, sweeps=2000, kappa=kappa)
    step = advance_chain(packing, motion, memory or ForceMemory.empty(), settings, ThresholdNetwork(1e-5))
    return step, force_scale(packing, settings)


def test_a_clamped_rod_bears_what_moves_the_boundary_by_its_error():
    """Two rods of the boundary, each moved by half of the narrowing: f = f₀ · (narrowing / 2) / (√2 σ)."""
    for error in (2e-6, 1e-5):
        step, scale = clamped(error)
        assert step.solution.fn == pytest.approx([scale * NARROWING / 2.0 / (np.sqrt(2.0) * error)] * 2, rel=1e-3)
        assert step.solution.unbalance < 1e-3  # the rods of the boundary need no equilibrium
    assert clamped(2e-6)[0].solution.fn.min() > 4.0 * clamped(1e-5)[0].solution.fn.max()


def test_a_reaction_that_was_there_before_moves_the_boundary_no_more():
    first, _ = clamped(2e-6)
    still, _ = clamped(2e-6, 0.0, first.memory)
    assert still.solution.fn == pytest.approx(first.solution.fn, rel=1e-3)
    assert still.old_unbalance < 1e-6
    again, _ = clamped(2e-6, NARROWING, first.memory)
    assert again.solution.fn == pytest.approx(2.0 * first.solution.fn, rel=1e-3)


def test_a_boundary_without_an_error_and_that_of_the_papers_scheme_stay():
    grains = Grains(np.full(3, 0.01), np.ones(3), np.array([True, False, True]))
    impedance = np.array([1.0, 2.0, 3.0])
    assert with_boundary(impedance, grains, force_scale=6.0, error=3.0).tolist() == [2.0, 2.0, 2.0]
    assert with_boundary(impedance, grains, force_scale=6.0, error=0.0).tolist() == [np.inf, 2.0, np.inf]
    assert clamped(1e-5, kappa=None)[0].problem.body[:, 3].tolist()[::2] == [0.0, 0.0]
    assert with_boundary(impedance, replace(grains, boundary=None), force_scale=6.0, error=3.0) is impedance
