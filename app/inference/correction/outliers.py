"""Poses that contradict the photographs before and after them: a rod that jumps against its neighbours and returns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ...solver.bodies.grains import Array
from ...tracks import Tracks, TrackStatus

NEIGHBOURS = 8  # whose median motion a rod is compared with
JUMP = 6.0  # robust standard deviations of a rod's deviation from its neighbours beyond which it jumps …
NOISE = 6.0  # … and standard deviations of a position
RETURN = 0.5  # a jump that is undone leaves at most this fraction of it
ONE_SIDED = 1.2  # times the least jump, where no later photograph shows the return
PENETRATION = 0.15  # of the jump: a wrong pose overlaps a neighbour by more of it, a rod that really moved does not
PASSES = 3  # an outlier hides the one before or after it until it is interpolated
MOST = 0.1  # of the poses of a frame: where more jump, the packing rearranges
ROBUST = 1.4826  # standard deviation over the median absolute deviation of a Gaussian


def replace_outliers(tracks: Tracks) -> tuple[Tracks, str]:
    """Replace poses of rods that jump for one photograph by interpolated ones.

    Parameters
    ----------
    tracks : Tracks

    Returns
    -------
    tracks : Tracks
        Position and rotation of outliers are the means of the photographs before and after, plus the neighbours' own
        deviation from theirs; their status is SUSPECT.
    remark : str
        How many were replaced; empty where there is none.

    Notes
    -----
    With d_k the displacement of a rod in step k less the median of its neighbours', its deviation in photograph k is
    e = (d_k − d_{k+1})/2. It is an outlier if |e| > max(6 s, 6 σ), s the robust standard deviation of e over the rods,
    |d_k + d_{k+1}| < |e|, so that the jump is undone, and the rod would overlap a neighbour by 0.15 |e| more than
    without the jump: rods that really jump, as rattlers do, cannot penetrate others. In the last photograph
    e = d_k − d_{k−1}, and 1.2 times as much is needed.
    """
    outlier, position = np.zeros(tracks.status.shape, np.bool_), tracks.position
    for _ in range(PASSES):
        more = find_outliers(replace(tracks, position=position)) & ~outlier
        if not more.any():
            break
        outlier |= more
        position = _interpolate(replace(tracks, position=position), more)
    count = int(outlier.sum())
    if not count:
        return tracks, ""
    rotation, status = tracks.rotation.copy(), tracks.status.copy()
    for k in np.flatnonzero(outlier.any(axis=1)):
        rows = np.flatnonzero(outlier[k])
        later = tracks.rotation[k + 1 if k + 1 < tracks.frame_count else k - 1]
        rotation[k, rows] = 0.5 * (tracks.rotation[k - 1, rows] + later[rows])
        status[k, rows] = TrackStatus.SUSPECT
    frames = int(outlier.any(axis=1).sum())
    remark = (
        f"{count} poses in {frames} photographs jump against their neighbours and return: they are interpolated; "
        "check these rods"
    )
    return replace(tracks, position=position, rotation=rotation, status=status), remark


def find_outliers(tracks: Tracks) -> NDArray[np.bool_]:
    """Whether a pose is an outlier (f, n); those of the first frame cannot be found from motions."""
    frames, n = tracks.position.shape[:2]
    found = np.zeros((frames, n), np.bool_)
    if frames < 3 or n <= NEIGHBOURS or tracks.boundary is not None:
        return found
    steps = [_relative_step(tracks, k) for k in range(1, frames)]
    for k in range(1, frames):
        last = k == frames - 1
        before, after = steps[k - 1], steps[k - 2] if last else steps[k]
        deviation = np.linalg.norm(before - after, axis=1) * (1.0 if last else 0.5)
        known = deviation[np.isfinite(deviation)]
        if not len(known):
            continue
        least = np.maximum(JUMP * ROBUST * float(np.median(known)), NOISE * tracks.sigma[k])
        jumps = deviation > (ONE_SIDED * least if last else least)
        if not last:
            jumps &= np.linalg.norm(before + after, axis=1) < 2.0 * RETURN * deviation
        if last and frames > 3:  # a jump in the photograph before returns now
            jumps &= ~found[k - 1]
        if jumps.mean() <= MOST:
            found[k] = jumps
            found[k] &= _penetrates(tracks, found, k, deviation)
    return found


def _penetrates(tracks: Tracks, jumps: NDArray[np.bool_], k: int, deviation: Array) -> NDArray[np.bool_]:
    """Whether a rod that jumps in frame k overlaps a neighbour more than without its jump (n,)."""
    chosen = np.zeros_like(jumps)
    chosen[k] = jumps[k]
    rows = np.flatnonzero(jumps[k])
    result = np.zeros(jumps.shape[1], np.bool_)
    if len(rows):
        measured, moved = tracks.position[k], _interpolate(tracks, chosen)[k]
        others = np.flatnonzero(~jumps[k] & np.isfinite(measured[:, 0]))
        change = _overlap(tracks, measured, rows, others) - _overlap(tracks, moved, rows, others)
        result[rows] = change > PENETRATION * deviation[rows]
    return result


def _overlap(tracks: Tracks, position: Array, rows: NDArray[np.int64], others: NDArray[np.int64]) -> Array:
    """Greatest overlap (m,) [m] of each of the rows with another rod, 0 without one."""
    apart = np.linalg.norm(position[rows][:, None] - position[others][None], axis=2)
    depth = tracks.radius[rows][:, None] + tracks.radius[others][None] - apart
    return np.maximum(depth.max(axis=1), 0.0)


def _interpolate(tracks: Tracks, outlier: NDArray[np.bool_]) -> Array:
    """Positions (f, n, 2) [m] with those of outliers (f, n) interpolated from the photographs beside theirs."""
    position = tracks.position.copy()
    for k in np.flatnonzero(outlier.any(axis=1)):
        rows, last = np.flatnonzero(outlier[k]), k == tracks.frame_count - 1
        neighbours = neighbour_rows(tracks.position[k - 1], np.flatnonzero(~outlier[k]), rows)
        middle = tracks.position[k - 1] if last else 0.5 * (tracks.position[k - 1] + tracks.position[k + 1])
        position[k, rows] = middle[rows] + np.nanmedian(tracks.position[k][neighbours] - middle[neighbours], axis=1)
    return position


def _relative_step(tracks: Tracks, k: int) -> Array:
    """Displacement (n, 2) [m] since the frame before, less the median of the neighbours'; NaN where unknown."""
    step = tracks.position[k] - tracks.position[k - 1]
    known = np.flatnonzero(np.isfinite(step[:, 0]))
    if len(known) <= NEIGHBOURS:
        return np.full_like(step, np.nan)
    relative = np.full_like(step, np.nan)
    near = neighbour_rows(tracks.position[k - 1], known, known)
    relative[known] = step[known] - np.median(step[near], axis=1)
    return relative


def neighbour_rows(position: Array, among: NDArray[np.int64], of: NDArray[np.int64]) -> NDArray[np.int64]:
    """Rows of the nearest of `among` for each of `of` (m, NEIGHBOURS), itself left out; position (n, 2) [m]."""
    finite = among[np.isfinite(position[among, 0])]
    _, near = KDTree(position[finite]).query(position[of], k=NEIGHBOURS + 1)
    rows = finite[near]
    own = rows == of[:, None]
    own[~own.any(axis=1), -1] = True  # it is not among them: the farthest is left out
    return rows[~own].reshape(len(of), NEIGHBOURS)
