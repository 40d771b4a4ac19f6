"""Area of a packing, between its walls or around its rods."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, Delaunay, KDTree

from ..bodies.grains import Array
from ..bodies.wall_shapes import IN, OUT
from ..bodies.walls import Walls

PARALLEL = np.radians(10.0)  # greatest angle between walls of one side, as the halves of a box that is split
CORNERS = 2048  # of the polygon that approximates a circle
FEWEST_AROUND = 4  # boundary rods around an opening
MOST_BEYOND = 0.1  # fraction of the rods beyond the line of a wall around them: some rise beside a plate
ROUNDING = 1e-9  # [m]
WIDEST_PORE = 1.5  # distances of neighbouring boundary rods: radius of the circle through three rods around a pore


def polygon_area(corners: Array) -> float:
    """Return the area of a polygon (m, 2) [m], counter-clockwise positive [m²]."""
    x, y = corners[:, 0], corners[:, 1]
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def packing_area(
    walls: Walls,
    position: Array,
    present: NDArray[np.bool_] | None = None,
    boundary: NDArray[np.bool_] | None = None,
) -> float:
    """Return the area of the packing [m²].

    Parameters
    ----------
    walls
        The area is that of the cell, or of the polygon bounded by the lines of the straight walls around the rods, in
        the order of their directions. A circle around the packing is cut by these lines; the area of inner circles is
        subtracted.
    position : (n, 2)
        Centres [m], whose convex hull is used where the walls do not enclose an area.
    present : (n,) bool, optional
        Which rods are there; None: all.
    boundary : (n,) bool, optional
        Which rods are the packing's boundary: openings between them, as a tunnel or the inside of a ring, do not count.
    """
    if walls.cell is not None:
        return walls.cell.area
    if present is not None:
        position, boundary = position[present], None if boundary is None else boundary[present]
    radius, around = 0.5 * walls.length, np.flatnonzero(walls.sides == IN)
    within = float(np.pi * np.sum(radius[walls.sides == OUT] ** 2)) + _area_of_openings(position, boundary)
    if len(around):
        narrowest = int(around[np.argmin(radius[around])])
        return _area_in_circle(walls, narrowest) - within
    return _area_between_lines(walls, _outer_walls(walls, position), position) - within


def _outer_walls(walls: Walls, position: Array) -> NDArray[np.intp]:
    """Straight walls that nearly all rods lie in front of; faces of a body in the packing, as of a wedge, are none."""
    straight = np.flatnonzero(~walls.curved)
    if not len(position):
        return straight
    depth = np.einsum("wk,nwk->nw", walls.outward[straight], walls.endpoints[straight, 0] - position[:, None])
    return straight[(depth < -ROUNDING).mean(axis=0) <= MOST_BEYOND]


def _area_of_openings(position: Array, boundary: NDArray[np.bool_] | None) -> float:
    """Return the area [m²] between boundary rods (n,) alone: of Delaunay triangles too large for a pore."""
    if boundary is None or boundary.sum() < FEWEST_AROUND:
        return 0.0
    corner = Delaunay(position).simplices
    a, b, c = np.moveaxis(position[corner[boundary[corner].all(axis=1)]], 1, 0)
    u, v = b - a, c - a
    area = 0.5 * np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    sides = np.linalg.norm(u, axis=1) * np.linalg.norm(v, axis=1) * np.linalg.norm(c - b, axis=1)
    apart = float(np.median(KDTree(position[boundary]).query(position[boundary], k=2)[0][:, 1]))
    return float(area[sides > 4.0 * WIDEST_PORE * apart * area].sum())  # R = a b c / 4 A, of the circle through them


def _area_in_circle(walls: Walls, circle: int) -> float:
    """Return the area [m²] of a circle cut by all straight walls; the circle is a polygon of equal area."""
    step = 2.0 * np.pi / CORNERS
    radius = 0.5 * walls.length[circle] * np.sqrt(step / np.sin(step))
    angle = step * np.arange(CORNERS)
    corners = walls.centre[circle] + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    for w in np.flatnonzero(~walls.curved):
        inside = (walls.endpoints[w, 0] - corners) @ walls.outward[w]
        following, further = np.roll(corners, -1, axis=0), np.roll(inside, -1)
        kept: list[Array] = []
        for here, there, a, b in zip(corners, following, inside, further, strict=True):
            kept += [here] if a >= 0.0 else []
            kept += [here + a / (a - b) * (there - here)] if (a >= 0.0) != (b >= 0.0) else []
        if not kept:
            return 0.0
        corners = np.array(kept)
    return polygon_area(corners)


def _area_between_lines(walls: Walls, straight: NDArray[np.intp], position: Array) -> float:
    order = _sides(walls, straight)
    if len(order) >= 3:
        start, direction = walls.endpoints[order, 0], walls.direction[order]
        corners = np.empty_like(start)
        for k in range(len(order)):
            previous = k - 1
            cross = direction[previous, 0] * direction[k, 1] - direction[previous, 1] * direction[k, 0]
            if cross < 1e-6:
                break
            step = start[k] - start[previous]
            s = (step[0] * direction[k, 1] - step[1] * direction[k, 0]) / cross
            corners[k] = start[previous] + s * direction[previous]
        else:
            return polygon_area(corners)
    return float(ConvexHull(position).volume)


def _sides(walls: Walls, straight: NDArray[np.intp]) -> NDArray[np.intp]:
    """Straight walls (s,) in the order of their directions, of nearly parallel ones the longest: halves of one side."""
    angle = np.arctan2(walls.direction[straight, 1], walls.direction[straight, 0])
    kept: list[int] = []
    for k in np.argsort(-walls.length[straight], kind="stable"):
        apart = np.abs((angle[kept] - angle[k] + np.pi) % (2.0 * np.pi) - np.pi)
        if (apart > PARALLEL).all():
            kept.append(int(k))
    return straight[np.array(sorted(kept, key=lambda k: angle[k]), np.intp)]
