"""Rotations that were not measured, estimated by least sliding of the rods on their neighbours.

At any time most contacts roll. Robust least squares of the sliding at all candidate contacts gives little weight to
those that slide, and the remaining sliding shows them: without any measured rotation, forces of a sheared packing
correlate with the truth by .95 with these rotations, by .92 without.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import spsolve

from ..bodies.cell import Cell
from ..bodies.grains import Array, Grains
from ..bodies.wall_shapes import Sides, wall_displacement
from ..bodies.walls import Walls
from ..contacts.contacts import detect_contacts
from ..contacts.kinematics import relative_motion

REACH = 0.02  # mean diameters: greatest gap of pairs that may roll on one another
ROUNDS = 6  # of re-weighting
RIDGE = 1e-3  # of a contact's weight, towards no rotation: a rod without neighbours does not rotate
MIN_SLIDING = 1e-6  # mean diameters: lower limit of the scale of sliding


def fill_unknown_rotations(
    radius: Array,
    position: Array,
    rotation: Array,
    present: NDArray[np.bool_],
    endpoints: Array,
    *,
    side: Sides = None,
    cell: Array | None = None,
) -> Array:
    """Fill in unknown rotations, from 0 where a rod is first present.

    Parameters
    ----------
    radius : array (n,)
        Radii [m].
    position : array (f, n, 2)
        Centres [m].
    rotation : array (f, n)
        Rotations [rad]; NaN: unknown.
    present : bool array (f, n)
        Whether each rod is present.
    endpoints : array (f, w, 2, 2)
        Ends of the walls [m]; NaN where a wall is unknown: nothing then slides on it.
    side : array (w,), optional
        Which walls are circles.
    cell : array (f, 2, 2), optional
        Vectors [m] of a periodic cell.

    Returns
    -------
    array (f, n)
        Rotations [rad]; `rotation` itself where none is unknown.

    Notes
    -----
    The rotations φ of an interval minimise Σ w (d_t − R_i φ_i − R_j φ_j)² + ρ Σ φ², with d_t the sliding displacement
    at rotations of zero and w = 1/(1 + (r/s)²), r the residual of the round before and s its median, in six rounds;
    ρ = 10⁻³ ⟨w⟩ ⟨R⟩².
    """
    unknown = present & ~np.isfinite(rotation)
    if not unknown.any():
        return rotation
    grains = Grains.of_rods(radius, density=1.0, length=1.0)
    filled = np.where(unknown, 0.0, rotation)
    for k in range(len(position) - 1):
        both = present[k] & present[k + 1]
        free = both & (unknown[k] | unknown[k + 1])
        angle = np.where(both & ~free, rotation[k + 1] - rotation[k], 0.0)
        seen = np.isfinite(endpoints[k : k + 2]).all(axis=(0, 2, 3))  # walls that are known in both frames
        ends, sides = endpoints[k : k + 2, seen], None if side is None else side[seen]
        wall_shift = wall_displacement(ends[0], ends[1], sides, at=ends[0])
        box = None if cell is None else Cell(cell[k], cell[k + 1] - cell[k])
        walls = Walls(ends[0], wall_shift, np.full(len(wall_shift), np.nan), sides, box)
        angle = _minimise_sliding(grains, (position[k], position[k + 1]), angle, both, free, walls)
        carried = np.where(present[k], np.nan_to_num(filled[k]), 0.0) + angle
        filled[k + 1] = np.where(unknown[k + 1], carried, filled[k + 1])
    return filled


def _minimise_sliding(
    grains: Grains,
    position: tuple[Array, Array],
    angle: Array,
    both: NDArray[np.bool_],
    free: NDArray[np.bool_],
    walls: Walls,
) -> Array:
    """Compute rotations (n,) [rad] over one interval: those given, and for `free` rods those of least sliding.

    walls: at the beginning, with displacements in place of velocities.
    """
    if not free.any():
        return angle
    diameter = 2.0 * float(grains.radius.mean())
    near = detect_contacts(grains, position[0], both, walls, REACH * diameter)
    moved = np.where(both[:, None], position[1] - position[0], 0.0)
    _, sliding = relative_motion(near, grains.radius, moved, np.where(free, 0.0, angle), walls)
    if near.count == 0:
        return angle
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
        residual = np.abs(sliding + lever @ found)
        scale = max(float(np.median(residual)), MIN_SLIDING * diameter)
        weight = 1.0 / (1.0 + (residual / scale) ** 2)
    result = angle.copy()
    result[free] = found
    return result
