"""Nearest balanced forces around contacts whose friction or geometry is another one.

The motion is not used again: as for a contact that is removed, the result is the force field with the least sum of
squared differences from the given one that preserves the resultant of every grain in the neighbourhood and satisfies
f_n ≥ 0 and |f_t| ≤ μ f_n.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..bodies.grains import Array, Grains
from ..contacts.contacts import Contacts
from .nearest_forces import REACH, nearest_forces, neighbourhood, resultants

WITHIN = 1e-3  # of the mean normal force: a friction force that is so little beyond the cone is within it


def limit_friction(grains: Grains, contacts: Contacts, fn: Array, ft: Array, *, friction: Array) -> tuple[Array, Array]:
    """Return the nearest balanced forces (c,), (c,) within cones of another coefficient, one neighbourhood at a time.

    Forces that are within their cones stay as they are, so a larger coefficient changes nothing.

    Parameters
    ----------
    grains, contacts
        Bodies and contacts of the frame.
    fn, ft : (c,)
        Forces [N].
    friction : (c,)
        The coefficient of every contact.
    """
    beyond = np.abs(ft) - friction * fn
    enough = WITHIN * max(float(np.mean(np.abs(fn))), 1e-300)
    for row in np.argsort(-beyond, kind="stable").tolist():
        if np.abs(ft[row]) - friction[row] * fn[row] > enough:  # not solved beside another one
            force, rows = np.stack([fn, ft]), np.array([row])
            fn, ft = rebalance(grains, contacts, force, rows, friction=friction)
    return fn, ft


def rebalance(
    grains: Grains,
    contacts: Contacts,
    force: Array,
    rows: NDArray[np.intp],
    *,
    friction: Array,
    moved: Contacts | None = None,
) -> Array:
    """Return the nearest balanced forces (2, c), f_n and f_t, around some contacts.

    Parameters
    ----------
    grains, contacts
        Bodies and contacts of the frame, for which the forces are in balance with what they carry.
    force : (2, c)
        f_n and f_t [N].
    rows
        Contacts that have changed.
    friction : (c,)
        The coefficient of every contact.
    moved
        The same contacts with other normals; None: as they are.
    """
    touching, members = neighbourhood(grains, contacts, rows, REACH)
    free = np.flatnonzero(touching)
    given = force[:, free].ravel()
    carried = resultants(grains, contacts, free, members) @ given
    matrix = resultants(grains, contacts if moved is None else moved, free, members)
    scale = max(float(np.mean(np.abs(force[0]))), 1e-300)
    changed = force.copy()
    changed[:, free] = nearest_forces(matrix, carried, given, friction[free], scale).reshape(2, -1)
    return changed
