"""Tracking of discs by their rims: completeness, accuracy, and the status of failures."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.tracking.detection.detect import Detection
from rodsight.tracking.outline.outline_tracker import OutlineTracker
from rodsight.tracking.settings import TrackingSettings
from rodsight.tracks import TrackStatus

from tests.app.tracking.outline.discs import KINDS, WHITE, Light, lay_row_by_row, photograph_discs

RADII = (13.0, 18.0)  # [px]
SHAPE = (420, 420)
ALLOWED = {"white on black": 0.04, "black on white": 0.04, "fringes": 0.17}  # [px] rms
WORST = {"white on black": 0.2, "black on white": 0.2, "fringes": 1.0}  # [px]
SETTINGS = TrackingSettings("outline")

Discs = tuple[np.ndarray, np.ndarray, np.ndarray]


@pytest.fixture(scope="module")
def discs() -> Discs:
    return lay_row_by_row(10, 10, RADII)


def make_tracker(light: Light, discs: Discs, force: float = 0.8) -> OutlineTracker:
    x, y, radius = discs
    n = len(x)
    image = photograph_discs(light, SHAPE, x, y, radius, np.full(n, force), 1)
    rng = np.random.default_rng(5)
    rough = [at + rng.normal(0.0, 0.3, n) for at in (x, y)]
    return OutlineTracker(image, Detection(*rough, radius + 0.3, np.full(n, 0.1), np.ones(n)), SETTINGS)


@pytest.mark.slow
@pytest.mark.parametrize("kind", list(KINDS))
def test_discs_are_tracked_with_changing_interiors(discs: Discs, kind: str) -> None:
    x, y, radius = discs
    tracker, rng = make_tracker(KINDS[kind], discs), np.random.default_rng(3)
    history, errors, scaled = [tracker.first()], [], []
    dx, dy = np.zeros(len(x)), np.zeros(len(x))
    for k in range(1, 5):
        dx += 1.3 + 0.01 * y + rng.normal(0.0, 0.1, len(x))
        dy += -0.8 + rng.normal(0.0, 0.1, len(x))
        force = rng.uniform(0.2, 2.5, len(x))  # another at every disc, and in every photograph
        image = photograph_discs(KINDS[kind], SHAPE, x + dx, y + dy, radius, force, 10 + k)
        history.append(tracker.follow(image, history))
        error = np.stack([history[-1].x - x - dx, history[-1].y - y - dy])
        errors.append(error)
        scaled.append(error / history[-1].sigma)
    assert all(frame.has_pose.all() for frame in history)
    assert all(np.isnan(frame.rotation).all() for frame in history)
    assert np.mean([(frame.status == TrackStatus.OK).mean() for frame in history]) > 0.97
    error = np.concatenate(errors, axis=1)
    assert np.sqrt((error**2).mean()) < ALLOWED[kind]
    assert np.abs(error).max() < WORST[kind]
    assert 0.5 < np.sqrt(np.mean(np.square(scaled))) < 2.0  # σ covers the error


def test_a_common_jump_of_most_of_a_radius_loses_none(discs: Discs) -> None:
    x, y, radius = discs
    tracker = make_tracker(WHITE, discs)
    near = photograph_discs(WHITE, SHAPE, x + 4.0, y, radius, 0.0 * x, 2)
    history = [tracker.first(), tracker.follow(near, [tracker.first()])]
    jumped = tracker.follow(photograph_discs(WHITE, SHAPE, x + 12.0, y - 4.0, radius, 0.0 * x, 3), history)
    assert jumped.has_pose.all()
    assert np.abs(jumped.x - x - 12.0).max() < 0.5
    assert np.abs(jumped.y - y + 4.0).max() < 0.5


def test_a_disc_that_is_taken_away_is_lost_and_found_again(discs: Discs) -> None:
    x, y, radius = discs
    tracker = make_tracker(WHITE, discs)
    there = np.arange(len(x)) != 44
    without = photograph_discs(WHITE, SHAPE, x[there], y[there], radius[there], 0.0 * x[there], 2)
    history = [tracker.first(), tracker.follow(without, [tracker.first()])]
    assert history[1].status[44] == TrackStatus.LOST
    assert np.isnan(history[1].x[44])
    assert history[1].has_pose[there].all()
    again = tracker.follow(photograph_discs(WHITE, SHAPE, x + 1.0, y, radius, 0.0 * x, 3), history)
    assert again.has_pose.all()
    assert abs(again.x[44] - x[44] - 1.0) < 0.2


def test_lost_discs_are_assigned_to_the_rings_of_no_other_disc(discs: Discs) -> None:
    x, y, radius = discs
    tracker = make_tracker(WHITE, discs)
    moved = np.isin(np.arange(len(x)), (0, 9, 90))  # three corners jump outwards by more than a radius, one returns
    outwards = 28.0 * np.stack([np.sign(x - x.mean()), np.sign(y - y.mean())]) * moved
    at = np.stack([x, y]) + outwards
    followed = tracker.follow(photograph_discs(WHITE, SHAPE, *at, radius, 0.0 * x, 2), [tracker.first()])
    assert followed.has_pose.all()
    assert np.hypot(followed.x - at[0], followed.y - at[1]).max() < 0.5
    assert (followed.status[~moved] == TrackStatus.OK).all()
    assert not np.isin(followed.status[moved], (TrackStatus.OK, TrackStatus.LOST)).any()


def test_a_place_with_a_weak_ring_is_no_pose(discs: Discs) -> None:
    x, y, radius = discs
    tracker = make_tracker(WHITE, discs)
    faint = photograph_discs(WHITE, SHAPE, x[:1], y[:1], radius[:1], np.zeros(1), 2) - WHITE.outside
    there = np.arange(len(x)) != 0
    image = photograph_discs(WHITE, SHAPE, x[there], y[there], radius[there], np.zeros(there.sum()), 3)
    followed = tracker.follow((image + 0.12 * faint).astype(np.float32), [tracker.first()])
    assert followed.status[0] == TrackStatus.LOST
    assert (followed.status[1:] == TrackStatus.OK).all()


def test_a_blank_photograph_shows_no_disc(discs: Discs) -> None:
    tracker = make_tracker(WHITE, discs)
    blank = np.random.default_rng(1).normal(90.0, 2.0, SHAPE).astype(np.float32)
    assert not tracker.follow(blank, [tracker.first()]).has_pose.any()


def test_a_disc_that_leaves_the_photograph_is_out_of_frame() -> None:
    x, y, radius = np.array([60.0, 200.0, 300.0]), np.array([100.0, 200.0, 100.0]), np.full(3, 15.0)
    tracker, history = make_tracker(WHITE, (x, y, radius)), []
    history.append(tracker.first())
    for shift in (20.0, 40.0, 60.0, 75.0):
        image = photograph_discs(WHITE, SHAPE, x - shift, y, radius, 0.0 * x, int(shift))
        history.append(tracker.follow(image, history))
    assert history[2].has_pose.all()
    assert history[-1].status.tolist() == [TrackStatus.OUT_OF_FRAME, TrackStatus.OK, TrackStatus.OK]
