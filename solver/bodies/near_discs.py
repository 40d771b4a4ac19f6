"""Discs whose surfaces are near each other, by a grid of squares: only discs of neighbouring squares can be."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from solver.bodies.grains import Array

PAIRS = 6  # of each disc for which there is room at first
OUTSIDE = 0.01  # share of the discs that may lie beyond the grid, either way
ROUNDING = 1e-9  # by which a square is wider than discs reach


def find_near_discs(place: Array, radius: Array, threshold: float) -> NDArray[np.int64]:
    """Pairs (c, 2) of rows, the first below the second, of discs whose gap is below the threshold [m].

    place (n, 2) [m], finite; radius (n,) [m]. Errors: ValueError where a place is not finite.
    """
    count = len(place)
    reach = 2.0 * float(radius.max(initial=0.0)) + threshold
    if count < 2 or not reach > 0.0:
        return np.empty((0, 2), np.int64)
    if not np.isfinite(place).all():
        raise ValueError("the place of a disc is not finite")
    few = int(OUTSIDE * count)  # a disc far away must not make the squares large: it counts to those at the edge
    ordered = np.partition(place, (few, count - 1 - few), axis=0)
    low, extent = ordered[few], ordered[count - 1 - few] - ordered[few]
    shape = np.clip(extent / (reach * (1.0 + ROUNDING)), 1, math.isqrt(count)).astype(np.int64)
    share = (place - low) / np.maximum(extent, np.finfo(float).tiny)
    square = np.clip(share * shape, 0, shape - 1).astype(np.int64)
    number = square[:, 0] * shape[1] + square[:, 1]
    order = np.argsort(number, kind="stable")
    start = np.concatenate([[0], np.cumsum(np.bincount(number, minlength=shape[0] * shape[1]))])
    found = np.empty((PAIRS * count, 2), np.int64)
    total = _search(place[order], radius[order], order, start, shape, threshold, found)
    if total > len(found):
        found = np.empty((total, 2), np.int64)
        _search(place[order], radius[order], order, start, shape, threshold, found)
    return found[:total]


@njit(cache=True, nogil=True, error_model="numpy")
def _search(place, radius, order, start, shape, threshold, found):  # type: ignore[no-untyped-def]
    """Put down as many pairs as there is room for; gives how many there are. Discs are ordered by square."""
    total = 0
    for x in range(shape[0]):
        for y in range(shape[1]):
            here = x * shape[1] + y
            for a in range(start[here], start[here + 1]):
                # Every pair of squares once: the discs after this one in its own, those above, and the next column.
                for other in range(x, min(x + 2, shape[0])):
                    low = y if other == x else max(y - 1, 0)
                    high = min(y + 1, shape[1] - 1)
                    first = a + 1 if other == x else start[other * shape[1] + low]
                    for b in range(first, start[other * shape[1] + high + 1]):
                        u, v = place[b, 0] - place[a, 0], place[b, 1] - place[a, 1]
                        if math.sqrt(u * u + v * v) - radius[a] - radius[b] < threshold:
                            if total < len(found):
                                i, j = order[a], order[b]
                                found[total, 0], found[total, 1] = min(i, j), max(i, j)
                            total += 1
    return total
