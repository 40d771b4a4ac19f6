"""The gap equations of a sequence: how constant errors of grains, walls and scale show in every measured gap.

Let a grain's true centre be x + Rot(θ) o, its true radius R + δR, a wall lie b further out and
lengths be (1 + ε) times the measured ones. The gap of grains i and j is then, to first order,

    g − n·Rot(θ_i) o_i + n·Rot(θ_j) o_j − δR_i − δR_j + ε |x_j − x_i|,

and of grain i and a wall g − n·Rot(θ_i) o_i − δR_i + b + ε n·(e − x_i). The angle θ counts from
the first frame in which the grain is seen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial import KDTree

from solver.grains import Array


@dataclass(frozen=True, slots=True)
class MeasuredSequence:
    """What tracking says of n grains and w walls in f frames. Rows that are not present may hold any number."""

    radius: Array  # (n,) [m]
    position: Array  # (f, n, 2) [m]
    rotation: Array  # (f, n) [rad], counter-clockwise, continuous
    present: NDArray[np.bool_]  # (f, n)
    endpoints: Array  # (f, w, 2, 2) [m]; the packing lies to the left of endpoint 0 → 1
    sigma: Array  # (f, n) [m], standard deviation of the random error of a position component

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
class Layout:
    """Where each kind of unknown stands in the one vector that is solved for."""

    grain_count: int
    wall_count: int
    class_count: int

    @property
    def offset(self) -> slice:
        """Body-fixed centre offsets, x and y of each grain [m]."""
        return slice(0, 2 * self.grain_count)

    @property
    def radius(self) -> slice:
        """Radius error of each grain, beside that of its class [m]."""
        return slice(self.offset.stop, self.offset.stop + self.grain_count)

    @property
    def wall(self) -> slice:
        """Outward displacement of each wall [m]."""
        return slice(self.radius.stop, self.radius.stop + self.wall_count)

    @property
    def radius_class(self) -> slice:
        """Radius error shared by each class [m]."""
        return slice(self.wall.stop, self.wall.stop + self.class_count)

    @property
    def scale(self) -> slice:
        """Relative error of the pixel size."""
        return slice(self.radius_class.stop, self.radius_class.stop + 1)

    @property
    def count(self) -> int:
        return self.scale.stop


@dataclass(frozen=True, slots=True)
class GapRows:
    """The pairs that may touch, once for every frame in which both are seen, sorted by pair, then frame."""

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
    """Gaps of some rows and the directions they are measured in."""

    gap: Array  # (m,) [m], negative: overlap
    normal: Array  # (m, 2) unit vector from i towards j
    distance: Array  # (m,) [m], from the centre of i to that of j, or to the wall, along the normal

    def select(self, rows: NDArray) -> GapGeometry:
        return GapGeometry(self.gap[rows], self.normal[rows], self.distance[rows])


def find_gap_rows(sequence: MeasuredSequence, reach: float, *, wall_reach: float | None = None) -> GapRows:
    """List every pair and frame whose measured gap is below `reach` [m], or `wall_reach` between grain and wall."""
    wall_reach = reach if wall_reach is None else wall_reach
    n = sequence.grain_count
    frames, first, second = [], [], []
    for k in range(sequence.frame_count):
        i, j = _pairs_of_frame(sequence, k, reach, wall_reach)
        frames.append(np.full(len(i), k))
        first.append(i)
        second.append(j)
    frame, i, j = (np.concatenate(part).astype(np.int32) for part in (frames, first, second))
    key = i.astype(np.int64) * (n + sequence.wall_count) + j
    order = np.lexsort((frame, key))
    pair = np.unique(key, return_inverse=True)[1].astype(np.int32)
    return GapRows(frame[order], i[order], j[order], pair[order])


def rotate_offsets(sequence: MeasuredSequence, offset: Array) -> Array:
    """Turn body-fixed offsets (n, 2) [m] with their grains: (f, n, 2) [m], zero where a grain is not present."""
    angle = _angle_since_first_seen(sequence)
    c, s = np.cos(angle), np.sin(angle)
    turned = np.stack([c * offset[:, 0] - s * offset[:, 1], s * offset[:, 0] + c * offset[:, 1]], axis=2)
    return np.where(sequence.present[..., None], turned, 0.0)


def outward_normals(endpoints: Array) -> Array:
    """Unit normals (…, 2) that point out of the packing, of walls with endpoints (…, 2, 2) [m]."""
    along = endpoints[..., 1, :] - endpoints[..., 0, :]
    along = along / np.linalg.norm(along, axis=-1, keepdims=True)
    return np.stack([along[..., 1], -along[..., 0]], axis=-1)


class GapEquations:
    """Gaps and derivatives of the rows of a sequence, for any value of the unknowns."""

    def __init__(self, sequence: MeasuredSequence, radius_class: NDArray[np.integer] | None = None) -> None:
        self.sequence = sequence
        self.radius_class = radius_class
        classes = 0 if radius_class is None else int(radius_class.max()) + 1
        self.layout = Layout(sequence.grain_count, sequence.wall_count, classes)
        angle = _angle_since_first_seen(sequence)
        self._cosine, self._sine = np.cos(angle), np.sin(angle)

    def radius(self, unknowns: Array) -> Array:
        """Corrected radii (n,) [m]."""
        correction = unknowns[self.layout.radius]
        if self.radius_class is not None:
            correction = correction + unknowns[self.layout.radius_class][self.radius_class]
        return self.sequence.radius + correction

    def position(self, unknowns: Array) -> Array:
        """Corrected centres (f, n, 2) [m]."""
        offset = unknowns[self.layout.offset].reshape(-1, 2)
        scale = 1.0 + unknowns[self.layout.scale][0]
        return scale * (self.sequence.position + rotate_offsets(self.sequence, offset))

    def endpoints(self, unknowns: Array) -> Array:
        """Corrected ends of the walls (f, w, 2, 2) [m]."""
        scale = 1.0 + unknowns[self.layout.scale][0]
        outward = outward_normals(self.sequence.endpoints)
        return scale * self.sequence.endpoints + (unknowns[self.layout.wall][:, None] * outward)[:, :, None, :]

    def measure(self, rows: GapRows, unknowns: Array) -> GapGeometry:
        """Compute the corrected gaps, exactly, not to first order."""
        n = self.sequence.grain_count
        position, endpoints, radius = self.position(unknowns), self.endpoints(unknowns), self.radius(unknowns)
        k, i, grain, wall = rows.frame, rows.i, rows.second_grain(n), rows.with_wall(n)
        branch = position[k, grain] - position[k, i]
        normal = branch / np.maximum(np.linalg.norm(branch, axis=1, keepdims=True), np.finfo(float).tiny)
        w = rows.j[wall] - n
        branch[wall] = endpoints[k[wall], w, 0] - position[k[wall], i[wall]]
        normal[wall] = outward_normals(endpoints)[k[wall], w]
        distance = np.einsum("mk,mk->m", branch, normal)
        return GapGeometry(distance - radius[i] - np.where(wall, 0.0, radius[grain]), normal, distance)

    def derive(self, rows: GapRows, geometry: GapGeometry, unknowns: Array) -> sparse.csr_matrix:
        """Derivatives (m, unknowns) of the corrected gaps of `rows`, whose geometry is `geometry`."""
        n, layout = self.sequence.grain_count, self.layout
        scale = 1.0 + unknowns[layout.scale][0]
        i, j, grain = rows.i.astype(np.int64), rows.j.astype(np.int64), rows.second_grain(n).astype(np.int64)
        wall = rows.with_wall(n)
        of_grain = np.where(wall, 0.0, 1.0)
        shift = np.zeros(rows.count)  # of a wall, which the scale leaves as it is
        shift[wall] = unknowns[layout.wall][j[wall] - n]
        ix, iy = self._in_body_frame(rows.frame, i, geometry.normal)
        jx, jy = self._in_body_frame(rows.frame, grain, geometry.normal)
        one = np.ones(rows.count)
        entries = [
            (2 * i, -scale * ix),
            (2 * i + 1, -scale * iy),
            (2 * grain, scale * of_grain * jx),
            (2 * grain + 1, scale * of_grain * jy),
            (layout.radius.start + i, -one),
            (np.where(wall, layout.wall.start + j - n, layout.radius.start + grain), np.where(wall, one, -one)),
            (np.full(rows.count, layout.scale.start), (geometry.distance - shift) / scale),
        ]
        if self.radius_class is not None:
            start = layout.radius_class.start
            entries += [(start + self.radius_class[i], -one), (start + self.radius_class[grain], -of_grain)]
        columns = np.stack([column for column, _ in entries], axis=1)
        values = np.stack([value for _, value in entries], axis=1)
        ends = np.arange(rows.count + 1) * len(entries)
        return sparse.csr_matrix((values.ravel(), columns.ravel(), ends), shape=(rows.count, layout.count))

    def _in_body_frame(self, frame: NDArray, grain: NDArray, normal: Array) -> tuple[Array, Array]:
        c, s = self._cosine[frame, grain], self._sine[frame, grain]
        return c * normal[:, 0] + s * normal[:, 1], c * normal[:, 1] - s * normal[:, 0]


def _angle_since_first_seen(sequence: MeasuredSequence) -> Array:
    first = np.argmax(sequence.present, axis=0)
    start = sequence.rotation[first, np.arange(sequence.grain_count)]
    return np.where(sequence.present, sequence.rotation - start, 0.0)


def _pairs_of_frame(sequence: MeasuredSequence, k: int, reach: float, wall_reach: float) -> tuple[NDArray, NDArray]:
    rows = np.flatnonzero(sequence.present[k])
    position, radius = sequence.position[k], sequence.radius
    if len(rows) == 0:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    tree = KDTree(position[rows])
    pairs = rows[tree.query_pairs(2.0 * radius[rows].max() + reach, output_type="ndarray")]
    i, j = pairs.min(axis=1), pairs.max(axis=1)
    near = np.linalg.norm(position[j] - position[i], axis=1) - radius[i] - radius[j] < reach

    start = sequence.endpoints[k, :, 0]
    outward = outward_normals(sequence.endpoints[k])
    along = np.stack([-outward[:, 1], outward[:, 0]], axis=1)
    length = np.linalg.norm(sequence.endpoints[k, :, 1] - start, axis=1)
    offset = position[rows, None, :] - start[None]
    gap = -np.einsum("nwk,wk->nw", offset, outward) - radius[rows, None]
    s = np.einsum("nwk,wk->nw", offset, along)
    # A grain meets a wall only beside the segment, give or take its radius.
    beside = (s > -radius[rows, None]) & (s < length + radius[rows, None]) & (gap > -radius[rows, None])
    grain, wall = np.nonzero(beside & (gap < wall_reach))
    return np.concatenate([i[near], rows[grain]]), np.concatenate([j[near], wall + sequence.grain_count])
