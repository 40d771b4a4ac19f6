"""Rods glued to a plate under load: the forces on both carry the load."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numba
import numpy as np
import pytest
from rodsight.solver.bodies.grains import Grains
from rodsight.solver.bodies.motion import Snapshot
from rodsight.solver.bodies.packing import Material, Packing
from rodsight.solver.bodies.walls import Walls
from rodsight.solver.contacts.pairs import make_keys, match_values
from rodsight.solver.sequence import frame as frames
from rodsight.solver.sequence.boundary_load import inner_reaction, scale_to_load
from rodsight.solver.sequence.frames import solve_sequence
from rodsight.solver.sequence.settings import SequenceSettings

from tests.solver.posterior.simulated import simulate_shear

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs the compiled kernels")
TOP, FRAMES = 2, 4


@pytest.fixture(scope="module")
def glued():
    """A packing in shear whose rods at the top are rods of the boundary, and the true forces of others on these."""
    sheared = simulate_shear(0.25, FRAMES)
    grains = sheared.packing.grains
    top = sheared.snapshots[0].endpoints[TOP, :, 1].mean()
    at_top = top - sheared.snapshots[0].position[:, 1] < 1.05 * grains.radius
    return sheared, replace(sheared.packing, grains=replace(grains, boundary=at_top))


def scales(sheared, packing) -> list[float]:
    """Sums of f_n of every frame over the true ones of the same contacts."""
    found = []
    for k, (frame, _) in enumerate(solve_sequence(packing, sheared.snapshots, SequenceSettings())):
        key, force = sheared.truth(k)
        contacts = frame.contacts
        known = make_keys(contacts.i, contacts.j, packing.grains.count + 4)
        true = match_values(known, np.sort(key), force[np.argsort(key), 0], fill=np.nan)
        found.append(float(frame.fn[np.isfinite(true)].sum() / np.nansum(true)))
    return found


@pytest.mark.thorough
def test_rods_glued_to_a_plate_bear_their_part_of_its_load(glued, monkeypatch) -> None:
    sheared, packing = glued
    assert packing.grains.boundary.sum() > 5
    right = np.array(scales(sheared, packing))
    monkeypatch.setattr(frames, "load_scale", lambda *_: 1.0)
    by_width = np.array(scales(sheared, packing))
    assert np.abs(right - 1.0)[1:].max() < 0.15
    assert np.abs(by_width - 1.0)[1:].max() > 0.2


def problem_of(boundary=(1, 0, 0, 1, 0), pressure=(np.nan, 1000.0), gravity=(0.0, 0.0), glued=0.1):
    """Two columns of two rods between a bottom and a plate of 1 m² under load, to which two are glued; a free rod."""
    radius = np.array([glued, 0.1, 0.1, glued, 0.1])
    grains = Grains(radius, np.ones(5), np.array(boundary, np.bool_))
    packing = Packing(grains, 1.0, Material(0.3, 0.3, gravity=gravity), np.array(pressure))
    position = np.array([[0.2, 0.4 - radius[0]], [0.2, 0.1], [0.6, 0.1], [0.6, 0.4 - radius[3]], [0.9, 0.3]])
    ends = np.array([[[0.0, 0.0], [1.0, 0.0]], [[1.0, 0.4], [0.0, 0.4]]])
    snapshot = Snapshot(0.0, position, np.zeros(5), np.ones(5, bool), ends, 1e-6)
    contacts = SimpleNamespace(  # glued and free, free and glued, free and bottom twice
        i=np.array([0, 2, 1, 2]), j=np.array([1, 3, 5, 5]),
        normal=np.array([[0.0, -1.0], [0.0, 1.0], [0.0, -1.0], [0.0, -1.0]]), tangent=np.array([[1.0, 0.0]] * 4),
    )  # fmt: skip
    fn, ft = np.array([300.0, 200.0, 300.0, 200.0]), np.zeros(4)
    return SimpleNamespace(packing=packing, snapshot=snapshot), Walls.at_rest(ends), contacts, fn, ft


def test_glued_rods_bear_the_load_wherever_they_stand_in_a_pair():
    assert scale_to_load(*problem_of()) == pytest.approx(1000.0 / 500.0)


@pytest.mark.parametrize(
    "changed",
    [
        {"boundary": (0,) * 5},
        {"pressure": (400.0, 1000.0), "boundary": (1, 1, 0, 1, 0)},
        {"gravity": (0.0, -9.81)},
        {"glued": 0.02},
    ],
)
def test_without_glued_rods_with_two_loads_or_with_weight_nothing_is_scaled(changed):
    assert scale_to_load(*problem_of(**changed)) == 1.0


def test_boundary_rods_inside_a_packing_bear_what_others_press_on_them_from_all_sides():
    """Two boundary rods: one between two free ones, with 300 N below and 200 N above; one with 50 N from below."""
    grains = Grains(np.full(5, 0.1), np.ones(5), np.array([False, True, False, True, False]))
    contacts = SimpleNamespace(
        i=np.array([0, 1, 3]), j=np.array([1, 2, 4]), normal=np.array([[0.0, 1.0]] * 2 + [[0.0, -1.0]]),
        tangent=np.array([[-1.0, 0.0]] * 2 + [[1.0, 0.0]]), with_wall=np.zeros(3, np.bool_), grain_count=5,
    )  # fmt: skip
    fn, ft = np.array([300.0, 200.0, 50.0]), np.zeros(3)
    assert inner_reaction(grains, contacts, fn, ft) == pytest.approx(100.0 / 550.0)
    sheared = np.array([0.0, 75.0, 0.0])  # along x
    size = 300.0 + np.hypot(200.0, 75.0) + 50.0
    assert inner_reaction(grains, contacts, fn, sheared) == pytest.approx(125.0 / size)
    assert inner_reaction(replace(grains, boundary=None), contacts, fn, ft) == 0.0
    assert inner_reaction(grains, contacts, fn * [1.0, 0.0, 1.0], ft) == 0.0  # pressed from one side
    assert inner_reaction(grains, contacts, 0.0 * fn, ft) == 0.0
