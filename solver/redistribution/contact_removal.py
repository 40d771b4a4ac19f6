"""Removal of one contact: the nearest forces around it that preserve the resultants without it.

The motion is not used again. Among all forces that preserve the resultant of every grain in the neighbourhood and
satisfy f_n ≥ 0 and |f_t| ≤ μ f_n, the result has the least sum of squared differences from the given forces. Forces
beyond the neighbourhood are unchanged.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from ..bodies.grains import Array, Grains
from ..contacts.contacts import Contacts
from .nearest_forces import REACH, nearest_forces, neighbourhood, resultants


@dataclass(frozen=True, slots=True)
class Removal:
    """Forces without one contact."""

    fn: Float[Array, " c"]  # [N]; 0 for the removed contact
    ft: Float[Array, " c"]  # [N]
    free: Bool[np.ndarray, " c"]  # contacts whose force may change
    unbalance: float  # greatest residual of a resultant over the mean f_n; large where no forces can replace it


def remove_contact(
    grains: Grains, contacts: Contacts, fn: Array, ft: Array, row: int, *, friction: Array, reach: int = REACH
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
    before = np.flatnonzero(free)
    resultant = resultants(grains, contacts, before, members) @ np.concatenate([fn[before], ft[before]])
    free[row] = False
    rows = np.flatnonzero(free)
    matrix = resultants(grains, contacts, rows, members)
    scale = max(float(np.mean(np.abs(fn))), 1e-300)
    changed = nearest_forces(matrix, resultant, np.concatenate([fn[rows], ft[rows]]), friction[rows], scale)
    new_fn, new_ft = fn.copy(), ft.copy()
    new_fn[rows], new_ft[rows] = changed.reshape(2, -1)
    new_fn[row] = new_ft[row] = 0.0
    worst = float(np.abs(matrix @ changed - resultant).max(initial=0.0)) / scale
    return Removal(new_fn, new_ft, free, worst)
