"""Straight and circular walls: distances, contacts, displacement and area."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.solver.bodies.grains import GrainMotion
from rodsight.solver.bodies.motion import LastSeen, Snapshot, motion_from, motion_to
from rodsight.solver.bodies.wall_shapes import (
    IN,
    OUT,
    STRAIGHT,
    behind_body,
    beside_wall,
    bounding_distance,
    circle_ends,
    circle_parameters,
    faces_walls,
    interpolate_walls,
    wall_displacement,
    wall_distance,
    walls_before,
)
from rodsight.solver.bodies.walls import Walls
from rodsight.solver.contacts.contacts import detect_contacts, measure_contacts, measure_pairs
from rodsight.solver.contacts.kinematics import equilibrium_matrix, relative_motion
from rodsight.solver.statistics.packing_area import packing_area
from rodsight.solver.statistics.stress import love_weber_stress, wall_forces

from tests.packings import LENGTH, rods

ROUNDING = 1e-14
RING, CORE = 0.05, 0.02  # [m] radii of the circles
CENTRE = np.array([0.3, -0.1])
RADIUS = 0.5 * (RING - CORE)  # of a rod that touches both


def circles(angle: float = 0.0, *, widened: float = 0.0, shift: float = 0.0) -> np.ndarray:
    """A ring and a core with one centre, both rotated, widened and translated."""
    centre = np.stack([CENTRE + shift] * 2)
    return circle_ends(centre, np.array([RING, CORE]) + widened, np.array([angle, angle]))


SIDES = np.array([IN, OUT], np.int8)


def beside(distance: float) -> np.ndarray:
    """A point to the right of the centre."""
    return CENTRE + distance * np.array([1.0, 0.0])


def between(angle: float) -> np.ndarray:
    """A point midway between both circles."""
    return CENTRE + 0.5 * (RING + CORE) * np.array([np.cos(angle), np.sin(angle)])


def test_centre_radius_and_angle_follow_from_the_diameter():
    centre, radius, angle = circle_parameters(circles(0.7))
    assert centre == pytest.approx(np.stack([CENTRE, CENTRE]))
    assert radius == pytest.approx([RING, CORE])
    assert angle == pytest.approx([0.7, 0.7])


def test_grain_between_two_circles_touches_both_with_opposite_normals():
    walls = Walls.at_rest(circles(), side=SIDES)
    position = np.array([between(0.4)])
    contacts = detect_contacts(rods(RADIUS), position, np.ones(1, bool), walls, 1e-9)
    assert contacts.j.tolist() == [1, 2]
    assert contacts.gap == pytest.approx([0.0, 0.0], abs=ROUNDING)
    radial = np.array([np.cos(0.4), np.sin(0.4)])
    assert contacts.normal == pytest.approx(np.stack([radial, -radial]))
    assert contacts.point == pytest.approx(np.stack([CENTRE + RING * radial, CENTRE + CORE * radial]))


def test_overlap_with_a_circle_is_a_negative_gap_on_both_sides():
    walls = Walls.at_rest(circles(), side=SIDES)
    out = np.stack([beside(RING - 0.9 * RADIUS), beside(CORE + 0.9 * RADIUS)])
    found = measure_contacts(rods(RADIUS, RADIUS), out, walls, np.array([0, 1]), np.array([2, 3]))
    assert found.gap == pytest.approx([-0.1 * RADIUS, -0.1 * RADIUS])


def test_every_point_is_beside_a_circle():
    point, margin = beside(1.0), np.zeros(2)
    assert beside_wall(circles(), SIDES, point, margin).tolist() == [True, True]
    assert beside_wall(circles(), None, point, margin).tolist() == [False, False]


def test_distance_is_computed_by_the_shape_of_each_wall():
    floor = np.array([[[0.0, 0.0], [1.0, 0.0]]])
    ends, side = np.concatenate([circles(), floor]), np.array([IN, OUT, STRAIGHT], np.int8)
    position = CENTRE + np.array([0.03, 0.0])
    distance, normal = wall_distance(ends, side, position)
    assert distance == pytest.approx([RING - 0.03, 0.03 - CORE, position[1]])
    assert normal == pytest.approx(np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, -1.0]]))


def test_rotating_circle_slides_along_the_grain_and_shrinking_one_closes_the_gap():
    position, present = np.array([between(1.1)]), np.ones(1, bool)
    at_rest = np.zeros((1, 2)), np.zeros(1)
    rotated, shrunk = circles(0.3), circles(0.0, widened=-1e-4)
    for later, expected in ((rotated, None), (shrunk, (-1e-4, 1e-4))):
        displacement = wall_displacement(circles(), later, SIDES, at=circles())
        walls = Walls(circles(), displacement, np.full(2, np.nan), SIDES)
        contacts = detect_contacts(rods(RADIUS), position, present, walls, 1e-9)
        un, ut = relative_motion(contacts, np.array([RADIUS]), *at_rest, walls)
        if expected is None:
            assert un == pytest.approx([0.0, 0.0], abs=ROUNDING)
            # The tangent is the rotated normal: along the motion of the ring, against that of the core.
            assert ut == pytest.approx([0.3 * RING, -0.3 * CORE])
        else:
            assert un == pytest.approx(expected)
            assert ut == pytest.approx([0.0, 0.0], abs=ROUNDING)


def test_rotation_past_pi_is_taken_the_short_way():
    displacement = wall_displacement(circles(3.1), circles(-3.1), SIDES)
    walls = Walls(circles(-3.1), displacement, np.full(2, np.nan), SIDES)
    at_ring = walls.velocity_at(np.array([0], np.int32), beside(RING)[None])
    assert at_ring == pytest.approx(np.array([[0.0, RING * (2.0 * np.pi - 6.2)]]))


def test_interpolated_circle_is_a_circle():
    later = circles(0.8, widened=2e-3, shift=0.01)
    quarter = interpolate_walls(circles(), later, 0.25, SIDES)
    centre, radius, angle = circle_parameters(quarter)
    assert centre == pytest.approx(np.stack([CENTRE + 0.0025] * 2))
    assert radius == pytest.approx([RING + 5e-4, CORE + 5e-4])
    assert angle == pytest.approx([0.2, 0.2])
    assert walls_before(later, wall_displacement(circles(), later, SIDES), SIDES) == pytest.approx(circles())


def snapshot(time: float, ends: np.ndarray) -> Snapshot:
    return Snapshot(time, np.array([between(0.0)]), np.zeros(1), np.ones(1, bool), ends, 1e-6, SIDES)


def test_motion_over_an_interval_preserves_circles_and_starts_at_the_former_ones():
    first, second = snapshot(0.0, circles()), snapshot(2.0, circles(1.0, shift=0.01))
    motion = motion_to(second, LastSeen.never(1).updated(first), 0.0, first.endpoints)
    load = np.full(2, np.nan)
    assert motion.at(1.0, load)[1].endpoints == pytest.approx(second.endpoints)
    assert motion.at(0.0, load)[1].endpoints == pytest.approx(first.endpoints)
    assert motion.at(0.3, load)[1].length == pytest.approx([2.0 * RING, 2.0 * CORE])
    away = motion_from(first, second).at(1.0, load)[1]
    assert away.endpoints == pytest.approx(first.endpoints)
    drag = away.velocity_at(np.zeros(1, np.int32), CENTRE[None] + [[0.0, RING]])
    assert drag == pytest.approx(np.array([[0.01 - RING, 0.01]]) / 2.0)


def test_load_of_a_circle_is_the_sum_of_its_normal_forces():
    walls = Walls.at_rest(circles(), np.array([8.0, np.nan]), SIDES)
    position = np.stack([between(a) for a in (0.0, 2.0, 4.0)])
    contacts = detect_contacts(rods(*[RADIUS] * 3), position, np.ones(3, bool), walls, 1e-9)
    h = equilibrium_matrix(contacts, np.full(3, RADIUS), walls)
    assert h.shape == (10, 12)
    on_ring = (contacts.j == 3).astype(float)
    assert h.toarray()[9] == pytest.approx(np.concatenate([on_ring, np.zeros(6)]))


def test_stress_in_a_ring_is_the_pressure_on_it():
    count, force = 40, 10.0
    angle = 2.0 * np.pi * np.arange(count) / count
    position = CENTRE + 0.5 * (RING + CORE) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    walls = Walls.at_rest(circles(), side=SIDES)
    pairs = np.tile(np.arange(count), 2), np.repeat([count, count + 1], count)
    contacts = measure_contacts(rods(*[RADIUS] * count), position, walls, *pairs)
    fn = np.full(2 * count, force)
    area = packing_area(walls, position)
    assert area == pytest.approx(np.pi * (RING**2 - CORE**2))
    stress = love_weber_stress(contacts, fn, np.zeros(2 * count), position, area, LENGTH)
    assert np.trace(stress) == pytest.approx(count * force * 2.0 * RADIUS / (area * LENGTH))
    assert np.abs(wall_forces(contacts, fn, np.zeros(2 * count))).max() < 1e-12 * count * force


def test_area_of_a_drum_is_cut_by_the_floor():
    floor = np.stack([beside(-1.0), beside(1.0)])
    ends, side = np.stack([circles()[0], floor]), np.array([IN, STRAIGHT], np.int8)
    assert packing_area(Walls.at_rest(ends, side=side), np.empty((0, 2))) == pytest.approx(0.5 * np.pi * RING**2)


def test_side_must_be_given_for_every_wall():
    with pytest.raises(ValueError, match="side"):
        Walls.at_rest(circles(), side=np.array([IN], np.int8))


def test_grain_rolling_on_a_rotating_core_does_not_slide():
    walls = Walls(
        circles(), wall_displacement(circles(), circles(0.01), SIDES, at=circles()), np.full(2, np.nan), SIDES
    )
    position = beside(CORE + RADIUS)[None]
    contacts = detect_contacts(rods(RADIUS), position, np.ones(1, bool), walls, 1e-9).select(np.array([1]))
    rolled = GrainMotion(position, np.zeros((1, 2)), np.array([-0.01 * CORE / RADIUS]), np.ones(1, bool))
    un, ut = relative_motion(contacts, np.array([RADIUS]), rolled.velocity, rolled.spin, walls)
    assert un == pytest.approx([0.0], abs=ROUNDING)
    assert ut == pytest.approx([0.0], abs=1e-8)


@pytest.mark.parametrize("overhang", [0.0, 1e-5, 0.05, 0.4])
def test_rods_touch_a_bar_between_its_neighbours(overhang):
    box = np.array(
        [
            [[0.0, 0.0], [1.0, 0.0]],
            [[1.0, 0.0], [1.1, 0.5]],
            [[1.1 + overhang, 0.5], [0.1 - overhang, 0.5]],
            [[0.1, 0.5], [0.0, 0.0]],
        ]
    )
    assert Walls.at_rest(box).face == pytest.approx(Walls.at_rest(box).length - [0, 0, 2 * overhang, 0], abs=3e-5)


def split_side() -> np.ndarray:
    """The right side of a box that is split at y = 0.1, its upper half shifted by 5 mm."""
    return np.array([[[0.2, 0.0], [0.2, 0.1]], [[0.205, 0.1], [0.205, 0.2]]])


def test_a_grain_touches_the_half_of_a_split_side_that_it_is_beside() -> None:
    beside = np.array([[0.19, 0.095], [0.195, 0.105], [0.195, 0.205], [0.195, 0.25]])
    pair = np.repeat(beside, 2, axis=0), np.full(8, 0.01)  # each with both halves
    faces = faces_walls(split_side(), None, np.tile([0, 1], 4), *pair).reshape(4, 2)
    assert faces.tolist() == [[True, False], [False, True], [False, True], [False, False]]
    past = np.array([[0.19, 0.105], [0.195, 0.105]])  # of a wall measured too short; beside a wall that ends
    assert faces_walls(split_side()[:1], None, np.zeros(2, int), past, np.full(2, 0.01)).tolist() == [True, False]
    place = np.array([[0.19, 0.095], [0.195, 0.1095]])
    found = detect_contacts(rods(0.01, 0.01), place, np.ones(2, bool), Walls.at_rest(split_side()), 1e-4)
    assert (found.j[found.with_wall] - 2).tolist() == [0, 1]


# Place of a rod of 10 mm at the right end of a footing at y = .1, its gap [m], and the cosine of its normal with the
# normal of the face.
AT_FOOTING = [
    ((0.18, 0.09), 0.0, 1.0),  # beneath it
    ((0.201, 0.0901), -1e-4, 1.0),  # a little past its end: the footing may be stated too short
    ((0.20199, 0.0902), 0.0, 0.98),  # nearer to touching the end than the line
    ((0.206, 0.092), 0.0, 0.8),  # on the end
    ((0.2072, 0.0922), 6.15e-4, None),  # past it, and apart from its end
]


@pytest.mark.parametrize(("place", "gap", "cosine"), AT_FOOTING)
def test_a_grain_past_the_end_of_a_wall_touches_the_end(place, gap, cosine) -> None:
    footing = Walls.at_rest(np.array([[[0.2, 0.1], [0.1, 0.1]]]), np.array([50.0]))
    grains, position = rods(0.01), np.array([place])
    found = detect_contacts(grains, position, np.ones(1, bool), footing, 2e-4)
    assert found.count == (cosine is not None)
    measured = measure_pairs(grains, position, footing, np.array([1]))  # at any distance, as in other photographs
    assert measured.gap == pytest.approx([gap], abs=1e-5)
    if cosine is not None:
        assert found.normal[0] @ [0.0, 1.0] == pytest.approx(cosine, abs=1e-4)
        assert np.linalg.norm(found.point[0] - place) == pytest.approx(0.01 + 0.5 * gap, abs=1e-6)
        _, along_normal, along_tangent = footing.plate_components(np.zeros(1, int), found.normal)
        assert along_normal == pytest.approx([cosine], abs=1e-4)
        assert along_tangent[0] ** 2 == pytest.approx(1.0 - cosine**2, abs=1e-4)
        assert (along_normal[0] == 1.0) == (cosine == 1.0)  # exactly, on the face


def test_a_grain_past_the_end_of_one_wall_is_not_beyond_it() -> None:
    corner = np.concatenate([split_side(), [[[0.205, 0.2], [0.0, 0.2]]]])
    place = np.array([[0.203, 0.15], [0.203, 0.05], [0.25, 0.25], [0.19, 0.15]])
    distance, normal = bounding_distance(corner, None, place)
    assert np.isinf(distance[0, 0])  # in the upper half: the line of the lower one does not bound it
    assert distance[0, 1] == pytest.approx(0.002)
    assert distance[1, 0] == pytest.approx(-0.003)  # beside the lower half and beyond it
    assert (distance[2] < 0.0).all()  # outside of the corner: beyond several walls
    assert np.isfinite(distance[3]).all()
    assert normal.shape == (4, 3, 2)
    far = bounding_distance(corner[:1], None, np.array([[0.35, 0.15], [0.25, 0.15]]))[0]
    assert far[:, 0] == pytest.approx([-0.15, np.inf])  # the first is farther away than the wall is long


def test_a_face_of_a_body_does_not_bound_what_is_in_front_of_its_opposite_face() -> None:
    box = np.array([[0.0, 0.0], [0.3, 0.0], [0.3, 0.2], [0.0, 0.2]])
    pile = np.array([[[0.14, 0.1], [0.14, 0.2]], [[0.16, 0.2], [0.16, 0.1]], [[0.16, 0.1], [0.14, 0.1]]])
    walls = np.concatenate([np.stack([box, np.roll(box, -1, axis=0)], axis=1), pile])
    place = np.array([[0.25, 0.15], [0.05, 0.15], [0.25, 0.05], [0.145, 0.15], [0.305, 0.15], [0.15, 0.15]])
    behind = behind_body(walls, None, place)
    assert behind[:, 4].tolist() == [True, False, False, False, True, False]
    assert behind[:, 5].tolist() == [False, True, False, False, False, False]
    assert not behind[:, [0, 1, 2, 3, 6]].any()
    longer = np.array([[[0.14, 0.05], [0.14, 0.2]], pile[1]])
    assert not behind_body(longer, None, np.array([0.25, 0.07])).any()  # not in front of the shorter face
    overhanging = np.array([[[0.0, 0.0], [0.4, 0.0]], [[0.3, 0.0], [0.3, 0.2]]])
    assert not behind_body(overhanging, None, np.array([0.31, 0.005])).any()  # in front of the floor
    distance, _ = bounding_distance(walls, None, place)
    assert (distance[:3] > 0.0).all()
    assert distance[3, 4] == pytest.approx(-0.005)  # inside the pile
    assert distance[4, 1] == pytest.approx(-0.005)  # outside of the box


@pytest.mark.parametrize("place", [(0.2034, 0.0991), (0.15, 0.0955)])
def test_a_wall_deep_inside_a_rod_is_no_contact(place) -> None:
    """A rod that has risen beside the end of a plate, and one half beyond its face: the wall is not there."""
    plate = Walls.at_rest(np.array([[[0.2, 0.1], [0.1, 0.1]]]), np.array([50.0]))
    assert detect_contacts(rods(0.01), np.array([place]), np.ones(1, bool), plate, 2e-4).count == 0
    higher = Walls.at_rest(plate.endpoints + np.array([0.0, 0.004]))
    assert detect_contacts(rods(0.01), np.array([[0.15, 0.0955]]), np.ones(1, bool), higher, 2e-4).count == 1


def test_one_flank_of_a_wedge_does_not_bound_what_is_in_front_of_the_other() -> None:
    tip, left, right = [0.14, 0.08], [0.08, 0.16], [0.2, 0.16]
    walls = np.array([[[0.0, 0.0], [0.3, 0.0]], [tip, left], [right, tip]])
    place = np.array([[0.1, 0.12], [0.18, 0.12], [0.13, 0.05], [0.14, 0.15], [0.1, -0.01]])
    behind = behind_body(walls, None, place)
    assert behind.tolist() == [[False, False, True], [False, True, False], *[[False] * 3] * 3]
    distance, _ = bounding_distance(walls, None, place)
    assert (distance[:3] > 0.0).all()
    assert (distance[3, 1:] < 0.0).all()  # inside the wedge
    assert distance[4, 0] == pytest.approx(-0.01)  # below the floor


def test_floors_of_different_heights_bound_what_is_in_front_of_them() -> None:
    corners = np.array([[0.0, 0.0], [0.1, 0.0], [0.1, -0.03], [0.2, -0.03], [0.2, 0.0], [0.3, 0.0]])
    pit = np.stack([corners[:-1], corners[1:]], axis=1)  # left floor, step, floor of the pit, step, right floor
    place = np.array([[0.15, -0.02], [0.05, 0.01], [0.101, -0.001], [0.05, -0.01], [0.15, -0.035]])
    distance, _ = bounding_distance(pit, None, place)
    assert (distance[:3] > 0.0).all()  # in the pit, beyond the lines of both floors; above a floor, far from the steps
    assert distance[3, 0] == pytest.approx(-0.01)  # in the ground beneath the left floor
    assert distance[4, 2] == pytest.approx(-0.005)
    assert np.isfinite(distance[4]).all()  # behind the nearest wall: outside of both floors, too
