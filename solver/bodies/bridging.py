"""Stand-ins for grains that one photograph has lost: without them their neighbours would push into a hole.

A lost grain takes no part in what is reported, but its neighbours were in balance with it. Left out of the solve, one
grain in a hundred ruins the forces of the whole packing. So the solve keeps it where it must have been,
and its forces are dropped afterwards.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from solver.bodies.grains import Array
from solver.bodies.motion import Snapshot

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


def _carried(then: Snapshot, here: Snapshot, place: Array) -> Array:
    """Mean displacement (2,) [m] from `then` to `here` of the grains nearest to a place."""
    both = np.flatnonzero(then.present & here.present)
    if not len(both):
        return np.zeros(2)
    _, near = KDTree(then.position[both]).query(place, k=min(NEIGHBOURS, len(both)))
    rows = both[np.atleast_1d(near)]
    return (here.position[rows] - then.position[rows]).mean(axis=0)
