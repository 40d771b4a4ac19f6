"""Removal of one contact: the nearest forces around it that preserve the resultants without it.

The motion is not used again. Among all forces that preserve the resultant of every grain in the neighbourhood and
satisfy f_n ≥ 0 and |f_t| ≤ μ f_n, the result has the least sum of squared differences from the given forces. Forces
beyond the neighbourhood are unchanged. The projection onto this convex set is computed by Dykstra's alternating
projections (Boyle & Dykstra 1986).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numba import njit
from numpy.typing import NDArray

from ..bodies.grains import Array, Grains
from ..contacts.contacts import Contacts

MAX_ITERATIONS = 4000
TOLERANCE = 1e-4  # of the mean normal force: of a force between iterations, and of a resultant
CHECK_INTERVAL = 25  # iterations between convergence checks


@dataclass(frozen=True, slots=True)
class Removal:
    """Forces without one contact."""

    fn: Float[Array, " c"]  # [N]; 0 for the removed contact
    ft: Float[Array, " c"]  # [N]
    free: Bool[np.ndarray, " c"]  # contacts whose force may change
    unbalance: float  # greatest residual of a resultant over the mean f_n; large where no forces can replace it


def remove_contact(
    grains: Grains, contacts: Contacts, fn: Array, ft: Array, row: int, *, friction: Array, reach: int = 4
) -> Removal:  # fmt: skip
    """Remove one contact and redistribute its force.

    Parameters
    ----------
    grains, contacts
        Bodies and contacts of the frame.
    fn, ft : (c,)
        Forces [N].
    row
        The contact to remove.
    friction : (c,)
        Coefficient of friction of every contact.
    reach
        Number of contacts from the removed one within which forces change.
    """
    free, members = neighbourhood(grains, contacts, np.array([row]), reach)
    free[row] = False
    rows = np.flatnonzero(free)
    matrix = resultants(grains, contacts, rows, members)
    removed = resultants(grains, contacts, np.array([row]), members) @ np.array([fn[row], ft[row]])
    given = np.stack([fn[rows], ft[rows]], axis=1)
    resultant = matrix @ given.ravel() + removed
    scale = max(float(np.mean(np.abs(fn))), 1e-300)
    changed = project_forces(matrix, resultant, given, friction[rows], TOLERANCE * scale)
    new_fn, new_ft = fn.copy(), ft.copy()
    new_fn[rows], new_ft[rows] = changed[:, 0], changed[:, 1]
    new_fn[row] = new_ft[row] = 0.0
    residual = (matrix @ changed.ravel() - resultant).reshape(-1, 3)
    residual[:, 2] /= grains.radius[members]
    worst = float(np.abs(residual).max(initial=0.0)) / scale
    return Removal(new_fn, new_ft, free, worst)


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


def resultants(grains: Grains, contacts: Contacts, rows: NDArray[np.intp], members: NDArray[np.intp]) -> Array:
    """Return the matrix (3p, 2m) from forces (fn, ft) of contacts `rows` (m,) to fx, fy, torque of grains (p,)."""
    at = np.full(contacts.grain_count, -1)
    at[members] = np.arange(len(members))
    matrix = np.zeros((len(members), 3, len(rows), 2))
    directions = np.stack([contacts.normal[rows], contacts.tangent[rows]], axis=2)  # (m, xy, fn | ft)
    for m, contact in enumerate(rows):
        for body, sign in ((int(contacts.i[contact]), -1.0), (int(contacts.j[contact]), 1.0)):
            if body < contacts.grain_count and at[body] >= 0:
                matrix[at[body], :2, m] = sign * directions[m]
                matrix[at[body], 2, m, 1] = -grains.radius[body]
    return matrix.reshape(3 * len(members), 2 * len(rows))


def project_forces(matrix: Array, resultant: Array, given: Array, limit: Array, tolerance: float) -> Array:
    """Return the forces (m, 2) nearest to `given` with matrix · f = resultant, each within its Coulomb cone."""
    inverse = np.linalg.pinv(matrix)
    # The projection onto equilibrium is null_space · f + particular solution.
    null_space = np.ascontiguousarray(np.eye(matrix.shape[1]) - inverse @ matrix)
    force = np.ascontiguousarray(given, np.float64).copy()
    _alternate_projections(null_space, inverse @ resultant, force, limit, 0.01 * tolerance)
    return force


@njit(cache=True, nogil=True, error_model="numpy")
def _alternate_projections(null_space, particular, force, limit, tolerance):  # type: ignore[no-untyped-def]
    """Project forces (m, 2) alternately on equilibrium and on the Coulomb cones, in place, until they converge."""
    flat = force.reshape(force.size)
    correction, equilibrated = np.zeros(len(flat)), np.empty(len(flat))
    for step in range(MAX_ITERATIONS):
        equilibrated[:] = particular
        for k in range(len(flat)):  # the matrix is symmetric: rows are columns
            row, value = null_space[k], flat[k]
            for other in range(len(flat)):
                equilibrated[other] += row[other] * value
        change = 0.0
        for m in range(len(force)):
            tried_n, tried_t = equilibrated[2 * m] + correction[2 * m], equilibrated[2 * m + 1] + correction[2 * m + 1]
            fn, ft = _project_on_cone(tried_n, tried_t, limit[m])
            correction[2 * m], correction[2 * m + 1] = tried_n - fn, tried_t - ft
            change = max(change, abs(fn - flat[2 * m]), abs(ft - flat[2 * m + 1]))
            flat[2 * m], flat[2 * m + 1] = fn, ft
        if step % CHECK_INTERVAL == 0 and change < tolerance:
            break


@njit(inline="always")
def _project_on_cone(fn, ft, friction):  # type: ignore[no-untyped-def]
    """Return the nearest force with f_n ≥ 0 and |f_t| ≤ μ f_n."""
    along = max((fn + friction * abs(ft)) / (1.0 + friction * friction), 0.0)
    if abs(ft) > friction * fn:
        return along, friction * along if ft >= 0.0 else -friction * along
    return fn, ft
