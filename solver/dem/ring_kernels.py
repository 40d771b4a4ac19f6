"""The time step of rods between two circles: a ring around them, that may carry a load, and a core that is moved."""

from __future__ import annotations

import numpy as np
from numba import njit

from solver.bodies.grains import Array
from solver.dem.kernels import (
    LOAD,
    OMEGA,
    PLATE_DAMPING,
    PLATE_MASS,
    VX,
    VY,
    Bodies,
    Law,
    Pairs,
    X,
    Y,
    base_forces,
    contact_force,
    grain_forces,
    move_grains,
    press_on_wall,
)

# entries of the circles' state: the ring is about the origin, and does not turn
RING_RADIUS, RING_RATE, CORE_RADIUS, CORE_X, CORE_Y, CORE_TURN = range(6)
# columns of the drive
CORE_VX, CORE_VY, CORE_SPIN, RING_DRIVE = range(4)
# rows of walls
RING, CORE = range(2)


@njit(cache=True)
def circle_forces(bodies: Bodies, pairs: Pairs, law: Law, circles: Array, drive: Array) -> float:
    """Add the circles' forces to `bodies.force`; return the sum of the normal forces on the ring [N].

    circles (6,) and drive (4,): as named above [m, m/s, rad/s].
    """
    state, force, radius = bodies.state, bodies.force, bodies.radius
    total = 0.0
    for p in range(pairs.i.shape[0]):
        i, wall = pairs.i[p], pairs.j[p]
        x, y = state[i, X], state[i, Y]
        if wall == CORE:
            x -= circles[CORE_X]
            y -= circles[CORE_Y]
        apart = np.sqrt(x * x + y * y)
        ex, ey = x / apart, y / apart
        if wall == RING:
            distance = circles[RING_RADIUS] - apart
            nx, ny = ex, ey
            wx, wy = circles[RING_RATE] * ex, circles[RING_RATE] * ey
        else:
            distance = apart - circles[CORE_RADIUS]
            nx, ny = -ex, -ey
            surface = drive[CORE_SPIN] * circles[CORE_RADIUS]
            wx, wy = drive[CORE_VX] - surface * ey, drive[CORE_VY] + surface * ex
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
        press_on_wall(force, radius, i, nx, ny, fn, ft)
        if wall == RING:
            total += fn
    return total


@njit(cache=True)
def advance_between_circles(
    bodies: Bodies, pairs: Pairs, wall_pairs: Pairs, law: Law, circles: Array, drive: Array, reach: float
) -> int:
    """Take one step per row of drive (steps, 4); stop early when two bodies may have approached by `reach` [m].

    The ring's radius goes as it is driven, or under its load (row 0 of `bodies.plates`). Return the steps taken.
    """
    ring, dt, travel = bodies.plates[0], law.time_step, 0.0
    for step in range(drive.shape[0]):
        row = drive[step]
        grain_speed = move_grains(bodies, law)
        circles[RING_RADIUS] += dt * circles[RING_RATE]
        circles[CORE_X] += dt * row[CORE_VX]
        circles[CORE_Y] += dt * row[CORE_VY]
        circles[CORE_TURN] += dt * row[CORE_SPIN]
        grain_forces(bodies, pairs, law)
        push = circle_forces(bodies, wall_pairs, law, circles, row)
        base_forces(bodies, law)
        if np.isnan(ring[LOAD]):
            circles[RING_RATE] = row[RING_DRIVE]
        else:
            pull = push - ring[LOAD] - ring[PLATE_DAMPING] * circles[RING_RATE]
            circles[RING_RATE] += dt * pull / ring[PLATE_MASS]
        core_speed = np.sqrt(row[CORE_VX] ** 2 + row[CORE_VY] ** 2)
        travel += dt * (grain_speed + max(grain_speed, abs(circles[RING_RATE]), core_speed))
        if travel > reach:
            return step + 1
    return drive.shape[0]
