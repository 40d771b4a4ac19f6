"""Tests of the input that need no forces: rotations, the order of the photographs, walls that do not move."""

from __future__ import annotations

import numpy as np

from ...results.finding import Finding
from ...solver.bodies.grains import Array
from ...solver.bodies.wall_shapes import STRAIGHT
from ...solver.inferred.unknown_rotations import fill_unknown_rotations
from ...solver.statistics.agreement import pearson
from ...tracks import Tracks, WallTracks
from .causes import finding

AGREES = 0.25  # rank correlation of stated and inferred rotations beyond which they are the same, or opposite …
SIGMAS = 5.0  # … and standard deviations of that of unrelated ones
DEGREES = 10.0  # ratio of stated to inferred rotations: degrees are 57 times radians
SHORTER = 0.75  # path through the photographs in another order over the given one, below which that order is right
REPEATED = 0.1  # displacement of a step over the median step below which a photograph is repeated …
STILL = 1.5  # … or over that of noise alone
MOVES = 4.0  # noise that the median step must exceed for that
DRIFT_SIGMAS = 15.0  # standard deviations of a position by which rods may leave or penetrate a wall …
DRIFT = 0.02  # … and fraction of the mean radius
NEAREST = 3  # rods at a wall: the distance of the third nearest is judged


def examine_rotations(tracks: Tracks, walls: WallTracks) -> list[Finding]:
    """Compare stated rotations with those that rolling among the neighbours leads to expect.

    Notes
    -----
    The rank correlation is that of Spearman over all rods and steps, about .3 to .5 for correct rotations.
    """
    stated = np.diff(tracks.rotation, axis=0)
    known = np.isfinite(stated)
    if not known.any():
        return []
    if not stated[known].any():
        return [finding("rotation_zero", "no rod rotates in any photograph")]
    inferred = np.diff(
        fill_unknown_rotations(
            tracks.radius, tracks.position, np.full_like(tracks.rotation, np.nan), tracks.present, walls.endpoints,
            side=walls.side, cell=walls.cell,
        ),
        axis=0,
    )  # fmt: skip
    known &= np.isfinite(inferred)
    stated, inferred = stated[known], inferred[known]
    if len(stated) < 2 or not inferred.any():
        return []
    from scipy.stats import rankdata  # a third of a second of imports that few inputs need

    rank = pearson(rankdata(stated), rankdata(inferred))
    if abs(rank) < max(AGREES, SIGMAS / np.sqrt(len(stated))):
        return []
    against = f"the rank correlation with the rotations expected from rolling is {rank:.2f}"
    if rank < 0:
        return [finding("rotation_sign", against)]
    ratio = float(np.median(np.abs(stated)) / max(float(np.median(np.abs(inferred))), 1e-300))
    if ratio > DEGREES:
        return [finding("rotation_in_degrees", f"rods rotate {ratio:.0f} times as much as rolling leads to expect")]
    return []


def examine_order(tracks: Tracks) -> list[Finding]:
    """Look for photographs that are swapped with the next one, or repeated."""
    f = tracks.frame_count
    if f < 4:
        return []
    step = np.array([_distance(tracks, k, k + 1) for k in range(f - 1)])
    if not np.isfinite(step).any():
        return []
    usual, noise = float(np.nanmedian(step)), float(np.sqrt(2.0) * np.nanmedian(tracks.position_sigma))
    found = []
    swapped = [k for k in range(1, f - 2) if _shorter_if_swapped(tracks, step, k)]
    if swapped:
        pairs = ", ".join(f"{k} and {k + 1}" for k in swapped[:4]) + ("…" if len(swapped) > 4 else "")
        found.append(finding("photographs_swapped", f"the motion is shorter with photographs {pairs} swapped"))
    repeated = (
        np.flatnonzero(step < max(REPEATED * usual, STILL * noise)) if usual > MOVES * noise else np.empty(0, np.int64)
    )
    if len(repeated):
        words = ", ".join(f"{k + 1}" for k in repeated[:4].tolist())
        found.append(finding("photograph_repeated", f"nothing moves from the photograph before to photograph {words}"))
    return found


def examine_walls(tracks: Tracks, walls: WallTracks) -> list[Finding]:
    """Look for straight walls that rods leave or penetrate more and more."""
    if walls.count == 0 or tracks.frame_count < 3:
        return []
    allowed = max(DRIFT_SIGMAS * float(np.nanmedian(tracks.position_sigma)), DRIFT * float(tracks.radius.mean()))
    found = []
    for w in np.flatnonzero(walls.sides == STRAIGHT).tolist():
        gap = np.array([_near_gap(tracks, walls, k, w) for k in range(tracks.frame_count)])
        gap = gap[np.isfinite(gap)]
        if len(gap) < 3:
            continue
        last = float(np.median(gap[-3:] - gap[0]))
        loaded = np.isfinite(walls.pressure[w]) or (walls.load is not None and np.isfinite(walls.load[:, w]).any())
        still = float(np.abs(walls.endpoints[:, w] - walls.endpoints[0, w]).max()) < allowed
        if still and (last < -allowed or (loaded and last > allowed)):
            does = "penetrate" if last < 0 else "leave"
            words = f"rods {does} wall '{walls.name[w]}', which does not move, by {1e3 * abs(last):.2g} mm"
            found.append(finding("wall_at_rest", words))
    return found


def _distance(tracks: Tracks, k: int, other: int) -> float:
    """Rms displacement of the rods from one photograph to another [m]; NaN where they have no rod in common."""
    both = tracks.present[k] & tracks.present[other]
    moved = tracks.position[other, both] - tracks.position[k, both]
    return float(np.sqrt(np.mean(moved**2))) if len(moved) else np.nan


def _shorter_if_swapped(tracks: Tracks, step: Array, k: int) -> bool:
    given = float(step[k - 1] + step[k] + step[k + 1])
    swapped = _distance(tracks, k - 1, k + 1) + float(step[k]) + _distance(tracks, k, k + 2)
    return swapped < SHORTER * given


def _near_gap(tracks: Tracks, walls: WallTracks, k: int, w: int) -> float:
    """Gap [m] between a wall and the NEAREST-th rod."""
    here = tracks.present[k]
    if here.sum() < NEAREST:
        return np.nan
    (a, b) = walls.endpoints[k, w]
    along = (b - a) / np.linalg.norm(b - a)
    normal = np.array([-along[1], along[0]])
    gap = (tracks.position[k, here] - a) @ normal - tracks.radius[here]
    return float(np.sort(gap)[NEAREST - 1])
