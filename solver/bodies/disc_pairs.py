"""Pairs of discs with a gap below a threshold, searched in neighbouring squares of a grid (cell list)."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .grains import Array

PAIRS_PER_DISC = 6  # first size of the result
OUTSIDE = 0.01  # fraction of the discs that may lie beyond the grid, on either side
ROUNDING = 1e-9  # by which a square is wider than the range of the search


def find_disc_pairs(position: Array, radius: Array, threshold: float) -> NDArray[np.int64]:
    """Find all pairs of discs whose gap is below the threshold.

    Parameters
    ----------
    position : (n, 2)
        Centres [m], finite.
    radius : (n,)
        Radii [m].
    threshold
        Greatest gap [m].

    Returns
    -------
    (c, 2) int
        Rows of the discs, the first below the second.

    Raises
    ------
    ValueError
        A position is not finite.
    """
    count = len(position)
    reach = 2.0 * float(radius.max(initial=0.0)) + threshold
    if count < 2 or not reach > 0.0:
        return np.empty((0, 2), np.int64)
    if not np.isfinite(position).all():
        raise ValueError("the position of a disc is not finite")
    few = int(OUTSIDE * count)  # a distant disc must not enlarge the squares: it belongs to a square at the edge
    ordered = np.partition(position, (few, count - 1 - few), axis=0)
    low, extent = ordered[few], ordered[count - 1 - few] - ordered[few]
    shape = np.clip(extent / (reach * (1.0 + ROUNDING)), 1, math.isqrt(count)).astype(np.int64)
    fraction = (position - low) / np.maximum(extent, np.finfo(float).tiny)
    square = np.clip(fraction * shape, 0, shape - 1).astype(np.int64)
    number = square[:, 0] * shape[1] + square[:, 1]
    order = np.argsort(number, kind="stable")
    start = np.concatenate([[0], np.cumsum(np.bincount(number, minlength=shape[0] * shape[1]))])
    found = np.empty((PAIRS_PER_DISC * count, 2), np.int64)
    total = _search(position[order], radius[order], order, start, shape, threshold, found)
    if total > len(found):
        found = np.empty((total, 2), np.int64)
        _search(position[order], radius[order], order, start, shape, threshold, found)
    return found[:total]


@njit(cache=True, nogil=True, error_model="numpy")
def _search(position, radius, order, start, shape, threshold, found):  # type: ignore[no-untyped-def]
    """Write as many pairs as `found` holds and return their total number. Discs are ordered by square."""
    total = 0
    for x in range(shape[0]):
        for y in range(shape[1]):
            here = x * shape[1] + y
            for a in range(start[here], start[here + 1]):
                # Every pair of squares once: later discs of the same square, the square above, the next column.
                for other in range(x, min(x + 2, shape[0])):
                    low = y if other == x else max(y - 1, 0)
                    high = min(y + 1, shape[1] - 1)
                    first = a + 1 if other == x else start[other * shape[1] + low]
                    for b in range(first, start[other * shape[1] + high + 1]):
                        u, v = position[b, 0] - position[a, 0], position[b, 1] - position[a, 1]
                        if math.sqrt(u * u + v * v) - radius[a] - radius[b] < threshold:
                            if total < len(found):
                                i, j = order[a], order[b]
                                found[total, 0], found[total, 1] = min(i, j), max(i, j)
                            total += 1
    return total
