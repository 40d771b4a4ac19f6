"""Poses that one or two photographs lack are interpolated; longer gaps stay."""

from dataclasses import replace

import numpy as np
import pytest
from rodsight.inference.correction.tables.short_gaps import interpolate_short_gaps
from rodsight.inference.snapshots import make_snapshots, measure_sequence
from rodsight.process.counts import state_count
from rodsight.tracks import TrackStatus, WallTracks

from .test_outliers import FRAMES, NOISE, ROD, N, sheared_tracks


def without_poses(*missing):
    """Sheared tracks without the poses (frame, rod)."""
    tracks = sheared_tracks()
    position, sigma, status = tracks.position.copy(), tracks.sigma.copy(), tracks.status.copy()
    for frame, rod in missing:
        position[frame, rod] = sigma[frame, rod] = np.nan
        status[frame, rod] = TrackStatus.LOST
    return replace(tracks, position=position, sigma=sigma, status=status)


def test_complete_tracks_are_returned_as_they_are():
    tracks = sheared_tracks()
    assert interpolate_short_gaps(tracks) == (tracks, "")


@pytest.mark.parametrize("frames", [(2,), (2, 3), (0,), (FRAMES - 1,)])
def test_a_short_gap_is_interpolated_and_remains_marked_as_lost(frames):
    tracks = without_poses(*((k, ROD) for k in frames))
    found, remark = interpolate_short_gaps(tracks)
    rows = list(frames)
    assert np.abs(found.position[rows, ROD] - sheared_tracks().position[rows, ROD]).max() < 6 * NOISE
    inside = [k for k in rows if 0 < k < FRAMES - 1]
    np.testing.assert_allclose(found.rotation[inside, ROD], tracks.rotation[inside, ROD], atol=1e-12)
    assert np.all(found.status[rows, ROD] == TrackStatus.INTERPOLATED)
    assert np.array_equal(found.lost, tracks.lost)
    assert state_count(len(frames), "lost pose") in remark


@pytest.mark.parametrize("frames", [(1, 2, 3), (0, 1), (FRAMES - 2, FRAMES - 1), tuple(range(FRAMES))])
def test_a_longer_gap_stays(frames):
    tracks = without_poses(*((k, ROD) for k in frames))
    found, _ = interpolate_short_gaps(tracks)
    assert not found.present[list(frames), ROD].any()


def test_where_too_many_poses_are_missing_none_is_interpolated():
    tracks = without_poses(*((2, rod) for rod in range(0, N, 2)))
    assert interpolate_short_gaps(tracks)[0] is tracks


def test_the_solver_uses_an_interpolated_pose_and_calibration_does_not():
    found, _ = interpolate_short_gaps(without_poses((2, ROD)))
    walls = WallTracks((), np.empty((FRAMES, 0, 2, 2)), np.empty(0))
    assert make_snapshots(found, walls)[2].present[ROD]
    assert not measure_sequence(found, walls).present[2, ROD]
