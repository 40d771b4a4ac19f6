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
    free: Bool[NDArray[np.bool_], " c"]  # contacts whose force might change
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
    force, correction = found.copy(), np.zeros_like(found)
    for step in range(STEPS):
        balanced = (force.ravel() - inverse @ (matrix @ force.ravel() - wanted)).reshape(-1, 2)
        before, force = force, _into_cones(balanced + correction, limit)
        correction = balanced + correction - force
        if step % CHECKED == 0 and np.abs(force - before).max(initial=0.0) < 0.01 * close:
            break
    return force


def _into_cones(force: Array, limit: Array) -> Array:
    """The nearest forces (m, 2) with f_n ≥ 0 and |f_t| ≤ μ f_n; limit (m,): μ."""
    fn, ft = force[:, 0], force[:, 1]
    along = np.maximum((fn + limit * np.abs(ft)) / (1.0 + limit**2), 0.0)
    beyond = np.abs(ft) > limit * fn
    return np.stack([np.where(beyond, along, fn), np.where(beyond, np.copysign(limit * along, ft), ft)], axis=1)
