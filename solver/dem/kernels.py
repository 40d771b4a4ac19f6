"""The time step of the discrete-element simulation: springs and dashpots in, motion out.

Conventions: the force of contact (i, j) is the one i exerts on j, f_n along the normal n from i
to j, f_t along t, n turned by +90°. Relative velocities are those of j as seen from i.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from solver.bodies.grains import Array

# columns of the grains' state
X, Y, THETA, VX, VY, OMEGA = range(6)
# columns of the frame's state and of its constants
SHEAR, HEIGHT, RISE = range(3)
WIDTH, PLATE_MASS, LOAD, PLATE_DAMPING = range(4)
# rows of walls
BOTTOM, RIGHT, TOP, LEFT = range(4)


class Bodies(NamedTuple):
    state: Array  # (n, 6) x, y [m], θ [rad], vx, vy [m/s] and ω [rad/s] half a step earlier
    force: Array  # (n, 3) fx, fy [N], torque [N m] of the last step
    radius: Array  # (n,) [m]
    mass: Array  # (n,) [kg]
    frame: Array  # (3,) shear angle [rad], height of the plate [m], its velocity [m/s]
    frame_constants: Array  # (4,) width [m], plate mass [kg], load [N] (NaN: the plate is held), damping [N s/m]


class Pairs(NamedTuple):
    """Neighbours and the forces between them; j is a grain, or a wall in the wall list."""

    i: NDArray[np.int32]  # (p,)
    j: NDArray[np.int32]  # (p,)
    damping: Array  # (p,) [N s/m], normal dashpot
    spring: Array  # (p,) [N], elastic part of f_t
    fn: Array  # (p,) [N]
    ft: Array  # (p,) [N]


class Law(NamedTuple):
    time_step: float  # [s]
    normal_stiffness: float  # [N/m]
    tangential_stiffness: float  # [N/m]
    tangential_damping: float  # –, tangential over normal dashpot
    friction: float
    wall_friction: float
    drag: float  # [1/s], preparation only
    gravity_x: float  # [m/s²]
    gravity_y: float


@njit(cache=True)
def contact_force(
    overlap: float, un: float, ut: float, damping: float, spring: float, friction: float, law: Law
) -> tuple[float, float, float]:
    """Return f_n, f_t [N] and the new tangential spring of a closed contact."""
    fn = law.normal_stiffness * overlap - damping * un
    if fn < 0.0:  # a dashpot does not pull
        fn = 0.0
    spring -= law.tangential_stiffness * ut * law.time_step
    ft = spring - law.tangential_damping * damping * ut
    limit = friction * fn
    if ft > limit:
        ft = limit
        spring = limit
    elif ft < -limit:
        ft = -limit
        spring = -limit
    return fn, ft, spring


@njit(cache=True)
def grain_forces(bodies: Bodies, pairs: Pairs, law: Law) -> None:
    """Add the forces between grains to `bodies.force`."""
    state, force, radius = bodies.state, bodies.force, bodies.radius
    for p in range(pairs.i.shape[0]):
        i, j = pairs.i[p], pairs.j[p]
        dx = state[j, X] - state[i, X]
        dy = state[j, Y] - state[i, Y]
        touch = radius[i] + radius[j]
        square = dx * dx + dy * dy
        if square >= touch * touch:
            pairs.spring[p] = 0.0
            pairs.fn[p] = 0.0
            pairs.ft[p] = 0.0
            continue
        distance = np.sqrt(square)
        nx, ny = dx / distance, dy / distance
        dvx = state[j, VX] - state[i, VX]
        dvy = state[j, VY] - state[i, VY]
        un = nx * dvx + ny * dvy
        ut = nx * dvy - ny * dvx - radius[i] * state[i, OMEGA] - radius[j] * state[j, OMEGA]
        fn, ft, pairs.spring[p] = contact_force(
            touch - distance, un, ut, pairs.damping[p], pairs.spring[p], law.friction, law
        )
        pairs.fn[p] = fn
        pairs.ft[p] = ft
        fx = fn * nx - ft * ny
        fy = fn * ny + ft * nx
        force[j, 0] += fx
        force[j, 1] += fy
        force[j, 2] -= radius[j] * ft
        force[i, 0] -= fx
        force[i, 1] -= fy
        force[i, 2] -= radius[i] * ft


@njit(cache=True)
def wall_forces(bodies: Bodies, pairs: Pairs, law: Law, shear_rate: float) -> float:
    """Add the walls' forces to `bodies.force`; return the normal force on the plate [N].

    The frame is a linkage: the sides turn about the bottom corners, the plate keeps its length
    and its ends on the lines of the sides, so it moves sideways with them.
    """
    state, force, radius = bodies.state, bodies.force, bodies.radius
    shear, height, rise = bodies.frame[SHEAR], bodies.frame[HEIGHT], bodies.frame[RISE]
    width = bodies.frame_constants[WIDTH]
    sine, cosine = np.sin(shear), np.cos(shear)
    plate_speed = rise * sine / cosine + height * shear_rate / cosine**2
    plate_force = 0.0
    for p in range(pairs.i.shape[0]):
        i, wall = pairs.i[p], pairs.j[p]
        x, y = state[i, X], state[i, Y]
        wx, wy = 0.0, 0.0
        if wall == BOTTOM:
            nx, ny = 0.0, -1.0
            distance = y
        elif wall == TOP:
            nx, ny = 0.0, 1.0
            distance = height - y
            wx, wy = plate_speed, rise
        else:
            if wall == RIGHT:
                nx, ny = cosine, -sine
                distance = (width - x) * cosine + y * sine
                arm = (x - width) * sine + y * cosine
            else:
                nx, ny = -cosine, sine
                distance = x * cosine - y * sine
                arm = x * sine + y * cosine
            wx, wy = arm * shear_rate * cosine, -arm * shear_rate * sine
        if distance >= radius[i]:
            pairs.spring[p] = 0.0
            pairs.fn[p] = 0.0
            pairs.ft[p] = 0.0
            continue
        dvx, dvy = wx - state[i, VX], wy - state[i, VY]
        un = nx * dvx + ny * dvy
        ut = nx * dvy - ny * dvx - radius[i] * state[i, OMEGA]
        fn, ft, pairs.spring[p] = contact_force(
            radius[i] - distance, un, ut, pairs.damping[p], pairs.spring[p], law.wall_friction, law
        )
        pairs.fn[p] = fn
        pairs.ft[p] = ft
        force[i, 0] -= fn * nx - ft * ny
        force[i, 1] -= fn * ny + ft * nx
        force[i, 2] -= radius[i] * ft
        if wall == TOP:
            plate_force += fn
    return plate_force


@njit(cache=True)
def advance(bodies: Bodies, pairs: Pairs, wall_pairs: Pairs, law: Law, shear_rate: Array, reach: float) -> int:
    """Take one step per entry of `shear_rate` [rad/s]; stop early when two bodies may have approached by `reach` [m].

    Velocity Verlet with the velocities kept at the half steps. Return the number of steps taken.
    """
    state, force, mass, frame = bodies.state, bodies.force, bodies.mass, bodies.frame
    load, dt = bodies.frame_constants[LOAD], law.time_step
    keep = 1.0 - law.drag * dt
    travel = 0.0
    for step in range(shear_rate.shape[0]):
        fastest = 0.0
        for k in range(mass.shape[0]):
            a = dt / mass[k]
            state[k, VX] = keep * state[k, VX] + a * force[k, 0] + dt * law.gravity_x
            state[k, VY] = keep * state[k, VY] + a * force[k, 1] + dt * law.gravity_y
            state[k, OMEGA] = keep * state[k, OMEGA] + 2.0 * a * force[k, 2] / bodies.radius[k] ** 2
            state[k, X] += dt * state[k, VX]
            state[k, Y] += dt * state[k, VY]
            state[k, THETA] += dt * state[k, OMEGA]
            fastest = max(fastest, state[k, VX] ** 2 + state[k, VY] ** 2)
            force[k, 0] = 0.0
            force[k, 1] = 0.0
            force[k, 2] = 0.0
        rate = shear_rate[step]
        frame[SHEAR] += dt * rate
        frame[HEIGHT] += dt * frame[RISE]
        grain_forces(bodies, pairs, law)
        plate_force = wall_forces(bodies, wall_pairs, law, rate)
        if not np.isnan(load):
            damping = bodies.frame_constants[PLATE_DAMPING] * frame[RISE]
            frame[RISE] += dt * (plate_force - load - damping) / bodies.frame_constants[PLATE_MASS]
        grain_speed = np.sqrt(fastest)
        wall_speed = (abs(frame[RISE]) + abs(rate) * frame[HEIGHT]) / np.cos(frame[SHEAR]) ** 2
        travel += dt * (grain_speed + max(grain_speed, wall_speed))
        if travel > reach:
            return step + 1
    return shear_rate.shape[0]
