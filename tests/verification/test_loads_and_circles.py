"""Loads that vary in time, halves of a shear box, rods in a drum."""

import numpy as np
import pytest
from rodsight.solver.bodies.motion import LastSeen, Snapshot, motion_to
from rodsight.solver.bodies.packing import Material, Packing
from rodsight.solver.bodies.wall_shapes import IN, circle_ends
from rodsight.solver.bodies.walls import Walls
from rodsight.solver.contacts.contacts import detect_contacts
from rodsight.solver.contacts.kinematics import relative_motion
from rodsight.solver.statistics.stress import sums_on_walls

from tests.packings import LENGTH, box, rods
from tests.verification.test_boundaries import CONVERGED, square_lattice, static_forces

NAN = np.nan


def test_measured_loads_of_two_plates_are_carried_in_every_frame():
    position, ends = square_lattice(3, 2), box(0.06, 0.04).endpoints
    loads = (np.array([NAN, 8.0, 30.0, NAN]), np.array([NAN, 16.0, 12.0, NAN]))
    mean_pressure = np.mean(loads, axis=0) / (np.array([0.06, 0.04, 0.06, 0.04]) * LENGTH)
    packing = Packing(rods(*[0.01] * 6), LENGTH, Material(0.0, 0.0), mean_pressure)
    assert packing.scale_is_known
    for k, load in enumerate(loads):
        snapshot = Snapshot(float(k), position, np.zeros(6), np.ones(6, bool), ends, 1e-6, load=load)
        contacts, solution = static_forces(packing.grains, position, packing.walls_of(snapshot), friction=0.0)
        pushed = sums_on_walls(contacts, solution.fn, solution.ft)[:, 0]
        assert pushed[1:3] == pytest.approx(load[1:3], rel=CONVERGED)
        assert packing.mean_pressure(snapshot) == pytest.approx(np.mean(load[1:3] / (np.array([0.04, 0.06]) * LENGTH)))


def test_halves_of_a_shear_box_slide_the_rods_against_each_other():
    # A side in two halves on one line: the lower one is at rest, the upper one moves.
    radius, step = 0.01, 1e-3
    halves = np.array([[[0.0, 0.02], [0.0, 0.0]], [[0.0, 0.04], [0.0, 0.02]]])
    moved = halves + np.array([[[0.0, 0.0]], [[-step, 0.0]]])
    position = np.array([[radius, radius], [radius, 3 * radius]])
    at_rest = Snapshot(0.0, position, np.zeros(2), np.ones(2, bool), halves, 1e-6)
    later = Snapshot(1.0, position, np.zeros(2), np.ones(2, bool), moved, 1e-6)
    motion = motion_to(later, LastSeen.never(2).updated(at_rest), 0.0, halves)
    _, walls = motion.at(0.0, np.full(2, NAN))
    contacts = detect_contacts(rods(radius, radius), position, np.ones(2, bool), walls, 1e-9)
    on_wall = contacts.select(contacts.with_wall)
    un, ut = relative_motion(on_wall, np.full(2, radius), np.zeros((2, 2)), np.zeros(2), walls)
    by_pair = {(int(i), int(j) - 2): u for i, j, u in zip(on_wall.i, on_wall.j, un, strict=True)}
    assert by_pair[0, 0] == pytest.approx(0.0)
    assert by_pair[1, 1] == pytest.approx(step)  # moved to the left, away from rods at rest
    assert ut == pytest.approx(np.zeros(len(ut)), abs=1e-15)


@pytest.mark.parametrize("count", [3, 5])
def test_ring_of_rods_carries_the_load_of_the_drum(count):
    radius, load = 0.01, 12.0
    away = radius / np.sin(np.pi / count)
    angle = 2.0 * np.pi * np.arange(count) / count
    position = away * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    ends = circle_ends(np.zeros((1, 2)), np.array([away + radius]), np.zeros(1))
    walls = Walls(ends, np.zeros((1, 2, 2)), np.array([load]), np.array([IN], np.int8))
    contacts, solution = static_forces(rods(*[radius] * count), position, walls, friction=0.0)
    on_wall = contacts.with_wall
    assert solution.fn[on_wall] == pytest.approx(np.full(count, load / count), rel=CONVERGED)
    # Two neighbours carry the inward force of the drum.
    assert solution.fn[~on_wall] == pytest.approx(
        np.full(count, load / count / (2.0 * np.sin(np.pi / count))), rel=CONVERGED
    )
