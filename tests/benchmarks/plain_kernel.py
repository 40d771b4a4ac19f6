"""Reference kernel: the same Gauss-Seidel scheme, written plainly in numba.

One array per quantity, contacts in the order of detection, walls as bodies without compliance, a branch per case of
Coulomb's law. It shares no code with the solver, so that a fault there does not change both.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from rodsight.solver.bodies.grains import Array, GrainMotion, Grains
from rodsight.solver.bodies.walls import Walls
from rodsight.solver.contacts.contacts import Contacts
from rodsight.solver.nlgs.problem import PLATE_IMPEDANCE


class PlainProblem(NamedTuple):
    i: NDArray[np.int64]  # (c,) grain
    j: NDArray[np.int64]  # (c,) grain, or n + wall
    nx: Array  # (c,)
    ny: Array  # (c,)
    radius: Array  # (n + w,) [m], 0 of a wall
    compliance: Array  # (n + w,) [m/(N s)] of a centre
    rotational: Array  # (n + w,) [rad/(N m s)] compliance of a rotation
    plate: NDArray[np.bool_]  # (n + w,) moves along its normal alone


def plain_problem(
    grains: Grains, walls: Walls, contacts: Contacts, impedance: Array, order: NDArray[np.int64]
) -> PlainProblem:
    """Arrange the quantities of contacts in the order of visits; impedance (n,) [N s/m]."""
    n = grains.count
    plate = np.where(walls.loaded, 1.0 / (PLATE_IMPEDANCE * impedance.mean()), 0.0)
    return PlainProblem(
        contacts.i[order].astype(np.int64),
        contacts.j[order].astype(np.int64),
        contacts.normal[order, 0].copy(),
        contacts.normal[order, 1].copy(),
        np.concatenate([grains.radius, np.zeros(walls.count)]),
        np.concatenate([1.0 / impedance, plate]),
        np.concatenate([2.0 / (impedance * grains.radius**2), np.zeros(walls.count)]),
        np.arange(n + walls.count) >= n,
    )


def plain_state(grains: Grains, motion: GrainMotion, walls: Walls, impedance: Array) -> tuple[Array, Array, Array]:
    """Velocities (n + w,) of all bodies without contact forces: vx, vy [m/s], spin [rad/s]."""
    pull = np.where(walls.loaded, -np.nan_to_num(walls.load) / (PLATE_IMPEDANCE * impedance.mean()), 0.0)
    velocity = np.concatenate([motion.velocity, pull[:, None] * walls.outward])
    return velocity[:, 0].copy(), velocity[:, 1].copy(), np.concatenate([motion.spin, np.zeros(walls.count)])


@njit(cache=True)
def plain_sweeps(problem, vx, vy, spin, fn, ft, friction, sweeps):  # type: ignore[no-untyped-def]
    """Sweep in place over forces fn, ft (c,) [N] in the order of the problem."""
    i, j, nx, ny, radius, compliance, rotational, plate = problem
    for _ in range(sweeps):
        for c in range(len(i)):
            a, b = i[c], j[c]
            tx, ty = -ny[c], nx[c]
            dx, dy = vx[b] - vx[a], vy[b] - vy[a]
            un = dx * nx[c] + dy * ny[c]
            ut = dx * tx + dy * ty - radius[a] * spin[a] - radius[b] * spin[b]
            wnn = compliance[a] + compliance[b]
            wtt = compliance[a] + radius[a] ** 2 * rotational[a]
            if not plate[b]:
                wtt += compliance[b] + radius[b] ** 2 * rotational[b]
            new_n = fn[c] - un / wnn
            new_t = ft[c] - ut / wtt
            if new_n <= 0.0:
                new_n = 0.0
                new_t = 0.0
            elif new_t > friction * new_n:
                new_t = friction * new_n
            elif new_t < -friction * new_n:
                new_t = -friction * new_n
            change_n, change_t = new_n - fn[c], new_t - ft[c]
            fn[c] = new_n
            ft[c] = new_t
            fx, fy = change_n * nx[c] + change_t * tx, change_n * ny[c] + change_t * ty
            vx[a] -= compliance[a] * fx
            vy[a] -= compliance[a] * fy
            spin[a] -= rotational[a] * radius[a] * change_t
            if plate[b]:
                vx[b] += compliance[b] * change_n * nx[c]
                vy[b] += compliance[b] * change_n * ny[c]
            else:
                vx[b] += compliance[b] * fx
                vy[b] += compliance[b] * fy
                spin[b] -= rotational[b] * radius[b] * change_t
