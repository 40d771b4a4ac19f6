"""Extension of walls that are too short, along the rods on their line, up to the next wall."""

from __future__ import annotations

import numpy as np

from ..bodies.grains import Array
from ..bodies.wall_shapes import STRAIGHT, all_sides, outward_normals
from ..calibration.gaps import MeasuredSequence

CONTACT_DISTANCE = 0.05  # radii: greatest distance of a rod's surface from the line of a wall that it bears on
PAST_END = 0.5  # radii: rods nearer to an end bear on the given wall
NEIGHBOUR_DISTANCE = 1.0  # radii: a wall is extended along rods whose surface is this near to its line
PARALLEL = 0.1  # sine of the least angle of two walls that meet


def continue_walls(sequence: MeasuredSequence) -> Array:
    """Compute the extension (w, 2) [m] of each wall beyond its ends, zero where it is long enough.

    A wall is extended only where a rod bears on its line beyond the end: past the last rod beside the line in any
    frame, but not beyond the line of another wall.
    """
    ends = sequence.endpoints
    normal = outward_normals(ends)
    along = np.stack([-normal[..., 1], normal[..., 0]], axis=-1)
    length = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
    extension = np.zeros((sequence.wall_count, 2))
    straight = np.flatnonzero(all_sides(sequence.side, sequence.wall_count) == STRAIGHT)
    for at, w in enumerate(straight.tolist()):
        offset = sequence.position - ends[:, None, w, 0]
        place = np.einsum("fnk,fk->fn", offset, along[:, w])
        off = np.abs(-np.einsum("fnk,fk->fn", offset, normal[:, w]) - sequence.radius) / sequence.radius
        for end, past in enumerate((-place, place - length[:, None, w])):
            with np.errstate(invalid="ignore"):
                bears = sequence.present & (off < CONTACT_DISTANCE) & (past > PAST_END * sequence.radius)
                rods = sequence.present & (off < NEIGHBOUR_DISTANCE) & (past > 0.0)
            if bears.any():
                reach = np.where(rods, past + sequence.radius, 0.0).max(axis=1)
                limit = _distance_to_next_wall(ends[:, straight], along[:, straight], at, end)
                extension[w, end] = np.minimum(reach, limit).max()
    return extension


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
