"""The forces nearest to given ones that preserve the resultants of some grains, within the Coulomb cones.

The motion is not used. The convex program of one neighbourhood, solved by the interior-point method:

    minimise  ½ |f − f_given|² + ρ/2 |H f − b|²    where f_n ≥ 0 and |f_t| ≤ μ f_n
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..bodies.grains import Array, Grains
from ..contacts.contacts import Contacts
from ..convex.grain_blocks import block_balance
from ..convex.interior_point import solve_program
from ..convex.interior_point_kernels import Program

EQUILIBRIUM_WEIGHT = 1e6  # ρ in units of the mean force: residuals of resultants stay below 1e-4 where forces exist
REACH = 4  # contacts from a changed one within which forces change
TOLERANCE = 1e-8  # of the interior-point method


def neighbourhood(
    grains: Grains, contacts: Contacts, rows: NDArray[np.intp], reach: int
) -> tuple[NDArray[np.bool_], NDArray[np.intp]]:
    """Return the contacts (c,) of the grains that are at most `reach` contacts away from some, and those grains (p,).

    Boundary grains are left out of the grains, which must be in balance, and not of the contacts.
    """
    inside = np.zeros(contacts.grain_count, np.bool_)
    between = ~contacts.with_wall
    inside[contacts.i[rows]] = True
    inside[contacts.j[rows[between[rows]]]] = True
    i, j = contacts.i[between], contacts.j[between]
    for _ in range(reach):
        beside = inside[i] | inside[j]
        inside[i[beside]] = inside[j[beside]] = True
    touching = inside[contacts.i] | (inside[np.minimum(contacts.j, contacts.grain_count - 1)] & ~contacts.with_wall)
    return touching, np.flatnonzero(inside if grains.boundary is None else inside & ~grains.boundary)


def resultants(
    grains: Grains, contacts: Contacts, rows: NDArray[np.intp], members: NDArray[np.intp]
) -> sparse.csr_matrix:
    """Return the matrix (3p, 2m) from all f_n, then all f_t, of contacts `rows` (m,) to resultants of grains (p,).

    Its rows are the forces along x of all grains, those along y, and the torques over the grains' radii.
    """
    p, m = len(members), len(rows)
    place = np.full(contacts.grain_count + contacts.wall_count, -1)
    place[members] = np.arange(p)
    row, column, value = [], [], []
    for bodies, sign in ((contacts.i, -1.0), (contacts.j, 1.0)):
        at = place[bodies[rows]]
        some = np.flatnonzero(at >= 0)
        for first, direction in ((0, contacts.normal), (m, contacts.tangent)):
            for axis in range(2):
                row.append(axis * p + at[some])
                column.append(first + some)
                value.append(sign * direction[rows[some], axis])
        # The torques on both grains have the same sign: the arms R n and −R n belong to −f and f.
        row.append(2 * p + at[some])
        column.append(m + some)
        value.append(np.full(len(some), -1.0))
    indices = np.concatenate(row), np.concatenate(column)
    return sparse.csr_matrix((np.concatenate(value), indices), shape=(3 * p, 2 * m))


def nearest_forces(matrix: sparse.csr_matrix, resultant: Array, given: Array, friction: Array, unit: float) -> Array:
    """Return the forces (2m,), all f_n, then all f_t, that are nearest to given ones with these resultants.

    Parameters
    ----------
    matrix : (3p, 2m) sparse
        As of `resultants`.
    resultant : (3p,)
        Resultants [N], torques over the radius.
    given : (2m,)
        Forces [N].
    friction : (m,)
        Coefficients of friction.
    unit : float
        Typical contact force [N].
    """
    m = len(friction)
    if m == 0:
        return np.zeros(0)
    grains = block_balance(matrix, resultant / unit, len(resultant) // 3, m)
    centre = np.ascontiguousarray(given.reshape(2, m).T) / unit
    program = Program(np.asarray(friction, np.float64), np.zeros((m, 2)), centre, 1.0, EQUILIBRIUM_WEIGHT)
    return solve_program(grains, program, TOLERANCE).force.T.ravel() * unit
