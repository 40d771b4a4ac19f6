"""Measured displacements between frames: at the contacts, their typical size, and where the loading reverses."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from solver.bodies.cell import Cell
from solver.bodies.grains import Array
from solver.bodies.wall_shapes import walls_moved
from solver.bodies.walls import Walls
from solver.contacts.contacts import Contacts
from solver.contacts.kinematics import relative_motion

NEIGHBOURS = 8  # grains that a displacement is compared with: a little more than the first shell
LEAST_SCALE = 1e-6  # of the distance to the neighbours: less than any photograph can show


def contact_displacement(
    contacts: Contacts,
    radius: Array,
    position: tuple[Array, Array],
    rotation: tuple[Array, Array],
    walls: Walls,
    endpoints: tuple[Array, Array],
    cells: tuple[Array | None, Array | None] = (None, None),
) -> tuple[Array, Array]:
    """Give the measured relative displacement at the contacts between two frames (u_n, u_t), each (c,) [m].

    position: earlier and later (n, 2) [m], NaN where a grain is missing; rotation: both (n,) [rad]; endpoints: both
    (w, 2, 2) [m]; cells: vectors (2, 2) [m] of both, where there is a cell. Contacts, walls and radius (n,) [m] are
    those of the frame whose forces are sought: its normals and points hold for the whole interval. A contact of a
    grain missing in either frame gets NaN.
    """
    cell, (before, after) = walls.cell, cells
    if cell is not None and before is not None and after is not None:
        cell = Cell(cell.vectors, after - before)
    way = walls_moved(*endpoints, walls.side, at=walls.endpoints)
    moved = Walls(walls.endpoints, way, walls.load, walls.side, cell)
    return relative_motion(contacts, radius, position[1] - position[0], rotation[1] - rotation[0], moved)


def displacement_scale(before: Array, after: Array, sigma: Array) -> float:
    """Estimate the typical size of a component of the displacement between neighbours in an interval [m].

    before, after (n, 2) [m], NaN where a grain is missing; sigma (n,) [m], standard deviation of a position component
    in either frame. It is the rms of what remains of every grain's displacement when the mean displacement of
    its nearest neighbours is taken off, freed of the noise; never less than the noise or
    a millionth of the neighbours' distance. In sheared packings it is 0.6 to 1.0 of the rms sliding at the contacts.
    """
    seen = np.flatnonzero(np.isfinite(before).all(axis=1) & np.isfinite(after).all(axis=1))
    count = min(NEIGHBOURS, len(seen) - 1)
    if count < 1:
        raise ValueError("fewer than two grains are seen in both frames: no displacement scale")
    distance, near = _neighbours(before[seen].tobytes(), count)
    moved = after[seen] - before[seen]
    rest = moved - moved[near].mean(axis=1)
    variance = sigma[seen] ** 2
    noise = 2.0 * (variance.mean() + variance[near].mean() / count)
    least = max(variance.mean(), (LEAST_SCALE * distance) ** 2)
    return float(np.sqrt(max((rest**2).mean() - noise, least)))


@lru_cache(maxsize=8)  # intervals around a frame begin at the same few photographs
def _neighbours(place: bytes, count: int) -> tuple[float, NDArray[np.intp]]:
    """Mean distance to the `count` nearest of places (n, 2) [m], as bytes, and which these are (n, count)."""
    at = np.frombuffer(place).reshape(-1, 2)
    distance, near = KDTree(at).query(at, k=count + 1)
    return float(np.asarray(distance)[:, 1:].mean()), np.asarray(near)[:, 1:]


def find_reversals(endpoints: Array, position: Array) -> NDArray[np.bool_]:
    """Say at which frames the loading turns round (f,): the motion after it undoes the motion before it.

    endpoints (f, w, 2, 2) [m] of the walls; position (f, n, 2) [m], NaN where missing. The motion of an
    interval is that of the walls' ends; where no wall moves, the mean strain of the grains. A rest in between
    does not hide a reversal: each motion is compared with the last one that was there.
    """
    frames = len(endpoints)
    motion = np.diff(endpoints.reshape(frames, -1), axis=0)
    if not np.any(motion):
        motion = np.stack([_mean_strain(position[f], position[f + 1]) for f in range(frames - 1)] or [np.empty(0)])
    size = np.linalg.norm(motion, axis=1)
    turned = np.zeros(frames, dtype=bool)
    last = None
    for f in range(frames - 1):
        if size[f] < 1e-3 * size.max(initial=0.0) or size[f] == 0.0:
            continue
        if last is not None and motion[f] @ motion[last] < 0.0:
            turned[f] = True
        last = f
    return turned


def member_intervals(frame: int, reversed_at: NDArray[np.bool_]) -> tuple[tuple[int, int] | None, ...]:
    """Give the intervals (k−1, k), (k, k+1), (k−1, k+1), (k−2, k+2), cut to what may be used; None: nothing of its own.

    reversed_at (f,), of `find_reversals`. An interval ends at the first or last frame and at a reversal. The forces at
    a reversal are those of the motion that led there; the first frame has only the motion that follows. An
    interval that is cut down to one already given would only repeat it.
    """
    last = len(reversed_at) - 1
    if last < 1:
        raise ValueError("a single frame has no interval")
    turns = np.flatnonzero(reversed_at)
    before, after = turns[turns < frame], turns[turns >= frame]
    lowest = int(before[-1]) if len(before) else 0
    highest = min(int(after[0]), last) if len(after) else last
    if frame == 0:
        highest = max(highest, 1)
    given: list[tuple[int, int] | None] = []
    for back, ahead in ((1, 0), (0, 1), (1, 1), (2, 2)):
        interval = max(frame - back, lowest), min(frame + ahead, highest)
        given.append(None if interval[0] == interval[1] or interval in given else interval)
    return tuple(given)


def _mean_strain(before: Array, after: Array) -> Array:
    """Gradient of the affine motion that fits all grains best (4,)."""
    seen = np.isfinite(before).all(axis=1) & np.isfinite(after).all(axis=1)
    start = before[seen] - before[seen].mean(axis=0) if seen.any() else np.empty((0, 2))
    moved = after[seen] - before[seen]
    if len(start) < 3:
        return np.zeros(4)
    design = np.column_stack([start, np.ones(len(start))])
    return np.asarray(np.linalg.lstsq(design, moved, rcond=None)[0][:2].ravel(), dtype=np.float64)
