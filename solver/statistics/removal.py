"""What would change if one contact were not there: the nearest forces around it that balance as before without it.

No inference: the motion is not asked again. Of all fields that leave every grain of the neighbourhood with the
resultant that it had, that pull nowhere and rub no more than friction lets them, it is the one that differs least, in
the sum of squares, from what was found. Forces beyond the neighbourhood stay. Alternating projections with Dykstra's
correction (Boyle & Dykstra 1986) find it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numba import njit
from numpy.typing import NDArray

from solver.bodies.grains import Array, Grains
from solver.contacts.contacts import Contacts

STEPS = 4000  # projections at most
CLOSE = 1e-4  # of the mean normal force: a change by less ends them, and a resultant may be off by
CHECKED = 25  # projections between looks


@dataclass(frozen=True, slots=True)
class Removal:
    """Forces without one contact."""

    fn: Float[Array, " c"]  # [N]; 0 of the contact that is taken away
    ft: Float[Array, " c"]  # [N]
    free: Bool[np.ndarray, " c"]  # contacts whose force might change
    unbalance: float  # worst resultant that is left over, over the mean normal force: large where nothing can stand in


def remove_contact(
    grains: Grains, contacts: Contacts, fn: Array, ft: Array, row: int, *, friction: float, wall_friction: float,
    reach: int = 4,
) -> Removal:  # fmt: skip
    """Take one contact away; fn, ft (c,) [N]; reach: how many contacts away grains take part."""
    inside = _neighbourhood(contacts, row, reach)
    touching = inside[contacts.i] | (inside[np.minimum(contacts.j, contacts.grain_count - 1)] & ~contacts.with_wall)
    free = touching.copy()
    free[row] = False
    balanced = inside if grains.boundary is None else inside & ~grains.boundary
    rows, places = np.flatnonzero(free), np.flatnonzero(balanced)
    matrix = _resultants(grains, contacts, rows, places)
    lost = _resultants(grains, contacts, np.array([row]), places) @ np.array([fn[row], ft[row]])
    found = np.stack([fn[rows], ft[rows]], axis=1)
    wanted = matrix @ found.ravel() + lost
    limit = np.where(contacts.with_wall[rows], wall_friction, friction)
    scale = max(float(np.mean(np.abs(fn))), 1e-300)
    changed = _nearest(matrix, wanted, found, limit, CLOSE * scale)
    new_fn, new_ft = fn.copy(), ft.copy()
    new_fn[rows], new_ft[rows] = changed[:, 0], changed[:, 1]
    new_fn[row] = new_ft[row] = 0.0
    left = (matrix @ changed.ravel() - wanted).reshape(-1, 3)
    left[:, 2] /= grains.radius[places]
    worst = float(np.abs(left).max(initial=0.0)) / scale
    return Removal(new_fn, new_ft, free, worst)


def _neighbourhood(contacts: Contacts, row: int, reach: int) -> NDArray[np.bool_]:
    """Grains (n,) that are no more than so many contacts away from a contact."""
    inside = np.zeros(contacts.grain_count, np.bool_)
    inside[contacts.i[row]] = True
    between = ~contacts.with_wall
    if between[row]:
        inside[contacts.j[row]] = True
    i, j = contacts.i[between], contacts.j[between]
    for _ in range(reach):
        beside = inside[i] | inside[j]
        inside[i[beside]] = inside[j[beside]] = True
    return inside


def _resultants(grains: Grains, contacts: Contacts, rows: NDArray[np.intp], places: NDArray[np.intp]) -> Array:
    """What forces (fn, ft) of `rows` (m,) make of the resultants fx, fy, torque of grains `places` (p,): (3p, 2m)."""
    at = np.full(contacts.grain_count, -1)
    at[places] = np.arange(len(places))
    matrix = np.zeros((len(places), 3, len(rows), 2))
    directions = np.stack([contacts.normal[rows], contacts.tangent[rows]], axis=2)  # (m, xy, fn | ft)
    for m, contact in enumerate(rows):
        for body, sign in ((int(contacts.i[contact]), -1.0), (int(contacts.j[contact]), 1.0)):
            if body < contacts.grain_count and at[body] >= 0:
                matrix[at[body], :2, m] = sign * directions[m]
                matrix[at[body], 2, m, 1] = -grains.radius[body]
    return matrix.reshape(3 * len(places), 2 * len(rows))


def _nearest(matrix: Array, wanted: Array, found: Array, limit: Array, close: float) -> Array:
    """The point (m, 2) nearest to `found` with matrix · f = wanted and every force within its friction cone."""
    inverse = np.linalg.pinv(matrix)
    # What leaves the resultants as they are, and what makes them those that are wanted: one product for a projection.
    apart = np.ascontiguousarray(np.eye(matrix.shape[1]) - inverse @ matrix)
    force = np.ascontiguousarray(found, np.float64).copy()
    _project_by_turns(apart, inverse @ wanted, force, limit, 0.01 * close)
    return force


@njit(cache=True, nogil=True, error_model="numpy")
def _project_by_turns(apart, shift, force, limit, close):  # type: ignore[no-untyped-def]
    """Project (m, 2) forces on the balance and on the cones by turns, in place, until they hardly change."""
    flat = force.reshape(force.size)
    correction, balanced = np.zeros(len(flat)), np.empty(len(flat))
    for step in range(STEPS):
        balanced[:] = shift
        for k in range(len(flat)):  # apart is symmetric: its rows are its columns
            row, part = apart[k], flat[k]
            for other in range(len(flat)):
                balanced[other] += row[other] * part
        change = 0.0
        for m in range(len(force)):
            tried_n, tried_t = balanced[2 * m] + correction[2 * m], balanced[2 * m + 1] + correction[2 * m + 1]
            fn, ft = _into_cone(tried_n, tried_t, limit[m])
            correction[2 * m], correction[2 * m + 1] = tried_n - fn, tried_t - ft
            change = max(change, abs(fn - flat[2 * m]), abs(ft - flat[2 * m + 1]))
            flat[2 * m], flat[2 * m + 1] = fn, ft
        if step % CHECKED == 0 and change < close:
            break


@njit(inline="always")
def _into_cone(fn, ft, friction):  # type: ignore[no-untyped-def]
    """The nearest force with f_n ≥ 0 and |f_t| ≤ μ f_n."""
    along = max((fn + friction * abs(ft)) / (1.0 + friction * friction), 0.0)
    if abs(ft) > friction * fn:
        return along, friction * along if ft >= 0.0 else -friction * along
    return fn, ft
