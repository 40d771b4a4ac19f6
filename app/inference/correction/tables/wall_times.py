"""Walls whose places are those of another time, from the rods that touch them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ....solver.bodies.grains import Array
from ....solver.bodies.wall_shapes import outward_normals
from ....tracks import Tracks, WallTracks
from .rods_at_walls import RodsAtWalls

LAGS = np.linspace(-1.5, 1.5, 31)  # [photographs] by which walls may be late
IN_TIME = int(np.argmin(np.abs(LAGS)))
LEAST_LAG = 0.15  # [photographs] below which walls count as in time
# Times as many contacts as in time, fraction of the rods near the wall, and contacts, from which a wall is late. Of
# simulated walls in time, .55 to .85 of the rods near them touch, of those that are late .39 to .7; with wrong radii or
# a wrong camera at most .45 touch at any time, and 2.4 times as many at a wall that soft rods overlap.
MORE, MOST, FEWEST = 4.0, 0.45, 20
CLEARLY = 3.0  # standard deviations of a count of rods by which more touch a wall in one place than in another
MORE_TOGETHER, FEWEST_TOGETHER = 2.0, 8  # of a wall that shares its lag with one that is late by these
ALIKE = 0.2  # [photographs] by which the lags of two halves of the photographs, or of several walls, may differ


class Touches(NamedTuple):
    """Rods at a wall of every photograph, for all LAGS."""

    touching: Array  # (f, l) rods that touch it
    near: Array  # (f, l) rods near it
    gap: Array  # (f, l) sum of the gaps [m] of touching rods from the wall as it is given

    def fraction(self, number: int) -> float:
        """Fraction of the near rods that touch the wall at a lag."""
        return float(self.touching[:, number].sum() / max(self.near[:, number].sum(), 1.0))


class _Late(NamedTuple):
    """A wall that is not in time."""

    lag: float  # [photographs] by which it is late
    name: str
    touching: int  # rods that touch it at that time, in all photographs
    given: int  # … and as it is given
    apart: bool  # whether these rods seem apart from it, not beyond it
    moved: int  # rods that touch it if it is in time, but misplaced by its median motion in that time
    place: float  # [m] of that motion along its normal, of the end that moves most


def correct_wall_times(tracks: Tracks, walls: WallTracks) -> tuple[WallTracks, str]:
    """Move straight walls that more rods touch if they are late or early by a part of a photograph to their times.

    Returns
    -------
    WallTracks
        With the places at the times of the photographs.
    str
        A sentence on the correction; empty: none.

    Notes
    -----
    Between two photographs the wall moves on a straight path. Counted are rods whose gap is within three standard
    deviations of zero, for every lag; even and odd photographs must show the same lag by themselves. Wrong radii move
    the rods from all walls, or beyond all: some wall must be in time, or rods apart from one and beyond another. A wall
    that moves steadily and is late looks like one that is misplaced, with the same places after the correction: both
    are named unless clearly fewer rods touch it in the other place.
    """
    rods = RodsAtWalls.of(tracks)
    found = {w: _count_touches(rods, walls, w) for w in walls.straight}
    in_time = any(each.fraction(IN_TIME) > MOST for each in found.values())
    late = []
    for w, number in find_lags(found).items():
        count, apart = found[w].touching.sum(axis=0), bool(found[w].gap[:, number].sum() > 0.0)
        lag, counts = float(LAGS[number]), (int(count[number]), int(count[IN_TIME]))
        late.append(_Late(lag, walls.name[w], *counts, apart, *_misplaced(rods, walls, w, lag)))
    if not late or not (in_time or len({each.apart for each in late}) == 2):
        return walls, ""
    endpoints = walls.endpoints.copy()
    for each in late:
        w = walls.name.index(each.name)
        endpoints[:, w] = _move_in_time(rods, walls.endpoints[:, w], each.lag)
    late.sort()
    groups = np.split(np.arange(len(late)), np.flatnonzero(np.diff([each.lag for each in late]) > ALIKE) + 1)
    words = [_describe([late[each] for each in group]) for group in groups]
    return replace(walls, endpoints=endpoints), "; ".join(words)


def _count_touches(rods: RodsAtWalls, walls: WallTracks, w: int) -> Touches:
    """Count the rods at wall w."""
    frames = rods.tracks.frame_count
    found = Touches(*np.zeros((3, frames, len(LAGS))))
    for k in range(frames):
        here, own = rods.near(k, walls.endpoints[k, w])
        known = (k + LAGS >= 0.0) & (k + LAGS <= frames - 1)
        ends = _at(walls.endpoints[:, w], k + LAGS[known])
        touches = rods.touching(k, here, ends)
        found.touching[k, known], found.near[k, known] = touches.sum(axis=1), len(here)
        found.gap[k, known] = touches @ own
    return found


def find_lags(found: Mapping[int, Touches]) -> dict[int, int]:
    """Numbers of the lags among LAGS of the walls that are late; fewer contacts show a lag that two walls share."""
    certain = {w: number for w, each in found.items() if (number := _find_lag(each, MORE, FEWEST, MOST)) != IN_TIME}
    shared = {
        w: number
        for w, each in found.items()
        if w not in certain
        and (number := _find_lag(each, MORE_TOGETHER, FEWEST_TOGETHER, 0.0)) != IN_TIME
        and any(abs(LAGS[number] - LAGS[other]) <= ALIKE for other in certain.values())
    }
    return dict(sorted({**certain, **shared}.items()))


def _find_lag(found: Touches, more: float, fewest: int, most: float) -> int:
    """Number of the lag of a wall among LAGS; IN_TIME also where it is not known."""
    count = found.touching.sum(axis=0)
    best = int(np.argmax(count))
    enough = count[best] >= max(more * count[IN_TIME], fewest) and found.fraction(best) > most
    if not enough or abs(LAGS[best]) < LEAST_LAG:
        return IN_TIME
    halves = [float(LAGS[int(np.argmax(found.touching[start::2].sum(axis=0)))]) for start in (0, 1)]
    return best if abs(halves[0] - halves[1]) <= ALIKE else IN_TIME


def _misplaced(rods: RodsAtWalls, walls: WallTracks, w: int, lag: float) -> tuple[int, float]:
    """Count rods that touch wall w if it is misplaced by its median motion in a lag; its greatest normal motion [m]."""
    time = np.arange(rods.tracks.frame_count, dtype=np.float64) + lag
    known = np.flatnonzero((time >= 0.0) & (time <= rods.tracks.frame_count - 1))
    given = walls.endpoints[:, w]
    shift = np.median(_at(given, time[known]) - given[known], axis=0)
    count = 0
    for k in known.tolist():
        here = rods.near(k, given[k])[0]
        count += int(rods.touching(k, here, (given[k] + shift)[None]).sum())
    return count, float(np.abs(shift @ outward_normals(given.mean(axis=0))).max())


def _move_in_time(rods: RodsAtWalls, given: Array, lag: float) -> Array:
    """Ends (f, 2, 2) of a wall (f, 2, 2) that is late; as given where more rods touch it there, as before it moves."""
    moved = _at(given, np.arange(len(given), dtype=np.float64) + lag)
    for k in range(len(given)):
        here = rods.near(k, given[k])[0]
        then, now = rods.touching(k, here, np.stack([moved[k], given[k]])).sum(axis=1)
        if now > then:
            moved[k] = given[k]
    return moved


def _describe(walls: list[_Late]) -> str:
    """Describe walls that are late, or early, by the same time."""
    lag = float(np.mean([each.lag for each in walls]))
    names = ", ".join(f"'{each.name}'" for each in walls)
    subject, verb, them, they = (
        ("wall", "is", "it", "it is") if len(walls) == 1 else ("walls", "are", "them", "they are")
    )
    touch, given, moved = (sum(each) for each in zip(*((w.touching, w.given, w.moved) for w in walls), strict=True))
    other = ""
    if touch - moved <= CLEARLY * np.sqrt(touch):
        place = 1e3 * max(each.place for each in walls)
        other = f", or misplaced by up to {place:.2g} mm (a steady motion shows no difference)"
    return (
        f"{subject} {names} {verb} {'late' if lag > 0.0 else 'early'} by {abs(lag):.1f} of the time between "
        f"photographs{other}: {touch} rods touch {them} then, {given} as {they} given"
    )


def _at(endpoints: Array, time: Array) -> Array:
    """Ends (t, 2, 2) of a wall (f, 2, 2) at times (t,) [photographs], outside of the test by its motion at the end."""
    before = np.clip(np.floor(time).astype(np.intp), 0, len(endpoints) - 2)
    part = (time - before)[:, None, None]
    return (1.0 - part) * endpoints[before] + part * endpoints[before + 1]
