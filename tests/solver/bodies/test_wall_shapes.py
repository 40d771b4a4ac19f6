"""Walls as shapes: circles are known by a diameter, contacts with them by how far the grain is from the centre."""

from __future__ import annotations

import numpy as np
import pytest

from solver.bodies.grains import GrainMotion
from solver.bodies.motion import LastSeen, Snapshot, motion_from, motion_to
from solver.bodies.wall_shapes import (
    IN,
    OUT,
    STRAIGHT,
    circle_ends,
    circle_of,
    moved_back,
    reach_of_wall,
    walls_between,
    walls_moved,
)
from solver.bodies.walls import Walls
from solver.contacts.contacts import detect_contacts, measure_contacts
from solver.contacts.kinematics import equilibrium_matrix, relative_motion
from solver.statistics.stress import love_weber_stress, packing_area, wall_forces
from tests.packings import LENGTH, rods

ROUNDING = 1e-14
RING, CORE = 0.05, 0.02  # [m] radii of the circles
CENTRE = np.array([0.3, -0.1])
RADIUS = 0.5 * (RING - CORE)  # of a rod that touches both


def circles(turn: float = 0.0, *, grown: float = 0.0, shift: float = 0.0) -> np.ndarray:
    """A ring and a core about one centre, both turned, widened and moved alike."""
    centre = np.stack([CENTRE + shift] * 2)
    return circle_ends(centre, np.array([RING, CORE]) + grown, np.array([turn, turn]))


SIDES = np.array([IN, OUT], np.int8)


def beside(distance: float) -> np.ndarray:
    """A place to the right of the centre."""
    return CENTRE + distance * np.array([1.0, 0.0])


def between(angle: float) -> np.ndarray:
    """A place half way between both circles."""
    return CENTRE + 0.5 * (RING + CORE) * np.array([np.cos(angle), np.sin(angle)])


def test_a_diameter_tells_centre_radius_and_turn():
    centre, radius, turn = circle_of(circles(0.7))
    assert centre == pytest.approx(np.stack([CENTRE, CENTRE]))
    assert radius == pytest.approx([RING, CORE])
    assert turn == pytest.approx([0.7, 0.7])


def test_a_grain_between_two_circles_touches_both_with_opposite_normals():
    walls = Walls.at_rest(circles(), side=SIDES)
    place = np.array([between(0.4)])
    contacts = detect_contacts(rods(RADIUS), place, np.ones(1, bool), walls, 1e-9)
    assert contacts.j.tolist() == [1, 2]
    assert contacts.gap == pytest.approx([0.0, 0.0], abs=ROUNDING)
    radial = np.array([np.cos(0.4), np.sin(0.4)])
    assert contacts.normal == pytest.approx(np.stack([radial, -radial]))
    assert contacts.point == pytest.approx(np.stack([CENTRE + RING * radial, CENTRE + CORE * radial]))


def test_a_grain_that_overlaps_a_circle_has_a_negative_gap_on_either_side():
    walls = Walls.at_rest(circles(), side=SIDES)
    out = np.stack([beside(RING - 0.9 * RADIUS), beside(CORE + 0.9 * RADIUS)])
    found = measure_contacts(rods(RADIUS, RADIUS), out, walls, np.array([0, 1]), np.array([2, 3]))
    assert found.gap == pytest.approx([-0.1 * RADIUS, -0.1 * RADIUS])


def test_distance_from_a_mixture_of_walls_is_that_of_each_shape():
    floor = np.array([[[0.0, 0.0], [1.0, 0.0]]])
    ends, side = np.concatenate([circles(), floor]), np.array([IN, OUT, STRAIGHT], np.int8)
    place = CENTRE + np.array([0.03, 0.0])
    distance, normal = reach_of_wall(ends, side, place)
    assert distance == pytest.approx([RING - 0.03, 0.03 - CORE, place[1]])
    assert normal == pytest.approx(np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, -1.0]]))


def test_a_circle_that_turns_drags_the_grain_along_it_and_one_that_shrinks_closes_the_gap():
    place, present = np.array([between(1.1)]), np.ones(1, bool)
    still = np.zeros((1, 2)), np.zeros(1)
    turned, shrunk = circles(0.3), circles(0.0, grown=-1e-4)
    for later, expected in ((turned, None), (shrunk, (-1e-4, 1e-4))):
        way = walls_moved(circles(), later, SIDES, at=circles())
        walls = Walls(circles(), way, np.full(2, np.nan), SIDES)
        contacts = detect_contacts(rods(RADIUS), place, present, walls, 1e-9)
        un, ut = relative_motion(contacts, np.array([RADIUS]), *still, walls)
        if expected is None:
            assert un == pytest.approx([0.0, 0.0], abs=ROUNDING)
            # The tangent is the normal turned: along the ring's motion, against the core's.
            assert ut == pytest.approx([0.3 * RING, -0.3 * CORE])
        else:
            assert un == pytest.approx(expected)
            assert ut == pytest.approx([0.0, 0.0], abs=ROUNDING)


def test_a_turn_past_half_a_circle_is_the_short_way_round():
    way = walls_moved(circles(3.1), circles(-3.1), SIDES)
    walls = Walls(circles(-3.1), way, np.full(2, np.nan), SIDES)
    at_ring = walls.velocity_at(np.array([0], np.int32), beside(RING)[None])
    assert at_ring == pytest.approx(np.array([[0.0, RING * (2.0 * np.pi - 6.2)]]))


def test_a_circle_stays_one_half_way_through_its_turn():
    later = circles(0.8, grown=2e-3, shift=0.01)
    half = walls_between(circles(), later, 0.5, SIDES)
    centre, radius, turn = circle_of(half)
    assert centre == pytest.approx(np.stack([CENTRE + 0.005] * 2))
    assert radius == pytest.approx([RING + 1e-3, CORE + 1e-3])
    assert turn == pytest.approx([0.4, 0.4])
    assert moved_back(later, walls_moved(circles(), later, SIDES), SIDES) == pytest.approx(circles())


def snapshot(time: float, ends: np.ndarray) -> Snapshot:
    return Snapshot(time, np.array([between(0.0)]), np.zeros(1), np.ones(1, bool), ends, 1e-6, SIDES)


def test_the_motion_over_an_interval_keeps_circles_round_and_begins_where_they_were():
    first, second = snapshot(0.0, circles()), snapshot(2.0, circles(1.0, shift=0.01))
    motion = motion_to(second, LastSeen.never(1).renewed(first), 0.0, first.endpoints)
    load = np.full(2, np.nan)
    assert motion.at(1.0, load)[1].endpoints == pytest.approx(second.endpoints)
    assert motion.at(0.0, load)[1].endpoints == pytest.approx(first.endpoints)
    assert motion.at(0.3, load)[1].length == pytest.approx([2.0 * RING, 2.0 * CORE])
    away = motion_from(first, second).at(1.0, load)[1]
    assert away.endpoints == pytest.approx(first.endpoints)
    drag = away.velocity_at(np.zeros(1, np.int32), CENTRE[None] + [[0.0, RING]])
    assert drag == pytest.approx(np.array([[0.01 - RING, 0.01]]) / 2.0)


def test_a_circle_under_load_is_balanced_by_the_sum_of_its_normal_forces():
    walls = Walls.at_rest(circles(), np.array([8.0, np.nan]), SIDES)
    place = np.stack([between(a) for a in (0.0, 2.0, 4.0)])
    contacts = detect_contacts(rods(*[RADIUS] * 3), place, np.ones(3, bool), walls, 1e-9)
    h = equilibrium_matrix(contacts, np.full(3, RADIUS), walls)
    assert h.shape == (10, 12)
    on_ring = (contacts.j == 3).astype(float)
    assert h.toarray()[9] == pytest.approx(np.concatenate([on_ring, np.zeros(6)]))


def test_the_stress_in_a_ring_is_the_pressure_on_it():
    count, force = 40, 10.0
    angle = 2.0 * np.pi * np.arange(count) / count
    place = CENTRE + 0.5 * (RING + CORE) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    walls = Walls.at_rest(circles(), side=SIDES)
    pairs = np.tile(np.arange(count), 2), np.repeat([count, count + 1], count)
    contacts = measure_contacts(rods(*[RADIUS] * count), place, walls, *pairs)
    fn = np.full(2 * count, force)
    area = packing_area(walls, place)
    assert area == pytest.approx(np.pi * (RING**2 - CORE**2))
    stress = love_weber_stress(contacts, fn, np.zeros(2 * count), place, area, LENGTH)
    assert np.trace(stress) == pytest.approx(count * force * 2.0 * RADIUS / (area * LENGTH))
    assert np.abs(wall_forces(contacts, fn, np.zeros(2 * count))).max() < 1e-12 * count * force


def test_a_floor_cuts_off_part_of_a_drum():
    floor = np.stack([beside(-1.0), beside(1.0)])
    ends, side = np.stack([circles()[0], floor]), np.array([IN, STRAIGHT], np.int8)
    assert packing_area(Walls.at_rest(ends, side=side), np.empty((0, 2))) == pytest.approx(0.5 * np.pi * RING**2)


def test_a_wall_is_told_for_every_side():
    with pytest.raises(ValueError, match="side"):
        Walls.at_rest(circles(), side=np.array([IN], np.int8))


def test_a_rolling_grain_does_not_slide_on_a_turning_core():
    walls = Walls(circles(), walls_moved(circles(), circles(0.01), SIDES, at=circles()), np.full(2, np.nan), SIDES)
    place = beside(CORE + RADIUS)[None]
    contacts = detect_contacts(rods(RADIUS), place, np.ones(1, bool), walls, 1e-9).select(np.array([1]))
    rolled = GrainMotion(place, np.zeros((1, 2)), np.array([-0.01 * CORE / RADIUS]), np.ones(1, bool))
    un, ut = relative_motion(contacts, np.array([RADIUS]), rolled.velocity, rolled.spin, walls)
    assert un == pytest.approx([0.0], abs=ROUNDING)
    assert ut == pytest.approx([0.0], abs=1e-8)
