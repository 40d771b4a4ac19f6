"""Poses that one or two photographs lack: interpolated between the photographs before and after."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...solver.bodies.grains import Array
from ...tracks import Tracks, TrackStatus
from .outliers import neighbour_rows

LONGEST = 2  # photographs without a pose; neighbours rearrange over longer gaps
MOST = 0.3  # of the poses of a photograph: where more are missing, the neighbours do not show the motion either


def interpolate_short_gaps(tracks: Tracks) -> tuple[Tracks, str]:
    """Interpolate poses that a photograph or two lack, so that the forces on these rods are reported.

    Parameters
    ----------
    tracks : Tracks

    Returns
    -------
    tracks : Tracks
        Position and rotation are linear in time between the photographs before and after, plus the median deviation
        of the nearest rods from their own linear motion. The status is INTERPOLATED, the
        precision that of the others. In the first and last photograph
        rods follow their neighbours from the photograph beside it.
    remark : str
        How many were interpolated; empty where there is none.
    """
    gaps = _short_gaps(tracks)
    count = int(gaps.sum())
    if not count:
        return tracks, ""
    position, rotation, status = tracks.position.copy(), tracks.rotation.copy(), tracks.status.copy()
    sigma = tracks.sigma.copy()
    for k in np.flatnonzero(gaps.any(axis=1)).tolist():
        for rows, before, after in _by_neighbours_in_time(tracks, gaps, k):
            fraction = _fraction(tracks.time, k, before, after)
            line = (1.0 - fraction) * tracks.position[before] + fraction * tracks.position[after]
            turned = (1.0 - fraction) * tracks.rotation[before] + fraction * tracks.rotation[after]
            known = np.flatnonzero(np.isfinite(line[:, 0]) & tracks.present[k])
            near = neighbour_rows(line, known, rows)
            position[k, rows] = line[rows] + np.median(tracks.position[k][near] - line[near], axis=1)
            rotation[k, rows] = turned[rows]
        status[k, gaps[k]] = TrackStatus.INTERPOLATED
        sigma[k, gaps[k]] = np.median(tracks.sigma[k][tracks.present[k]])
    frames = int(gaps.any(axis=1).sum())
    remark = f"{count} lost poses in {frames} photographs are interpolated between the photographs before and after"
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


def _by_neighbours_in_time(tracks: Tracks, gaps: NDArray[np.bool_], k: int) -> list[tuple[NDArray[np.int64], int, int]]:
    """Rows of the gaps of a photograph, grouped by the photographs before and after (twice the same at an end)."""
    groups: dict[tuple[int, int], list[int]] = {}
    for row in np.flatnonzero(gaps[k]):
        seen = np.flatnonzero(tracks.present[:, row])
        before, after = seen[seen < k], seen[seen > k]
        first = int(before[-1]) if len(before) else int(after[0])
        groups.setdefault((first, int(after[0]) if len(after) else first), []).append(int(row))
    return [(np.array(rows), *ends) for ends, rows in groups.items()]


def _fraction(time: Array, k: int, before: int, after: int) -> float:
    return 0.0 if after == before else float((time[k] - time[before]) / (time[after] - time[before]))
