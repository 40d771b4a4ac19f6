"""Equilibrium matrix H of a contact set, and the relative motion at the contacts, Hᵀ v.

H f is the force that the contacts exert on every degree of freedom; Hᵀ v is the relative velocity at the contacts for
velocities v of the degrees of freedom.

Degrees of freedom, in this order: the grains' x, the grains' y, the grains' rotation, then every
plate under load along its outward normal. Contact unknowns: all normal components, then all
tangential ones.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

from ..bodies.grains import Array
from ..bodies.walls import Walls
from .contacts import Contacts


def equilibrium_matrix(contacts: Contacts, radius: Array, walls: Walls) -> csr_matrix:
    """Assemble the equilibrium matrix H.

    Parameters
    ----------
    contacts
        Contacts, c in number, of n grains.
    radius : (n,)
        Radii [m].
    walls
        Walls, of which p are plates under load.

    Returns
    -------
    (3n + p, 2c) sparse
        Rows 0 … 2n − 1 give forces [N], rows 2n … 3n − 1 torques [N m], the last p rows the force [N] on each loaded
        plate and the walls fixed to it, along its outward normal, in the order of the walls. Rows of grains without a
        contact are empty.
    """
    n, c = contacts.grain_count, contacts.count
    i, j, normal, tangent = contacts.i, contacts.j, contacts.normal, contacts.tangent
    column = np.arange(c)
    pair = ~contacts.with_wall
    rows, columns, values = [], [], []

    def add(row: np.ndarray, column: np.ndarray, value: np.ndarray) -> None:
        rows.append(row)
        columns.append(column)
        values.append(value)

    for axis in range(2):
        for offset, direction in ((0, normal), (c, tangent)):
            add(axis * n + i, offset + column, -direction[:, axis])
            add(axis * n + j[pair], offset + column[pair], direction[pair, axis])
    # The torques on both grains have the same sign: the arms R n and −R n belong to −f and f.
    add(2 * n + i, c + column, -radius[i])
    add(2 * n + j[pair], c + column[pair], -radius[j[pair]])

    plate_of_wall = np.cumsum(walls.loaded) - 1
    at_wall = np.flatnonzero(~pair)
    plate, along_normal, along_tangent = walls.plate_components(j[at_wall] - n, normal[at_wall])
    loaded = walls.loaded[plate]
    on_plate, row = at_wall[loaded], 3 * n + plate_of_wall[plate[loaded]]
    add(row, on_plate, along_normal[loaded])
    fixed = along_tangent[loaded] != 0.0
    add(row[fixed], c + on_plate[fixed], along_tangent[loaded][fixed])

    shape = (3 * n + int(walls.loaded.sum()), 2 * c)
    return csr_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=shape)


def external_load(weight: Array, walls: Walls, moment: Array | None = None) -> Array:
    """Return b (3n + p,) of the equilibrium H f = b: minus the weights and moments, the loads of the plates.

    weight (n, 2) [N]; moment (n,) [N m], None: zero.
    """
    torque = np.zeros(len(weight)) if moment is None else -moment
    return np.concatenate([-weight[:, 0], -weight[:, 1], torque, walls.load[walls.loaded]])


def relative_motion(
    contacts: Contacts, radius: Array, translation: Array, rotation: Array, walls: Walls
) -> tuple[Array, Array]:
    """Return the motion of j relative to i at the contacts.

    Parameters
    ----------
    contacts
        Contacts, c in number.
    radius : (n,)
        Radii [m].
    translation, rotation : (n, 2), (n,)
        Velocities [m/s, rad/s], or displacements [m, rad] if `walls.velocity` and the rate of the cell are
        displacements, too.
    walls
        Walls or cell.

    Returns
    -------
    un, ut : (c,)
        Normal component, positive where the contact opens, and tangential component; NaN where the motion is NaN.

    Notes
    -----
    u_n = n·(v_j − v_i), u_t = t·(v_j − v_i) − R_i ω_i − R_j ω_j; for a wall v_j is its velocity at the contact point
    and R_j ω_j = 0.
    """
    i, j = contacts.i, contacts.j
    wall = contacts.with_wall
    motion = -translation[i]
    rolling = -radius[i] * rotation[i]
    motion[~wall] += translation[j[~wall]]
    rolling[~wall] -= radius[j[~wall]] * rotation[j[~wall]]
    if walls.cell is not None and contacts.shift is not None:
        motion += walls.cell.drift(contacts.shift)
    motion[wall] += walls.velocity_at(j[wall] - contacts.grain_count, contacts.point[wall])
    un = np.einsum("ij,ij->i", motion, contacts.normal)
    ut = np.einsum("ij,ij->i", motion, contacts.tangent) + rolling
    return un, ut
