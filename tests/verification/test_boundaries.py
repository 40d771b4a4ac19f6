"""Static equilibrium with convex arrangements of walls, several loaded plates, and weight."""

import numpy as np
import pytest
from rodsight.solver.bodies.motion import Snapshot, no_motion
from rodsight.solver.bodies.packing import Material, Packing
from rodsight.solver.bodies.walls import Walls
from rodsight.solver.contacts.contacts import detect_contacts
from rodsight.solver.convex.program import LoadScale, assemble_balance, project_onto_equilibrium
from rodsight.solver.detection.contact_networks import ThresholdNetwork
from rodsight.solver.nlgs.chain import ChainSettings, advance_chain
from rodsight.solver.nlgs.force_memory import ForceMemory
from rodsight.solver.nlgs.problem import assemble
from rodsight.solver.nlgs.solve import NlgsSettings, solve
from rodsight.solver.statistics.stress import wall_forces

from tests.packings import LENGTH, box, motion, rods

CONVERGED = 1e-6  # relative, of an iteration run far beyond its need


def triangle(inradius: float, load: float) -> Walls:
    """An equilateral triangle around the origin; its first side carries a load [N]."""
    angle = np.deg2rad([-150.0, -30.0, 90.0])
    corners = 2.0 * inradius * np.column_stack([np.cos(angle), np.sin(angle)])
    endpoints = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    return Walls(endpoints, np.zeros((3, 2, 2)), np.array([load, np.nan, np.nan]))


def static_forces(grains, position, walls, *, friction=0.3, gravity=(0.0, 0.0)):
    state = motion(position)
    contacts = detect_contacts(grains, state.position, state.present, walls, 1e-9)
    problem = assemble(grains, state, walls, contacts, Material(friction, friction, 0.0, gravity), grains.mass * 1e3)
    solution = solve(problem, NlgsSettings(sweeps=100_000, natural_map=1e-13), every=20)
    return contacts, solution


def test_grain_in_a_triangle_has_equal_forces_on_all_sides():
    contacts, solution = static_forces(rods(0.01), np.zeros((1, 2)), triangle(0.01, 7.0), friction=0.0)
    assert contacts.count == 3
    assert solution.fn == pytest.approx([7.0] * 3, rel=CONVERGED)
    assert wall_forces(contacts, solution.fn, solution.ft).sum(axis=0) == pytest.approx([0.0, 0.0], abs=1e-6)


def square_lattice(columns, rows, radius=0.01):
    x, y = np.meshgrid(np.arange(columns), np.arange(rows))
    return radius * (1 + 2 * np.column_stack([x.ravel(), y.ravel()]).astype(float))


def test_two_plates_each_carry_their_own_load():
    position = square_lattice(3, 2)
    walls = box(0.06, 0.04)
    walls = Walls(walls.endpoints, walls.velocity, np.array([np.nan, 8.0, 30.0, np.nan]))
    contacts, solution = static_forces(rods(*[0.01] * 6), position, walls, friction=0.0)
    total = wall_forces(contacts, solution.fn, solution.ft)
    assert total[1] == pytest.approx([8.0, 0.0], rel=CONVERGED, abs=1e-6)
    assert total[2] == pytest.approx([0.0, 30.0], rel=CONVERGED, abs=1e-6)
    assert total[0] == pytest.approx([0.0, -30.0], rel=CONVERGED, abs=1e-6)
    assert total[3] == pytest.approx([-8.0, 0.0], rel=CONVERGED, abs=1e-6)


def test_floor_carries_weight_and_load():
    position = square_lattice(2, 3)
    grains = rods(*[0.01] * 6)
    contacts, solution = static_forces(grains, position, box(0.04, 0.06, top_load=5.0), gravity=(0.0, -9.81))
    floor = wall_forces(contacts, solution.fn, solution.ft)[0, 1]
    sides = wall_forces(contacts, solution.fn, solution.ft)[[1, 3], 1].sum()
    assert -(floor + sides) == pytest.approx(5.0 + 9.81 * grains.mass.sum(), rel=CONVERGED)


def test_gravity_may_have_any_direction():
    grains = rods(*[0.01] * 6)
    contacts, solution = static_forces(grains, square_lattice(3, 2), box(0.06, 0.04), gravity=(9.81, 0.0))
    assert wall_forces(contacts, solution.fn, solution.ft).sum(axis=0) == pytest.approx(
        [9.81 * grains.mass.sum(), 0.0], rel=CONVERGED, abs=1e-6
    )


def test_projected_forces_balance_every_plate():
    position = square_lattice(3, 2)
    walls = box(0.06, 0.04)
    walls = Walls(walls.endpoints, walls.velocity, np.array([np.nan, 8.0, 30.0, np.nan]))
    grains = rods(*[0.01] * 6)
    present = np.ones(6, bool)
    contacts = detect_contacts(grains, position, present, walls, 1e-9)
    balance = assemble_balance(
        contacts, grains, walls, present=present, friction=np.full(contacts.count, 0.3), scale=LoadScale(10.0)
    )
    given = np.full(contacts.count, 9.0)
    found = project_onto_equilibrium(balance, given, np.zeros(contacts.count))
    total = wall_forces(contacts, found.fn, found.ft)
    # Equilibrium is a strong penalty, not a constraint: a thousandth of the difference to the given forces remains.
    assert total[1, 0] == pytest.approx(8.0, rel=2e-3)
    assert total[2, 1] == pytest.approx(30.0, rel=2e-3)


def test_loads_of_a_chain_follow_from_the_pressures():
    grains = rods(*[0.01] * 6)
    pressure = np.array([np.nan, 2e3, 5e3, np.nan])
    packing = Packing(grains, LENGTH, Material(0.0, 0.0), pressure)
    at_rest = Snapshot(0.0, square_lattice(3, 2), np.zeros(6), np.ones(6, bool), box(0.06, 0.04).endpoints, 1e-6)
    step = advance_chain(
        packing, no_motion(at_rest), ForceMemory.empty(), ChainSettings(sweeps=4000), ThresholdNetwork(1e-9)
    )
    total = wall_forces(step.contacts, step.solution.fn, step.solution.ft)
    assert total[1, 0] == pytest.approx(2e3 * 0.04 * LENGTH, rel=1e-4)
    assert total[2, 1] == pytest.approx(5e3 * 0.06 * LENGTH, rel=1e-4)
