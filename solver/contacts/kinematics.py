"""Equilibrium matrix of a contact set, and its transpose: the relative motion at the contacts.

One matrix H says both. H f is the force that the contacts exert on every degree of freedom;
Hᵀ v is the relative velocity at the contacts when the degrees of freedom move with v.

Degrees of freedom, in this order: the grains' x, the grains' y, the grains' rotation, then every
plate under load along its outward normal. Contact unknowns: all normal components, then all
tangential ones.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

from solver.bodies.grains import Array
from solver.bodies.walls import Walls
from solver.contacts.contacts import Contacts


def equilibrium_matrix(contacts: Contacts, radius: Array, walls: Walls) -> csr_matrix:
    """Assemble H, sparse (3n + p, 2c): n grains, p plates under load, c contacts.

    radius (n,) [m]. Rows 0 … 2n − 1 give forces [N], rows 2n … 3n − 1 torques [N m], the last p rows
    the force [N] on each loaded plate along its outward normal, in the order of the walls.
    Grains without a contact have empty rows.
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
    # Both grains of a contact are turned the same way: the levers R n and −R n act on −f and f.
    add(2 * n + i, c + column, -radius[i])
    add(2 * n + j[pair], c + column[pair], -radius[j[pair]])

    plate_of_wall = np.cumsum(walls.loaded) - 1
    on_plate = np.flatnonzero(~pair)
    on_plate = on_plate[walls.loaded[j[on_plate] - n]]
    add(3 * n + plate_of_wall[j[on_plate] - n], on_plate, np.ones(len(on_plate)))

    shape = (3 * n + int(walls.loaded.sum()), 2 * c)
    return csr_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=shape)


def external_load(mass: Array, walls: Walls, gravity: tuple[float, float] = (0.0, 0.0)) -> Array:
    """Give b of the balance H f = b (3n + p,): minus the weights, zero torques, the plates' loads.

    mass (n,) [kg]; gravity [m/s²]. A plate is in balance when its grains push it outward as much as
    its load presses it inward.
    """
    return np.concatenate([-mass * gravity[0], -mass * gravity[1], np.zeros(len(mass)), walls.load[walls.loaded]])


def relative_motion(
    contacts: Contacts, radius: Array, translation: Array, rotation: Array, walls: Walls
) -> tuple[Array, Array]:
    """Give the motion of j as seen from i at every contact, (u_n, u_t), each (c,).

    translation (n, 2) and rotation (n,) are velocities [m/s, rad/s], or displacements [m, rad] if
    `walls.velocity` holds the displacements of the endpoints too, and the cell's that of its vectors. u_n > 0 opens.
    A contact of a grain whose motion is NaN is NaN.
    """
    i, j = contacts.i, contacts.j
    wall = contacts.with_wall
    motion = -translation[i]
    turn = -radius[i] * rotation[i]
    motion[~wall] += translation[j[~wall]]
    turn[~wall] -= radius[j[~wall]] * rotation[j[~wall]]
    if walls.cell is not None and contacts.shift is not None:
        motion += walls.cell.drift(contacts.shift)
    motion[wall] += walls.velocity_at(j[wall] - contacts.grain_count, contacts.point[wall])
    un = np.einsum("ij,ij->i", motion, contacts.normal)
    ut = np.einsum("ij,ij->i", motion, contacts.tangent) + turn
    return un, ut
