"""Holes in a packing that a rod would fit into: grains that no photograph shows leave them behind."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay, KDTree

from solver.bodies.grains import Array, Grains
from solver.bodies.wall_shapes import reach_of_wall
from solver.bodies.walls import Walls

FITTING = 0.97  # of the smallest radius: the three grains around a hole give way a little
NATURAL = 0.6  # of the greatest radius: gaps between great grains are that wide without anything missing
NEIGHBOURS = 12  # nearest centres among which the nearest surface is sought
FEWEST = 4  # grains that a triangulation needs
STEPS = 8  # of the walk from a triangle's middle to the middle of its hole


def find_holes(grains: Grains, position: Array, present: NDArray[np.bool_], walls: Walls) -> Array:
    """Centres (h, 2) [m] of circles of the smallest rod's size, or nearly, that touch neither grains nor walls.

    position (n, 2) [m]; present (n,): the others leave holes. No circle lies over the centre of another.
    """
    seen = np.flatnonzero(present)
    if len(seen) < FEWEST or walls.count == 0:
        return np.empty((0, 2))
    centre, radius, least = position[seen], grains.radius[seen], _least_room(grains.radius)
    corner = Delaunay(centre).simplices
    place = _equally_far(centre[corner], radius[corner])
    with np.errstate(invalid="ignore"):
        inside = np.all(
            reach_of_wall(walls.endpoints[None], None if walls.side is None else walls.side[None], place[:, None])[0]
            >= least,
            1,
        )
    place = place[inside & np.isfinite(place).all(axis=1)]
    tree = KDTree(centre)
    # Nearly all places are ruled out by the nearest centre, whose search is quick.
    place = place[np.asarray(tree.query(place)[0]) - radius.min() >= least]
    if not len(place):
        return np.empty((0, 2))
    distance, near = tree.query(place, k=min(NEIGHBOURS, len(seen)))
    room = (np.asarray(distance) - radius[np.asarray(near)]).min(axis=1)
    found: list[Array] = []
    for k in np.argsort(-room, kind="stable"):
        if room[k] < least:
            break
        if all(np.hypot(*(place[k] - each)) >= least for each in found):
            found.append(place[k])
    return np.array(found).reshape(-1, 2)


def _least_room(radius: Array) -> float:
    return max(FITTING * float(radius.min()), NATURAL * float(radius.max()))


def _equally_far(centre: Array, radius: Array) -> Array:
    """Points (h, 2) equally far from three rims, of centre (h, 3, 2) and radius (h, 3), by Newton's method."""
    point = centre.mean(axis=1)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        for _ in range(STEPS):
            apart = point[:, None] - centre
            distance = np.linalg.norm(apart, axis=2)
            room = distance - radius
            toward = apart / distance[:, :, None]
            matrix = toward[:, 1:] - toward[:, :1]
            wrong = room[:, 1:] - room[:, :1]
            pivot = matrix[:, 0, 0] * matrix[:, 1, 1] - matrix[:, 0, 1] * matrix[:, 1, 0]
            point = point - np.stack([
                (matrix[:, 1, 1] * wrong[:, 0] - matrix[:, 0, 1] * wrong[:, 1]) / pivot,
                (matrix[:, 0, 0] * wrong[:, 1] - matrix[:, 1, 0] * wrong[:, 0]) / pivot,
            ], axis=1)  # fmt: skip
    return point
