"""Contacts: pairs of bodies with their point, normal and gap, and a key that is the same in every frame."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated

import numpy as np
from jaxtyping import Float, Int32
from numba import njit
from numpy.typing import NDArray

from ..bodies.cell import Cell
from ..bodies.disc_pairs import find_disc_pairs
from ..bodies.grains import Array, Grains, move_freely
from ..bodies.wall_shapes import faces_walls
from ..bodies.walls import Walls
from ..quantity import Quantity
from .pairs import Keys, make_keys, split_keys
from .wall_kernels import find_near_walls, measure_at_wall


@dataclass(frozen=True, slots=True)
class Contacts:
    """Contacts of one frame, ordered by key.

    Body `i` is always a grain; `j` is a grain (j > i) or wall `j − n`. The normal points from i to j.
    """

    i: Annotated[Int32[np.ndarray, " c"], Quantity("row of a grain", dims="contact", essential=True)]
    j: Annotated[
        Int32[np.ndarray, " c"],
        Quantity("row of a grain, j > i, or grain count + row of a wall", dims="contact", essential=True),
    ]
    gap: Annotated[
        Float[Array, " c"], Quantity("distance of the two surfaces, negative: overlap", "m", "contact", essential=True)
    ]
    normal: Annotated[Float[Array, "c 2"], Quantity("unit vector from i towards j", dims="contact xy", essential=True)]
    point: Annotated[
        Float[Array, "c 2"], Quantity("midway between the two surfaces", "m", "contact xy", essential=True)
    ]
    grain_count: int  # n: j >= n is a wall
    wall_count: int
    shift: Annotated[
        Float[Array, "c 2"] | None,
        Quantity("to be added to the centre of j for the image that i touches", "m", "contact xy", since=2),
    ] = None  # None: no periodic cell

    @property
    def count(self) -> int:
        return len(self.i)

    @property
    def body_count(self) -> int:
        """Grains and walls together."""
        return self.grain_count + self.wall_count

    @property
    def key(self) -> Keys:
        """Keys of the pairs (c,), ascending, the same in every frame of a sequence."""
        return make_keys(self.i, self.j, self.body_count)

    @property
    def with_wall(self) -> NDArray[np.bool_]:
        return self.j >= self.grain_count

    def second_centre(self, position: Array) -> Array:
        """Return the centre (c, 2) [m] of the image of j that i touches; NaN for a wall. position (n, 2) [m]."""
        centre = np.full((self.count, 2), np.nan)
        pair = ~self.with_wall
        centre[pair] = position[self.j[pair]]
        return centre if self.shift is None else centre + self.shift

    @property
    def gauge(self) -> NDArray[np.bool_]:
        """Contacts (c,) whose Σ f_n normalises forces of unknown scale: those with walls, or all without walls."""
        wall = self.with_wall
        return wall if wall.any() else np.ones(self.count, np.bool_)

    @property
    def tangent(self) -> Array:
        """The normal rotated by +90° (c, 2)."""
        return np.stack([-self.normal[:, 1], self.normal[:, 0]], axis=1)

    def select(self, rows: NDArray) -> Contacts:
        """Return some rows, given by a mask or by ascending indices."""
        return Contacts(
            self.i[rows], self.j[rows], self.gap[rows], self.normal[rows], self.point[rows],
            self.grain_count, self.wall_count, None if self.shift is None else self.shift[rows],
        )  # fmt: skip


def detect_contacts(
    grains: Grains,
    position: Array,
    present: NDArray[np.bool_],
    walls: Walls,
    threshold: float,
    *,
    wall_threshold: float | None = None,
) -> Contacts:
    """Find every pair of bodies whose gap is below a threshold.

    Parameters
    ----------
    grains
        Radii, and boundary grains, which have no contacts with each other and with walls.
    position : (n, 2)
        Centres [m].
    present : (n,) bool
        Grains that take part.
    walls
        Walls or cell of the frame.
    threshold
        Greatest gap [m].
    wall_threshold
        Greatest gap [m] between a grain and a wall; `threshold` by default.
    """
    wall_threshold = threshold if wall_threshold is None else wall_threshold
    i, j = _grain_pairs(grains.radius, position, present, threshold, walls.cell)
    i, j = i[moves := move_freely(grains.boundary, i, j)], j[moves]
    wi, wj = _wall_pairs(grains.radius, position, present & grains.free, walls, wall_threshold)
    return measure_contacts(grains, position, walls, np.concatenate([i, wi]), np.concatenate([j, wj + grains.count]))


def measure_contacts(
    grains: Grains, position: Array, walls: Walls, i: NDArray[np.integer], j: NDArray[np.integer]
) -> Contacts:
    """Measure normal, gap and point of given pairs i, j (c,) at any distance.

    Raises
    ------
    ValueError
        Two grains have the same centre.
    """
    n, key = grains.count, make_keys(i, j, grains.count + walls.count)
    i, j = i.astype(np.int32), j.astype(np.int32)
    if np.any(key[1:] < key[:-1]):
        order = np.argsort(key, kind="stable")
        i, j = i[order], j[order]
    normal, gap, point, shift = np.empty((len(i), 2)), np.empty(len(i)), np.empty((len(i), 2)), None
    if walls.cell is not None:
        pair, shift = j < n, np.zeros((len(i), 2))
        shift[pair] = walls.cell.shift(position[j[pair]] - position[i[pair]])
    moved, bounds = np.empty((0, 2)) if shift is None else shift, (np.ascontiguousarray(walls.endpoints), walls.sides)
    row = _measure(i, j, position, grains.radius, moved, bounds, gap, normal, point)
    if row >= 0:
        raise ValueError(f"grains {i[row]} and {j[row]} have the same centre")
    return Contacts(i, j, gap, normal, point, n, walls.count, shift)


@njit(cache=True, nogil=True, error_model="numpy")
def _measure(i, j, position, radius, shift, walls, gap, normal, point):  # type: ignore[no-untyped-def]
    """Set gap, normal and point of the pairs; walls: endpoints and shapes. Return a row of zero distance, or −1."""
    endpoints, side = walls
    for c in range(len(i)):
        a, b = i[c], j[c]
        if b < len(radius):
            x, y = position[b, 0] - position[a, 0], position[b, 1] - position[a, 1]
            if len(shift):
                x += shift[c, 0]
                y += shift[c, 1]
            distance = math.sqrt(x * x + y * y)
            if distance == 0.0:
                return c
            normal[c, 0], normal[c, 1] = x / distance, y / distance
            gap[c] = distance - radius[a] - radius[b]
        else:
            w = b - len(radius)
            distance, normal[c, 0], normal[c, 1] = measure_at_wall(
                endpoints[w], side[w], position[a, 0], position[a, 1], radius[a]
            )
            gap[c] = distance - radius[a]
        arm = radius[a] + 0.5 * gap[c]
        point[c, 0], point[c, 1] = position[a, 0] + normal[c, 0] * arm, position[a, 1] + normal[c, 1] * arm
    return -1


def measure_pairs(grains: Grains, position: Array, walls: Walls, key: Keys) -> Contacts:
    """Measure the pairs of given keys (c,) at any distance."""
    return measure_contacts(grains, position, walls, *split_keys(key, grains.count + walls.count))


def _grain_pairs(
    radius: Array, position: Array, present: NDArray[np.bool_], threshold: float, cell: Cell | None
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    rows = np.flatnonzero(present)
    if len(rows) < 2:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    if cell is None:
        pairs = rows[find_disc_pairs(position[rows], radius[rows], threshold)]
        return pairs[:, 0], pairs[:, 1]
    point, owner = _with_images(cell, position, rows, 2.0 * radius[rows].max() + threshold)
    pairs = find_disc_pairs(point, radius[owner], threshold)
    i, j = owner[pairs[pairs[:, 0] < len(rows)]].T  # exactly one image of each pair has its first disc in the cell
    once = np.unique(i[i < j] * len(radius) + j[i < j])
    return once // len(radius), once % len(radius)


def _with_images(cell: Cell, position: Array, rows: NDArray[np.intp], reach: float) -> tuple[Array, NDArray[np.intp]]:
    point, owner = cell.with_images(position[rows], reach)
    return point, rows[owner]


def _wall_pairs(
    radius: Array, position: Array, present: NDArray[np.bool_], walls: Walls, threshold: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Find pairs of grain and wall; the grain faces it, a straight one for a radius past its ends, or is at an end."""
    near = np.empty((len(radius), walls.count), np.bool_)
    ends = np.ascontiguousarray(walls.endpoints)
    beside = find_near_walls(position, radius, present, ends, walls.sides, threshold, near)
    i, w = np.nonzero(near)
    if beside:
        return i, w
    faces = faces_walls(walls.endpoints, walls.side, w, position[i], radius[i])
    if not faces.all():
        ends = walls.nearest_ends(w, position[i], radius[i])
        faces |= ends.touched & (ends.distance - radius[i] < threshold)
    return i[faces], w[faces]


class ContactState(IntEnum):
    OPEN = 0  # carries no force
    STICKING = 1  # |f_t| < μ f_n
    SLIDING = 2  # |f_t| = μ f_n


class ContactSource(IntEnum):
    DETECTED = 0
    ADDED_BY_REVIEWER = 1
    FORBIDDEN_BY_REVIEWER = 2
    FROM_BALANCE = 3  # not detected: added because the forces around it contradict the motion without it
    INTERPOLATED = 4  # of a rod that was lost in this photograph and stands where it must have been
