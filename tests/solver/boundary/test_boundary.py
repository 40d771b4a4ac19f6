"""Rods along the walls of a box that shears and dilates; the corners where its bars meet are what a person marks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from solver.boundary.bars import find_bars
from solver.boundary.boundary import BoundarySettings, mend_boundary
from solver.boundary.camera_pose import find_camera_pose
from solver.boundary.continuation import continue_walls, lengthen
from solver.calibration.gaps import MeasuredSequence

pytestmark = pytest.mark.unit

RADIUS, FRAMES, SIDE, NOISE = 8e-3, 8, 0.4, 5e-6
NOT_TOLD, BAR, CORNER = np.full(4, -1, np.int8), np.zeros(4, np.int8), np.ones(4, np.int8)


def sheared_box(*, rolling: float = 0.6, seed: int = 0) -> tuple[MeasuredSequence, np.ndarray]:
    """Rods that touch the walls, a share of which rolls with its wall while the others slide; and the true bars.

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
    place, turn = [], []
    for w in range(4):
        unit = (bars[:, w, 1] - bars[:, w, 0]) / SIDE
        inward = np.stack([-unit[:, 1], unit[:, 0]], axis=1)
        angle = np.unwrap(np.arctan2(unit[:, 1], unit[:, 0]))
        for s in np.linspace(0.1, 0.9, 14) * SIDE:
            slide = np.zeros(FRAMES) if rng.random() < rolling else 2e-4 * rng.normal(size=FRAMES).cumsum()
            place.append(bars[:, w, 0] + (s + slide)[:, None] * unit + RADIUS * inward)
            turn.append(angle - angle[0])
    position = np.stack(place, axis=1) + NOISE * rng.normal(size=(FRAMES, len(place), 2))
    shape = position.shape[:2]
    return MeasuredSequence(
        np.full(shape[1], RADIUS), position, np.stack(turn, axis=1), np.ones(shape, bool), bars, np.full(shape, NOISE)
    ), bars


def at_corners(sequence: MeasuredSequence) -> MeasuredSequence:
    """The same with the side walls told by the corners where they meet floor and lid."""
    ends = sequence.endpoints.copy()
    ends[:, 1, 1], ends[:, 3, 0] = ends[:, 2, 0], ends[:, 2, 1]
    return replace(sequence, endpoints=ends)


def speed_along(ends: np.ndarray, w: int) -> np.ndarray:
    unit = (ends[1:, w, 1] - ends[1:, w, 0]) / np.linalg.norm(ends[1:, w, 1] - ends[1:, w, 0], axis=1)[:, None]
    return np.einsum("fk,fk->f", np.diff(ends[:, w, 0], axis=0), unit)


def test_corners_are_found_by_their_stretching_and_give_the_motion_of_the_bars() -> None:
    sequence, bars = sheared_box()
    told = at_corners(sequence)
    found, points = find_bars(told, NOISE, NOT_TOLD)
    assert found.corner.tolist() == [False, True, False, True]
    assert np.abs(speed_along(told.endpoints, 3) - speed_along(bars, 3)).max() > 5e-4
    for w in (1, 3):
        assert speed_along(points, w) == pytest.approx(speed_along(bars, w), abs=1e-6)  # told: 5e-4
        length = np.linalg.norm(points[:, w, 1] - points[:, w, 0], axis=1)
        assert np.ptp(length) < 1e-12  # rigid
    assert found.share[[1, 3]].tolist() == [0.0, 1.0]  # hinged below: at end 0 of the right wall, end 1 of the left
    assert np.abs(found.slip[1:, 1]) == pytest.approx(0.5 * np.diff(np.linalg.norm(
        told.endpoints[:, 1, 1] - told.endpoints[:, 1, 0], axis=1)))  # fmt: skip


def test_what_the_user_tells_of_the_ends_is_obeyed() -> None:
    sequence, _ = sheared_box()
    told = at_corners(sequence)
    assert not find_bars(told, NOISE, BAR)[0].corner.any()
    assert find_bars(told, NOISE, CORNER)[0].corner.all()
    assert np.array_equal(find_bars(told, NOISE, BAR)[1], told.endpoints)


def test_bars_stay_as_they_were_told() -> None:
    sequence, bars = sheared_box()
    found, points = find_bars(sequence, NOISE, NOT_TOLD)
    assert not found.corner.any()
    assert np.array_equal(points, bars)
    assert not found.slip.any()


def test_a_wall_told_too_short_goes_on_to_the_last_rod_but_not_past_the_next_wall() -> None:
    sequence, bars = sheared_box()
    short = bars.copy()
    short[:, 3, 0] += 0.3 * (bars[:, 3, 1] - bars[:, 3, 0])  # the left wall's upper end, hanging 12 cm too low
    beyond = continue_walls(replace(sequence, endpoints=short))
    assert 0.08 < beyond[3, 0] <= 0.3 * SIDE + 8e-3  # the lid is that much higher at the end
    assert np.count_nonzero(beyond) == 1
    longer = lengthen(short, beyond)
    assert np.linalg.norm(longer[:, 3, 1] - longer[:, 3, 0], axis=1) == pytest.approx(0.7 * SIDE + beyond[3, 0])
    assert not continue_walls(sequence).any()


def test_a_rod_beyond_the_end_that_does_not_bear_leaves_a_wall_as_it_is() -> None:
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


def test_the_camera_is_followed_to_a_few_micrometres_and_left_alone_where_it_stood_still() -> None:
    sequence, _ = sheared_box(seed=1)
    rng = np.random.default_rng(2)
    shift = rng.uniform(-6e-5, 6e-5, (FRAMES, 2))
    turn = rng.normal(0, 1e-4, FRAMES)
    middle = sequence.position.mean(axis=(0, 1))
    place = sequence.position - middle
    spun = turn[:, None, None] * np.stack([-place[..., 1], place[..., 0]], axis=2)
    moved = replace(sequence, position=sequence.position + shift[:, None] + spun)
    pose = find_camera_pose(moved)
    assert pose.applied
    assert np.abs(pose.turn - (turn - turn.mean())).max() < 2e-5
    left = pose.correct(moved.position) - sequence.position
    left -= left.mean(axis=0)  # what all photographs share is where the walls are
    assert np.sqrt(np.mean(left**2)) < 4e-6
    still = find_camera_pose(sequence)
    assert not still.applied
    assert still.evidence < 3.0
    assert np.array_equal(still.correct(sequence.position), sequence.position)


def test_too_few_rods_at_the_walls_tell_no_pose() -> None:
    sequence, _ = sheared_box()
    few = MeasuredSequence(
        sequence.radius[:5], sequence.position[:, :5], sequence.rotation[:, :5], sequence.present[:, :5],
        sequence.endpoints, sequence.sigma[:, :5],
    )  # fmt: skip
    assert not find_camera_pose(few).applied
    assert np.isnan(find_camera_pose(few).evidence)


def test_all_of_it_together_is_said_in_words() -> None:
    sequence, bars = sheared_box(seed=3)
    told = at_corners(sequence)
    shifted = replace(told, position=told.position + np.random.default_rng(4).uniform(-6e-5, 6e-5, (FRAMES, 1, 2)))
    mended, boundary = mend_boundary(shifted, NOISE, NOT_TOLD, BoundarySettings())
    assert speed_along(mended.endpoints, 3) == pytest.approx(speed_along(bars, 3), abs=1e-6)
    said = " ".join(boundary.describe(("floor", "right", "lid", "left")))
    assert "'right' are corners" in said
    assert "'left' are corners" in said
    assert "camera moves" in said
    kept, none = mend_boundary(shifted, NOISE, BAR, BoundarySettings(camera=False, continued=False))
    assert np.array_equal(kept.position, shifted.position)
    assert none.describe(("floor", "right", "lid", "left")) == []
