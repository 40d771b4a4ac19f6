"""Measured displacements between frames: at the contacts, their scale, and reversals of the loading."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ..bodies.cell import Cell
from ..bodies.grains import Array
from ..bodies.strain import find_dominant_rigid_motion
from ..bodies.wall_shapes import wall_displacement
from ..bodies.walls import Walls
from ..contacts.contacts import Contacts
from ..contacts.kinematics import relative_motion

NEIGHBOURS = 8  # grains whose mean displacement is subtracted: a little more than the first shell
LEAST_SCALE = 1e-6  # of the distance to the neighbours: below the resolution of any photograph


def contact_displacement(
    contacts: Contacts,
    radius: Array,
    position: tuple[Array, Array],
    rotation: tuple[Array, Array],
    walls: Walls,
    endpoints: tuple[Array, Array],
    cells: tuple[Array | None, Array | None] = (None, None),
) -> tuple[Array, Array]:
    """Return the measured relative displacement at the contacts between two frames.

    Parameters
    ----------
    contacts, radius, walls
        Contacts, radii (n,) [m] and walls of the frame whose forces are computed; its normals and points are used for
        the whole interval.
    position : two (n, 2)
        Earlier and later positions [m], NaN where a grain is missing.
    rotation : two (n,)
        Earlier and later rotations [rad].
    endpoints : two (w, 2, 2)
        Earlier and later walls [m].
    cells : two (2, 2), optional
        Earlier and later vectors of the cell [m].

    Returns
    -------
    un, ut : (c,)
        Displacement of j relative to i [m]; NaN for a contact of a grain that is missing in either frame.
    """
    cell, (before, after) = walls.cell, cells
    if cell is not None and before is not None and after is not None:
        cell = Cell(cell.vectors, after - before)
    displacement = wall_displacement(*endpoints, walls.side, at=walls.endpoints)
    moved = Walls(walls.endpoints, displacement, walls.load, walls.side, cell, walls.plate)
    return relative_motion(contacts, radius, position[1] - position[0], rotation[1] - rotation[0], moved)


def displacement_scale(before: Array, after: Array, sigma: Array) -> float:
    """Estimate the rms non-affine displacement of a grain in an interval.

    Parameters
    ----------
    before, after : (n, 2)
        Positions [m], NaN where a grain is missing.
    sigma : (n,)
        Standard deviation of a position component in either frame [m].

    Returns
    -------
    float
        The scale s of one component [m].

    Raises
    ------
    ValueError
        Fewer than two grains are present in both frames.

    Notes
    -----
    s² = ⟨(Δx_i − mean of Δx_j over the m nearest neighbours j)²⟩ − 2 ⟨σ_i² + ⟨σ_j²⟩ / m⟩, with Δx the displacements
    without a rigid motion of all grains that dominates them. s is at least the rms σ of one position and a millionth of
    the neighbours' distance. In sheared packings s is 0.6 to 1.0 of the rms sliding at the contacts.
    """
    return _displacement_scale(before.tobytes(), after.tobytes(), sigma.tobytes())


@lru_cache(maxsize=16)  # the intervals before a frame and after the frame before it are one
def _displacement_scale(*arrays: bytes) -> float:
    before, after, sigma = (np.frombuffer(each) for each in arrays)
    before, after = before.reshape(-1, 2), after.reshape(-1, 2)
    seen = np.flatnonzero(np.isfinite(before).all(axis=1) & np.isfinite(after).all(axis=1))
    count = min(NEIGHBOURS, len(seen) - 1)
    if count < 1:
        raise ValueError("fewer than two grains are seen in both frames: no displacement scale")
    distance, near = _neighbours(before[seen].tobytes(), count)
    rigid = find_dominant_rigid_motion(before[seen], after[seen], np.ones(len(seen), np.bool_))
    moved = after[seen] - (before[seen] if rigid is None else rigid.moved(before[seen]))
    non_affine = moved - moved[near].mean(axis=1)
    variance = sigma[seen] ** 2
    noise = 2.0 * (variance.mean() + variance[near].mean() / count)
    least = max(variance.mean(), (LEAST_SCALE * distance) ** 2)
    return float(np.sqrt(max((non_affine**2).mean() - noise, least)))


@lru_cache(maxsize=16)  # the intervals around a frame begin at few photographs
def _neighbours(points: bytes, count: int) -> tuple[float, NDArray[np.int32]]:
    """Return the mean distance to the `count` nearest points and their rows (n, count); points (n, 2) [m] as bytes."""
    at = np.frombuffer(points).reshape(-1, 2)
    distance, near = KDTree(at).query(at, k=count + 1)
    return float(np.asarray(distance)[:, 1:].mean()), np.asarray(near)[:, 1:].astype(np.int32)


def find_reversals(endpoints: Array, position: Array) -> NDArray[np.bool_]:
    """Find the frames at which the loading reverses.

    Parameters
    ----------
    endpoints : (f, w, 2, 2)
        Walls [m].
    position : (f, n, 2)
        Positions [m], NaN where a grain is missing.

    Returns
    -------
    (f,) bool
        True where the motion after the frame is opposite to the last motion before it (negative scalar product). The
        motion of an interval is that of the walls' ends or, where no wall moves, the mean strain of the grains.
        Intervals without motion are skipped.
    """
    frames = len(endpoints)
    motion = np.diff(endpoints.reshape(frames, -1), axis=0)
    if not np.any(motion):
        motion = np.stack([_mean_strain(position[f], position[f + 1]) for f in range(frames - 1)] or [np.empty(0)])
    size = np.linalg.norm(motion, axis=1)
    reversed_at = np.zeros(frames, dtype=bool)
    last = None
    for f in range(frames - 1):
        if size[f] < 1e-3 * size.max(initial=0.0) or size[f] == 0.0:
            continue
        if last is not None and motion[f] @ motion[last] < 0.0:
            reversed_at[f] = True
        last = f
    return reversed_at


def member_intervals(frame: int, reversed_at: NDArray[np.bool_], span: int = 1) -> tuple[tuple[int, int] | None, ...]:
    """Return the intervals (k−m, k), (k, k+m), (k−m, k+m), (k−2m, k+2m) of the convex ensemble members at frame k.

    Parameters
    ----------
    frame
        k.
    reversed_at : (f,) bool
        Result of `find_reversals`.
    span
        m.

    Returns
    -------
    tuple
        The four intervals, cut at the first and last frame and at reversals; None where a cut interval is empty or
        repeats an earlier one. A reversal ends the motion that led to it; the first frame only has the motion that
        follows.
    """
    last = len(reversed_at) - 1
    if last < 1:
        raise ValueError("a single frame has no interval")
    reversals = np.flatnonzero(reversed_at)
    before, after = reversals[reversals < frame], reversals[reversals >= frame]
    lowest = int(before[-1]) if len(before) else 0
    highest = min(int(after[0]), last) if len(after) else last
    if frame == 0:
        highest = max(highest, 1)
    intervals: list[tuple[int, int] | None] = []
    for back, ahead in ((1, 0), (0, 1), (1, 1), (2, 2)):
        interval = max(frame - span * back, lowest), min(frame + span * ahead, highest)
        intervals.append(None if interval[0] == interval[1] or interval in intervals else interval)
    return tuple(intervals)


def _mean_strain(before: Array, after: Array) -> Array:
    """Return the gradient of the best affine fit to the motion of all grains (4,)."""
    seen = np.isfinite(before).all(axis=1) & np.isfinite(after).all(axis=1)
    start = before[seen] - before[seen].mean(axis=0) if seen.any() else np.empty((0, 2))
    moved = after[seen] - before[seen]
    if len(start) < 3:
        return np.zeros(4)
    design = np.column_stack([start, np.ones(len(start))])
    return np.asarray(np.linalg.lstsq(design, moved, rcond=None)[0][:2].ravel(), dtype=np.float64)
