"""Extension of walls that are too short, along the rods on their line, up to the next wall."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..bodies.grains import Array
from ..bodies.wall_shapes import STRAIGHT, all_sides, beside_another, outward_normals
from ..calibration.gaps import MeasuredSequence

CONTACT_DISTANCE = 0.05  # radii: greatest distance of a rod's surface from the line of a wall that it bears on
PAST_END = 0.5  # radii: rods nearer to an end bear on the given wall
NEIGHBOUR_DISTANCE = 1.0  # radii: a wall is extended along rods whose surface is this near to its line
BEARING = 0.3  # of the rods near the line of a wall, those that touch it: more than half at a wall, few at a surface
PARALLEL = 0.1  # sine of the least angle of two walls that meet
ACROSS, NEAR_END = 0.5, 4.0  # radii: greatest distance of a centre from a line that the rod crosses, and from the end


def continue_walls(sequence: MeasuredSequence) -> Array:
    """Compute the extension (w, 2) [m] of each wall beyond its ends, zero where it is long enough.

    A wall is extended only where a rod bears on its line beyond the end: past the last rod beside the line in any
    frame, but not beyond the line of another wall. It is long enough where a rod stands across its line past the end or
    few of the rods near the line touch it, as beside a footing, and along rods that are beside another wall which faces
    the same way, as in a split box.
    """
    ends, straight = sequence.endpoints, _straight(sequence)
    along = _along(outward_normals(ends))
    extension = np.zeros((sequence.wall_count, 2))
    for past in _past_ends(sequence):
        reach = np.where(past.near, past.distance + sequence.radius, 0.0).max(axis=1)
        at = straight.tolist().index(past.wall)
        limit = _distance_to_next_wall(ends[:, straight], along[:, straight], at, past.end)
        extension[past.wall, past.end] = np.minimum(reach, limit).max()
    return extension


def bearing_past_ends(sequence: MeasuredSequence) -> NDArray[np.bool_]:
    """Return which grains (n, w) bear on the line of a wall past its end in any frame."""
    found = np.zeros((len(sequence.radius), sequence.wall_count), bool)
    for past in _past_ends(sequence):
        found[:, past.wall] |= past.bears.any(axis=0)
    return found


class _PastEnd(NamedTuple):
    """Grains (f, n) past an end of a wall that continues there."""

    wall: int
    end: int
    distance: Array  # [m] from the end, along the wall
    bears: NDArray[np.bool_]  # touch the wall's line
    near: NDArray[np.bool_]  # are beside it


def _past_ends(sequence: MeasuredSequence) -> Iterator[_PastEnd]:
    """Yield every end past which rods bear on the line of the wall."""
    ends, radius = sequence.endpoints, sequence.radius
    normal = outward_normals(ends)
    along = _along(normal)
    length = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
    another = beside_another(ends, sequence.side, sequence.position)
    for w in _straight(sequence).tolist():
        offset = sequence.position - ends[:, None, w, 0]
        place = np.einsum("fnk,fk->fn", offset, along[:, w])
        depth = -np.einsum("fnk,fk->fn", offset, normal[:, w])
        free = sequence.present if another is None else sequence.present & ~another[..., w]
        for end, past in enumerate((-place, place - length[:, None, w])):
            with np.errstate(invalid="ignore"):
                off = np.abs(depth - radius)
                bears = free & (off < CONTACT_DISTANCE * radius) & (past > PAST_END * radius)
                near = free & (off < NEIGHBOUR_DISTANCE * radius) & (past > 0.0)
                close = (past > radius) & (past < NEAR_END * radius)
                across = free & close & (np.abs(depth) < ACROSS * radius)
            if bears.any() and bears.sum() > BEARING * near.sum() and not across.any():
                yield _PastEnd(w, end, past, bears, near)


def _straight(sequence: MeasuredSequence) -> NDArray[np.intp]:
    return np.flatnonzero(all_sides(sequence.side, sequence.wall_count) == STRAIGHT)


def _along(normal: Array) -> Array:
    return np.stack([-normal[..., 1], normal[..., 0]], axis=-1)


def extend_walls(endpoints: Array, extension: Array) -> Array:
    """Extend walls (f, w, 2, 2) [m] beyond their ends by `extension` (w, 2) [m]."""
    along = endpoints[:, :, 1] - endpoints[:, :, 0]
    along = along / np.linalg.norm(along, axis=-1, keepdims=True)
    return endpoints + np.stack([-extension[:, 0, None] * along, extension[:, 1, None] * along], axis=2)


def _distance_to_next_wall(ends: Array, along: Array, w: int, end: int) -> Array:
    """Compute the distance (f,) [m] from an end of wall w along it to the nearest line of another; inf: none."""
    start, ahead = ends[:, w, end], (2 * end - 1) * along[:, w]
    distance = np.full(len(ends), np.inf)
    for other in range(ends.shape[1]):
        d = along[:, other]
        sine = ahead[:, 0] * d[:, 1] - ahead[:, 1] * d[:, 0]
        to = ends[:, other, 0] - start
        with np.errstate(divide="ignore", invalid="ignore"):
            there = (to[:, 0] * d[:, 1] - to[:, 1] * d[:, 0]) / sine
        meets = (other != w) & (np.abs(sine) > PARALLEL) & (there > 0.0)
        distance = np.where(meets, np.minimum(distance, there), distance)
    return distance
