"""Poses that one or two photographs lack: interpolated between the photographs before and after."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ....process.counts import state_count
from ....solver.inferred.interpolated_poses import interpolate_poses, settle_poses
from ....tracks import Tracks, TrackStatus, WallTracks
from ...snapshots import grains_of
from .outliers import walls_in

LONGEST = 2  # photographs without a pose; neighbours rearrange over longer gaps
MOST = 0.3  # of the poses of a photograph: where more are missing, the neighbours do not show the motion either


def interpolate_short_gaps(tracks: Tracks, walls: WallTracks | None = None) -> tuple[Tracks, str]:
    """Interpolate poses that a photograph or two lack, so that the forces on these rods are reported.

    Parameters
    ----------
    tracks : Tracks
    walls : WallTracks, optional

    Returns
    -------
    tracks : Tracks
        Position and rotation are linear in time between the photographs before and after, plus the median deviation
        of the nearest rods from their own linear motion; positions are then moved to where the gaps to others are
        nearest to those before and after. The status is INTERPOLATED, the precision that of the others. In the first
        and last photograph rods follow their neighbours from the photograph beside it.
    remark : str
        How many were interpolated; empty where there is none.
    """
    gaps = _short_gaps(tracks)
    count = int(gaps.sum())
    if not count:
        return tracks, ""
    position, rotation, status = tracks.position.copy(), tracks.rotation.copy(), tracks.status.copy()
    sigma = tracks.sigma.copy()
    grains = grains_of(tracks)
    for k in np.flatnonzero(gaps.any(axis=1)).tolist():
        poses = interpolate_poses(tracks.time, tracks.position, k, np.flatnonzero(gaps[k]))
        noise = float(np.median(tracks.sigma[k][tracks.present_in(k)]))
        position[k, poses.row] = settle_poses(poses, grains, tracks.position, noise, partial(walls_in, walls))
        line = 1.0 - poses.fraction, poses.fraction
        rotation[k, poses.row] = (
            line[0] * tracks.rotation[poses.before, poses.row] + line[1] * tracks.rotation[poses.after, poses.row]
        )
        status[k, gaps[k]] = TrackStatus.INTERPOLATED
        sigma[k, gaps[k]] = noise
    poses, frames = state_count(count, "lost pose"), state_count(int(gaps.any(axis=1).sum()), "photograph")
    verb = "is" if count == 1 else "are"
    remark = f"{poses} in {frames} {verb} interpolated between the photographs before and after"
    return replace(tracks, position=position, rotation=rotation, sigma=sigma, status=status), remark


def _short_gaps(tracks: Tracks) -> NDArray[np.bool_]:
    """Which lost poses belong to gaps of at most LONGEST photographs (f, n)."""
    present, frames = tracks.present, tracks.frame_count
    found = np.zeros_like(present)
    if frames < 2 or tracks.boundary is not None:
        return found
    for grain in np.flatnonzero(tracks.lost.any(axis=0)):
        seen = np.flatnonzero(present[:, grain])
        for before, after in zip(np.append(-1, seen), np.append(seen, frames), strict=True):
            inside = before >= 0 and after < frames
            found[before + 1 : after, grain] = len(seen) > 0 and after - before - 1 <= (LONGEST if inside else 1)
    found &= tracks.lost
    found[found.mean(axis=1) > MOST] = False
    return found
