"""Walls that are stated a distance away from where the rods touch them, inside the packing or outside of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ....solver.bodies.grains import Array
from ....solver.bodies.wall_shapes import STRAIGHT, outward_normals
from ....tracks import Tracks, WallTracks
from .wall_times import NEAR, rods_beside, touch_width

NEAREST = 3  # rod at a wall, in the order of their gaps, beside whose gap the place of the wall is sought …
BEFORE, BEHIND = 4.0, 8.0  # … from so many widths of touching before it to so many behind it
# Times as many rods that touch it there as where it is stated, their number, and their fraction of the rods near it.
MORE, FEWEST, MOST = 4.0, 20, 0.45


@dataclass(frozen=True, slots=True)
class _Gaps:
    """Gaps of the rods beside a wall as it is stated."""

    of_frames: list[Array]  # (m,) [m] of each photograph, ascending
    width: float  # [m] of touching
    near: float  # [m] of rods near it

    def count(self, place: float, *, within: float | None = None) -> int:
        """Rods within the width of touching, or another distance, of a wall that lies a distance [m] further inside."""
        reach = self.width if within is None else within
        ends = (place - reach, place + reach)
        return int(sum(np.diff(np.searchsorted(gap, ends))[0] for gap in self.of_frames))

    def fraction(self, place: float) -> float:
        """Fraction of the rods near a wall at some place [m] that touch it."""
        return self.count(place) / max(self.count(place, within=self.near), 1)

    def find_place(self) -> float:
        """Place [m] beside the outermost rods at which most of them touch it; NaN where few are beside it."""
        outermost = [gap[NEAREST - 1] for gap in self.of_frames if len(gap) >= NEAREST]
        if not outermost:
            return np.nan
        places = float(np.median(outermost)) + self.width * np.arange(-BEFORE, BEHIND, 0.25)
        return float(places[int(np.argmax([self.count(each) for each in places]))])

    def half(self, first: int) -> _Gaps:
        """The same of every second photograph."""
        return replace(self, of_frames=self.of_frames[first::2])


def correct_wall_places(tracks: Tracks, walls: WallTracks) -> tuple[WallTracks, str]:
    """Move straight walls that hardly any rod touches to where their outermost rods would touch them.

    Returns
    -------
    WallTracks
    str
        A sentence on the correction; empty: none.

    Notes
    -----
    Counted are rods of all photographs whose gap is within three standard deviations of a position of the same
    distance; even and odd photographs must show the same by themselves. Another wall must be touched as it is stated:
    wrong radii and a wrong scale move rods away from all walls, or beyond all.
    """
    gaps = {w: _measure(tracks, walls, w) for w in np.flatnonzero(walls.sides == STRAIGHT).tolist()}
    touched = {w for w, each in gaps.items() if each.fraction(0.0) > MOST}
    endpoints, words = walls.endpoints.copy(), []
    for w, each in gaps.items():
        place = each.find_place()
        if np.isnan(place) or not touched - {w}:
            continue
        there, stated = each.count(place), each.count(0.0)
        halves = [each.half(first).find_place() for first in (0, 1)]
        alike = abs(halves[0] - halves[1]) <= each.width
        if not (alike and there >= max(MORE * stated, FEWEST) and each.fraction(place) > MOST):
            continue
        endpoints[:, w] -= place * outward_normals(walls.endpoints[:, w])[:, None]
        where = f"{1e3 * abs(place):.2g} mm too far {'outside' if place > 0.0 else 'inside'}"
        words.append(
            f"wall '{walls.name[w]}' is stated {where}: {there} rods touch it in its right place, {stated} as stated"
        )
    return (replace(walls, endpoints=endpoints), "; ".join(words)) if words else (walls, "")


def _measure(tracks: Tracks, walls: WallTracks, w: int) -> _Gaps:
    frames = [np.sort(rods_beside(tracks, k, walls.endpoints[k, w])[1]) for k in range(tracks.frame_count)]
    return _Gaps(frames, touch_width(tracks), NEAR * float(tracks.radius.mean()))
