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
    half = len(values) // 2
    work = values.copy()
    upper = select(work, half)
    if len(values) % 2:
        return upper
    lower = work[0]
    for k in range(1, half):
        lower = max(lower, work[k])
    return (lower + upper) / 2


@njit(cache=True, nogil=True)
def select(values, place):
    """Return the value at a place of the ascending order of values (n,) without NaN, by Hoare's selection.

    The values are rearranged: none before the place is greater, none after it less.
    """
    low, high = 0, len(values) - 1
    while low < high:
        pivot = values[(low + high) // 2]
        i, j = low, high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while pivot < values[j]:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i += 1
                j -= 1
        if place <= j:
            high = j
        elif place >= i:
            low = i
        else:
            break
    return values[place]
