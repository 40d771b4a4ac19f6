"""What a user tells of a grain is where the tracker begins, and stands where it finds nothing better."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.tracking.registration.manual_poses import ManualPoses
from rodsight.tracking.tracker import Tracker
from rodsight.tracks import TrackStatus

from tests.app.tracking.speckled import Rods, grid_of_rods

RADIUS = 22.0  # [px]
RIGHT = 0.05  # [px] an accepted fit's error
HIDDEN = 3  # the grain that is covered


@pytest.fixture(scope="module")
def rods() -> Rods:
    return grid_of_rods(4, 4, radius=RADIUS, pitch=47.0, margin=90.0)


@pytest.fixture(scope="module")
def tracker(rods: Rods) -> Tracker:
    return Tracker(rods.reference(), (rods.x, rods.y, rods.radius))


def told(row: int, x: float, y: float, rotation: float) -> ManualPoses:
    return ManualPoses(np.array([row]), np.array([[x, y, rotation]]))


def far(rods: Rods, row: int, dx: float, dy: float, turn: float) -> np.ndarray:
    """A photograph in which one rod alone has gone farther than any search looks."""
    x, y, rotation = np.zeros(rods.count), np.zeros(rods.count), np.zeros(rods.count)
    x[row], y[row], rotation[row] = dx, dy, turn
    return rods.moved(x, y, rotation)


def test_a_grain_beyond_every_search_is_found_where_it_is_told(rods: Rods, tracker: Tracker) -> None:
    # To the empty margin on the left of the grid, from its upper right corner.
    dx, dy = 45.0 - rods.x[HIDDEN], 120.0 - rods.y[HIDDEN]
    image = far(rods, HIDDEN, dx, dy, 0.7)
    history = [tracker.first()]
    assert tracker.follow(image, history).status[HIDDEN] == TrackStatus.LOST
    poses = tracker.follow(image, history, told(HIDDEN, 46.5, 118.8, 0.72))
    assert poses.status[HIDDEN] == TrackStatus.OK
    assert abs(poses.x[HIDDEN] - 45.0) < RIGHT
    assert abs(poses.rotation[HIDDEN] - 0.7) < 0.005
    # And the next photograph follows from there.
    later = tracker.follow(far(rods, HIDDEN, dx + 3.0, dy + 2.0, 0.8), [*history, poses])
    assert later.status[HIDDEN] == TrackStatus.OK
    assert abs(later.y[HIDDEN] - 122.0) < RIGHT


def test_an_angle_that_is_not_told_is_found(rods: Rods, tracker: Tracker) -> None:
    dx, dy = 45.0 - rods.x[HIDDEN], 120.0 - rods.y[HIDDEN]
    poses = tracker.follow(far(rods, HIDDEN, dx, dy, -2.0), [tracker.first()], told(HIDDEN, 44.0, 121.0, np.nan))
    assert poses.status[HIDDEN] == TrackStatus.OK
    assert abs(poses.rotation[HIDDEN] + 2.0) < 0.005


def test_a_told_pose_stands_where_nothing_correlates(rods: Rods, tracker: Tracker) -> None:
    image = rods.moved(2.0, 1.0, 0.1)
    row, column = np.mgrid[: rods.height, : rods.width]
    image[np.hypot(column - rods.x[HIDDEN] - 2.0, row - rods.y[HIDDEN] - 1.0) < RADIUS + 2] = 70.0
    poses = tracker.follow(image, [tracker.first()], told(HIDDEN, rods.x[HIDDEN] + 2.2, rods.y[HIDDEN] + 1.1, 0.1))
    assert poses.status[HIDDEN] == TrackStatus.GIVEN
    assert poses.x[HIDDEN] == rods.x[HIDDEN] + 2.2
    assert poses.rotation[HIDDEN] == pytest.approx(0.1)
    assert poses.sigma[HIDDEN] == 1.0
    assert np.isnan(poses.zncc[HIDDEN])
    others = np.arange(rods.count) != HIDDEN
    assert (poses.status[others] == TrackStatus.OK).all()


def test_a_grain_said_to_be_lost_is_lost_and_found_again(rods: Rods, tracker: Tracker) -> None:
    poses = tracker.follow(rods.moved(2.0, 1.0, 0.1), [tracker.first()], told(HIDDEN, np.nan, np.nan, np.nan))
    assert poses.status[HIDDEN] == TrackStatus.LOST
    assert np.isnan(poses.x[HIDDEN])
    later = tracker.follow(rods.moved(4.0, 2.0, 0.2), [tracker.first(), poses])
    assert later.status[HIDDEN] == TrackStatus.OK


def test_a_wrong_told_pose_does_not_spoil_a_good_neighbour(rods: Rods, tracker: Tracker) -> None:
    image = rods.moved(2.0, 1.0, 0.1)
    poses = tracker.follow(image, [tracker.first()], told(HIDDEN, rods.x[0], rods.y[0], 0.0))
    assert poses.status[HIDDEN] == TrackStatus.GIVEN
    assert abs(poses.x[0] - rods.x[0] - 2.0) < RIGHT


def test_without_corrections_nothing_changes(rods: Rods, tracker: Tracker) -> None:
    image = rods.moved(2.0, 1.0, 0.1)
    nothing = ManualPoses(np.empty(0, np.intp), np.empty((0, 3)))
    with_none, plain = tracker.follow(image, [tracker.first()], nothing), tracker.follow(image, [tracker.first()])
    for name in ("x", "y", "rotation", "sigma", "zncc", "status"):
        assert getattr(with_none, name).tobytes() == getattr(plain, name).tobytes()
