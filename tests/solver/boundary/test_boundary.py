"""Corrections of the boundary, on rods along the walls of a box that shears and dilates, marked by its corners."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.bodies.wall_shapes import IN, OUT, circle_ends
from rodsight.solver.boundary.bars import find_wall_bars
from rodsight.solver.boundary.boundary_correction import BoundarySettings, correct_boundary
from rodsight.solver.boundary.camera_pose import find_camera_pose
from rodsight.solver.boundary.continuation import continue_walls, extend_walls
from rodsight.solver.boundary.picture_shifts import find_picture_shifts
from rodsight.solver.calibration.gaps import MeasuredSequence, find_gap_rows, measure_gaps

pytestmark = pytest.mark.unit

RADIUS, FRAMES, SIDE, NOISE = 8e-3, 8, 0.4, 5e-6
UNSPECIFIED, BAR, CORNER = np.full(4, -1, np.int8), np.zeros(4, np.int8), np.ones(4, np.int8)


def sheared_box(*, rolling: float = 0.6, seed: int = 0, noise: float = NOISE) -> tuple[MeasuredSequence, np.ndarray]:
    """Make rods at the walls, a fraction of which rolls with its wall while the others slide; and the true bars.

    The side bars are hinged at their lower ends and stay as long as they are; the lid is lifted as the box shears.
    """
    rng = np.random.default_rng(seed)
    shear, height = 0.01 * np.arange(FRAMES), SIDE + 1e-3 * np.arange(FRAMES)
    along = np.stack([np.sin(shear), np.cos(shear)], axis=1)
    low, right = np.zeros((FRAMES, 2)), np.tile([SIDE, 0.0], (FRAMES, 1))
    lean = (height * np.tan(shear))[:, None] * [1.0, 0.0]
    lid = np.column_stack([np.zeros(FRAMES), height]) + lean
    bars = np.stack([
        np.stack([low, right], 1), np.stack([right, right + SIDE * along], 1),
        np.stack([lid + right, lid], 1), np.stack([SIDE * along, low], 1),
    ], axis=1)  # fmt: skip
    place, rotation = [], []
    for w in range(4):
        unit = (bars[:, w, 1] - bars[:, w, 0]) / SIDE
        inward = np.stack([-unit[:, 1], unit[:, 0]], axis=1)
        angle = np.unwrap(np.arctan2(unit[:, 1], unit[:, 0]))
        for s in np.linspace(0.1, 0.9, 14) * SIDE:
            slide = np.zeros(FRAMES) if rng.random() < rolling else 2e-4 * rng.normal(size=FRAMES).cumsum()
            place.append(bars[:, w, 0] + (s + slide)[:, None] * unit + RADIUS * inward)
            rotation.append(angle - angle[0])
    position = np.stack(place, axis=1) + noise * rng.normal(size=(FRAMES, len(place), 2))
    shape = position.shape[:2]
    return MeasuredSequence(
        np.full(shape[1], RADIUS),
        position,
        np.stack(rotation, axis=1),
        np.ones(shape, bool),
        bars,
        np.full(shape, NOISE),
    ), bars


def at_corners(sequence: MeasuredSequence) -> MeasuredSequence:
    """Give the side walls by the corners where they meet floor and lid."""
    ends = sequence.endpoints.copy()
    ends[:, 1, 1], ends[:, 3, 0] = ends[:, 2, 0], ends[:, 2, 1]
    return replace(sequence, endpoints=ends)


def speed_along(ends: np.ndarray, w: int) -> np.ndarray:
    unit = (ends[1:, w, 1] - ends[1:, w, 0]) / np.linalg.norm(ends[1:, w, 1] - ends[1:, w, 0], axis=1)[:, None]
    return np.einsum("fk,fk->f", np.diff(ends[:, w, 0], axis=0), unit)


def test_corners_are_found_by_stretching_and_replaced_by_points_of_the_bars() -> None:
    sequence, bars = sheared_box()
    cornered = at_corners(sequence)
    found, points = find_wall_bars(cornered, NOISE, UNSPECIFIED)
    assert found.corner.tolist() == [False, True, False, True]
    assert np.abs(speed_along(cornered.endpoints, 3) - speed_along(bars, 3)).max() > 5e-4
    for w in (1, 3):
        assert speed_along(points, w) == pytest.approx(speed_along(bars, w), abs=1e-6)  # of the corners: 5e-4
        length = np.linalg.norm(points[:, w, 1] - points[:, w, 0], axis=1)
        assert np.ptp(length) < 1e-12  # rigid
    assert found.end_fraction[[1, 3]].tolist() == [
        0.0,
        1.0,
    ]  # hinged below: end 0 on the right, end 1 on the left
    assert np.abs(found.slip[1:, 1]) == pytest.approx(0.5 * np.diff(np.linalg.norm(
        cornered.endpoints[:, 1, 1] - cornered.endpoints[:, 1, 0], axis=1)))  # fmt: skip


@pytest.mark.parametrize("factor", [0.98, 0.975, 1.02])
def test_hinges_are_found_with_radii_that_share_an_error(factor) -> None:
    sequence, bars = sheared_box()
    cornered = replace(at_corners(sequence), radius=factor * sequence.radius)
    found, points = find_wall_bars(cornered, NOISE, UNSPECIFIED)
    assert found.end_fraction[[1, 3]].tolist() == [0.0, 1.0]
    assert speed_along(points, 3) == pytest.approx(speed_along(bars, 3), abs=1e-6)


def test_a_hinge_that_no_rod_shows_is_reported_as_unknown() -> None:
    sequence, _ = sheared_box()
    cornered = at_corners(sequence)
    inside = np.abs(sequence.position[0] - 0.5 * SIDE).max(axis=1) < 0.5 * SIDE - 2.0 * RADIUS
    far = replace(cornered, present=cornered.present & inside)
    found, points = find_wall_bars(far, NOISE, UNSPECIFIED)
    assert np.isnan(found.end_fraction[[1, 3]]).all()
    assert not found.slip.any()
    assert np.ptp(np.linalg.norm(points[:, 3, 1] - points[:, 3, 0], axis=1)) < 1e-12
    _, boundary = correct_boundary(far, NOISE, UNSPECIFIED, BoundarySettings(camera=False))
    assert any("hinge is unknown" in each for each in boundary.describe(("floor", "right", "lid", "left")))


def test_corners_of_a_packing_at_rest_slide_where_the_bar_would_move_though_noise_hides_it_from_the_rods() -> None:
    """All shrinks alike, by less than the noise of a rod from photograph to photograph; the walls' ends have none."""
    sequence, _ = sheared_box(rolling=1.0)
    squeezed = 1.0 - 1e-5 * np.arange(FRAMES)
    corner = SIDE * squeezed[:, None, None] * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    ends = np.stack([corner, np.roll(corner, -1, axis=1)], axis=2)
    noise = sequence.position - sheared_box(rolling=1.0, noise=0.0)[0].position
    position = sequence.position[0] * squeezed[:, None, None] + noise
    at_rest = replace(sequence, endpoints=ends, position=position, rotation=np.zeros_like(sequence.rotation))
    found, points = find_wall_bars(at_rest, NOISE, UNSPECIFIED)
    assert found.corner.all()
    assert found.end_fraction.tolist() == [0.0, 0.0, 1.0, 1.0]
    assert max(np.abs(speed_along(points, w)).max() for w in range(4)) < 1e-12
    for seed in range(40):
        shaken = replace(at_rest, endpoints=ends + 2e-5 * np.random.default_rng(seed).normal(size=ends.shape))
        length = np.linalg.norm(np.diff(shaken.endpoints, axis=2)[:, :, 0], axis=2)
        within = np.abs(length - length[0]).max(axis=0) < 4.0 * np.sqrt(2.0) * 2e-5
        assert not (within & find_wall_bars(shaken, 2e-5, UNSPECIFIED)[0].corner).any()  # noise of the ends


def test_specified_kind_of_ends_is_used() -> None:
    sequence, _ = sheared_box()
    cornered = at_corners(sequence)
    assert not find_wall_bars(cornered, NOISE, BAR)[0].corner.any()
    assert find_wall_bars(cornered, NOISE, CORNER)[0].corner.all()
    assert np.array_equal(find_wall_bars(cornered, NOISE, BAR)[1], cornered.endpoints)


def test_rigid_bars_are_not_changed() -> None:
    sequence, bars = sheared_box()
    found, points = find_wall_bars(sequence, NOISE, UNSPECIFIED)
    assert not found.corner.any()
    assert np.array_equal(points, bars)
    assert not found.slip.any()


def test_short_wall_is_extended_to_the_last_rod_but_not_past_the_next_wall() -> None:
    sequence, bars = sheared_box()
    short = bars.copy()
    short[:, 3, 0] += 0.3 * (bars[:, 3, 1] - bars[:, 3, 0])  # the left wall's upper end, hanging 12 cm too low
    extension = continue_walls(replace(sequence, endpoints=short))
    assert 0.08 < extension[3, 0] <= 0.3 * SIDE + 8e-3  # the lid is that much higher at the end
    assert np.count_nonzero(extension) == 1
    longer = extend_walls(short, extension)
    assert np.linalg.norm(longer[:, 3, 1] - longer[:, 3, 0], axis=1) == pytest.approx(0.7 * SIDE + extension[3, 0])
    assert not continue_walls(sequence).any()


def test_rod_off_the_line_does_not_extend_a_wall() -> None:
    sequence, bars = sheared_box()
    past = np.array([SIDE + 2 * RADIUS, 1.5 * RADIUS])  # half a radius off the floor's line
    position = np.concatenate([sequence.position, np.tile(past, (FRAMES, 1, 1))], axis=1)
    beside = [
        np.concatenate([each, each[:, :1]], axis=1) for each in (sequence.rotation, sequence.present, sequence.sigma)
    ]
    radius = np.append(sequence.radius, RADIUS)
    floor = MeasuredSequence(radius, position, beside[0], beside[1], bars[:, :1], beside[2])
    assert not continue_walls(floor).any()
    position[:, -1, 1] = RADIUS
    assert continue_walls(floor)[0, 1] == pytest.approx(3 * RADIUS)


def test_camera_motion_is_found_to_a_few_micrometres_and_none_at_rest() -> None:
    sequence, _ = sheared_box(seed=1)
    rng = np.random.default_rng(2)
    shift = rng.uniform(-6e-5, 6e-5, (FRAMES, 2))
    rotation = rng.normal(0, 1e-4, FRAMES)
    middle = sequence.position.mean(axis=(0, 1))
    place = sequence.position - middle
    rotated = rotation[:, None, None] * np.stack([-place[..., 1], place[..., 0]], axis=2)
    moved = replace(sequence, position=sequence.position + shift[:, None] + rotated)
    pose = find_camera_pose(moved)
    assert pose.applied
    assert np.abs(pose.rotation - (rotation - rotation.mean())).max() < 2e-5
    left = pose.correct(moved.position) - sequence.position
    left -= left.mean(axis=0)  # a common pose is an error of the walls
    assert np.sqrt(np.mean(left**2)) < 4e-6
    resting = find_camera_pose(sequence)
    assert not resting.applied
    assert resting.evidence < 3.0
    assert np.array_equal(resting.correct(sequence.position), sequence.position)


@pytest.mark.parametrize("size", [0.2, 0.5])  # radii
def test_one_displaced_photograph_is_found_and_the_others_stay(size) -> None:
    sequence, _ = sheared_box()
    displacement = size * RADIUS * np.array([0.8, -0.6])
    sequence.position[3] += displacement
    found = find_camera_pose(sequence)
    assert found.applied
    assert found.shift[3] == pytest.approx(displacement, abs=3e-5)
    assert np.abs(np.delete(found.shift, 3, axis=0)).max() < 3e-5


@pytest.mark.parametrize("size", [0.3, 0.7])  # radii
def test_a_camera_displaced_for_half_of_the_photographs_is_found_against_the_walls(size) -> None:
    sequence, _ = sheared_box()
    displacement = size * RADIUS * np.array([0.8, -0.6])
    sequence.position[FRAMES // 2 :] += displacement
    found = find_camera_pose(sequence)
    assert found.applied
    assert found.shift[: FRAMES // 2] == pytest.approx(np.zeros((FRAMES // 2, 2)), abs=4e-5)
    assert found.shift[FRAMES // 2 :] == pytest.approx(np.tile(displacement, (FRAMES - FRAMES // 2, 1)), abs=4e-5)


def test_a_camera_that_drifts_is_found_against_the_walls() -> None:
    sequence, _ = sheared_box()
    drift = np.linspace(0.0, 0.6 * RADIUS, FRAMES)[:, None] * np.array([0.6, 0.8])
    sequence.position[:] += drift[:, None]
    assert find_camera_pose(sequence).shift == pytest.approx(drift, abs=4e-5)


def picture_shifts(sequence: MeasuredSequence) -> np.ndarray:
    rows = find_gap_rows(sequence, -np.inf, wall_reach=RADIUS)
    geometry = measure_gaps(rows, sequence.position, sequence.endpoints, sequence.radius)
    return find_picture_shifts(rows, geometry, np.ones(FRAMES, np.bool_), RADIUS)


@pytest.mark.parametrize("outward", [0.4, -0.4])  # radii
def test_one_misplaced_wall_is_no_displacement_of_the_camera(outward) -> None:
    sequence, _ = sheared_box()
    endpoints = sequence.endpoints.copy()
    endpoints[FRAMES // 2 :, 1, :, 0] += outward * RADIUS
    assert not picture_shifts(replace(sequence, endpoints=endpoints)).any()


def test_walls_that_no_rod_is_near_show_no_shift() -> None:
    sequence, _ = sheared_box()
    assert not picture_shifts(replace(sequence, position=sequence.position + 100.0 * RADIUS)).any()


def test_rods_between_two_circles_show_no_shift_by_the_outermost() -> None:
    rng = np.random.default_rng(3)
    angle = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)
    along = np.column_stack([np.cos(angle), np.sin(angle)])
    outer, inner = 12.0 * RADIUS, 6.0 * RADIUS
    place = np.concatenate([(outer - RADIUS) * along, (inner + RADIUS) * along[::2]])
    errors = 0.05 * RADIUS * rng.normal(size=place.shape)  # of centres
    position = np.tile(place + errors, (FRAMES, 1, 1)) + NOISE * rng.normal(size=(FRAMES, *place.shape))
    ends = circle_ends(np.zeros((2, 2)), np.array([outer, inner]), np.zeros(2))
    shape = position.shape[:2]
    ring = MeasuredSequence(
        np.full(shape[1], RADIUS), position, np.zeros(shape), np.ones(shape, bool), np.tile(ends, (FRAMES, 1, 1, 1)),
        np.full(shape, NOISE), np.array([IN, OUT], np.int8),
    )  # fmt: skip
    assert np.abs(find_camera_pose(ring).shift).max() < 0.01 * RADIUS


def test_the_shift_of_a_picture_needs_walls_of_two_directions() -> None:
    sequence, _ = sheared_box()
    moved = replace(sequence, position=sequence.position + 0.4 * RADIUS)
    assert picture_shifts(moved) == pytest.approx(np.full((FRAMES, 2), 0.4 * RADIUS), abs=2e-5)
    assert not picture_shifts(replace(moved, endpoints=moved.endpoints[:, [0]])).any()


def test_too_few_rods_at_the_walls_give_no_pose() -> None:
    sequence, _ = sheared_box()
    few = MeasuredSequence(
        sequence.radius[:5], sequence.position[:, :5], sequence.rotation[:, :5], sequence.present[:, :5],
        sequence.endpoints, sequence.sigma[:, :5],
    )  # fmt: skip
    assert not find_camera_pose(few).applied
    assert np.isnan(find_camera_pose(few).evidence)


def test_all_corrections_are_described() -> None:
    sequence, bars = sheared_box(seed=3)
    cornered = at_corners(sequence)
    shifted = replace(
        cornered, position=cornered.position + np.random.default_rng(4).uniform(-6e-5, 6e-5, (FRAMES, 1, 2))
    )
    corrected, boundary = correct_boundary(shifted, NOISE, UNSPECIFIED, BoundarySettings())
    assert speed_along(corrected.endpoints, 3) == pytest.approx(speed_along(bars, 3), abs=1e-6)
    sentences = " ".join(boundary.describe(("floor", "right", "lid", "left")))
    assert "'right' are corners" in sentences
    assert "'left' are corners" in sentences
    assert "camera moves" in sentences
    kept, none = correct_boundary(shifted, NOISE, BAR, BoundarySettings(camera=False, continued=False))
    assert np.array_equal(kept.position, shifted.position)
    assert none.describe(("floor", "right", "lid", "left")) == []


def floor_with(*past: tuple[float, float], endpoints: np.ndarray | None = None) -> MeasuredSequence:
    """Rods on a floor, and others at places (x, y) [radii] from its right end."""
    sequence, bars = sheared_box()
    place = np.array([SIDE, 0.0]) + RADIUS * np.array(past)
    position = np.concatenate([sequence.position[:, :14], np.tile(place, (FRAMES, 1, 1))], axis=1)
    shape = position.shape[:2]
    floor = bars[:, :1]
    if endpoints is not None:
        floor = np.concatenate([floor, np.tile(endpoints, (FRAMES, 1, 1, 1))], axis=1)
    return MeasuredSequence(
        np.full(shape[1], RADIUS), position, np.zeros(shape), np.ones(shape, bool), floor, np.full(shape, NOISE)
    )


def test_a_wall_ends_where_a_rod_stands_across_its_line() -> None:
    assert continue_walls(floor_with((2.0, 1.0)))[0, 1] > 0.0
    assert not continue_walls(floor_with((2.0, 1.0), (3.5, 0.1))).any()  # heaved beside a footing
    assert continue_walls(floor_with((2.0, 1.0), (12.0, 0.1)))[0, 1] > 0.0  # far from the end


def test_a_wall_ends_where_few_of_the_rods_near_its_line_touch_it() -> None:
    surface = ((4.0, 1.4), (6.0, 1.7), (8.0, 1.5))  # of a bed whose highest rods are level with a footing
    assert not continue_walls(floor_with((2.0, 1.0), *surface)).any()
    assert continue_walls(floor_with((2.0, 1.0), *surface[:2]))[0, 1] > 0.0


def test_a_wall_ends_where_another_that_faces_the_same_way_goes_on() -> None:
    next_half = np.array([[SIDE, 0.0], [2.0 * SIDE, 0.0]])
    assert not continue_walls(floor_with((2.0, 1.0), endpoints=next_half)).any()
    assert continue_walls(floor_with((2.0, 1.0), endpoints=next_half[::-1]))[0, 1] > 0.0  # faces the other way
