"""Predictions from the history, and the poses that are handed out."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from rodsight.tracking.registration.poses import FramePoses, found_poses, no_poses
from rodsight.tracking.registration.prediction import fit_from_own_motion, last_known
from rodsight.tracks import TrackStatus

from tests.app.tracking.registration.registered import fits_of, patches_at, registered, results_at

REFERENCE = np.zeros(3, np.int32)


def frame(x: list[float], rotation: float = 0.0) -> FramePoses:
    """Poses of three grains at x [px], y = 100; NaN: lost."""
    known = np.where(np.isnan(x), np.nan, 1.0)
    status = np.where(np.isnan(x), TrackStatus.LOST, TrackStatus.OK).astype(np.uint8)
    return FramePoses(np.array(x), 100.0 * known, rotation * known, known, known, known, status, REFERENCE)


def test_the_last_known_pose_is_the_most_recent_one() -> None:
    first = frame([10.0, 20.0, 30.0])
    history = [frame([11.0, 21.0, np.nan], 0.1), frame([12.0, np.nan, np.nan], 0.2)]
    assert last_known(history, first)[:, 0].tolist() == [12.0, 21.0, 30.0]
    assert last_known(history, first)[:, 2] == pytest.approx([0.2, 0.1, 0.0])


def test_grains_are_fitted_from_their_extrapolated_motion_then_from_rest() -> None:
    starts: list[tuple[list[int], np.ndarray]] = []
    results = results_at(np.zeros((3, 2)))

    def fit_and_accept(rows, pose, status):
        starts.append((rows.tolist(), pose))
        if len(starts) == 1:
            results.accept(rows[:1], fits_of(pose[:1], np.array([0.9])), status)

    history = [frame([10.0, np.nan, 30.0], 0.1), frame([14.0, 25.0, 36.0], 0.3)]
    last = last_known(history, history[0])
    registration = SimpleNamespace(results=results, last=last, fit_and_accept=fit_and_accept)
    fit_from_own_motion(registration, history)  # type: ignore[arg-type]
    (rows, extrapolated), (left, rest) = starts
    assert rows == [0, 1, 2]
    assert extrapolated[:, 0].tolist() == [18.0, 25.0, 42.0]
    assert extrapolated[:, 2] == pytest.approx([0.5, 0.3, 0.5])
    assert left == [1, 2]
    assert rest[:, 0].tolist() == [25.0, 36.0]


def finished(rotation: float, last_rotation: float) -> FramePoses:
    """Poses of three grains: one found, one lost, one whose last place is at the border."""
    centre = np.array([[200.0, 200.0], [300.0, 200.0], [22.0, 200.0]])
    registration = registered(centre, np.zeros((3, 2)), 0.9)
    registration.results.pose[:, 2] = rotation
    registration.last[:, 2] = last_rotation
    registration.results.status[1:] = TrackStatus.LOST
    registration.patches = patches_at(centre)
    registration.patches.reference = SimpleNamespace(image=np.empty((400, 500), np.float32))
    return found_poses(registration, frame([200.0, 300.0, 22.0]), REFERENCE)


def test_rotations_continue_the_last_ones() -> None:
    assert finished(-3.1, 3.1).rotation[0] == pytest.approx(2.0 * np.pi - 3.1)
    assert finished(0.4, 12.5).rotation[0] == pytest.approx(4.0 * np.pi + 0.4)


def test_a_missing_grain_has_no_pose_and_is_out_of_frame_at_the_border() -> None:
    poses = finished(0.1, 0.0)
    assert poses.status.tolist() == [TrackStatus.OK, TrackStatus.LOST, TrackStatus.OUT_OF_FRAME]
    assert poses.has_pose.tolist() == [True, False, False]
    for values in (poses.y, poses.rotation, poses.sigma, poses.zncc, poses.second_zncc):
        assert np.isnan(values[1:]).all()


def test_a_failed_photograph_has_a_reason_and_no_poses() -> None:
    poses = no_poses(REFERENCE, "too dark")
    assert poses.failed_reason == "too dark"
    assert not poses.has_pose.any()
    assert (poses.status == TrackStatus.LOST).all()
