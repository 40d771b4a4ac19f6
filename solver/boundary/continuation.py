"""Walls that were told too short go on: along the rods that lie on their line, to where they meet the next wall."""

from __future__ import annotations

import numpy as np

from solver.bodies.grains import Array
from solver.bodies.wall_shapes import STRAIGHT, all_sides, outward_normals
from solver.calibration.gaps import MeasuredSequence

BEARING = 0.05  # radii off the line: a rod as near as that may bear on the wall
BEYOND = 0.5  # radii past an end: nearer ones bear on the wall as it was told
BESIDE = 1.0  # radii off the line: a wall goes on along rods as near as that
PARALLEL = 0.1  # sine of the least angle of two walls that meet


def continue_walls(sequence: MeasuredSequence) -> Array:
    """How far each wall goes on beyond its ends (w, 2) [m], zero where it was told long enough.

    It goes on only where a rod lies on its line beyond the end, past the last rod beside it in any frame, and not
    beyond the line of another wall.
    """
    ends = sequence.endpoints
    normal = outward_normals(ends)
    along = np.stack([-normal[..., 1], normal[..., 0]], axis=-1)
    length = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
    beyond = np.zeros((sequence.wall_count, 2))
    straight = np.flatnonzero(all_sides(sequence.side, sequence.wall_count) == STRAIGHT)
    for at, w in enumerate(straight.tolist()):
        offset = sequence.position - ends[:, None, w, 0]
        place = np.einsum("fnk,fk->fn", offset, along[:, w])
        off = np.abs(-np.einsum("fnk,fk->fn", offset, normal[:, w]) - sequence.radius) / sequence.radius
        for end, past in enumerate((-place, place - length[:, None, w])):
            with np.errstate(invalid="ignore"):
                bears = sequence.present & (off < BEARING) & (past > BEYOND * sequence.radius)
                rods = sequence.present & (off < BESIDE) & (past > 0.0)
            if bears.any():
                reach = np.where(rods, past + sequence.radius, 0.0).max(axis=1)
                beyond[w, end] = np.minimum(reach, _way_to_next(ends[:, straight], along[:, straight], at, end)).max()
    return beyond


def lengthen(endpoints: Array, beyond: Array) -> Array:
    """Walls (f, w, 2, 2) [m] that go on beyond their ends by `beyond` (w, 2) [m]."""
    along = endpoints[:, :, 1] - endpoints[:, :, 0]
    along = along / np.linalg.norm(along, axis=-1, keepdims=True)
    return endpoints + np.stack([-beyond[:, 0, None] * along, beyond[:, 1, None] * along], axis=2)


def _way_to_next(ends: Array, along: Array, w: int, end: int) -> Array:
    """Distance (f,) [m] from an end of wall w, along the wall, to the nearest line of another; inf: there is none."""
    start, ahead = ends[:, w, end], (2 * end - 1) * along[:, w]
    way = np.full(len(ends), np.inf)
    for other in range(ends.shape[1]):
        d = along[:, other]
        sine = ahead[:, 0] * d[:, 1] - ahead[:, 1] * d[:, 0]
        to = ends[:, other, 0] - start
        with np.errstate(divide="ignore", invalid="ignore"):
            there = (to[:, 0] * d[:, 1] - to[:, 1] * d[:, 0]) / sine
        meets = (other != w) & (np.abs(sine) > PARALLEL) & (there > 0.0)
        way = np.where(meets, np.minimum(way, there), way)
    return way
