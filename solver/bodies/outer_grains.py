"""The outer grains of a packing: those at its free surface and at the rims of large holes.

A disc of the size of the smallest grain is rolled over the packing from outside, and along the rim of every hole that
is clearly wider than a missing grain (an alpha shape). The grains that it touches are the outer ones. The search goes
from triangle to triangle of the Delaunay triangulation of the centres: the disc enters a triangle through a side that
is wide enough, or if it touches the third grain of the triangle from there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from numpy.typing import NDArray
from scipy.spatial import Delaunay, KDTree

from .grains import Array
from .wall_shapes import distance_from_walls
from .walls import Walls

DISC_FRACTION = 0.97  # radius of the rolled disc over the smallest radius
HOLE_RADII = 2.0  # of the greatest radius: a disc that fits into a hole or outside, not into the gap of a missing grain
MIN_GRAINS = 4  # that a Delaunay triangulation needs
SIDES = ("at the top", "at the bottom", "at the right", "at the left", "around a hole inside")
SIDEWAYS = np.array([[0.0, 0.0, 1.0, -1.0], [1.0, -1.0, 0.0, 0.0]])  # directions of the first four
FEWEST_BARE = 4  # unbounded gaps between outer grains: fewer are a missing rod beside a wall


class OpenSide(NamedTuple):
    """A side of the packing, or its holes, without a wall."""

    name: str
    place: Array  # (2,) [m] middle of the surface


@dataclass(frozen=True, slots=True)
class FreeSurface:
    """The grains at the free surfaces of a packing, and the positions of the disc on them."""

    outer: Bool[np.ndarray, " n"]  # grains at a free surface
    place: Float[Array, "s 2"]  # [m] centre of the disc at rest on two of them
    outward: Float[Array, "s 2"]  # unit vectors from the surface to the disc
    inner: Bool[np.ndarray, " s"]  # True in a hole, False outside

    def sides(self, chosen: Bool[np.ndarray, " s"]) -> list[OpenSide]:
        """Name the sides on which at least FEWEST_BARE of the chosen places are."""
        side = np.where(self.inner, len(SIDES) - 1, np.argmax(self.outward @ SIDEWAYS, axis=1))
        places = [(name, self.place[chosen & (side == k)]) for k, name in enumerate(SIDES)]
        return [OpenSide(name, place.mean(axis=0)) for name, place in places if len(place) >= FEWEST_BARE]


def find_outer_grains(radius: Array, position: Array, present: NDArray[np.bool_], walls: Walls) -> FreeSurface:
    """Find the outer grains of a packing.

    Grains along walls are no outer grains, and a periodic packing has none.

    Parameters
    ----------
    radius : (n,)
        Radii [m].
    position : (n, 2)
        Centres [m].
    present : (n,) bool
        Grains seen.
    walls
        Walls or cell of the frame.
    """
    empty = FreeSurface(np.zeros(len(radius), np.bool_), np.empty((0, 2)), np.empty((0, 2)), np.zeros(0, np.bool_))
    rows = np.flatnonzero(present)
    if walls.cell is not None or len(rows) < MIN_GRAINS:
        return empty
    x, r = position[rows], radius[rows]
    disc, wide = DISC_FRACTION * float(radius.min()), HOLE_RADII * float(radius.max())
    mesh = Delaunay(x)
    corner, beside = mesh.simplices, mesh.neighbors
    middle = _circumcentres(x[corner])
    hole = (_clearance(x, r, middle) >= wide) & _within(middle, wide, walls) & (mesh.find_simplex(middle) >= 0)
    # The search in a hole starts from the triangle that contains its centre.
    inner_start = np.unique(mesh.find_simplex(middle[hole]))
    outer = np.zeros(len(rows), np.bool_)
    reached = np.zeros(len(corner), np.bool_)
    queue: list[tuple[int, bool]] = []
    place, outward, in_hole = [], [], []

    def cross(a: int, b: int, c: int, hollow: bool) -> bool:
        """Return whether the disc passes the side a b from the side opposite to c; record its position of rest."""
        found = _rest_position(x[a], x[b], r[a] + disc, r[b] + disc, x[c])
        if found is None:
            return bool(_within(0.5 * (x[a] + x[b])[None], disc, walls)[0])
        if not _within(found[None], disc, walls)[0]:
            return False
        touches_third = float(np.hypot(*(found - x[c]))) < r[c] + disc
        if not touches_third:
            outer[[a, b]] = True
            place.append(found)
            away = found - 0.5 * (x[a] + x[b])
            outward.append(away / max(float(np.hypot(*away)), 1e-30))
            in_hole.append(hollow)
        return touches_third

    for t, k in np.argwhere(beside < 0).tolist():
        a, b, c = corner[t, (k + 1) % 3], corner[t, (k + 2) % 3], corner[t, k]
        if not _open_to_outside(x[a], x[b], float(r[a]) + wide, float(r[b]) + wide, x[c], wide, walls):
            continue
        if cross(a, b, c, False) and not reached[t]:
            reached[t] = True
            queue.append((int(t), False))
    for start in (None, *inner_start):  # first from outside: what it reaches, as a crater in a surface, is no hole
        if start is not None and not reached[start]:
            reached[start] = True
            queue.append((int(start), True))
        while queue:
            t, hollow = queue.pop()
            for k in range(3):
                other = int(beside[t, k])
                a, b = corner[t, (k + 1) % 3], corner[t, (k + 2) % 3]
                if other < 0 or reached[other]:
                    continue
                c = corner[other][np.flatnonzero(beside[other] == t)[0]]
                if cross(a, b, c, hollow):
                    reached[other] = True
                    queue.append((other, hollow))
    outer[np.unique(corner[reached])] = True
    marked = np.zeros(len(radius), np.bool_)
    marked[rows] = outer
    shape = (-1, 2)
    return FreeSurface(
        marked, np.array(place).reshape(shape), np.array(outward).reshape(shape), np.array(in_hole, bool)
    )


def _clearance(x: Array, r: Array, place: Array) -> Array:
    """Return the radius (m,) [m] of the greatest disc at points (m, 2) that overlaps no grain."""
    distance, near = KDTree(x).query(place, k=min(8, len(x)))
    return np.min(np.asarray(distance) - r[np.asarray(near)], axis=1)


def _circumcentres(corner: Array) -> Array:
    """Return the circumcentres (t, 2) [m] of triangles (t, 3, 2)."""
    a, b = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    cross = 2.0 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    square_a, square_b = np.sum(a**2, axis=1), np.sum(b**2, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        middle = np.stack([b[:, 1] * square_a - a[:, 1] * square_b, a[:, 0] * square_b - b[:, 0] * square_a], axis=1)
        middle /= cross[:, None]
    far = 1e3 * np.abs(corner).max()
    middle = np.clip(np.nan_to_num(middle, nan=far), -far, far)
    return corner[:, 0] + middle


def _rest_position(a: Array, b: Array, reach_a: float, reach_b: float, behind: Array) -> Array | None:
    """Return the centre (2,) [m] of a disc at rest on two grains, opposite to `behind`; None: it passes between them.

    reach_a, reach_b [m]: sums of the radii of grain and disc.
    """
    between = b - a
    distance = float(np.hypot(*between))
    if distance >= reach_a + reach_b:
        return None
    along = (distance**2 + reach_a**2 - reach_b**2) / (2.0 * distance)
    up = float(np.sqrt(max(reach_a**2 - along**2, 0.0)))
    unit = between / distance
    normal = np.array([-unit[1], unit[0]])
    if normal @ (behind - a) > 0.0:
        normal = -normal
    return a + along * unit + up * normal


def _open_to_outside(
    a: Array, b: Array, reach_a: float, reach_b: float, behind: Array, wide: float, walls: Walls
) -> bool:
    """Return whether the disc fits between the hull's side a b and the walls."""
    place = _rest_position(a, b, reach_a, reach_b, behind)
    place = 0.5 * (a + b) if place is None else place
    return bool(_within(place[None], wide, walls)[0])


def _within(place: Array, clearance: float, walls: Walls) -> NDArray[np.bool_]:
    """Return which points (m, 2) [m] are inside all walls and farther than about `clearance` [m] from them (m,)."""
    if walls.count == 0:
        return np.ones(len(place), np.bool_)
    distance = distance_from_walls(walls.endpoints, walls.sides, place[:, None])
    return np.all(distance >= 0.9 * clearance, axis=1)
