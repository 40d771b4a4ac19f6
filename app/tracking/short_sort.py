"""Order of short arrays in kernels; numba's own sorts take seconds to compile."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def ascending_order(values):
    """Return the order (n,) that sorts values (n,) without NaN; equal ones keep theirs. Merges runs of doubled length.

    Parameters
    ----------
    values : (n,) array of float64

    Returns
    -------
    order : (n,) array of int64
    """
    count = len(values)
    order, merged = np.empty(count, np.int64), np.empty(count, np.int64)
    for k in range(count):
        order[k] = k
    length = 1
    while length < count:
        for start in range(0, count, 2 * length):
            middle, end = min(start + length, count), min(start + 2 * length, count)
            left, right = start, middle
            for k in range(start, end):
                if left < middle and (right == end or not values[order[right]] < values[order[left]]):
                    merged[k] = order[left]
                    left += 1
                else:
                    merged[k] = order[right]
                    right += 1
        order, merged = merged, order
        length *= 2
    return order


@njit(cache=True, nogil=True)
def median(values):
    """Return the median of values (n,) without NaN, n ≥ 1."""
    order = ascending_order(values)
    half = len(values) // 2
    if len(values) % 2:
        return values[order[half]]
    return (values[order[half - 1]] + values[order[half]]) / 2
