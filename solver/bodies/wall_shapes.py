"""The shapes of walls: how far a place is from one, and how one moves between two photographs.

Every wall is two points. Those of a straight wall are its ends, the packing to the left of 0 → 1. Those of a circle are
the ends of a diameter, which turns with it; the packing is inside it or outside. Arrays of walls may have any leading
axes (…); `side` None says that all are straight.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array

STRAIGHT, IN, OUT = 0, 1, -1  # what a wall is: straight, or a circle with the packing inside or outside
CORNERS = 72  # of a circle as it is drawn
Sides = NDArray[np.int8] | None


def all_sides(side: Sides, count: int) -> NDArray[np.int8]:
    """What each of so many walls is (w,)."""
    return np.full(count, STRAIGHT, np.int8) if side is None else side


def circle_ends(centre: Array, radius: Array, turn: Array) -> Array:
    """Ends (…, 2, 2) [m] of the diameters of circles: centre (…, 2) [m], radius (…) [m], turn (…) [rad]."""
    arm = radius[..., None] * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    return np.stack([centre - arm, centre + arm], axis=-2)


def circle_of(endpoints: Array) -> tuple[Array, Array, Array]:
    """Centre (…, 2) [m], radius (…) [m] and turn (…) [rad], wrapped, of circles with these diameters (…, 2, 2)."""
    along = endpoints[..., 1, :] - endpoints[..., 0, :]
    radius = 0.5 * np.linalg.norm(along, axis=-1)
    return endpoints.mean(axis=-2), radius, np.arctan2(along[..., 1], along[..., 0])


def outlines(endpoints: Array, side: Sides) -> list[Array]:
    """Lines that draw walls (w, 2, 2): a straight one's ends (2, 2), points round a circle (CORNERS + 1, 2) [m]."""
    shape = all_sides(side, len(endpoints))
    centre, radius, turn = circle_of(endpoints)
    angle = np.linspace(0.0, 2.0 * np.pi, CORNERS + 1)
    lines = []
    for w, ends in enumerate(endpoints):
        around = turn[w] + angle
        circle = centre[w] + radius[w] * np.stack([np.cos(around), np.sin(around)], axis=1)
        lines.append(ends if shape[w] == STRAIGHT else circle)
    return lines


def outward_normals(endpoints: Array) -> Array:
    """Unit normals (…, 2) that point out of the packing, of straight walls with endpoints (…, 2, 2) [m]."""
    along = endpoints[..., 1, :] - endpoints[..., 0, :]
    along = along / np.linalg.norm(along, axis=-1, keepdims=True)
    return np.stack([along[..., 1], -along[..., 0]], axis=-1)


def reach_of_wall(endpoints: Array, side: Sides, place: Array) -> tuple[Array, Array]:
    """Distance (…) [m] of places (…, 2) from walls (…, 2, 2), negative beyond them, and outward normals (…, 2).

    side (…), broadcast as the walls are. A straight wall counts as an endless line. A place in a circle's centre has
    no normal: it is NaN.
    """
    outward = outward_normals(endpoints)
    distance = np.einsum("...k,...k->...", endpoints[..., 0, :] - place, outward)
    if side is None or not np.any(side):
        return distance, np.broadcast_to(outward, np.broadcast_shapes(outward.shape, place.shape))
    centre, radius, _ = circle_of(endpoints)
    from_centre = place - centre
    apart = np.linalg.norm(from_centre, axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        radial = np.where(apart > 0.0, side, np.nan)[..., None] * from_centre / apart[..., None]
    curved = side != STRAIGHT
    return np.where(curved, side * (radius - apart), distance), np.where(curved[..., None], radial, outward)


def beside_wall(endpoints: Array, side: Sides, place: Array, margin: Array) -> NDArray[np.bool_]:
    """Whether places (…, 2) project onto walls (…, 2, 2), give or take a margin (…) [m]; a circle is beside all."""
    along = endpoints[..., 1, :] - endpoints[..., 0, :]
    length = np.linalg.norm(along, axis=-1)
    s = np.einsum("...k,...k->...", place - endpoints[..., 0, :], along / length[..., None])
    beside = (s > -margin) & (s < length + margin)
    return beside if side is None else beside | (side != STRAIGHT)


def walls_moved(former: Array, later: Array, side: Sides, at: Array | None = None) -> Array:
    """Displacement (…, 2, 2) [m] of the endpoints that leads to walls `later` (…, 2, 2) from `former`.

    A circle's is that of its diameter as it lies in `at` (the later instant unless given): moved, widened and turned,
    as at a rate, so that a turn does not seem to narrow it.
    """
    straight = later - former
    if side is None or not np.any(side):
        return straight
    centre, radius, turn = circle_of(later)
    former_centre, former_radius, former_turn = circle_of(former)
    by = (turn - former_turn + np.pi) % (2.0 * np.pi) - np.pi
    place, wide = (turn, radius) if at is None else circle_of(at)[2:0:-1]
    unit = np.stack([np.cos(place), np.sin(place)], axis=-1)
    across = np.stack([-unit[..., 1], unit[..., 0]], axis=-1)
    arm = (radius - former_radius)[..., None] * unit + (wide * by)[..., None] * across
    shift = centre - former_centre
    curved = np.stack([shift - arm, shift + arm], axis=-2)
    return np.where((side != STRAIGHT)[..., None, None], curved, straight)


def moved_back(endpoints: Array, moved: Array, side: Sides) -> Array:
    """Walls (…, 2, 2) [m] as they were before a displacement of `walls_moved`; a circle stays one."""
    straight = endpoints - moved
    if side is None or not np.any(side):
        return straight
    centre, radius, turn = circle_of(endpoints)
    arm = 0.5 * (moved[..., 1, :] - moved[..., 0, :])
    unit = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    widened = np.einsum("...k,...k->...", arm, unit)
    turned = (unit[..., 0] * arm[..., 1] - unit[..., 1] * arm[..., 0]) / radius
    curved = circle_ends(centre - moved.mean(axis=-2), radius - widened, turn - turned)
    return np.where((side != STRAIGHT)[..., None, None], curved, straight)


def walls_between(one: Array, two: Array, share: float, side: Sides) -> Array:
    """Walls (…, 2, 2) [m] at a share of the way from one state to another."""
    straight = (1.0 - share) * one + share * two
    if side is None or not np.any(side):
        return straight
    curved = moved_back(two, (1.0 - share) * walls_moved(one, two, side), side)
    return np.where((side != STRAIGHT)[..., None, None], curved, straight)
