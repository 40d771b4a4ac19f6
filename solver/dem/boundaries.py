"""Boundaries of the discrete-element simulation: shear frame, ring with core, periodic cell, and split box.

The frame is a linkage: the sides rotate about the bottom corners, the plate on top keeps its length and its ends on the
lines of the sides, and the right side can move along the bottom. Discs may be fixed to the ends of bottom and plate,
where the sides meet them; those of the plate share its motion and its load. The ring is centred at the origin, does not
rotate, and changes its radius as a whole; the core inside it is moved and rotated. The periodic cell shears by b along
a and changes its size isotropically until the pressure is the required one. The upper half of the split box slides over
the lower one together with the plate; a tool, a flat bar or a disc, may be moved inside it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from ..bodies.grains import Array

FRAME, RING, CELL, BOX = range(4)  # kinds of boundary

# Rows of walls and entries of state and drive, by kind. Rates of the state are half a step old.
BOTTOM, RIGHT, TOP, LEFT, BOTTOM_LEFT, BOTTOM_RIGHT, TOP_RIGHT, TOP_LEFT = range(8)  # the last four are discs
SHEAR, HEIGHT, HEIGHT_RATE, WIDTH, WIDTH_RATE, DISC_RADIUS = range(6)  # [rad], [m], [m/s], [m], [m/s], [m]
SHEAR_RATE, PLATE_DRIVE, SIDE_DRIVE = range(3)  # [rad/s], [m/s], [m/s]

RING_WALL, CORE_WALL = range(2)
RING_RADIUS, RING_RATE, CORE_RADIUS, CORE_X, CORE_Y, CORE_ROTATION = range(6)  # [m], [m/s], [m], [m], [m], [rad]
CORE_VX, CORE_VY, CORE_SPIN, RING_DRIVE = range(4)  # [m/s], [m/s], [rad/s], [m/s]

# Of a box, after BOTTOM, RIGHT, TOP, LEFT; right and left are the lower halves.
UPPER_RIGHT, UPPER_LEFT, TOOL = 4, 5, 6
# As of a frame HEIGHT, HEIGHT_RATE, WIDTH; the height of the split; centre and size of the tool, all in m.
SLIDE, SPLIT, TOOL_X, TOOL_Y, TOOL_WIDTH, TOOL_RADIUS = 0, 4, 5, 6, 7, 8  # width 0, radius 0: not of this shape
SLIDE_RATE, TOOL_VX, TOOL_VY = 0, 2, 3  # [m/s], beside PLATE_DRIVE

AX, AY, BX, BY, CELL_PRESSURE = range(5)  # vectors a, b [m]; half the trace of the stress of the last step [Pa]
CELL_SHEAR_RATE = 0  # [1/s]

# Constants of a plate under load, and of the control of a cell's pressure.
PLATE_MASS, LOAD, PLATE_DAMPING = range(3)  # [kg], [N] (NaN: driven), [N s/m]
REQUIRED_PRESSURE, VISCOSITY, GREATEST_RATE, LENGTH = range(4)  # [Pa], [Pa s], [1/s], [m] of the rods


class Boundary(NamedTuple):
    """The boundary of a simulation; entries of the arrays as named above."""

    kind: int  # FRAME, RING, CELL or BOX
    state: Array  # (6,), of a box (9,)
    plates: Array  # (2, 3) of a frame: plate and right side; of a ring: the ring; of a box: the plate
    servo: Array  # (4,) of a cell


@njit(cache=True)
def cell_rates(boundary: Boundary, drive: Array) -> tuple[float, float]:
    """Return the rates of shear and of isotropic stretch of a cell [1/s]; zero for other boundaries."""
    if boundary.kind != CELL:
        return 0.0, 0.0
    servo = boundary.servo
    stretch = (boundary.state[CELL_PRESSURE] - servo[REQUIRED_PRESSURE]) / servo[VISCOSITY]
    return drive[CELL_SHEAR_RATE], min(max(stretch, -servo[GREATEST_RATE]), servo[GREATEST_RATE])


@njit(cache=True)
def move_boundary(boundary: Boundary, drive: Array, time_step: float, shear: float, stretch: float) -> None:
    """Move the boundary by one step; shear, stretch [1/s]: rates of a cell."""
    state, dt = boundary.state, time_step
    if boundary.kind == FRAME:
        state[SHEAR] += dt * drive[SHEAR_RATE]
        state[HEIGHT] += dt * state[HEIGHT_RATE]
        state[WIDTH] += dt * state[WIDTH_RATE]
    elif boundary.kind == RING:
        state[RING_RADIUS] += dt * state[RING_RATE]
        state[CORE_X] += dt * drive[CORE_VX]
        state[CORE_Y] += dt * drive[CORE_VY]
        state[CORE_ROTATION] += dt * drive[CORE_SPIN]
    elif boundary.kind == BOX:
        state[SLIDE] += dt * drive[SLIDE_RATE]
        state[HEIGHT] += dt * state[HEIGHT_RATE]
        state[TOOL_X] += dt * drive[TOOL_VX]
        state[TOOL_Y] += dt * drive[TOOL_VY]
    else:
        for column in (AX, BX):
            x, y = state[column], state[column + 1]
            state[column] = x + dt * (stretch * x + shear * y)
            state[column + 1] = y + dt * stretch * y


@njit(cache=True)
def linkage_motion(boundary: Boundary, drive: Array) -> tuple[float, float, float]:
    """Return sine and cosine of the shear angle and the sideways velocity of the plate of a frame [m/s]."""
    if boundary.kind != FRAME:
        return 0.0, 1.0, 0.0
    state = boundary.state
    sine, cosine = np.sin(state[SHEAR]), np.cos(state[SHEAR])
    return sine, cosine, state[HEIGHT_RATE] * sine / cosine + state[HEIGHT] * drive[SHEAR_RATE] / cosine**2


@njit(cache=True)
def wall_surface(
    boundary: Boundary, drive: Array, linkage: tuple[float, float, float], wall: int, x: float, y: float
) -> tuple[float, float, float, float, float, float]:
    """Return the surface of a wall nearest to a point: distance [m], outward normal, velocity [m/s], spin [rad/s]."""
    state = boundary.state
    if boundary.kind == RING:
        if wall == CORE_WALL:
            x -= state[CORE_X]
            y -= state[CORE_Y]
        apart = np.sqrt(x * x + y * y)
        ex, ey = x / apart, y / apart
        if wall == RING_WALL:
            return state[RING_RADIUS] - apart, ex, ey, state[RING_RATE] * ex, state[RING_RATE] * ey, 0.0
        surface = drive[CORE_SPIN] * state[CORE_RADIUS]
        wx, wy = drive[CORE_VX] - surface * ey, drive[CORE_VY] + surface * ex
        return apart - state[CORE_RADIUS], -ex, -ey, wx, wy, drive[CORE_SPIN]
    if boundary.kind == BOX:
        return box_surface(state, drive, wall, x, y)
    sine, cosine, plate_speed = linkage
    rate = drive[SHEAR_RATE]
    if wall == BOTTOM:
        return y, 0.0, -1.0, 0.0, 0.0, 0.0
    if wall == TOP:
        return state[HEIGHT] - y, 0.0, 1.0, plate_speed, state[HEIGHT_RATE], 0.0
    if wall == RIGHT:
        distance = (state[WIDTH] - x) * cosine + y * sine
        arm = (x - state[WIDTH]) * sine + y * cosine
        return distance, cosine, -sine, arm * rate * cosine + state[WIDTH_RATE], -arm * rate * sine, -rate
    if wall == LEFT:
        arm = x * sine + y * cosine
        return x * cosine - y * sine, -cosine, sine, arm * rate * cosine, -arm * rate * sine, -rate
    wx, wy = 0.0, 0.0
    if wall in (BOTTOM_RIGHT, TOP_RIGHT):
        x -= state[WIDTH]
        wx = state[WIDTH_RATE]
    if wall in (TOP_RIGHT, TOP_LEFT):
        x -= state[HEIGHT] * sine / cosine
        y -= state[HEIGHT]
        wx += plate_speed
        wy = state[HEIGHT_RATE]
    apart = np.sqrt(x * x + y * y)
    return apart - state[DISC_RADIUS], -x / apart, -y / apart, wx, wy, 0.0


@njit(cache=True)
def box_surface(
    state: Array, drive: Array, wall: int, x: float, y: float
) -> tuple[float, float, float, float, float, float]:
    """Return the surface of a wall of a box nearest to a point, as `wall_surface`.

    The sides are blocks with a ledge and an edge at the split, so that a rod meets the other half where it slides.
    """
    if wall == BOTTOM:
        return y, 0.0, -1.0, 0.0, 0.0, 0.0
    if wall == TOP:
        return state[HEIGHT] - y, 0.0, 1.0, drive[SLIDE_RATE], state[HEIGHT_RATE], 0.0
    if wall == TOOL:
        nearest = min(max(x, state[TOOL_X] - 0.5 * state[TOOL_WIDTH]), state[TOOL_X] + 0.5 * state[TOOL_WIDTH])
        if nearest == x and state[TOOL_RADIUS] == 0.0:
            return state[TOOL_Y] - y, 0.0, 1.0, drive[TOOL_VX], drive[TOOL_VY], 0.0
        dx, dy = nearest - x, state[TOOL_Y] - y
        apart = np.sqrt(dx * dx + dy * dy)
        return apart - state[TOOL_RADIUS], dx / apart, dy / apart, drive[TOOL_VX], drive[TOOL_VY], 0.0
    upper = wall in (UPPER_RIGHT, UPPER_LEFT)
    side = 1.0 if wall in (RIGHT, UPPER_RIGHT) else -1.0
    face = (state[WIDTH] if side > 0.0 else 0.0) + (state[SLIDE] if upper else 0.0)
    inside = side * (face - x)  # distance from the face, negative behind it
    beside = y - state[SPLIT] if upper else state[SPLIT] - y  # negative beyond the block's end
    speed = drive[SLIDE_RATE] if upper else 0.0
    if beside >= 0.0:
        return inside, side, 0.0, speed, 0.0, 0.0
    ledge = 1.0 if upper else -1.0
    if inside <= 0.0:
        return -beside, 0.0, ledge, speed, 0.0, 0.0
    apart = np.sqrt(inside * inside + beside * beside)
    return apart, side * inside / apart, -ledge * beside / apart, speed, 0.0, 0.0


@njit(cache=True)
def box_distance(boundary: Boundary, position: Array, distance: Array) -> None:
    """Set the distances (n, 7) [m] of points (n, 2) [m] from the walls of a box."""
    drive = np.zeros(4)
    for k in range(len(position)):
        for wall in range(TOOL + 1):
            distance[k, wall] = box_surface(boundary.state, drive, wall, position[k, 0], position[k, 1])[0]


@njit(cache=True)
def apply_loads(boundary: Boundary, drive: Array, push: tuple[float, float], work: float, time_step: float) -> float:
    """Update the velocities of plates, or the pressure of a cell; return the greatest speed of a wall [m/s].

    push [N]: normal forces of the packing on plate and right side, or on the ring; work [N m]: Σ f_n |branch vector|.
    """
    state, plates = boundary.state, boundary.plates
    if boundary.kind == FRAME:
        state[HEIGHT_RATE] = plate_velocity(state[HEIGHT_RATE], drive[PLATE_DRIVE], push[0], plates[0], time_step)
        state[WIDTH_RATE] = plate_velocity(state[WIDTH_RATE], drive[SIDE_DRIVE], push[1], plates[1], time_step)
        sheared = abs(state[HEIGHT_RATE]) + abs(drive[SHEAR_RATE]) * state[HEIGHT]
        return sheared / np.cos(state[SHEAR]) ** 2 + abs(state[WIDTH_RATE])
    if boundary.kind == RING:
        state[RING_RATE] = plate_velocity(state[RING_RATE], drive[RING_DRIVE], push[0], plates[0], time_step)
        return max(abs(state[RING_RATE]), np.sqrt(drive[CORE_VX] ** 2 + drive[CORE_VY] ** 2))
    if boundary.kind == BOX:
        state[HEIGHT_RATE] = plate_velocity(state[HEIGHT_RATE], drive[PLATE_DRIVE], push[0], plates[0], time_step)
        tool = abs(drive[TOOL_VX]) + abs(drive[TOOL_VY])
        return max(abs(state[HEIGHT_RATE]) + abs(drive[SLIDE_RATE]), tool)
    area = abs(state[AX] * state[BY] - state[AY] * state[BX])
    state[CELL_PRESSURE] = work / (2.0 * area * boundary.servo[LENGTH])
    return 0.0


@njit(cache=True)
def plate_velocity(velocity: float, imposed: float, push: float, plate: Array, time_step: float) -> float:
    """Return the velocity of a plate after a step [m/s]: imposed, or by its load and the force `push` on it [N]."""
    if np.isnan(plate[LOAD]):
        return imposed
    return velocity + time_step * (push - plate[LOAD] - plate[PLATE_DAMPING] * velocity) / plate[PLATE_MASS]
