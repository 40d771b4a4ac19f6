"""A plate of several bodies: a bar and the corner discs fixed to it have one motion and one load."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.solver.bodies.motion import Snapshot
from rodsight.solver.bodies.packing import Material, Packing
from rodsight.solver.bodies.wall_shapes import OUT, STRAIGHT
from rodsight.solver.bodies.walls import Walls
from rodsight.solver.contacts.contacts import detect_contacts
from rodsight.solver.contacts.kinematics import equilibrium_matrix, external_load
from rodsight.solver.convex.program import LoadScale, assemble_balance, project_onto_equilibrium
from rodsight.solver.nlgs.problem import assemble
from rodsight.solver.nlgs.solve import NlgsSettings, solve

from tests.packings import LENGTH, motion, rods

LOAD = 90.0  # [N]
R, CORNER = 0.01, 0.02  # [m] of the rods and of the disc
RIGHT = np.array([1.0, 0.0])
SOLVED = 1e-6  # relative
FIXED = np.array([-1, -1, -1, -1, 2, -1], np.int32)


def three_supports(plate=FIXED):
    """Two rods on a floor hold up the bar; a third, on a floor of its own and against a wall, holds up the disc."""
    height = 2.0 * R
    corner = np.array([0.09, height])  # end of the bar and centre of the disc
    lean = np.arcsin(0.6)  # between the vertical and the line from the disc to the third rod
    third = corner + (CORNER + R) * np.array([np.sin(lean), -np.cos(lean)])
    position = np.array([[0.02, R], [0.06, R], third])
    right, low = third + R * np.array([1.0, -1.0])
    ends = np.array([
        [[0.0, low], [right, low]],
        [[right, low], [right, height]],
        [corner, [0.0, height]],
        [[0.0, height], [0.0, 0.0]],
        np.stack([corner - CORNER * RIGHT, corner + CORNER * RIGHT]),
        [[0.0, 0.0], [0.08, 0.0]],
    ])  # fmt: skip
    load = np.array([np.nan, np.nan, LOAD, np.nan, np.nan, np.nan])
    sides = np.array([STRAIGHT, STRAIGHT, STRAIGHT, STRAIGHT, OUT, STRAIGHT], np.int8)
    walls = Walls(ends, np.zeros((6, 2, 2)), load, sides, plate=plate)
    grains = rods(R, R, R)
    contacts = detect_contacts(grains, position, np.ones(3, bool), walls, 1e-9)
    return grains, motion(position), walls, contacts


def upward_on_plate(contacts, fn, ft):
    """Sum of the forces of rods on the bar and on the disc, upwards [N]."""
    on = np.isin(contacts.j - contacts.grain_count, (2, 4))
    return float((fn * contacts.normal[:, 1] + ft * contacts.tangent[:, 1])[on].sum())


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_the_load_is_shared_by_bar_and_discs(friction):
    grains, state, walls, contacts = three_supports()
    assert contacts.count == 7
    material = Material(friction, friction, 0.0, (0.0, 0.0))
    problem = assemble(grains, state, walls, contacts, material, grains.mass * 1e3)
    found = solve(problem, NlgsSettings(sweeps=20_000, natural_map=1e-13), every=50)
    assert upward_on_plate(contacts, found.fn, found.ft) == pytest.approx(LOAD, rel=SOLVED)
    assert found.fn[contacts.j == grains.count + 4] > 0.05 * LOAD


def test_every_method_has_the_same_equilibrium():
    grains, _, walls, contacts = three_supports()
    matrix = equilibrium_matrix(contacts, grains.radius, walls)
    row = matrix[[3 * grains.count]].toarray()[0]
    on = np.isin(contacts.j - grains.count, (2, 4))
    assert row == pytest.approx(np.concatenate([contacts.normal[:, 1] * on, contacts.tangent[:, 1] * on]))
    assert external_load(grains.weight((0.0, 0.0)), walls)[-1] == LOAD
    balance = assemble_balance(
        contacts, grains, walls, present=np.ones(3, bool), friction=np.full(contacts.count, 0.3), scale=LoadScale(LOAD)
    )
    uniform = np.full(contacts.count, LOAD / 3.0)
    found = project_onto_equilibrium(balance, uniform, np.zeros(contacts.count))
    assert upward_on_plate(contacts, found.fn, found.ft) == pytest.approx(LOAD, rel=1e-3)


def test_a_disc_beside_a_plate_is_fixed_unless_it_belongs_to_it():
    grains, _, walls, contacts = three_supports(plate=None)
    assert walls.carrier.tolist() == [-1, -1, 2, -1, -1, -1]
    row = equilibrium_matrix(contacts, grains.radius, walls)[[3 * grains.count]].toarray()[0]
    assert row.sum() == 2.0
    assert three_supports()[2].carrier.tolist() == [-1, -1, 2, -1, 2, -1]


def test_a_snapshot_names_the_plate_of_every_wall():
    grains, state, walls, _ = three_supports()
    packing = Packing(grains, LENGTH, Material(0.3, 0.3), np.full(6, np.nan))
    shot = Snapshot(
        0.0, state.position, np.zeros(3), state.present, walls.endpoints, 1e-6, walls.side, walls.load,
        plate=walls.plate,
    )  # fmt: skip
    assert packing.walls_of(shot).carrier.tolist() == walls.carrier.tolist()
