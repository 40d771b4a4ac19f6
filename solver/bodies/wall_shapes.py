"""Shapes of walls: distance of a point from a wall, and displacement of a wall between two photographs.

Every wall is given by two points. Those of a straight wall are its ends, with the packing to the left of 0 → 1. Those
of a circle are the ends of a diameter that rotates with it, with the packing inside or outside. Arrays of walls may
have any leading axes (…); side = None: all walls are straight.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .grains import Array

STRAIGHT, IN, OUT = 0, 1, -1  # shape of a wall: straight, or a circle with the packing inside or outside
CORNERS = 72  # of the polygon that draws a circle
# Radii by which a grain past the end of a wall reaches beyond its line: from the first on it may touch the end instead,
# from the second on it can touch nothing else.
NEAR_END, ACROSS = 0.01, 0.05
ALIKE = 0.9  # cosine of the greatest angle of two walls that face the same way
DEEPEST = 0.4  # radii: a rod that overlaps a wall by more stands where the wall is not, as beside a plate's end
Sides = NDArray[np.int8] | None


def all_sides(side: Sides, count: int) -> NDArray[np.int8]:
    """Return the shape of every wall (w,), STRAIGHT where `side` is None."""
    return np.full(count, STRAIGHT, np.int8) if side is None else side


def circle_ends(centre: Array, radius: Array, angle: Array) -> Array:
    """Return the ends (…, 2, 2) [m] of diameters; centre (…, 2) [m], radius (…) [m], angle (…) [rad]."""
    arm = radius[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return np.stack([centre - arm, centre + arm], axis=-2)


def circle_parameters(endpoints: Array) -> tuple[Array, Array, Array]:
    """Return centre (…, 2) [m], radius (…) [m] and angle (…) [rad] in (−π, π] of circles of diameters (…, 2, 2)."""
    along = endpoints[..., 1, :] - endpoints[..., 0, :]
    radius = 0.5 * np.linalg.norm(along, axis=-1)
    return endpoints.mean(axis=-2), radius, np.arctan2(along[..., 1], along[..., 0])


def outlines(endpoints: Array, side: Sides) -> list[Array]:
    """Return a line for every wall (w, 2, 2): the ends (2, 2) [m], or points along a circle (CORNERS + 1, 2) [m]."""
    shape = all_sides(side, len(endpoints))
    centre, radius, angle = circle_parameters(endpoints)
    corner = np.linspace(0.0, 2.0 * np.pi, CORNERS + 1)
    lines = []
    for w, ends in enumerate(endpoints):
        around = angle[w] + corner
        circle = centre[w] + radius[w] * np.stack([np.cos(around), np.sin(around)], axis=1)
        lines.append(ends if shape[w] == STRAIGHT else circle)
    return lines


def outward_normals(endpoints: Array) -> Array:
    """Return the unit normals (…, 2) out of the packing, of straight walls with endpoints (…, 2, 2) [m]."""
    along = directions(endpoints)
    return np.stack([along[..., 1], -along[..., 0]], axis=-1)


def directions(endpoints: Array) -> Array:
    """Return the unit vectors (…, 2) from the first to the second end of straight walls (…, 2, 2) [m]."""
    along = endpoints[..., 1, :] - endpoints[..., 0, :]
    return along / np.linalg.norm(along, axis=-1, keepdims=True)


def wall_distance(endpoints: Array, side: Sides, point: Array) -> tuple[Array, Array]:
    """Return the distance of points from walls and the outward normals there.

    Parameters
    ----------
    endpoints : (…, 2, 2)
        Walls [m]; a straight wall counts as an infinite line.
    side : (…)
        Shapes of the walls, broadcast as the walls.
    point : (…, 2)
        Points [m].

    Returns
    -------
    distance : (…)
        Distance [m], negative beyond the wall.
    normal : (…, 2)
        Outward unit normals; NaN at the centre of a circle.
    """
    distance, outward = distance_from_walls(endpoints, side, point), outward_normals(endpoints)
    if side is None or not np.any(side):
        return distance, np.broadcast_to(outward, np.broadcast_shapes(outward.shape, point.shape))
    from_centre = point - endpoints.mean(axis=-2)
    apart = np.linalg.norm(from_centre, axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        radial = np.where(apart > 0.0, side, np.nan)[..., None] * from_centre / apart[..., None]
    return distance, np.where((side != STRAIGHT)[..., None], radial, outward)


def distance_from_walls(endpoints: Array, side: Sides, point: Array) -> Array:
    """Return the distance (…) [m] of points from walls, negative beyond them; parameters as of `wall_distance`."""
    distance = np.einsum("...k,...k->...", endpoints[..., 0, :] - point, outward_normals(endpoints))
    if side is None or not np.any(side):
        return distance
    apart = np.linalg.norm(point - endpoints.mean(axis=-2), axis=-1)
    radius = 0.5 * np.linalg.norm(endpoints[..., 1, :] - endpoints[..., 0, :], axis=-1)
    return np.where(side != STRAIGHT, side * (radius - apart), distance)


def beside_wall(endpoints: Array, side: Sides, point: Array, margin: Array) -> NDArray[np.bool_]:
    """Return whether points (…, 2) project onto walls (…, 2, 2), within a margin (…) [m]; True for circles."""
    along = endpoints[..., 1, :] - endpoints[..., 0, :]
    length = np.linalg.norm(along, axis=-1)
    s = np.einsum("...k,...k->...", point - endpoints[..., 0, :], along / length[..., None])
    beside = (s > -margin) & (s < length + margin)
    return beside if side is None else beside | (side != STRAIGHT)


def faces_walls(
    endpoints: Array, side: Sides, wall: NDArray[np.int64], point: Array, radius: Array
) -> NDArray[np.bool_]:
    """Return which grains can touch a wall that is near.

    Parameters
    ----------
    endpoints : (w, 2, 2)
        Walls [m].
    side : (w,)
        Shapes of the walls.
    wall : (k,)
        Row of the wall of every pair.
    point : (k, 2)
        Centre of its grain [m].
    radius : (k,)
        Radius of its grain [m].

    Returns
    -------
    (k,)
        True beside the wall. A straight wall is taken to go on for a radius past its ends, but neither along another
        wall that faces the same way, as in a box that is split, nor where a grain touches the end, see `nearest_ends`.
    """
    rows, shape = endpoints[wall], None if side is None else side[wall]
    near = beside_wall(rows, shape, point, radius)
    past = near & ~beside_wall(rows, shape, point, np.zeros(1))
    if not past.any():
        return near
    elsewhere = nearest_ends(rows, shape, point, radius).touched
    another = beside_another(endpoints, side, point)
    if another is not None:
        elsewhere |= another[np.arange(len(wall)), wall]
    return near & ~(past & elsewhere)


class NearestEnds(NamedTuple):
    """Ends of straight walls that are nearest to grains."""

    touched: NDArray[np.bool_]  # (k,) whether the grain can touch the end, and not the face
    distance: Array  # (k,) [m] of its centre from the end
    normal: Array  # (k, 2) unit vectors from the centre to the end


def nearest_ends(endpoints: Array, side: Sides, point: Array, radius: Array) -> NearestEnds:
    """Find which grains past the end of a straight wall touch that end, as beside a footing or in a box that is split.

    Parameters
    ----------
    endpoints : (k, 2, 2)
        The wall of every pair [m].
    side : (k,)
        Its shape.
    point : (k, 2)
        Centre of the grain [m].
    radius : (k,)
        Radius of the grain [m].

    Notes
    -----
    A grain that overlaps the line of the wall by o is at the end if o > .05 R, or if o > .01 R and it is nearer to
    touching the end than to touching the line: walls may be stated a little too short, and soft grains overlap them.
    """
    past = ~beside_wall(endpoints, side, point, np.zeros(1))
    overlap = radius - distance_from_walls(endpoints, side, point)
    away = endpoints - point[:, None]
    apart = np.linalg.norm(away, axis=2)
    row, end = np.arange(len(point)), apart.argmin(axis=1)
    distance = apart[row, end]
    touched = past & (overlap > NEAR_END * radius) & (distance > 0.0)
    touched &= (overlap > ACROSS * radius) | (np.abs(distance - radius) < overlap)
    return NearestEnds(touched, distance, away[row, end] / np.where(distance > 0.0, distance, 1.0)[:, None])


def beside_another(endpoints: Array, side: Sides, point: Array) -> NDArray[np.bool_] | None:
    """Return which grains are beside another straight wall that faces the same way.

    Parameters
    ----------
    endpoints : (…, w, 2, 2)
        Walls [m].
    side : (w,)
        Shapes of the walls.
    point : (…, n, 2)
        Centres [m].

    Returns
    -------
    (…, n, w), or None
        Beside another wall than w that faces as w does; None: no two walls face the same way.
    """
    straight = all_sides(side, endpoints.shape[-3]) == STRAIGHT
    outward = np.where(straight[:, None], outward_normals(endpoints), 0.0)
    alike = np.einsum("...wk,...vk->...wv", outward, outward) > ALIKE
    alike &= ~np.eye(len(straight), dtype=bool)
    if not alike.any():
        return None
    beside = beside_wall(endpoints[..., None, :, :, :], None, point[..., None, :], np.zeros(1))
    return (beside & straight).astype(np.float64) @ alike.astype(np.float64) > 0.0


def bounding_distance(endpoints: Array, side: Sides, point: Array) -> tuple[Array, Array]:
    """Return the distance of points from the walls that bound them, and the outward normals there.

    A bar ends: what is past its end and beyond its line may be inside the packing, as rods are beside a footing, in
    the other half of a box that is split, or in a pit between two floors. It is outside only if it is not in front of
    the wall that is nearest, and beyond another wall, too, or farther beyond than the bar is long. Nor does one face of
    a body in the packing, as of a pile or a wedge, bound what is in front of another face.

    Parameters
    ----------
    endpoints : (…, w, 2, 2)
        Walls [m].
    side : (w,)
        Shapes of the walls.
    point : (…, 2)
        Points [m].

    Returns
    -------
    distance : (…, w)
        As `wall_distance`; infinite from a straight wall that does not bound the point.
    normal : (…, w, 2)
        Outward unit normals.
    """
    place = point[..., None, :]
    distance, normal = wall_distance(endpoints, side, place)
    past = ~beside_wall(endpoints, side, place, np.zeros(distance.shape))
    from_ends = _distance_from_ends(endpoints, place)
    nearest = np.where(past, from_ends, np.abs(distance)).argmin(axis=-1)[..., None]
    in_front = np.take_along_axis(~past & (distance >= 0.0), nearest, axis=-1)
    alone = (distance < 0.0).sum(axis=-1, keepdims=True) == 1
    length = np.linalg.norm(endpoints[..., 1, :] - endpoints[..., 0, :], axis=-1)
    inside = in_front | (alone & (distance > -length))
    free = past & inside & (distance < 0.0)
    return np.where(free | _in_front_of_another(endpoints, side, point, distance, normal), np.inf, distance), normal


def behind_body(endpoints: Array, side: Sides, point: Array) -> NDArray[np.bool_]:
    """Return whether points are beyond walls, but in front of another face of the same body.

    The way from such a point to its foot on the wall crosses that face from the front: of a pile the opposite one, of
    a wedge its other flank.

    Parameters
    ----------
    endpoints : (…, w, 2, 2)
        Walls [m].
    side : (w,)
        Shapes of the walls.
    point : (…, 2)
        Points [m].

    Returns
    -------
    (…, w)
        False for circles.
    """
    place = point[..., None, :]
    return _in_front_of_another(endpoints, side, point, *wall_distance(endpoints, side, place))


def _distance_from_ends(endpoints: Array, place: Array) -> Array:
    """Distance (…) [m] of points (…, 2) from the nearer end of walls (…, 2, 2)."""
    first, second = endpoints[..., 0, :] - place, endpoints[..., 1, :] - place
    square = [away[..., 0] ** 2 + away[..., 1] ** 2 for away in (first, second)]
    return np.sqrt(np.minimum(*square))


def _straight(side: Sides) -> NDArray[np.bool_]:
    """Which walls are straight, broadcast as the walls."""
    return np.ones(1, np.bool_) if side is None else side == STRAIGHT


def _in_front_of_another(
    endpoints: Array, side: Sides, point: Array, distance: Array, normal: Array
) -> NDArray[np.bool_]:
    """As `behind_body`, with the distances (…, w) and outward normals (…, w, 2) of the points (…, 2)."""
    if not (distance < 0.0).any():
        return np.zeros(distance.shape, np.bool_)
    straight = _straight(side)
    beyond = beside_wall(endpoints, side, point[..., None, :], np.zeros(distance.shape)) & straight & (distance < 0.0)
    foot = distance[..., None] * normal  # from the point, on every wall w
    # Where the way from the point to its foot on wall w crosses wall v.
    left = distance[..., None, :] - np.einsum("...wk,...vk->...wv", foot, normal)
    crosses = (distance >= 0.0)[..., None, :] & (left < 0.0) & straight
    covered = np.where(crosses, distance[..., None, :] / np.where(crosses, distance[..., None, :] - left, 1.0), 0.0)
    along = np.stack([-normal[..., 1], normal[..., 0]], axis=-1)
    start = np.einsum("...vk,...vk->...v", point[..., None, :] - endpoints[..., 0, :], along)
    where = start[..., None, :] + covered * np.einsum("...wk,...vk->...wv", foot, along)
    length = np.linalg.norm(endpoints[..., 1, :] - endpoints[..., 0, :], axis=-1)[..., None, :]
    return beyond & (crosses & (where >= 0.0) & (where <= length)).any(axis=-1)


def wall_displacement(former: Array, later: Array, side: Sides, at: Array | None = None) -> Array:
    """Return the displacement of the endpoints from walls `former` to walls `later`.

    Parameters
    ----------
    former, later : (…, 2, 2)
        Walls at two instants [m].
    side : (…)
        Shapes of the walls.
    at : (…, 2, 2), optional
        Instant of the diameter to which a circle's displacement refers; the later one by default.

    Returns
    -------
    (…, 2, 2)
        Displacements [m]. Those of a circle are a rate times the interval: translation, widening and rotation of the
        diameter to first order, so that a finite rotation does not narrow it.
    """
    straight = later - former
    if side is None or not np.any(side):
        return straight
    centre, radius, angle = circle_parameters(later)
    former_centre, former_radius, former_angle = circle_parameters(former)
    rotation = (angle - former_angle + np.pi) % (2.0 * np.pi) - np.pi
    phase, size = (angle, radius) if at is None else circle_parameters(at)[2:0:-1]
    unit = np.stack([np.cos(phase), np.sin(phase)], axis=-1)
    across = np.stack([-unit[..., 1], unit[..., 0]], axis=-1)
    arm = (radius - former_radius)[..., None] * unit + (size * rotation)[..., None] * across
    shift = centre - former_centre
    curved = np.stack([shift - arm, shift + arm], axis=-2)
    return np.where((side != STRAIGHT)[..., None, None], curved, straight)


def walls_before(endpoints: Array, moved: Array, side: Sides) -> Array:
    """Return walls (…, 2, 2) [m] before a displacement given by `wall_displacement`; a circle remains a circle."""
    straight = endpoints - moved
    if side is None or not np.any(side):
        return straight
    centre, radius, angle = circle_parameters(endpoints)
    arm = 0.5 * (moved[..., 1, :] - moved[..., 0, :])
    unit = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    widened = np.einsum("...k,...k->...", arm, unit)
    rotation = (unit[..., 0] * arm[..., 1] - unit[..., 1] * arm[..., 0]) / radius
    curved = circle_ends(centre - moved.mean(axis=-2), radius - widened, angle - rotation)
    return np.where((side != STRAIGHT)[..., None, None], curved, straight)


def interpolate_walls(one: Array, two: Array, fraction: float, side: Sides) -> Array:
    """Return walls (…, 2, 2) [m] at a fraction of the displacement from one state to another."""
    straight = (1.0 - fraction) * one + fraction * two
    if side is None or not np.any(side):
        return straight
    curved = walls_before(two, (1.0 - fraction) * wall_displacement(one, two, side), side)
    return np.where((side != STRAIGHT)[..., None, None], curved, straight)
