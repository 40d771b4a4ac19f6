"""Interpolated positions of lost grains, and interpolated snapshots in place of ignored frames.

A lost grain has no reported forces, but its neighbours were in equilibrium with it. Without it they would move into
the hole, and one missing grain in a hundred ruins the forces of the whole packing. The solver therefore keeps the
grain at its interpolated position and drops its forces afterwards.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from .grains import Array
from .motion import Snapshot
from .wall_shapes import interpolate_walls

NEIGHBOURS = 6  # number of neighbours whose mean motion extrapolates that of a lost grain


def interpolate_lost_grains(window: Sequence[Snapshot], row: int) -> tuple[Snapshot, NDArray[np.bool_]]:
    """Return one snapshot of a window with its lost grains interpolated.

    Parameters
    ----------
    window
        Consecutive snapshots.
    row
        The snapshot to complete, counted in the window.

    Returns
    -------
    snapshot
        The completed snapshot. A grain seen before and after is interpolated linearly in time. A grain seen on one
        side only follows the mean displacement of its neighbours. A grain absent from the whole window stays absent.
    interpolated : (n,) bool
        The grains that were interpolated.
    """
    here = window[row]
    present = np.stack([snapshot.present for snapshot in window])
    lost = np.flatnonzero(~here.present & present.any(axis=0))
    position, rotation, completed = here.position.copy(), here.rotation.copy(), here.present.copy()
    for grain in lost:
        seen = np.flatnonzero(present[:, grain])
        before, after = seen[seen < row], seen[seen > row]
        if len(before) and len(after):
            first, last = window[before[-1]], window[after[0]]
            fraction = (here.time - first.time) / (last.time - first.time)
            position[grain] = first.position[grain] + fraction * (last.position[grain] - first.position[grain])
            rotation[grain] = first.rotation[grain] + fraction * (last.rotation[grain] - first.rotation[grain])
        else:
            nearest = window[before[-1]] if len(before) else window[after[0]]
            moved = _neighbour_displacement(nearest, here, nearest.position[grain])
            position[grain] = nearest.position[grain] + moved
            rotation[grain] = nearest.rotation[grain]
        completed[grain] = True
    interpolated = completed & ~here.present
    return replace(here, position=position, rotation=rotation, present=completed), interpolated


def interpolate_ignored_frames(snapshots: Sequence[Snapshot], rows: Collection[int]) -> list[Snapshot]:
    """Replace the ignored snapshots `rows` by interpolated ones.

    Positions, rotations, walls and cell are linear in time between the last valid frame before and the next one after;
    beyond the first and the last valid frame they are constant.

    Raises
    ------
    ValueError
        Every frame is ignored.
    """
    valid = [k for k in range(len(snapshots)) if k not in rows]
    if not valid:
        raise ValueError("all frames are ignored: no frame is left to solve")
    completed = list(snapshots)
    for k in (k for k in range(len(snapshots)) if k in rows):
        before = max((v for v in valid if v < k), default=valid[0])
        after = min((v for v in valid if v > k), default=valid[-1])
        one, two = snapshots[before], snapshots[after]
        span = two.time - one.time
        fraction = min(max((snapshots[k].time - one.time) / span, 0.0), 1.0) if span > 0 else 0.0
        completed[k] = replace(
            snapshots[k],
            position=(1.0 - fraction) * one.position + fraction * two.position,
            rotation=(1.0 - fraction) * one.rotation + fraction * two.rotation,
            present=one.present & two.present,
            endpoints=interpolate_walls(one.endpoints, two.endpoints, fraction, one.side),
            sigma=max(one.sigma, two.sigma),
            cell=None if one.cell is None or two.cell is None else (1.0 - fraction) * one.cell + fraction * two.cell,
        )
    return completed


def _neighbour_displacement(then: Snapshot, here: Snapshot, point: Array) -> Array:
    """Return the mean displacement (2,) [m] from `then` to `here` of the grains nearest to a position."""
    both = np.flatnonzero(then.present & here.present)
    if not len(both):
        return np.zeros(2)
    _, near = KDTree(then.position[both]).query(point, k=min(NEIGHBOURS, len(both)))
    rows = both[np.atleast_1d(near)]
    return (here.position[rows] - then.position[rows]).mean(axis=0)
