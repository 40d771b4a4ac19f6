"""Walls that are stated a distance away from where the rods touch them, inside the packing or outside of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import theilslopes

from ....solver.bodies.grains import Array
from ....solver.bodies.wall_shapes import directions, outward_normals
from ....solver.calibration.equations import move_walls
from ....tracks import Tracks, WallTracks
from .rods_at_walls import RodsAtWalls
from .wall_times import FEWEST, MORE, MORE_TOGETHER, MOST
from .walls_at_rest import NEAREST

BEFORE, BEHIND = 4.0, 8.0  # widths of touching before and behind the NEAREST rod, between which a wall is sought
STEEPEST = 0.03  # slope of a wall against its stated direction
USUAL = 0.7  # of the least fraction of near rods that touch another wall: as many touch a wall in its place
FEWEST_WALLS, SAME_ANGLE = 3, 0.3  # walls that are turned by the same angle against the rods, within a part of it
LOOSE = 3.0  # widths of touching with which its place is sought, before a robust line through the gaps (Theil and Sen)
STATED = (0.0, 0.0)  # place of a wall as it is stated


@dataclass(frozen=True, slots=True)
class _Gaps:
    """Gaps of the rods beside a wall as it is stated."""

    of_frames: list[Array]  # (2, m) [m] of each photograph: gaps, and places along the wall from its middle
    width: float  # [m] of touching
    near: float  # [m] of rods near it
    length: float  # [m] of the wall

    def against(self, slope: float) -> Array:
        """Gaps (p,) [m] of all photographs from a wall of some slope, ascending."""
        return np.sort(np.concatenate([gap - slope * along for gap, along in self.of_frames]))

    def count(self, place: tuple[float, float], *, within: float | None = None) -> int:
        """Rods that touch a wall, or are within a distance of it, that lies a distance [m] inside, with a slope."""
        distance, slope = place
        reach = self.width if within is None else within
        return int(np.diff(np.searchsorted(self.against(slope), (distance - reach, distance + reach)))[0])

    def fraction(self, place: tuple[float, float]) -> float:
        """Fraction of the rods near a wall at some place that touch it."""
        return self.count(place) / max(self.count(place, within=self.near), 1)

    def find_better(self, more: float) -> tuple[float, float] | None:
        """Place at which so many times more rods touch the wall than as stated; None: there is none."""
        place = self.find_place()
        better = place is not None and self.count(place) >= max(more * self.count(STATED), FEWEST)
        return place if better else None

    def find_place(self) -> tuple[float, float] | None:
        """Place beside the outermost rods at which most of them touch the wall; None where few are beside it."""
        if not any(each.shape[1] >= NEAREST for each in self.of_frames):
            return None
        loose = LOOSE * self.width
        steps = int(STEEPEST * self.length / loose) + 1
        found = [self._best(loose / self.length * step) for step in sorted(range(-steps, steps + 1), key=abs)]
        _, distance, slope = max(found, key=lambda each: each[0])
        gap, along = np.concatenate(self.of_frames, axis=1)
        near = np.abs(gap - slope * along - distance) < loose
        if near.sum() < FEWEST:
            return None
        slope, distance = np.asarray(theilslopes(gap[near], along[near])[:2], dtype=np.float64).tolist()
        return distance, slope

    def _best(self, slope: float) -> tuple[int, float, float]:
        """Most rods that loosely touch a wall of some slope beside the outermost ones; its distance, and the slope."""
        loose = LOOSE * self.width
        outermost = [
            np.partition(gap - slope * along, NEAREST - 1)[NEAREST - 1]
            for gap, along in self.of_frames
            if len(gap) >= NEAREST
        ]
        distance = float(np.median(outermost)) + loose * np.arange(-BEFORE, BEHIND, 0.25)
        ends = np.searchsorted(self.against(slope), np.stack([distance - loose, distance + loose]))
        count = ends[1] - ends[0]
        best = int(np.argmax(count))
        return int(count[best]), float(distance[best]), slope


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
    distance, or of the same line. Another wall must be touched as it is stated: wrong radii and a wrong scale move rods
    away from all walls, or beyond all. Where no wall is touched, but three or more are turned by the same angle against
    the rods, all are moved as one, as of a camera that was turned.
    """
    rods = RodsAtWalls.of(tracks)
    gaps = {w: _measure(rods, walls, w) for w in walls.straight}
    stated = {w: each.fraction(STATED) for w, each in gaps.items()}
    touched = [each for each in stated.values() if each > MOST]
    if not touched:
        return _move_together(walls, gaps, LOOSE * rods.width)
    usual = min(MOST, USUAL * min(touched))
    endpoints, words = walls.endpoints.copy(), []
    for w, each in gaps.items():
        place = None if stated[w] > MOST else each.find_better(MORE)
        if place is None or not each.fraction(place) > usual:
            continue
        distance, slope = place
        endpoints[:, w : w + 1] = move_walls(endpoints[:, w : w + 1], np.array([-distance]), np.array([slope]))
        wrong = _describe(walls.name[w], distance, slope * each.length)
        there, given = each.count(place), each.count(STATED)
        words.append(f"{wrong}: {there} rods touch it in its right place, {given} as stated")
    return (replace(walls, endpoints=endpoints), "; ".join(words)) if words else (walls, "")


def _move_together(walls: WallTracks, gaps: Mapping[int, _Gaps], most: float) -> tuple[WallTracks, str]:
    """Move all walls by the turn and shift that straight ones share against the rods, up to a distance `most` [m]."""
    place = {w: found for w, each in gaps.items() if (found := each.find_better(MORE_TOGETHER)) is not None}
    inside, slope = np.array(list(place.values())).reshape(-1, 2).T
    if len(place) < FEWEST_WALLS or not np.ptp(slope) < SAME_ANGLE * abs(angle := float(np.median(slope))):
        return walls, ""
    along, across = np.cos(angle), np.sin(angle)
    turn = np.array([[along, across], [-across, along]])  # of points as rows
    ends = walls.endpoints[:, list(place)].mean(axis=0)
    normal, middle = outward_normals(ends), ends.mean(axis=1)
    centre = middle.mean(axis=0)
    turned_normal = normal @ turn
    # From the right place of each middle to the turned one, along the turned normal: what a shift must undo.
    away = np.einsum("ij,ij->i", (middle - centre) @ turn - (middle - centre) + inside[:, None] * normal, turned_normal)
    shift = np.linalg.lstsq(turned_normal, -away)[0]
    if np.abs(turned_normal @ shift + away).max() > most:
        return walls, ""
    moved = centre + shift + (walls.endpoints - centre) @ turn
    there, stated = sum(gaps[w].count(each) for w, each in place.items()), sum(gaps[w].count(STATED) for w in place)
    return replace(walls, endpoints=moved), (
        f"the walls are turned by {np.degrees(angle):.2g}° against the rods and shifted by "
        f"{1e3 * float(np.linalg.norm(shift)):.2g} mm: {there} rods touch them in their right place, {stated} as stated"
    )


def _describe(name: str, distance: float, rise: float) -> str:
    """Describe a wall whose right place is a distance [m] inside the stated one, and rises [m] from end to end."""
    inside, turned = 1e3 * distance, 1e3 * abs(rise)
    wrong = (
        [f"{abs(inside):.2g} mm too far {'outside' if inside > 0.0 else 'inside'}"] if turned < 4 * abs(inside) else []
    )
    wrong += [f"turned by {turned:.2g} mm from end to end"] if turned > abs(inside) else []
    return f"wall '{name}' is stated {' and '.join(wrong)}"


def _measure(rods: RodsAtWalls, walls: WallTracks, w: int) -> _Gaps:
    frames = []
    for k, ends in enumerate(walls.endpoints[:, w]):
        rows, gap = rods.beside(k, ends)
        frames.append(np.stack([gap, (rods.tracks.position[k, rows] - ends.mean(axis=0)) @ directions(ends)]))
    length = float(np.linalg.norm(walls.endpoints[0, w, 1] - walls.endpoints[0, w, 0]))
    return _Gaps(frames, rods.width, rods.reach, length)
