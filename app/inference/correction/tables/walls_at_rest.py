"""Walls that are stated at rest although rods leave or penetrate them: they are moved with the rods that touch them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
from numpy.typing import NDArray
from scipy.stats import theilslopes

from ....solver.bodies.grains import Array
from ....solver.bodies.wall_shapes import outward_normals
from ....tracks import Tracks, WallTracks
from .rods_at_walls import RodsAtWalls
from .wall_times import MORE, MOST

DRIFT_SIGMAS = 15.0  # standard deviations of a position by which rods may leave or penetrate a wall …
DRIFT = 0.02  # … and fraction of the mean radius
TOGETHER = 0.2  # of the greatest change of a gap at a wall: what a common translation of all rods may leave
NEAREST = 3  # rods at a wall: the distance of the third nearest is judged
LATE = 1.0 / 3.0  # fraction of the photographs, the last ones, in which the rods at a wall are counted
# Fraction of the rods near a wall that touch it if it moves with them, MORE times as many as at rest; MOST where rods
# drift. Of simulated walls at rest at most .48 of the near rods touch it if it moves, or others are not touched either.
MOST_AT_REST = 0.6
FEWEST = 3  # rods that show the motion of a wall …
FEWEST_TURNING, SPREAD = 5, 0.3  # … and its turning, with the fraction of its length over which they spread
NEARLY = 2.0  # widths of touching, in which rods touched a wall one photograph before


@dataclass(frozen=True, slots=True)
class WallAtRest:
    """A wall that is stated at rest."""

    evidence: str
    corrected: bool  # False: too few rods show its motion


def correct_walls_at_rest(tracks: Tracks, walls: WallTracks) -> tuple[WallTracks, list[WallAtRest]]:
    """Move straight walls that are stated at rest, but that rods leave or penetrate, with the rods that touch them.

    Returns
    -------
    WallTracks
        With the places of these walls in every photograph.
    list of WallAtRest
        Empty: all walls at rest may be.

    Notes
    -----
    Rods leave or penetrate a wall more and more, unless all rods move so against all walls: a camera that moves changes
    the gaps at opposite walls in opposite ways, which a run corrects. A smaller drift counts where four times as many
    rods touch the wall in the last third of the photographs if it moves with them.

    From photograph to photograph a wall follows the rods that touched it: along its normal and in its direction by a
    robust line through their gaps (Theil and Sen), along itself by the median motion of their surfaces at the wall,
    since most of them roll on it or rest against it.
    """
    if walls.count == 0 or tracks.frame_count < NEAREST:
        return walls, []
    rods = RodsAtWalls.of(tracks)
    given = {w: _touched(rods, walls.endpoints[:, w]) for w in walls.straight}
    still = [w for w in given if _is_still(tracks, walls, w)]
    drifting = _drifting(rods, walls)
    endpoints, found = walls.endpoints.copy(), []
    for w in still:
        if w not in drifting and given[w][1] * MORE > 1.0:  # no motion shows so many more
            continue
        followed = _follow(rods, walls.endpoints[0, w])
        count, fraction = _touched(rods, followed)
        shown = count >= MORE * max(given[w][0], 1) and fraction > (MOST if w in drifting else MOST_AT_REST)
        # Some other wall must be touched: else all walls are wrong, or the camera.
        shown &= any(each[1] > MOST for other, each in given.items() if other != w)
        if w not in drifting and not shown:
            continue
        words = drifting.get(w, f"wall '{walls.name[w]}' does not move")
        if shown:
            words += f": {count} rods touch it in the last photographs if it moves with them, {given[w][0]} at rest"
            endpoints[:, w] = followed
        found.append(WallAtRest(words, corrected=shown))
    return replace(walls, endpoints=endpoints) if any(each.corrected for each in found) else walls, found


def _allowed(tracks: Tracks) -> float:
    """By how much [m] rods may leave or penetrate a wall."""
    return max(DRIFT_SIGMAS * float(np.nanmedian(tracks.position_sigma)), DRIFT * float(tracks.radius.mean()))


def _is_still(tracks: Tracks, walls: WallTracks, w: int) -> bool:
    return float(np.abs(walls.endpoints[:, w] - walls.endpoints[0, w]).max()) < _allowed(tracks)


def _drifting(rods: RodsAtWalls, walls: WallTracks) -> dict[int, str]:
    """Walls that rods leave or penetrate by far, with the evidence if they rest."""
    allowed = _allowed(rods.tracks)
    gaps = {w: _first_and_last_gap(rods, walls, w) for w in walls.straight}
    changes = {w: last - first for w, (first, last) in gaps.items() if np.isfinite(last - first)}
    if _moved_together(walls, changes):
        return {}
    found = {}
    for w, change in changes.items():
        penetrated = max(change, gaps[w][1]) < -allowed  # rods that only come near a wall do not
        if penetrated or (walls.loaded[w] and change > allowed):
            does = "penetrate" if change < 0 else "leave"
            found[w] = f"rods {does} wall '{walls.name[w]}', which does not move, by {1e3 * abs(change):.2g} mm"
    return found


def _touched(rods: RodsAtWalls, ends: Array) -> tuple[int, float]:
    """Rods that touch a wall with ends (f, 2, 2) in the last photographs, and their fraction of those near it."""
    count, near = 0, 0
    for k in range(int((1.0 - LATE) * len(ends)), len(ends)):
        rows, _ = rods.near(k, ends[k])
        count += int(rods.touching(k, rows, ends[k][None]).sum())
        near += len(rows)
    return count, count / max(near, 1)


def _follow(rods: RodsAtWalls, ends: Array) -> Array:
    """Ends (f, 2, 2) of a wall that begins at some (2, 2) and moves with the rods that touch it."""
    tracks = rods.tracks
    followed = np.repeat(ends[None], tracks.frame_count, axis=0)
    for k in range(1, len(followed)):
        before = followed[k - 1]
        rows, gap = rods.near(k - 1, before)
        rows = rows[(np.abs(gap) < NEARLY * rods.width) & tracks.present_in(k)[rows]]
        followed[k] = before if len(rows) < FEWEST else before + _motion(rods, k, rows, before)
    return followed


def _motion(rods: RodsAtWalls, k: int, rows: NDArray[np.intp], ends: Array) -> Array:
    """Motion (2, 2) [m] of the ends (2, 2) of a wall to photograph k, with some rods (m,)."""
    tracks, gap = rods.tracks, rods.gaps(k, rows, ends)
    normal, length = outward_normals(ends), float(np.linalg.norm(ends[1] - ends[0]))
    along = (ends[1] - ends[0]) / length
    place = (tracks.position[k, rows] - ends[0]) @ along / length
    middle, slope = float(np.median(gap)), 0.0
    if len(rows) >= FEWEST_TURNING and np.ptp(place) > SPREAD:
        slope, middle = np.asarray(theilslopes(gap, place)[:2], dtype=np.float64).tolist()
    slid = float(np.median(rods.surface_motion(k, rows, along)))
    return slid * along - (middle + slope * np.array([[0.0], [1.0]])) * normal


def _first_and_last_gap(rods: RodsAtWalls, walls: WallTracks, w: int) -> tuple[float, float]:
    """Gaps at wall w [m] in the first photograph and, by their median, in the last three; NaN without rods there."""
    forward, back = (_known_gaps(rods, walls, w, order) for order in (1, -1))
    begin, end = list(islice(forward, 1)), list(islice(back, 3))
    return (begin[0], float(np.median(end))) if len(end) == 3 else (np.nan, np.nan)


def _moved_together(walls: WallTracks, changes: Mapping[int, float]) -> bool:
    """Whether one translation of all rods explains the changes of the gaps [m] at more walls than it has components."""
    normal = outward_normals(walls.endpoints[0, list(changes)])
    change = np.array(list(changes.values()))
    if len(change) <= np.linalg.matrix_rank(normal, tol=0.1):
        return False
    rest = change + normal @ np.linalg.lstsq(normal, -change, rcond=0.1)[0]
    return bool(np.abs(rest).max() < TOGETHER * np.abs(change).max())


def _known_gaps(rods: RodsAtWalls, walls: WallTracks, w: int, order: int) -> Iterator[float]:
    """Gaps [m] of wall w in the photographs that show one, from the first (order 1) or from the last (−1)."""
    gaps = (rods.nearest_gap(k, walls, w, NEAREST) for k in range(rods.tracks.frame_count)[::order])
    return (gap for gap in gaps if np.isfinite(gap))
