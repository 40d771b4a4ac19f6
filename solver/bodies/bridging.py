"""Stand-ins for what photographs have not shown: lost grains, and whole frames that are not to be believed.

Without its stand-in the neighbours of a lost grain would push into a hole.

A lost grain takes no part in what is reported, but its neighbours were in balance with it. Left out of the solve, one
grain in a hundred ruins the forces of the whole packing. So the solve keeps it where it must have been,
and its forces are dropped afterwards.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from solver.bodies.grains import Array
from solver.bodies.motion import Snapshot
from solver.bodies.wall_shapes import walls_between

NEIGHBOURS = 6  # whose motion carries a lost grain on where only one side in time is known


def bridge_lost(window: Sequence[Snapshot], row: int) -> tuple[Snapshot, NDArray[np.bool_]]:
    """Give the snapshot `row` of a window with its lost grains put back, and which they are (n,).

    A grain seen before and after moves evenly in time between; one seen on one side only moves as its neighbours did
    since. A grain that no snapshot of the window shows stays lost.
    """
    here = window[row]
    present = np.stack([snapshot.present for snapshot in window])
    lost = np.flatnonzero(~here.present & present.any(axis=0))
    position, rotation, whole = here.position.copy(), here.rotation.copy(), here.present.copy()
    for grain in lost:
        seen = np.flatnonzero(present[:, grain])
        before, after = seen[seen < row], seen[seen > row]
        if len(before) and len(after):
            first, last = window[before[-1]], window[after[0]]
            share = (here.time - first.time) / (last.time - first.time)
            position[grain] = first.position[grain] + share * (last.position[grain] - first.position[grain])
            rotation[grain] = first.rotation[grain] + share * (last.rotation[grain] - first.rotation[grain])
        else:
            nearest = window[before[-1]] if len(before) else window[after[0]]
            position[grain] = nearest.position[grain] + _carried(nearest, here, nearest.position[grain])
            rotation[grain] = nearest.rotation[grain]
        whole[grain] = True
    bridged = whole & ~here.present
    return replace(here, position=position, rotation=rotation, present=whole), bridged


def bridge_frames(snapshots: Sequence[Snapshot], rows: Collection[int]) -> list[Snapshot]:
    """Put snapshots between their neighbours where a frame, one of `rows`, is not to be believed.

    Positions, rotations and walls go linearly in time from the last believed frame to the next; before the first and
    behind the last they stand still. Raises ValueError where no frame is believed.
    """
    believed = [k for k in range(len(snapshots)) if k not in rows]
    if not believed:
        raise ValueError("no frame is believed: nothing is left to solve")
    shown = list(snapshots)
    for k in (k for k in range(len(snapshots)) if k in rows):
        before = max((b for b in believed if b < k), default=believed[0])
        after = min((b for b in believed if b > k), default=believed[-1])
        one, two = snapshots[before], snapshots[after]
        span = two.time - one.time
        share = min(max((snapshots[k].time - one.time) / span, 0.0), 1.0) if span > 0 else 0.0
        shown[k] = replace(
            snapshots[k],
            position=(1.0 - share) * one.position + share * two.position,
            rotation=(1.0 - share) * one.rotation + share * two.rotation,
            present=one.present & two.present,
            endpoints=walls_between(one.endpoints, two.endpoints, share, one.side),
            sigma=max(one.sigma, two.sigma),
            cell=None if one.cell is None or two.cell is None else (1.0 - share) * one.cell + share * two.cell,
        )
    return shown


def _carried(then: Snapshot, here: Snapshot, place: Array) -> Array:
    """Mean displacement (2,) [m] from `then` to `here` of the grains nearest to a place."""
    both = np.flatnonzero(then.present & here.present)
    if not len(both):
        return np.zeros(2)
    _, near = KDTree(then.position[both]).query(place, k=min(NEIGHBOURS, len(both)))
    rows = both[np.atleast_1d(near)]
    return (here.position[rows] - then.position[rows]).mean(axis=0)
