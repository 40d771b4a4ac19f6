"""Poses given by hand are starts of fits, and are kept where no fit is found."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rodsight.experiment.experiment import load_experiment
from rodsight.tracking.registration.manual_poses import ManualPoses
from rodsight.tracking.stage import track_first
from rodsight.tracking.tracker import Tracker
from rodsight.tracks import TrackStatus

from tests.app.tracking.speckled import Rods, grid_of_rods

RADIUS = 22.0  # [px]
ERROR_ALLOWED = 0.05  # [px] an accepted fit's error
COVERED = 3  # the grain that is covered or displaced


@pytest.fixture(scope="module")
def rods() -> Rods:
    return grid_of_rods(4, 4, radius=RADIUS, pitch=47.0, margin=90.0)


@pytest.fixture(scope="module")
def tracker(rods: Rods) -> Tracker:
    return Tracker(rods.reference(), (rods.x, rods.y, rods.radius))


def manual_pose(row: int, x: float, y: float, rotation: float) -> ManualPoses:
    return ManualPoses(np.array([row]), np.array([[x, y, rotation]]))


def displace_one(rods: Rods, row: int, dx: float, dy: float, angle: float) -> np.ndarray:
    """A photograph in which one rod alone has moved beyond the range of every search."""
    x, y, rotation = np.zeros(rods.count), np.zeros(rods.count), np.zeros(rods.count)
    x[row], y[row], rotation[row] = dx, dy, angle
    return rods.moved(x, y, rotation)


def test_a_grain_beyond_every_search_is_found_at_its_given_pose(rods: Rods, tracker: Tracker) -> None:
    # To the empty margin on the left of the grid, from its upper right corner.
    dx, dy = 45.0 - rods.x[COVERED], 120.0 - rods.y[COVERED]
    image = displace_one(rods, COVERED, dx, dy, 0.7)
    history = [tracker.first()]
    assert tracker.follow(image, history).status[COVERED] == TrackStatus.LOST
    poses = tracker.follow(image, history, manual_pose(COVERED, 46.5, 118.8, 0.72))
    assert poses.status[COVERED] == TrackStatus.OK
    assert abs(poses.x[COVERED] - 45.0) < ERROR_ALLOWED
    assert abs(poses.rotation[COVERED] - 0.7) < 0.005
    # The next photograph is predicted from there.
    later = tracker.follow(displace_one(rods, COVERED, dx + 3.0, dy + 2.0, 0.8), [*history, poses])
    assert later.status[COVERED] == TrackStatus.OK
    assert abs(later.y[COVERED] - 122.0) < ERROR_ALLOWED


def test_an_angle_that_is_not_given_is_found(rods: Rods, tracker: Tracker) -> None:
    dx, dy = 45.0 - rods.x[COVERED], 120.0 - rods.y[COVERED]
    poses = tracker.follow(
        displace_one(rods, COVERED, dx, dy, -2.0), [tracker.first()], manual_pose(COVERED, 44.0, 121.0, np.nan)
    )
    assert poses.status[COVERED] == TrackStatus.OK
    assert abs(poses.rotation[COVERED] + 2.0) < 0.005


def test_a_given_pose_is_kept_where_no_fit_is_found(rods: Rods, tracker: Tracker) -> None:
    image = rods.moved(2.0, 1.0, 0.1)
    row, column = np.mgrid[: rods.height, : rods.width]
    image[np.hypot(column - rods.x[COVERED] - 2.0, row - rods.y[COVERED] - 1.0) < RADIUS + 2] = 70.0
    poses = tracker.follow(
        image, [tracker.first()], manual_pose(COVERED, rods.x[COVERED] + 2.2, rods.y[COVERED] + 1.1, 0.1)
    )
    assert poses.status[COVERED] == TrackStatus.GIVEN
    assert poses.x[COVERED] == rods.x[COVERED] + 2.2
    assert poses.rotation[COVERED] == pytest.approx(0.1)
    assert poses.sigma[COVERED] == 1.0
    assert np.isnan(poses.zncc[COVERED])
    others = np.arange(rods.count) != COVERED
    assert (poses.status[others] == TrackStatus.OK).all()


def test_a_grain_given_as_lost_is_lost_and_found_again(rods: Rods, tracker: Tracker) -> None:
    poses = tracker.follow(rods.moved(2.0, 1.0, 0.1), [tracker.first()], manual_pose(COVERED, np.nan, np.nan, np.nan))
    assert poses.status[COVERED] == TrackStatus.LOST
    assert np.isnan(poses.x[COVERED])
    later = tracker.follow(rods.moved(4.0, 2.0, 0.2), [tracker.first(), poses])
    assert later.status[COVERED] == TrackStatus.OK


def test_a_wrong_given_pose_does_not_affect_a_good_neighbour(rods: Rods, tracker: Tracker) -> None:
    image = rods.moved(2.0, 1.0, 0.1)
    poses = tracker.follow(image, [tracker.first()], manual_pose(COVERED, rods.x[0], rods.y[0], 0.0))
    assert poses.status[COVERED] == TrackStatus.GIVEN
    assert abs(poses.x[0] - rods.x[0] - 2.0) < ERROR_ALLOWED


def test_without_corrections_nothing_changes(rods: Rods, tracker: Tracker) -> None:
    image = rods.moved(2.0, 1.0, 0.1)
    nothing = ManualPoses(np.empty(0, np.intp), np.empty((0, 3)))
    with_none, plain = tracker.follow(image, [tracker.first()], nothing), tracker.follow(image, [tracker.first()])
    for name in ("x", "y", "rotation", "sigma", "zncc", "status"):
        assert getattr(with_none, name).tobytes() == getattr(plain, name).tobytes()


@pytest.fixture(scope="module")
def glared() -> np.ndarray:
    """A first photograph in which a reflection hides one rod: it has no reference."""
    rods = grid_of_rods(4, 4, radius=RADIUS, pitch=47.0, margin=90.0)
    image = rods.reference()
    row, column = np.mgrid[: rods.height, : rods.width]
    image[np.hypot(column - rods.x[COVERED], row - rods.y[COVERED]) < RADIUS + 2] = 240.0
    return image


def test_a_correction_of_a_grain_without_a_reference_costs_no_other_grain(rods: Rods, glared: np.ndarray) -> None:
    tracker = Tracker(glared, (rods.x, rods.y, rods.radius))
    assert tracker.first().status[COVERED] == TrackStatus.LOST
    given = manual_pose(COVERED, rods.x[COVERED] + 2.0, rods.y[COVERED] + 1.0, 0.1)
    poses = tracker.follow(rods.moved(2.0, 1.0, 0.1), [tracker.first()], given)
    others = np.arange(rods.count) != COVERED
    assert (poses.status[others] == TrackStatus.OK).all()
    assert poses.status[COVERED] == TrackStatus.GIVEN
    assert poses.rotation[COVERED] == pytest.approx(0.1)
    later = tracker.follow(rods.moved(4.0, 2.0, 0.2), [tracker.first(), poses])
    assert (later.status[others] == TrackStatus.OK).all()


@pytest.mark.parametrize("pose", [(-900.0, 1e7, 0.1), (1e9, 50.0, np.nan), (200.0, 150.0, 1e9)])
def test_an_absurd_pose_costs_its_own_grain_at_most(
    rods: Rods, tracker: Tracker, pose: tuple[float, float, float]
) -> None:
    poses = tracker.follow(rods.moved(2.0, 1.0, 0.1), [tracker.first()], manual_pose(COVERED, *pose))
    others = np.arange(rods.count) != COVERED
    assert (poses.status[others] == TrackStatus.OK).all()


def test_a_wrong_given_pose_does_not_make_the_rod_there_suspect(rods: Rods, tracker: Tracker) -> None:
    poses = tracker.follow(
        rods.moved(2.0, 1.0, 0.1), [tracker.first()], manual_pose(COVERED, rods.x[0] + 3.0, rods.y[0], 0.0)
    )
    assert poses.status[COVERED] == TrackStatus.GIVEN
    assert poses.status[0] == TrackStatus.OK


@pytest.mark.thorough
def test_an_error_of_the_program_is_no_failure_of_a_photograph(
    made_photographs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def wrong(*_: object) -> None:
        raise ZeroDivisionError("a fault in the code")

    monkeypatch.setattr(Tracker, "follow", wrong)
    with pytest.raises(ZeroDivisionError):
        track_first(load_experiment(made_photographs), 2)
