"""A measured sequence of grains and walls, and its gaps that may be contacts."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..bodies.cell import Cell, reduce_vectors
from ..bodies.disc_pairs import find_disc_pairs
from ..bodies.grains import Array, move_freely
from ..bodies.wall_shapes import STRAIGHT, Sides, all_sides, faces_walls, wall_distance
from ..even_subset import even_subset

TINY = 1e-300  # [m] avoids division by a distance of zero


@dataclass(frozen=True, slots=True)
class MeasuredSequence:
    """Tracked poses of n grains and w walls in f frames. Rows that are not present may hold any number."""

    radius: Array  # (n,) [m]
    position: Array  # (f, n, 2) [m]
    rotation: Array  # (f, n) [rad], counter-clockwise, continuous
    present: NDArray[np.bool_]  # (f, n)
    endpoints: Array  # (f, w, 2, 2) [m]; the packing lies to the left of endpoint 0 → 1
    sigma: Array  # (f, n) [m], standard deviation of the random error of a position component
    side: Sides = None  # (w,) which walls are circles, as of Walls; None: none
    cell: Array | None = None  # (f, 2, 2) [m] vectors of the periodic cell, in place of walls
    # (n,) expected size of a centre's constant error, over that of most grains; None: alike
    centre_spread: Array | None = None
    # (n,) grains of the boundary, whose motion is imposed: they need not touch each other, nor walls; None: none
    boundary: NDArray[np.bool_] | None = None

    def __post_init__(self) -> None:
        f, n = self.present.shape
        if self.position.shape != (f, n, 2) or self.rotation.shape != (f, n) or self.sigma.shape != (f, n):
            raise ValueError(f"position, rotation and sigma must be ({f}, {n}, 2), ({f}, {n}) and ({f}, {n})")
        if self.radius.shape != (n,) or not np.all(self.radius > 0):
            raise ValueError(f"radius must be ({n},) and positive")
        if self.endpoints.ndim != 4 or self.endpoints.shape[0] != f or self.endpoints.shape[2:] != (2, 2):
            raise ValueError(f"endpoints must be ({f}, w, 2, 2), not {self.endpoints.shape}")
        for name in ("position", "rotation", "sigma"):
            if not np.all(np.isfinite(getattr(self, name)[self.present])):
                raise ValueError(f"the {name} of a present grain is not finite")
        if self.centre_spread is not None and not (self.centre_spread.shape == (n,) and np.all(self.centre_spread > 0)):
            raise ValueError(f"centre_spread must be ({n},) and positive")

    def spread_frames(self, count: int) -> NDArray[np.int64]:
        """Choose at most `count` frames, evenly spaced, the first and the last included."""
        f = self.frame_count
        return even_subset(f, count)

    def thinned(self, count: int) -> MeasuredSequence:
        """Select at most `count` frames, evenly spaced."""
        k = self.spread_frames(count)
        return replace(
            self, position=self.position[k], rotation=self.rotation[k], present=self.present[k],
            endpoints=self.endpoints[k], sigma=self.sigma[k], cell=None if self.cell is None else self.cell[k],
        )  # fmt: skip

    @property
    def frame_count(self) -> int:
        return self.present.shape[0]

    @property
    def grain_count(self) -> int:
        return self.present.shape[1]

    @property
    def wall_count(self) -> int:
        return self.endpoints.shape[1]


@dataclass(frozen=True, slots=True)
class GapRows:
    """Candidate pairs, one row for every frame in which both are present, sorted by pair, then frame."""

    frame: NDArray[np.int32]  # (m,)
    i: NDArray[np.int32]  # (m,) a grain
    j: NDArray[np.int32]  # (m,) a grain > i, or grain count + wall
    pair: NDArray[np.int32]  # (m,) the number of the pair, ascending

    @property
    def count(self) -> int:
        return len(self.frame)

    def with_wall(self, grain_count: int) -> NDArray[np.bool_]:
        return self.j >= grain_count

    def second_grain(self, grain_count: int) -> NDArray[np.int32]:
        """Body j (m,), and i itself where j is a wall, so that it can index arrays of grains."""
        return np.where(self.j >= grain_count, self.i, self.j)

    def select(self, rows: NDArray) -> GapRows:
        """Keep some rows (mask, or ascending indices); pairs keep their numbers."""
        return GapRows(self.frame[rows], self.i[rows], self.j[rows], self.pair[rows])


@dataclass(frozen=True, slots=True)
class GapGeometry:
    """Gaps of some rows and their directions."""

    gap: Array  # (m,) [m], negative: overlap
    normal: Array  # (m, 2) unit vector from i towards j
    along: Array  # (m,) [m] s, from the middle of the wall to the contact, in its direction 0 → 1; 0 between grains

    def select(self, rows: NDArray) -> GapGeometry:
        return GapGeometry(self.gap[rows], self.normal[rows], self.along[rows])


def find_gap_rows(sequence: MeasuredSequence, reach: float, *, wall_reach: float | None = None) -> GapRows:
    """List every pair and frame whose measured gap is below `reach` [m], or `wall_reach` between grain and wall."""
    wall_reach = reach if wall_reach is None else wall_reach
    n = sequence.grain_count
    frames, first, second = [], [], []
    for k in range(sequence.frame_count):
        i, j = _pairs_of_frame(sequence, k, reach, wall_reach)
        i, j = i[moves := move_freely(sequence.boundary, i, j)], j[moves]
        frames.append(np.full(len(i), k))
        first.append(i)
        second.append(j)
    frame, i, j = (np.concatenate(part).astype(np.int32) for part in (frames, first, second))
    key = i.astype(np.int64) * (n + sequence.wall_count) + j
    order = np.lexsort((frame, key))
    pair = np.unique(key, return_inverse=True)[1].astype(np.int32)
    return GapRows(frame[order], i[order], j[order], pair[order])


def measure_gaps(
    rows: GapRows,
    position: Array,
    endpoints: Array,
    radius: Array,
    side: Sides = None,
    cell: Array | None = None,
) -> GapGeometry:
    """Measure the gaps of some rows.

    Parameters
    ----------
    rows : GapRows
        Pairs and frames (m).
    position : array (f, n, 2)
        Centres [m].
    endpoints : array (f, w, 2, 2)
        Ends of the walls [m].
    radius : array (n,)
        Radii [m].
    side : array (w,), optional
        Which walls are circles.
    cell : array (f, 2, 2), optional
        Vectors [m] of a periodic cell.

    Notes
    -----
    g = |x_j − x_i| − R_i − R_j, with the nearest image in a cell; at a wall g = distance of its face − R_i.
    """
    gap, normal, along = np.empty(rows.count), np.empty((rows.count, 2)), np.zeros(rows.count)
    lattice = np.empty((0, 2, 2)) if cell is None else np.stack([reduce_vectors(each)[1] for each in cell])
    _measure_pairs(
        rows.frame, rows.i, rows.j, position, radius, lattice, np.linalg.inv(lattice), gap, normal
    )  # fmt: skip
    if endpoints.shape[1]:
        shape = all_sides(side, endpoints.shape[1])
        _measure_at_walls(rows.frame, rows.i, rows.j, position, radius, endpoints, shape, gap, normal, along)
    return GapGeometry(gap, normal, along)


@njit(cache=True, nogil=True, error_model="numpy")
def _measure_pairs(frame, first, second, position, radius, lattice, inverse, gap, normal):  # type: ignore[no-untyped-def]
    """Set gaps (m,) and normals (m, 2) of pairs of grains; lattice (f, 2, 2): the cell's shortest vectors, if any."""
    for c in range(len(gap)):
        k, i, j = frame[c], first[c], second[c]
        if j >= len(radius):
            continue
        x, y = position[k, j, 0] - position[k, i, 0], position[k, j, 1] - position[k, i, 1]
        if len(lattice):
            a = np.rint(x * inverse[k, 0, 0] + y * inverse[k, 1, 0])
            b = np.rint(x * inverse[k, 0, 1] + y * inverse[k, 1, 1])
            x -= a * lattice[k, 0, 0] + b * lattice[k, 1, 0]
            y -= a * lattice[k, 0, 1] + b * lattice[k, 1, 1]
        distance = math.sqrt(x * x + y * y)
        gap[c] = distance - radius[i] - radius[j]
        far = max(distance, TINY)
        normal[c, 0], normal[c, 1] = x / far, y / far


@njit(cache=True, nogil=True, error_model="numpy")
def _measure_at_walls(frame, grain, second, position, radius, endpoints, side, gap, normal, along):  # type: ignore[no-untyped-def]
    """Set gaps (m,), normals (m, 2) and places along the wall (m,) of the rows with a wall, as `wall_distance` does."""
    for c in range(len(gap)):
        w = second[c] - len(radius)
        if w < 0:
            continue
        k, i = frame[c], grain[c]
        x, y, ends = position[k, i, 0], position[k, i, 1], endpoints[k, w]
        u, v = ends[1, 0] - ends[0, 0], ends[1, 1] - ends[0, 1]
        length = math.sqrt(u * u + v * v)
        across_x, across_y = x - (ends[0, 0] + ends[1, 0]) / 2.0, y - (ends[0, 1] + ends[1, 1]) / 2.0
        if side[w] == STRAIGHT:
            u, v = u / length, v / length
            normal[c, 0], normal[c, 1] = v, -u
            distance = (ends[0, 0] - x) * v + (ends[0, 1] - y) * -u
            along[c] = across_x * u + across_y * v
        else:  # a circle that is rotated about its middle does not change
            apart = math.sqrt(across_x * across_x + across_y * across_y)
            sign = float(side[w]) if apart > 0.0 else math.nan
            normal[c, 0], normal[c, 1] = sign * across_x / apart, sign * across_y / apart
            distance = side[w] * (0.5 * length - apart)
        gap[c] = distance - radius[i]


def _pairs_of_frame(sequence: MeasuredSequence, k: int, reach: float, wall_reach: float) -> tuple[NDArray, NDArray]:
    rows = np.flatnonzero(sequence.present[k])
    position, radius = sequence.position[k], sequence.radius
    if len(rows) == 0:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    if sequence.cell is not None:
        widest = 2.0 * radius[rows].max() + reach
        return _pairs_of_cell(Cell.at_rest(sequence.cell[k]), position[rows], radius[rows], rows, widest, reach)
    i, j = rows[find_disc_pairs(position[rows], radius[rows], reach)].T

    walls, side = sequence.endpoints[k][None], all_sides(sequence.side, sequence.wall_count)[None]
    place, margin = position[rows, None], radius[rows, None]
    gap = wall_distance(walls, side, place)[0] - margin
    grain, wall = np.nonzero((gap > -margin) & (gap < wall_reach))
    faces = faces_walls(walls[0], side[0], wall, position[rows[grain]], radius[rows[grain]])
    grain, wall = grain[faces], wall[faces]
    return np.concatenate([i, rows[grain]]), np.concatenate([j, wall + sequence.grain_count])


def _pairs_of_cell(
    cell: Cell, position: Array, radius: Array, rows: NDArray, widest: float, reach: float
) -> tuple[NDArray, NDArray]:
    """List the pairs across the edges of a cell, without walls; widest [m]: greatest distance of centres."""
    place, owner = cell.with_images(position, widest)
    pairs = find_disc_pairs(place, radius[owner], reach)
    i, j = owner[pairs[pairs[:, 0] < len(rows)]].T  # of each pair and its images one lies in the cell by its first disc
    once = np.unique(i[i < j] * len(rows) + j[i < j])
    return rows[once // len(rows)], rows[once % len(rows)]
