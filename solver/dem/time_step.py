"""Time step of the discrete-element simulation (velocity Verlet), for every boundary.

Velocities in a periodic cell exclude the homogeneous motion of the cell; a pair across an edge of the cell touches
through the image given by its numbers of cell vectors.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..bodies.grains import Array
from .boundaries import (
    AX,
    AY,
    BX,
    BY,
    CELL,
    FRAME,
    RIGHT,
    RING,
    RING_WALL,
    TOP,
    TOP_LEFT,
    TOP_RIGHT,
    Boundary,
    apply_loads,
    cell_rates,
    linkage_motion,
    move_boundary,
    wall_surface,
)
from .contact_law import Law, add_pair_force, add_wall_force, contact_force, rolling_force
from .elliptic_section import elliptic_radius, tilted_normal

X, Y, THETA, VX, VY, OMEGA = range(6)  # columns of the state of the grains
# Greatest moment of a disc on its base over friction and radius, for a uniform pressure.
BASE_ARM = 2.0 / 3.0


class DemBodies(NamedTuple):
    """State of the grains."""

    state: Array  # (n, 6) x, y [m], θ [rad], vx, vy [m/s] and ω [rad/s] half a step earlier
    force: Array  # (n, 3) fx, fy [N], torque [N m] of the last step
    radius: Array  # (n,) [m], the mean one of elliptic sections
    mass: Array  # (n,) [kg]
    base: Array  # (n, 3) springs of the base friction: fx, fy [N], moment over the radius [N]
    base_limit: Array  # (n,) [N], greatest friction of the base
    roughness: Array  # (n,) the friction of a contact is the mean of both grains' times the law's
    external: Array  # (n, 2) [N] further forces, as of a membrane
    axis: Array  # (n,) [rad] direction of the greatest radius at rotation zero, of elliptic sections


class DemPairs(NamedTuple):
    """Neighbours and the forces between them; j is a grain, or a wall in the list of walls."""

    i: NDArray[np.int32]  # (p,)
    j: NDArray[np.int32]  # (p,)
    image: NDArray[np.int64]  # (p, 2) numbers of cell vectors a and b that are added to the position of j
    damping: Array  # (p,) [N s/m], normal dashpot
    spring: Array  # (p,) [N], elastic part of f_t
    roll: Array  # (p,) [N], elastic part of the rolling moment on j over the rolling radius
    fn: Array  # (p,) [N]
    ft: Array  # (p,) [N]


@njit(cache=True)
def advance(
    bodies: DemBodies, pairs: DemPairs, wall_pairs: DemPairs, law: Law, boundary: Boundary, drive: Array, reach: float
) -> int:
    """Advance by one step per row of `drive`; stop early when two bodies may have approached by `reach` [m].

    drive (steps, d): imposed rates of the boundary, columns as named in `boundaries`. Return the number of steps done.
    """
    dt, travel = law.time_step, 0.0
    widest = 2.0 * bodies.radius.max() + reach
    for step in range(drive.shape[0]):
        row = drive[step]
        shear, stretch = cell_rates(boundary, row)
        grain_speed = move_grains(bodies, law, shear, stretch)
        move_boundary(boundary, row, dt, shear, stretch)
        work = grain_forces(bodies, pairs, law, boundary, shear, stretch)
        push = wall_forces(bodies, wall_pairs, law, boundary, row)
        base_forces(bodies, law)
        wall_speed = apply_loads(boundary, row, push, work, dt)
        approach = grain_speed + max(grain_speed, wall_speed)
        if boundary.kind == CELL:
            approach += (abs(shear) + abs(stretch)) * widest
        travel += dt * approach
        if travel > reach:
            return step + 1
    return drive.shape[0]


@njit(cache=True)
def move_grains(bodies: DemBodies, law: Law, shear: float, stretch: float) -> float:
    """Integrate velocities and positions by one step and reset the forces; return the greatest speed [m/s].

    shear, stretch [1/s]: a cell adds the velocity (stretch x + shear y, stretch y).
    """
    state, force, mass = bodies.state, bodies.force, bodies.mass
    dt = law.time_step
    keep = 1.0 - law.drag * dt
    fastest = 0.0
    for k in range(mass.shape[0]):
        a = dt / mass[k]
        state[k, VX] = keep * state[k, VX] + a * (force[k, 0] + bodies.external[k, 0]) + dt * law.gravity_x
        state[k, VY] = keep * state[k, VY] + a * (force[k, 1] + bodies.external[k, 1]) + dt * law.gravity_y
        state[k, OMEGA] = keep * state[k, OMEGA] + 2.0 * a * force[k, 2] / bodies.radius[k] ** 2
        x, y = state[k, X], state[k, Y]
        state[k, X] = x + dt * (state[k, VX] + stretch * x + shear * y)
        state[k, Y] = y + dt * (state[k, VY] + stretch * y)
        state[k, THETA] += dt * state[k, OMEGA]
        fastest = max(fastest, state[k, VX] ** 2 + state[k, VY] ** 2)
        force[k, 0] = 0.0
        force[k, 1] = 0.0
        force[k, 2] = 0.0
    return np.sqrt(fastest)


@njit(cache=True)
def grain_forces(
    bodies: DemBodies, pairs: DemPairs, law: Law, boundary: Boundary, shear: float, stretch: float
) -> float:
    """Add the forces between grains to `bodies.force`; return Σ f_n |branch vector| [N m], of round rods."""
    state, force, radius, cell = bodies.state, bodies.force, bodies.radius, boundary.state
    periodic, rolls, oval = boundary.kind == CELL, law.rolling_friction > 0.0, law.ovality > 0.0
    work = 0.0
    for p in range(pairs.i.shape[0]):
        i, j = pairs.i[p], pairs.j[p]
        dx = state[j, X] - state[i, X]
        dy = state[j, Y] - state[i, Y]
        if periodic:
            dx = dx + pairs.image[p, 0] * cell[AX] + pairs.image[p, 1] * cell[BX]
            dy = dy + pairs.image[p, 0] * cell[AY] + pairs.image[p, 1] * cell[BY]
        widest = (1.0 + law.ovality) * (radius[i] + radius[j])
        square = dx * dx + dy * dy
        if square >= widest * widest:
            open_contact(pairs, p)
            continue
        distance = np.sqrt(square)
        nx, ny = dx / distance, dy / distance
        # Arms of f_t and of f_n; the latter vanish for round sections.
        arm_i, arm_j, slope_i, slope_j = float(radius[i]), float(radius[j]), 0.0, 0.0
        overlap = arm_i + arm_j - distance
        if oval:
            arm_i, slope_i = elliptic_radius(arm_i, law.ovality, bodies.axis[i] + state[i, THETA], nx, ny)
            arm_j, slope_j = elliptic_radius(arm_j, law.ovality, bodies.axis[j] + state[j, THETA], nx, ny)
            if distance >= arm_i + arm_j:
                open_contact(pairs, p)
                continue
            overlap = arm_i + arm_j - distance
            nx, ny, cosine = tilted_normal(nx, ny, (slope_i + slope_j) / distance)
            overlap /= cosine
            arm_i, arm_j = cosine * arm_i, cosine * arm_j
            slope_i, slope_j = cosine * slope_i, cosine * slope_j
        dvx = state[j, VX] - state[i, VX]
        dvy = state[j, VY] - state[i, VY]
        if periodic:
            dvx = dvx + stretch * dx + shear * dy
            dvy = dvy + stretch * dy
        un = nx * dvx + ny * dvy + (slope_i * state[i, OMEGA] + slope_j * state[j, OMEGA])
        ut = nx * dvy - ny * dvx - arm_i * state[i, OMEGA] - arm_j * state[j, OMEGA]
        fn, ft, pairs.spring[p] = contact_force(
            overlap, un, ut, pairs.damping[p], pairs.spring[p],
            float(0.5 * (bodies.roughness[i] + bodies.roughness[j]) * law.friction), law,
        )  # fmt: skip
        pairs.fn[p] = fn
        pairs.ft[p] = ft
        add_pair_force(force, (arm_i, arm_j, slope_i, slope_j), i, j, nx, ny, fn, ft)
        work += fn * distance
        if rolls:
            arm = radius[i] * radius[j] / (radius[i] + radius[j])
            rolling = arm * (state[j, OMEGA] - state[i, OMEGA])
            moment, pairs.roll[p] = rolling_force(fn + law.adhesion, rolling, pairs.damping[p], pairs.roll[p], law)
            force[j, 2] += arm * moment
            force[i, 2] -= arm * moment
    return work


@njit(cache=True)
def wall_forces(bodies: DemBodies, pairs: DemPairs, law: Law, boundary: Boundary, drive: Array) -> tuple[float, float]:
    """Add the forces of the walls to `bodies.force`; beside elliptic sections they are flat.

    Return the sums of the forces [N] normal to plate and right side of a frame; on the ring or the plate of a box, and
    zero. The discs of the plate are part of it.
    """
    state, force, radius = bodies.state, bodies.force, bodies.radius
    linkage = linkage_motion(boundary, drive)
    first_wall = RING_WALL if boundary.kind == RING else TOP
    second_wall = RIGHT if boundary.kind == FRAME else -1
    first, second = 0.0, 0.0
    for p in range(pairs.i.shape[0]):
        i, wall = pairs.i[p], pairs.j[p]
        distance, nx, ny, wx, wy, spin = wall_surface(boundary, drive, linkage, wall, state[i, X], state[i, Y])
        arm, slope = float(radius[i]), 0.0
        if law.ovality > 0.0:
            arm, slope = elliptic_radius(arm, law.ovality, bodies.axis[i] + state[i, THETA], nx, ny)
        if distance >= arm:
            open_contact(pairs, p)
            continue
        dvx, dvy = wx - state[i, VX], wy - state[i, VY]
        un = nx * dvx + ny * dvy + slope * state[i, OMEGA]
        ut = nx * dvy - ny * dvx - arm * state[i, OMEGA]
        fn, ft, pairs.spring[p] = contact_force(
            float(arm - distance), un, ut, pairs.damping[p], pairs.spring[p], law.wall_friction, law
        )
        pairs.fn[p] = fn
        pairs.ft[p] = ft
        add_wall_force(force, (arm, slope), i, nx, ny, fn, ft)
        if law.rolling_friction > 0.0:
            rolling = radius[i] * (spin - state[i, OMEGA])
            moment, pairs.roll[p] = rolling_force(fn + law.adhesion, rolling, pairs.damping[p], pairs.roll[p], law)
            force[i, 2] -= radius[i] * moment
        if wall == first_wall:
            first += fn
        elif wall == second_wall:
            second += fn
        elif boundary.kind == FRAME and wall in (TOP_RIGHT, TOP_LEFT):
            first += fn * ny + ft * nx
    return first, second


@njit(cache=True)
def base_forces(bodies: DemBodies, law: Law) -> None:
    """Add the friction of the base on which the discs lie flat to `bodies.force`: springs with dashpots, limited."""
    state, force, base = bodies.state, bodies.force, bodies.base
    for k in range(bodies.mass.shape[0]):
        limit = bodies.base_limit[k]
        if limit == 0.0:
            continue
        damping = np.sqrt(law.tangential_stiffness * bodies.mass[k])
        base[k, 0] -= law.tangential_stiffness * law.time_step * state[k, VX]
        base[k, 1] -= law.tangential_stiffness * law.time_step * state[k, VY]
        base[k, 2] -= law.tangential_stiffness * law.time_step * bodies.radius[k] * state[k, OMEGA]
        fx = base[k, 0] - damping * state[k, VX]
        fy = base[k, 1] - damping * state[k, VY]
        moment = base[k, 2] - damping * bodies.radius[k] * state[k, OMEGA]
        size = np.sqrt(fx * fx + fy * fy)
        if size > limit:
            fx *= limit / size
            fy *= limit / size
            base[k, 0] = fx
            base[k, 1] = fy
        if abs(moment) > BASE_ARM * limit:
            moment = BASE_ARM * limit if moment > 0.0 else -BASE_ARM * limit
            base[k, 2] = moment
        force[k, 0] += fx
        force[k, 1] += fy
        force[k, 2] += bodies.radius[k] * moment


@njit(cache=True)
def open_contact(pairs: DemPairs, p: int) -> None:
    """Set forces and springs of a pair to zero."""
    pairs.spring[p] = 0.0
    pairs.roll[p] = 0.0
    pairs.fn[p] = 0.0
    pairs.ft[p] = 0.0
