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
# columns of the frame's state, of its drive, and of a plate's constants
SHEAR, HEIGHT, RISE, WIDTH, SPREAD = range(5)
SHEAR_RATE, RISE_RATE, SPREAD_RATE = range(3)
PLATE_MASS, LOAD, PLATE_DAMPING = range(3)
# rows of walls
BOTTOM, RIGHT, TOP, LEFT = range(4)
# of a disc that turns on its base under evenly spread friction: its moment over that friction and its radius
BASE_ARM = 2.0 / 3.0


class Bodies(NamedTuple):
    state: Array  # (n, 6) x, y [m], θ [rad], vx, vy [m/s] and ω [rad/s] half a step earlier
    force: Array  # (n, 3) fx, fy [N], torque [N m] of the last step
    radius: Array  # (n,) [m]
    mass: Array  # (n,) [kg]
    frame: Array  # (5,) shear angle [rad], height of the plate [m], its velocity [m/s], width [m], its velocity [m/s]
    plates: Array  # (2, 3) top and right: mass [kg], load [N] (NaN: it moves as it is driven), damping [N s/m]
    base: Array  # (n, 3) elastic friction of the base: fx, fy [N], moment over the radius [N]
    base_limit: Array  # (n,) [N], the greatest friction of the base


class Pairs(NamedTuple):
    """Neighbours and the forces between them; j is a grain, or a wall in the wall list."""

    i: NDArray[np.int32]  # (p,)
    j: NDArray[np.int32]  # (p,)
    damping: Array  # (p,) [N s/m], normal dashpot
    spring: Array  # (p,) [N], elastic part of f_t
    roll: Array  # (p,) [N], rolling moment on j over the rolling radius
    fn: Array  # (p,) [N]
    ft: Array  # (p,) [N]


class Law(NamedTuple):
    time_step: float  # [s]
    normal_stiffness: float  # [N/m]
    tangential_stiffness: float  # [N/m]
    tangential_damping: float  # –, tangential over normal dashpot
    friction: float
    wall_friction: float
    rolling_friction: float  # greatest rolling moment over f_n and the rolling radius
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
def rolling_force(fn: float, turning: float, damping: float, roll: float, law: Law) -> tuple[float, float]:
    """Return the rolling moment on j over the rolling radius [N] and its new spring.

    turning [m/s]: angular velocity of j as seen from i, times the rolling radius.
    """
    roll -= law.tangential_stiffness * turning * law.time_step
    moment = roll - law.tangential_damping * damping * turning
    limit = law.rolling_friction * fn
    if moment > limit:
        return limit, limit
    if moment < -limit:
        return -limit, -limit
    return moment, roll


@njit(cache=True)
def base_forces(bodies: Bodies, law: Law) -> None:
    """Add to `bodies.force` the friction of a base on which the discs lie flat: a spring, cut at its limit."""
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
        turn = base[k, 2] - damping * bodies.radius[k] * state[k, OMEGA]
        size = np.sqrt(fx * fx + fy * fy)
        if size > limit:
            fx *= limit / size
            fy *= limit / size
            base[k, 0] = fx
            base[k, 1] = fy
        if abs(turn) > BASE_ARM * limit:
            turn = BASE_ARM * limit if turn > 0.0 else -BASE_ARM * limit
            base[k, 2] = turn
        force[k, 0] += fx
        force[k, 1] += fy
        force[k, 2] += bodies.radius[k] * turn


@njit(cache=True)
def press_apart(force: Array, radius: Array, i: int, j: int, nx: float, ny: float, fn: float, ft: float) -> None:
    """Add the forces f_n, f_t [N] of a contact with normal n from grain i to j to those on both (n, 3)."""
    fx = fn * nx - ft * ny
    fy = fn * ny + ft * nx
    force[j, 0] += fx
    force[j, 1] += fy
    force[j, 2] -= radius[j] * ft
    force[i, 0] -= fx
    force[i, 1] -= fy
    force[i, 2] -= radius[i] * ft


@njit(cache=True)
def press_on_wall(force: Array, radius: Array, i: int, nx: float, ny: float, fn: float, ft: float) -> None:
    """Add the forces f_n, f_t [N] of a contact with normal n from grain i to a wall to those on the grain (n, 3)."""
    force[i, 0] -= fn * nx - ft * ny
    force[i, 1] -= fn * ny + ft * nx
    force[i, 2] -= radius[i] * ft


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
            pairs.roll[p] = 0.0
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
        press_apart(force, radius, i, j, nx, ny, fn, ft)
        if law.rolling_friction > 0.0:
            arm = radius[i] * radius[j] / touch
            turning = arm * (state[j, OMEGA] - state[i, OMEGA])
            moment, pairs.roll[p] = rolling_force(fn, turning, pairs.damping[p], pairs.roll[p], law)
            force[j, 2] += arm * moment
            force[i, 2] -= arm * moment


@njit(cache=True)
def wall_forces(bodies: Bodies, pairs: Pairs, law: Law, shear_rate: float) -> tuple[float, float]:
    """Add the walls' forces to `bodies.force`; return the normal forces on the plate and on the right side [N].

    The frame is a linkage: the sides turn about the bottom corners, the plate keeps its length
    and its ends on the lines of the sides, so it moves sideways with them. The right side may move along the bottom.
    """
    state, force, radius = bodies.state, bodies.force, bodies.radius
    shear, height, rise = bodies.frame[SHEAR], bodies.frame[HEIGHT], bodies.frame[RISE]
    width, spread = bodies.frame[WIDTH], bodies.frame[SPREAD]
    sine, cosine = np.sin(shear), np.cos(shear)
    plate_speed = rise * sine / cosine + height * shear_rate / cosine**2
    plate_force, side_force = 0.0, 0.0
    for p in range(pairs.i.shape[0]):
        i, wall = pairs.i[p], pairs.j[p]
        x, y = state[i, X], state[i, Y]
        wx, wy, spin = 0.0, 0.0, 0.0
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
            wx, wy, spin = arm * shear_rate * cosine, -arm * shear_rate * sine, -shear_rate
            if wall == RIGHT:
                wx += spread
        if distance >= radius[i]:
            pairs.spring[p] = 0.0
            pairs.roll[p] = 0.0
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
        press_on_wall(force, radius, i, nx, ny, fn, ft)
        if law.rolling_friction > 0.0:
            turning = radius[i] * (spin - state[i, OMEGA])
            moment, pairs.roll[p] = rolling_force(fn, turning, pairs.damping[p], pairs.roll[p], law)
            force[i, 2] -= radius[i] * moment
        if wall == TOP:
            plate_force += fn
        elif wall == RIGHT:
            side_force += fn
    return plate_force, side_force


@njit(cache=True)
def plate_velocity(velocity: float, imposed: float, push: float, plate: Array, time_step: float) -> float:
    """Return a plate's velocity [m/s] after a step: as imposed, or under its load and the packing's push [N]."""
    if np.isnan(plate[LOAD]):
        return imposed
    return velocity + time_step * (push - plate[LOAD] - plate[PLATE_DAMPING] * velocity) / plate[PLATE_MASS]


@njit(cache=True)
def move_grains(bodies: Bodies, law: Law) -> float:
    """Take velocities and places of the grains through one step, forget the forces; the greatest speed [m/s]."""
    state, force, mass = bodies.state, bodies.force, bodies.mass
    dt = law.time_step
    keep = 1.0 - law.drag * dt
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
    return np.sqrt(fastest)


@njit(cache=True)
def advance(bodies: Bodies, pairs: Pairs, wall_pairs: Pairs, law: Law, drive: Array, reach: float) -> int:
    """Take one step per row of `drive`; stop early when two bodies may have approached by `reach` [m].

    drive (steps, 3): shear rate [rad/s]; velocities of the plate and of the right side [m/s], where no load moves them.
    Velocity Verlet with the velocities kept at the half steps. Return the number of steps taken.
    """
    frame, dt, travel = bodies.frame, law.time_step, 0.0
    for step in range(drive.shape[0]):
        grain_speed = move_grains(bodies, law)
        rate = drive[step, SHEAR_RATE]
        frame[SHEAR] += dt * rate
        frame[HEIGHT] += dt * frame[RISE]
        frame[WIDTH] += dt * frame[SPREAD]
        grain_forces(bodies, pairs, law)
        plate_force, side_force = wall_forces(bodies, wall_pairs, law, rate)
        base_forces(bodies, law)
        frame[RISE] = plate_velocity(frame[RISE], drive[step, RISE_RATE], plate_force, bodies.plates[0], dt)
        frame[SPREAD] = plate_velocity(frame[SPREAD], drive[step, SPREAD_RATE], side_force, bodies.plates[1], dt)
        wall_speed = (abs(frame[RISE]) + abs(rate) * frame[HEIGHT]) / np.cos(frame[SHEAR]) ** 2 + abs(frame[SPREAD])
        travel += dt * (grain_speed + max(grain_speed, wall_speed))
        if travel > reach:
            return step + 1
    return drive.shape[0]
