"""Walls whose stated places scatter from photograph to photograph against the rods that touch them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ....solver.bodies.grains import Array
from ....solver.bodies.wall_shapes import beside_wall, directions, distance_from_walls, outward_normals
from ....solver.robust_scale import SD_OVER_MAD
from ....tracks import Tracks, WallTracks
from .rods_at_walls import RodsAtWalls
from .walls_at_rest import NEAREST

FEWEST_FRAMES = 6  # whose steps show a scatter
FEWEST = 4  # rods that stay at a wall
SEEN = 0.5  # fraction of the photographs in which such a rod is near the wall
LAYER = 8.0  # widths of touching beyond the nearest rods, within which rods count as those at the wall
# Standard deviations of the gap of such a rod above which the middle of some wall scatters: at most 1.3 in 110 kinds of
# tests with other errors or none (seed 94, parameters drawn at random), 7.6 and more in four with ends that scatter by
# 100 µm. A camera that moves has 4.7.
LEAST = 2.0
# Of a gap's standard deviation against the stated wall, if it follows the rods: .65 and more in these kinds at the
# wall that scatters most, but for one with .49, and at most .23 at walls with such ends.
EXPLAINED = 0.6
ROUNDS = 5  # of the robust lines through the gaps
TOGETHER = 0.3  # of their mean square: what a camera leaves of the departures, over what it leaves of independent ones
STEADY = 1e-2  # of the weight of all rods: that of no turn, where rods at one place show none
RIGID, WEAK = 3, 0.1  # components of the motion of a camera; singular value of one that hardly moves the walls


@dataclass(frozen=True, slots=True)
class _Departure:
    """Departure of a wall from the rods that stay at it, which is zero on average."""

    outward: Array  # (f, 2) [m] of both ends
    along: Array  # (f,) [m] of the wall along itself, by the motion of the rods' surfaces
    spread: float  # [m] of a rod's gap, once the wall follows the rods
    given: float  # [m] the same against the stated wall
    width: float  # [m] of touching

    @property
    def noise(self) -> float:
        """Variance [m²] of the part of its middle that is another in every photograph."""
        return _noise(self.outward.mean(axis=1))

    @property
    def explained(self) -> bool:
        """Whether rods stay at the wall once it follows them."""
        return self.spread < min(EXPLAINED * self.given, self.width)

    @property
    def scatters(self) -> bool:
        return self.explained and self.noise > (LEAST * self.spread) ** 2


def correct_wall_scatter(tracks: Tracks, walls: WallTracks) -> tuple[WallTracks, str]:
    """Let straight walls follow the rods that stay at them, where their stated places scatter by more than the rods.

    Returns
    -------
    WallTracks
        With the mean place and direction of every wall as stated.
    str
        A sentence on the correction; empty: none.

    Notes
    -----
    The gaps of rods that stay at a wall change by a line through them, which is the same for all: the wall's departure.
    Its variance v that is another in every photograph follows from its steps, of which neighbouring ones have the
    covariance −v. What a rigid motion of all walls explains is that of a camera, which a run corrects. Along itself a
    wall keeps its sliding past the rods, steady and at random, and loses the rest: a smoothed local level beneath noise
    of the variance v is kept (Durbin and Koopman 2012, section 2.4).
    """
    if tracks.frame_count < FEWEST_FRAMES:
        return walls, ""
    rods = RodsAtWalls.of(tracks)
    found = {w: each for w in walls.straight if (each := _measure(rods, walls.endpoints[:, w])) is not None}
    noise = [each.noise for each in found.values() if each.scatters]
    if not noise or _moved_by_camera(walls, found):
        return walls, ""
    endpoints, moved = walls.endpoints.copy(), {w: each for w, each in found.items() if each.explained}
    for w, each in moved.items():
        ends = walls.endpoints[:, w]
        scatter = _scatter(each.along, float(np.mean(noise)))[:, None] * directions(ends)
        endpoints[:, w] = ends - each.outward[..., None] * outward_normals(ends)[:, None] - scatter[:, None]
    listed = ", ".join(f"'{walls.name[w]}' by {1e6 * each.given:.0f} µm" for w, each in moved.items())
    most = 1e6 * max(each.spread for each in moved.values())
    return replace(walls, endpoints=endpoints), (
        f"rods that stay at a wall scatter against its stated places, at {listed}, and by at most {most:.0f} µm if it "
        "moves with them"
    )


def _measure(rods: RodsAtWalls, ends: Array) -> _Departure | None:
    """Departure of a wall with ends (f, 2, 2) from its rods; None: too few stay at it."""
    tracks, each = rods.tracks, ends[:, None]
    gap = distance_from_walls(each, None, tracks.position) - tracks.radius
    gap[~(beside_wall(each, None, tracks.position, np.zeros(1)) & (np.abs(gap) < rods.reach))] = np.nan
    half = 0.5 * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)[:, None]
    place = np.einsum("fnk,fk->fn", tracks.position - ends.mean(axis=1)[:, None], directions(ends)) / half
    often = np.flatnonzero(np.isfinite(gap).mean(axis=0) >= SEEN)
    if len(often) < FEWEST:
        return None
    usual = np.nanmedian(gap[:, often], axis=0)
    stay = often[usual < np.sort(usual)[NEAREST - 1] + LAYER * rods.width]
    if len(stay) < FEWEST:
        return None
    gap, place = gap[:, stay], np.where(np.isfinite(gap), place, 0.0)[:, stay]
    line = _fit_lines(gap, place, rods.width)
    rest = gap - line[:, :1] - line[:, 1:] * place
    outward = np.stack([line[:, 0] - line[:, 1], line[:, 0] + line[:, 1]], axis=1)
    return _Departure(outward, _departure_along(rods, stay, ends), _spread(rest), _spread(gap), rods.width)


def _fit_lines(gap: Array, place: Array, width: float) -> Array:
    """Lines (f, 2), of mean zero, of which gaps (f, m) [m] depart by the same in all photographs; NaN: not near."""
    line = np.zeros((len(gap), 2))
    known = np.isfinite(gap)
    for _ in range(ROUNDS):
        rest = gap - line[:, :1] - line[:, 1:] * place
        own = np.nanmedian(rest, axis=0)
        weight = np.where(known, (1.0 + ((rest - own) / (3.0 * width)) ** 2) ** -2.0, 0.0)
        change = np.where(known, gap - own, 0.0)
        total = weight.sum(axis=1)
        first, second = (weight * place).sum(axis=1), (weight * place**2).sum(axis=1) + STEADY * total
        normal = np.stack([np.stack([total, first], axis=1), np.stack([first, second], axis=1)], axis=1)
        right = np.stack([(weight * change).sum(axis=1), (weight * change * place).sum(axis=1)], axis=1)
        line = np.linalg.solve(normal + np.finfo(np.float64).tiny * np.eye(2), right[..., None])[..., 0]
        line -= line.mean(axis=0)
    return line


def _departure_along(rods: RodsAtWalls, rows: NDArray[np.intp], ends: Array) -> Array:
    """Departure (f,) [m] of a wall with ends (f, 2, 2) along itself from the surfaces of rods that stay at it."""
    along, step = directions(ends), np.diff(ends.mean(axis=1), axis=0)
    slid = np.zeros(len(ends))
    for k in range(1, len(ends)):
        surface = rods.surface_motion(k, rows, along[k])
        if np.isfinite(surface).any():
            slid[k] = step[k - 1] @ along[k] - np.nanmedian(surface)
    return np.cumsum(slid)


def _moved_by_camera(walls: WallTracks, found: dict[int, _Departure]) -> bool:
    """Whether one rigid motion in every photograph explains the departures of more ends than it has components."""
    ends = walls.endpoints[0, list(found)].reshape(-1, 2)
    if len(ends) <= RIGID:
        return True
    normal = np.repeat(outward_normals(walls.endpoints[0, list(found)]), 2, axis=0)
    arm = (ends - ends.mean(axis=0)) / np.ptp(ends, axis=0).max()
    motion = np.column_stack([normal, normal[:, 1] * arm[:, 0] - normal[:, 0] * arm[:, 1]])
    outward = np.concatenate([each.outward for each in found.values()], axis=1).T
    rest = outward - motion @ np.linalg.lstsq(motion, outward, rcond=WEAK)[0]
    free = 1.0 - np.linalg.matrix_rank(motion, tol=WEAK) / len(ends)
    return float(np.mean(rest**2)) < TOGETHER * free * float(np.mean(outward**2))


def _noise(series: Array) -> float:
    """Variance of what is another in every value (f,), by the covariance of neighbouring steps; at least 0."""
    step = np.diff(series)
    return max(-float(np.mean(step[1:] * step[:-1])), 0.0)


def _scatter(series: Array, noise: float) -> Array:
    """What is another in every value (f,) of a series, with that variance, beside a steady and a random walk."""
    time = np.arange(len(series), dtype=np.float64)
    rest = series - np.polynomial.Polynomial.fit(time, series, 1)(time)
    walk = float(np.mean(np.diff(rest) ** 2)) - 2.0 * noise
    if not walk > 0.0:
        return rest
    change = np.diff(np.eye(len(rest)), axis=0)
    return rest - np.linalg.solve(np.eye(len(rest)) + noise / walk * change.T @ change, rest)


def _spread(gap: Array) -> float:
    """Robust standard deviation [m] of the gaps (f, m) of a rod in time."""
    return SD_OVER_MAD * float(np.nanmedian(np.abs(gap - np.nanmedian(gap, axis=0))))
