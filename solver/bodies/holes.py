"""Holes in a packing that a rod would fit into, as a grain that no photograph shows leaves them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay, KDTree

from .grains import Array, Grains
from .wall_shapes import distance_from_walls
from .walls import Walls

SMALLEST_FRACTION = 0.97  # of the smallest radius: least size of a hole, as its neighbours move in a little
LARGEST_FRACTION = 0.6  # of the largest radius: pores between large grains have this radius without a missing grain
NEIGHBOURS = 12  # nearest centres among which the nearest surface is searched
MIN_GRAINS = 4  # that a Delaunay triangulation needs
NEWTON_STEPS = 8  # from the centroid of a triangle to the centre of its hole


def find_holes(grains: Grains, position: Array, present: NDArray[np.bool_], walls: Walls) -> Array:
    """Find empty circles of about the smallest rod's size.

    Parameters
    ----------
    grains
        The grains of the packing.
    position : (n, 2)
        Centres of the grains [m].
    present : (n,) bool
        Grains seen; absent ones leave holes.
    walls
        Walls of the frame.

    Returns
    -------
    (h, 2)
        Centres [m] of circles that overlap neither grains nor walls; none covers the centre of another.
    """
    seen = np.flatnonzero(present)
    if len(seen) < MIN_GRAINS or walls.count == 0:
        return np.empty((0, 2))
    centre, radius, least_radius = position[seen], grains.radius[seen], _least_radius(grains.radius)
    corner = Delaunay(centre).simplices
    point = equidistant_points(centre[corner], radius[corner])
    # The corners of its own triangle exclude nearly all points, without a search for the nearest centre.
    apart = np.hypot(*np.moveaxis(point[:, None] - centre[corner], 2, 0)).min(axis=1)
    point = point[apart - radius.min() >= least_radius]  # not where Newton's method left NaN
    if not len(point):
        return np.empty((0, 2))
    with np.errstate(invalid="ignore"):
        inside = np.all(
            distance_from_walls(walls.endpoints[None], None if walls.side is None else walls.side[None], point[:, None])
            >= least_radius,
            1,
        )
    point = point[inside & np.isfinite(point).all(axis=1)]
    tree = KDTree(centre)
    point = point[np.asarray(tree.query(point)[0]) - radius.min() >= least_radius]
    if not len(point):
        return np.empty((0, 2))
    distance, near = tree.query(point, k=min(NEIGHBOURS, len(seen)))
    clearance = (np.asarray(distance) - radius[np.asarray(near)]).min(axis=1)
    found: list[Array] = []
    for k in np.argsort(-clearance, kind="stable"):
        if clearance[k] < least_radius:
            break
        if all(np.hypot(*(point[k] - each)) >= least_radius for each in found):
            found.append(point[k])
    return np.array(found).reshape(-1, 2)


def _least_radius(radius: Array) -> float:
    return max(SMALLEST_FRACTION * float(radius.min()), LARGEST_FRACTION * float(radius.max()))


def equidistant_points(centre: Array, radius: Array, start: Array | None = None) -> Array:
    """Compute points equidistant from three circles by Newton's method.

    Parameters
    ----------
    centre : array (h, 3, 2)
    radius : array (h, 3)
    start : array (2,), optional
        Where the iteration begins; None: in the middle of the centres.

    Returns
    -------
    array (h, 2)
        NaN or far away where there is none near the start.
    """
    # One row per circle and component: numpy is slow on axes of length two and three.
    x, y, r = (np.ascontiguousarray(each.T) for each in (centre[..., 0], centre[..., 1], radius))
    middle = (x.mean(axis=0), y.mean(axis=0)) if start is None else np.broadcast_to(start[:, None], (2, len(centre)))
    px, py = middle
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        for _ in range(NEWTON_STEPS):
            dx, dy = px - x, py - y
            distance = np.sqrt(dx * dx + dy * dy)
            clearance, dx, dy = distance - r, dx / distance, dy / distance
            (ax, bx), (ay, by), (first, second) = dx[1:] - dx[0], dy[1:] - dy[0], clearance[1:] - clearance[0]
            pivot = ax * by - ay * bx
            px, py = px - (by * first - ay * second) / pivot, py - (ax * second - bx * first) / pivot
    return np.column_stack([px, py])
