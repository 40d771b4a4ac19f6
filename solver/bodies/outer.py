"""Which grains are outermost: those that something outside the picture, or in a hole of the packing, could touch.

A disc as small as the smallest grain is rolled over the packing from outside, and along the rim of every hole that is
clearly wider than a missing grain. The grains it touches are the outermost. Triangles of Delaunay's between centres
say where it gets: through a side that lets it pass, and into a triangle whose third grain it would meet there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy.typing import NDArray
from scipy.spatial import Delaunay, KDTree

from solver.bodies.grains import Array
from solver.bodies.wall_shapes import reach_of_wall
from solver.bodies.walls import Walls

ROLLING = 0.97  # of the smallest radius: the disc that is rolled
WIDE = 2.0  # of the greatest radius: a disc of this fits into what is no missing grain but a hole, or outside
FEWEST = 4  # grains that a triangulation needs


@dataclass(frozen=True, slots=True)
class FreeSurface:
    """The grains at the free surfaces of a packing, and how these lie."""

    outer: Bool[np.ndarray, " n"]  # which grains
    place: Float[Array, "s 2"]  # [m] where the disc rests between two of them
    outward: Float[Array, "s 2"]  # unit vectors from the surface to the disc
    inner: Bool[np.ndarray, " s"]  # whether that is in a hole


def find_outer(radius: Array, position: Array, present: NDArray[np.bool_], walls: Walls) -> FreeSurface:
    """Find the outermost grains; radius (n,) and position (n, 2) [m]; present (n,).

    Nothing lies beyond walls: along them no grain is outermost. A periodic packing has no outermost grains.
    """
    nothing = FreeSurface(np.zeros(len(radius), np.bool_), np.empty((0, 2)), np.empty((0, 2)), np.zeros(0, np.bool_))
    rows = np.flatnonzero(present)
    if walls.cell is not None or len(rows) < FEWEST:
        return nothing
    x, r = position[rows], radius[rows]
    disc, wide = ROLLING * float(radius.min()), WIDE * float(radius.max())
    mesh = Delaunay(x)
    corner, beside = mesh.simplices, mesh.neighbors
    middle = _circumcentres(x[corner])
    hole = (_room(x, r, middle) >= wide) & _within(middle, wide, walls) & (mesh.find_simplex(middle) >= 0)
    # A triangle that the middle of a hole lies in, and so on from there.
    inner_start = np.unique(mesh.find_simplex(middle[hole]))
    outer = np.zeros(len(rows), np.bool_)
    reached = np.zeros(len(corner), np.bool_)
    reached[inner_start] = True
    todo = [(int(t), True) for t in inner_start]
    place, outward, in_hole = [], [], []

    def cross(a: int, b: int, c: int, hollow: bool) -> bool:
        """Whether the disc gets past the side a b, coming from the side that c is not on; notes where it rests."""
        found = _resting(x[a], x[b], r[a] + disc, r[b] + disc, x[c])
        if found is None:
            return bool(_within(0.5 * (x[a] + x[b])[None], disc, walls)[0])
        if not _within(found[None], disc, walls)[0]:
            return False
        meets = float(np.hypot(*(found - x[c]))) < r[c] + disc
        if not meets:
            outer[[a, b]] = True
            place.append(found)
            away = found - 0.5 * (x[a] + x[b])
            outward.append(away / max(float(np.hypot(*away)), 1e-30))
            in_hole.append(hollow)
        return meets

    for t, k in np.argwhere(beside < 0).tolist():
        a, b, c = corner[t, (k + 1) % 3], corner[t, (k + 2) % 3], corner[t, k]
        if not _open_to_outside(x[a], x[b], float(r[a]) + wide, float(r[b]) + wide, x[c], wide, walls):
            continue
        if cross(a, b, c, False) and not reached[t]:
            reached[t] = True
            todo.append((int(t), False))
    while todo:
        t, hollow = todo.pop()
        for k in range(3):
            other = int(beside[t, k])
            a, b = corner[t, (k + 1) % 3], corner[t, (k + 2) % 3]
            if other < 0 or reached[other]:
                continue
            c = corner[other][np.flatnonzero(beside[other] == t)[0]]
            if cross(a, b, c, hollow):
                reached[other] = True
                todo.append((other, hollow))
    outer[np.unique(corner[reached])] = True
    marked = np.zeros(len(radius), np.bool_)
    marked[rows] = outer
    shape = (-1, 2)
    return FreeSurface(
        marked, np.array(place).reshape(shape), np.array(outward).reshape(shape), np.array(in_hole, bool)
    )


def _room(x: Array, r: Array, place: Array) -> Array:
    """Radius (m,) [m] of the greatest disc at places (m, 2) that overlaps no grain."""
    distance, near = KDTree(x).query(place, k=min(8, len(x)))
    return np.min(np.asarray(distance) - r[np.asarray(near)], axis=1)


def _circumcentres(corner: Array) -> Array:
    """Middles (t, 2) [m] of the circles through three points (t, 3, 2)."""
    a, b = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    cross = 2.0 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    square_a, square_b = np.sum(a**2, axis=1), np.sum(b**2, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        middle = np.stack([b[:, 1] * square_a - a[:, 1] * square_b, a[:, 0] * square_b - b[:, 0] * square_a], axis=1)
        middle /= cross[:, None]
    far = 1e3 * np.abs(corner).max()
    middle = np.clip(np.nan_to_num(middle, nan=far), -far, far)
    return corner[:, 0] + middle


def _resting(a: Array, b: Array, reach_a: float, reach_b: float, behind: Array) -> Array | None:
    """Where a disc rests on two grains (2,) [m], on the side that `behind` is not on; None: it passes between them.

    reach [m]: of the centres, radii of grain and disc together.
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
    """Whether outside the hull's side a b there is room that no wall takes."""
    place = _resting(a, b, reach_a, reach_b, behind)
    place = 0.5 * (a + b) if place is None else place
    return bool(_within(place[None], wide, walls)[0])


def _within(place: Array, room: float, walls: Walls) -> NDArray[np.bool_]:
    """Which places (m, 2) [m] are on the packing's side of all walls, and `room` [m] away from them (m,)."""
    if walls.count == 0:
        return np.ones(len(place), np.bool_)
    ahead = reach_of_wall(walls.endpoints, walls.sides, place[:, None])[0]
    return np.all(ahead >= 0.9 * room, axis=1)
