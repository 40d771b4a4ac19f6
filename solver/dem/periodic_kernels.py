"""The time step of a simulation in a periodic cell: the cell deforms, and the packing with it.

The laws of contacts are those of `kernels`. Velocities are kept less the cell's homogeneous motion, which moves every
grain by its place; a pair across the edge touches by the image that its whole numbers of cell vectors name.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.dem.kernels import OMEGA, THETA, VX, VY, Law, X, Y, contact_force, press_apart


class PeriodicBodies(NamedTuple):
    state: Array  # (n, 6) x, y [m], θ [rad], vx, vy [m/s] beyond the cell's motion and ω [rad/s], half a step earlier
    force: Array  # (n, 3) fx, fy [N], torque [N m] of the last step
    radius: Array  # (n,) [m]
    mass: Array  # (n,) [kg]
    cell: Array  # (2, 2) [m] vectors a, b by rows
    pressure: Array  # (1,) [N/m²] half the trace of the stress of the last step


class PeriodicPairs(NamedTuple):
    """Neighbours and the forces between them."""

    i: NDArray[np.int32]  # (p,)
    j: NDArray[np.int32]  # (p,)
    image: NDArray[np.int64]  # (p, 2) how often a and b are added to the place of j
    damping: Array  # (p,) [N s/m], normal dashpot
    spring: Array  # (p,) [N], elastic part of f_t
    fn: Array  # (p,) [N]
    ft: Array  # (p,) [N]


class Servo(NamedTuple):
    """What holds the pressure: the cell shrinks at (wanted − pressure) / viscosity."""

    wanted: float  # [Pa]
    viscosity: float  # [Pa s]
    fastest: float  # [1/s] rate of either side's length
    length: float  # [m] of the rods


@njit(cache=True)
def pair_forces(bodies: PeriodicBodies, pairs: PeriodicPairs, law: Law, shear: float, stretch: float) -> float:
    """Add the forces between grains to `bodies.force`; return Σ f · ℓ [N m].

    shear, stretch [1/s]: the cell moves by (stretch x + shear y, stretch y).
    """
    state, force, radius, cell = bodies.state, bodies.force, bodies.radius, bodies.cell
    work = 0.0
    for p in range(pairs.i.shape[0]):
        i, j = pairs.i[p], pairs.j[p]
        dx = state[j, X] - state[i, X] + pairs.image[p, 0] * cell[0, 0] + pairs.image[p, 1] * cell[1, 0]
        dy = state[j, Y] - state[i, Y] + pairs.image[p, 0] * cell[0, 1] + pairs.image[p, 1] * cell[1, 1]
        touch = radius[i] + radius[j]
        square = dx * dx + dy * dy
        if square >= touch * touch:
            pairs.spring[p] = 0.0
            pairs.fn[p] = 0.0
            pairs.ft[p] = 0.0
            continue
        distance = np.sqrt(square)
        nx, ny = dx / distance, dy / distance
        dvx = state[j, VX] - state[i, VX] + stretch * dx + shear * dy
        dvy = state[j, VY] - state[i, VY] + stretch * dy
        un = nx * dvx + ny * dvy
        ut = nx * dvy - ny * dvx - radius[i] * state[i, OMEGA] - radius[j] * state[j, OMEGA]
        fn, ft, pairs.spring[p] = contact_force(
            touch - distance, un, ut, pairs.damping[p], pairs.spring[p], law.friction, law
        )
        pairs.fn[p] = fn
        pairs.ft[p] = ft
        press_apart(force, radius, i, j, nx, ny, fn, ft)
        work += fn * distance
    return work


@njit(cache=True)
def advance_periodic(
    bodies: PeriodicBodies, pairs: PeriodicPairs, law: Law, servo: Servo, drive: Array, reach: float
) -> int:
    """Take one step per row of `drive` (steps,), shear rates [1/s]; stop early when bodies may be `reach` [m] nearer.

    Return the number of steps taken.
    """
    state, force, mass, cell = bodies.state, bodies.force, bodies.mass, bodies.cell
    dt = law.time_step
    keep = 1.0 - law.drag * dt
    widest = 2.0 * bodies.radius.max() + reach
    travel = 0.0
    for step in range(drive.shape[0]):
        shear = drive[step]
        stretch = (bodies.pressure[0] - servo.wanted) / servo.viscosity
        stretch = min(max(stretch, -servo.fastest), servo.fastest)
        fastest = 0.0
        for k in range(mass.shape[0]):
            a = dt / mass[k]
            state[k, VX] = keep * state[k, VX] + a * force[k, 0]
            state[k, VY] = keep * state[k, VY] + a * force[k, 1]
            state[k, OMEGA] = keep * state[k, OMEGA] + 2.0 * a * force[k, 2] / bodies.radius[k] ** 2
            x, y = state[k, X], state[k, Y]
            state[k, X] = x + dt * (state[k, VX] + stretch * x + shear * y)
            state[k, Y] = y + dt * (state[k, VY] + stretch * y)
            state[k, THETA] += dt * state[k, OMEGA]
            fastest = max(fastest, state[k, VX] ** 2 + state[k, VY] ** 2)
            force[k, 0] = 0.0
            force[k, 1] = 0.0
            force[k, 2] = 0.0
        for row in range(2):
            x, y = cell[row, 0], cell[row, 1]
            cell[row, 0] = x + dt * (stretch * x + shear * y)
            cell[row, 1] = y + dt * stretch * y
        work = pair_forces(bodies, pairs, law, shear, stretch)
        area = abs(cell[0, 0] * cell[1, 1] - cell[0, 1] * cell[1, 0])
        bodies.pressure[0] = work / (2.0 * area * servo.length)
        travel += dt * (2.0 * np.sqrt(fastest) + (abs(shear) + abs(stretch)) * widest)
        if travel > reach:
            return step + 1
    return drive.shape[0]
