"""The gap equations of a sequence: measured gaps as functions of the constant errors of grains and walls.

Notes
-----
Let a grain's true centre be (1 + ε) x + Rot(θ) o, its true radius R + δR, a wall lie b further out and be rotated by a
about its middle. Where the gap of grains i and j is measured as g, the true gap is, to first order,

    g − n·Rot(θ_i) o_i + n·Rot(θ_j) o_j − δR_i − δR_j + ε n·(x_j − x_i),

and of grain i and a wall g − n·Rot(θ_i) o_i − δR_i + b − a s − ε n·x_i, at the distance s from the wall's middle, with
+ ε n·e more where the wall e was measured with the same pixel size. A circular wall that lies b further out has a
radius that is b greater, or smaller where the packing is outside it; it is not rotated. The angle θ counts from the
first frame in which the grain is seen.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..bodies.grains import Array
from ..bodies.wall_shapes import STRAIGHT, Sides, all_sides, circle_ends, circle_parameters, outward_normals
from .derivatives import OF_GRAIN, Derivatives
from .gaps import GapGeometry, GapRows, MeasuredSequence, measure_gaps

SHARED = 5  # greatest number of shared unknowns of a gap: a wall and its tilt, or classes, scale and lens


@dataclass(frozen=True, slots=True)
class UnknownLayout:
    """Slices of the vector of unknowns by kind."""

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
        """Outward displacement of each wall's middle [m]."""
        return slice(self.radius.stop, self.radius.stop + self.wall_count)

    @property
    def wall_tilt(self) -> slice:
        """Rotation of each wall about its middle [rad], counter-clockwise."""
        return slice(self.wall.stop, self.wall.stop + self.wall_count)

    @property
    def radius_class(self) -> slice:
        """Radius error shared by each class [m]."""
        return slice(self.wall_tilt.stop, self.wall_tilt.stop + self.class_count)

    @property
    def scale(self) -> slice:
        """Relative error of the pixel size."""
        return slice(self.radius_class.stop, self.radius_class.stop + 1)

    @property
    def lens(self) -> slice:
        """Shift by the remaining radial distortion of the lens, at the corner farthest from the centre [m]."""
        return slice(self.scale.stop, self.scale.stop + 1)

    @property
    def count(self) -> int:
        return self.lens.stop


def rotate_offsets(sequence: MeasuredSequence, offset: Array) -> Array:
    """Rotate body-fixed offsets (n, 2) [m] with their grains: (f, n, 2) [m], zero where a grain is not present."""
    angle = _angle_since_first_seen(sequence)
    return _rotate(offset, np.cos(angle), np.sin(angle), sequence.present)


def _rotate(offset: Array, c: Array, s: Array, present: NDArray[np.bool_]) -> Array:
    rotated = np.stack([c * offset[:, 0] - s * offset[:, 1], s * offset[:, 0] + c * offset[:, 1]], axis=2)
    return np.where(present[..., None], rotated, 0.0)


def move_walls(endpoints: Array, outward: Array, tilt: Array, side: Sides = None) -> Array:
    """Move walls outward and rotate them.

    Parameters
    ----------
    endpoints : array (f, w, 2, 2)
        Ends [m].
    outward : array (w,)
        Displacement [m]; a circular wall changes its radius by it instead.
    tilt : array (w,)
        Small rotation [rad] about the middle; none for circles.
    side : array (w,), optional
        Which walls are circles.
    """
    along = endpoints[..., 1, :] - endpoints[..., 0, :]
    half = 0.5 * np.linalg.norm(along, axis=-1) * tilt  # (f, w) [m] outward at end 0, inward at end 1
    moved = np.stack([outward + half, outward - half], axis=-1)
    straight = endpoints + moved[..., None] * outward_normals(endpoints)[:, :, None, :]
    if side is None or not np.any(side):
        return straight
    centre, radius, angle = circle_parameters(endpoints)
    return np.where((side != STRAIGHT)[:, None, None], circle_ends(centre, radius + side * outward, angle), straight)


def radial_distortion(sequence: MeasuredSequence) -> Array:
    """Compute the displacement (f, n, 2) of the centres by radial distortion of unit amplitude.

    Notes
    -----
    q(x) = |r|² r with r = (x − m)/a: third order, from the middle m of the packing instead of that of the picture, and
    of length 1 at the farthest corner of its bounding box, at the distance a. Walls may be stated far longer.
    """
    seen = sequence.position[sequence.present]
    if sequence.wall_count == 0 or len(seen) == 0:
        return np.zeros_like(sequence.position)
    least, greatest = seen.min(axis=0), seen.max(axis=0)
    reach = 0.5 * float(np.linalg.norm(greatest - least))
    place = (sequence.position - 0.5 * (least + greatest)) / (reach if reach > 0.0 else 1.0)
    return np.where(sequence.present[..., None], np.sum(place**2, axis=2, keepdims=True) * place, 0.0)


class GapEquations:
    """Corrected gaps of a sequence and their derivatives, for any value of the unknowns."""

    def __init__(
        self,
        sequence: MeasuredSequence,
        radius_class: NDArray[np.integer] | None = None,
        *,
        walls_follow: bool = True,
    ) -> None:
        """radius_class (n,): class 0, 1, … of each grain; walls_follow: the pixel size also scales the walls."""
        self.sequence = sequence
        self.radius_class = radius_class
        self.walls_follow = walls_follow
        classes = 0 if radius_class is None else int(radius_class.max()) + 1
        self.layout = UnknownLayout(sequence.grain_count, sequence.wall_count, classes)
        angle = _angle_since_first_seen(sequence)
        self._cosine, self._sine = np.cos(angle), np.sin(angle)
        self._distortion = radial_distortion(sequence)

    def thinned(self, count: int) -> GapEquations:
        """Select at most `count` frames, evenly spaced; the unknowns keep their meaning. With no more: itself."""
        if self.sequence.frame_count <= count:
            return self
        found, k = copy(self), self.sequence.spread_frames(count)
        found.sequence = self.sequence.thinned(count)
        found._cosine, found._sine, found._distortion = self._cosine[k], self._sine[k], self._distortion[k]
        return found

    def radius(self, unknowns: Array) -> Array:
        """Compute the corrected radii (n,) [m]."""
        correction = unknowns[self.layout.radius]
        if self.radius_class is not None:
            correction = correction + unknowns[self.layout.radius_class][self.radius_class]
        return self.sequence.radius + correction

    def position(self, unknowns: Array) -> Array:
        """Compute the corrected centres (f, n, 2) [m]."""
        offset = unknowns[self.layout.offset].reshape(-1, 2)
        scaled = (1.0 + unknowns[self.layout.scale]) * self.sequence.position
        rotated = _rotate(offset, self._cosine, self._sine, self.sequence.present)
        return scaled + unknowns[self.layout.lens] * self._distortion + rotated

    def endpoints(self, unknowns: Array) -> Array:
        """Compute the corrected ends of the walls (f, w, 2, 2) [m]."""
        scale = 1.0 + unknowns[self.layout.scale] * self.walls_follow
        out, tilt = unknowns[self.layout.wall], unknowns[self.layout.wall_tilt]
        return move_walls(scale * self.sequence.endpoints, out, tilt, self.sequence.side)

    def measure(self, rows: GapRows, unknowns: Array) -> GapGeometry:
        """Compute the corrected gaps exactly, not to first order."""
        radius, side, cell = self.radius(unknowns), self.sequence.side, self.sequence.cell
        return measure_gaps(rows, self.position(unknowns), self.endpoints(unknowns), radius, side, cell)

    def derive(self, rows: GapRows, geometry: GapGeometry, free: NDArray[np.bool_] | None = None) -> Derivatives:
        """Compute the derivatives (m, u) of the corrected gaps of some rows.

        Parameters
        ----------
        rows : GapRows
        geometry : GapGeometry
            Their corrected gaps and normals.
        free : bool array (u,), optional
            Unknowns whose derivatives are needed; others may be zero. None: all.

        Notes
        -----
        ∂g/∂o_i = −Rot(θ_i)ᵀ n, ∂g/∂o_j = Rot(θ_j)ᵀ n, ∂g/∂δR = −1 for both radii and their classes, ∂g/∂b = 1,
        ∂g/∂a = −s at a wall, ∂g/∂ε = n·(x_j − x_i), ∂g/∂d = n·(q(x_j) − q(x_i)) for the lens.
        """
        n, layout, count = self.sequence.grain_count, self.layout, rows.count
        i, grain, wall = rows.i.astype(np.int64), rows.second_grain(n).astype(np.int64), rows.with_wall(n)
        own, other = np.empty((count, OF_GRAIN)), np.empty((count, OF_GRAIN))
        _derive_grains(rows.frame, i, grain, geometry.normal, self._cosine, self._sine, own, other)
        column, value = np.zeros((count, SHARED), np.int64), np.zeros((count, SHARED))
        start = layout.wall.start
        if self.radius_class is not None:
            of_class = layout.radius_class.start - start + self.radius_class
            column[:, 0], column[:, 2] = of_class[i], of_class[grain]
            value[:, 0], value[:, 2] = -1.0, -1.0
        met = rows.j[wall] - n
        column[wall, 1], value[wall, 1] = layout.wall_tilt.start - start + met, -geometry.along[wall]
        column[wall, 2], value[wall, 2] = met, 1.0
        of_all = (layout.scale.start, self._scale_derivatives), (layout.lens.start, self._lens_derivatives)
        for k, (place, measure) in enumerate(of_all, start=3):
            column[:, k] = place - start
            if free is None or free[place]:
                value[:, k] = measure(rows, geometry)
        return Derivatives(i, grain, own, other, column, value, n, layout.count - start)

    def _scale_derivatives(self, rows: GapRows, geometry: GapGeometry) -> Array:
        """Compute the derivatives (m,) [m] with respect to the pixel size."""
        n, k, position = self.sequence.grain_count, rows.frame, self.sequence.position
        wall = rows.with_wall(n)
        end = position[k, rows.second_grain(n)]
        end[wall] = self.sequence.endpoints[k[wall], rows.j[wall] - n, 0] if self.walls_follow else 0.0
        if self.walls_follow and self.sequence.side is not None:
            curved = np.zeros(rows.count, np.bool_)
            curved[wall] = all_sides(self.sequence.side, self.layout.wall_count)[rows.j[wall] - n] != STRAIGHT
            depth = geometry.gap + self.sequence.radius[rows.i]  # of any point of the wall's face, along the normal
            end[curved] = (position[k, rows.i] + depth[:, None] * geometry.normal)[curved]
        return np.einsum("mk,mk->m", geometry.normal, end - position[k, rows.i])

    def _lens_derivatives(self, rows: GapRows, geometry: GapGeometry) -> Array:
        """Compute the derivatives (m,) with respect to the lens; walls do not move with it."""
        n, k = self.sequence.grain_count, rows.frame
        wall = rows.with_wall(n)
        end = np.where(wall[:, None], 0.0, self._distortion[k, rows.second_grain(n)])
        return np.einsum("mk,mk->m", geometry.normal, end - self._distortion[k, rows.i])


def _angle_since_first_seen(sequence: MeasuredSequence) -> Array:
    first = np.argmax(sequence.present, axis=0)
    start = sequence.rotation[first, np.arange(sequence.grain_count)]
    return np.where(sequence.present, sequence.rotation - start, 0.0)


@njit(cache=True, nogil=True, error_model="numpy")
def _derive_grains(frame, first, second, normal, cosine, sine, own, other):  # type: ignore[no-untyped-def]
    """Set the derivatives (m, 3) by the errors of both grains; a wall's row, where second is first, has one grain."""
    for c in range(len(frame)):
        k, i, j, x, y = frame[c], first[c], second[c], normal[c, 0], normal[c, 1]
        own[c, 0] = -(cosine[k, i] * x + sine[k, i] * y)
        own[c, 1] = -(cosine[k, i] * y - sine[k, i] * x)
        own[c, 2] = -1.0
        if j != i:
            other[c, 0] = cosine[k, j] * x + sine[k, j] * y
            other[c, 1] = cosine[k, j] * y - sine[k, j] * x
            other[c, 2] = -1.0
        else:
            other[c, :] = 0.0
