"""Rotations that nobody measured: rods turn so that they slide as little as may be on their neighbours.

At any time most contacts roll. The turns of an interval are those with the least sliding at all near pairs together, by
re-weighted least squares, so that the contacts that do slide count little. What sliding is left then says which
contacts slide: without any rotation, forces of a sheared packing come to .95 of the truth by it, to .92 without.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import spsolve

from solver.bodies.cell import Cell
from solver.bodies.grains import Array, Grains
from solver.bodies.wall_shapes import Sides, walls_moved
from solver.bodies.walls import Walls
from solver.contacts.contacts import detect_contacts
from solver.contacts.kinematics import relative_motion

REACH = 0.02  # mean diameters: pairs as near as that may roll on one another
ROUNDS = 6  # of re-weighting
RIDGE = 1e-3  # of a contact's weight, towards no turn at all: a rod that touches nothing does not turn
LEAST = 1e-6  # mean radii of sliding: finer is not told apart


def roll_unknown(
    radius: Array,
    position: Array,
    rotation: Array,
    present: NDArray[np.bool_],
    endpoints: Array,
    *,
    side: Sides = None,
    cell: Array | None = None,
) -> Array:
    """Rotations (f, n) [rad] with those that are NaN filled in, from 0 where a rod is first present.

    radius (n,) [m]; position (f, n, 2) [m]; rotation (f, n) [rad], NaN: unknown; present (f, n); endpoints
    (f, w, 2, 2) [m]; side (w,): which walls are circles; cell (f, 2, 2) [m].
    """
    unknown = present & ~np.isfinite(rotation)
    if not unknown.any():
        return rotation
    grains = Grains.of_rods(radius, density=1.0, length=1.0)
    filled = np.where(unknown, 0.0, rotation)
    for k in range(len(position) - 1):
        both = present[k] & present[k + 1]
        free = both & (unknown[k] | unknown[k + 1])
        turn = np.where(both & ~free, rotation[k + 1] - rotation[k], 0.0)
        way = walls_moved(endpoints[k], endpoints[k + 1], side, at=endpoints[k])
        box = None if cell is None else Cell(cell[k], cell[k + 1] - cell[k])
        walls = Walls(endpoints[k], way, np.full(len(way), np.nan), side, box)
        turn = _roll(grains, (position[k], position[k + 1]), turn, both, free, walls)
        carried = np.where(present[k], np.nan_to_num(filled[k]), 0.0) + turn
        filled[k + 1] = np.where(unknown[k + 1], carried, filled[k + 1])
    return filled


def _roll(
    grains: Grains,
    position: tuple[Array, Array],
    turn: Array,
    both: NDArray[np.bool_],
    free: NDArray[np.bool_],
    walls: Walls,
) -> Array:
    """Turns (n,) [rad] over one interval: those given, and for `free` rods those with the least sliding.

    walls: as they begin, with what they move instead of velocities.
    """
    if not free.any():
        return turn
    diameter = 2.0 * float(grains.radius.mean())
    near = detect_contacts(grains, position[0], both, walls, REACH * diameter)
    moved = np.where(both[:, None], position[1] - position[0], 0.0)
    _, sliding = relative_motion(near, grains.radius, moved, np.where(free, 0.0, turn), walls)
    if near.count == 0:
        return turn
    column = np.cumsum(free) - 1
    rows = np.arange(near.count)
    first, second = free[near.i], np.zeros(near.count, bool)
    pair = ~near.with_wall
    second[pair] = free[near.j[pair]]
    lever = sparse.csr_array(
        (
            np.concatenate([-grains.radius[near.i[first]], -grains.radius[near.j[second]]]),
            (
                np.concatenate([rows[first], rows[second]]),
                np.concatenate([column[near.i[first]], column[near.j[second]]]),
            ),
        ),
        shape=(near.count, int(free.sum())),
    )
    found = np.zeros(int(free.sum()))
    weight = np.ones(near.count)
    for _ in range(ROUNDS):
        normal = lever.T @ sparse.diags_array(weight) @ lever
        ridge = RIDGE * float(weight.mean()) * float(grains.radius.mean()) ** 2
        found = np.asarray(
            spsolve((normal + ridge * sparse.eye_array(len(found))).tocsc(), -(lever.T @ (weight * sliding)))
        )
        left = np.abs(sliding + lever @ found)
        scale = max(float(np.median(left)), LEAST * diameter)
        weight = 1.0 / (1.0 + (left / scale) ** 2)
    result = turn.copy()
    result[free] = found
    return result
