"""Blocks of items that share nothing, which kernels treat at once: contacts without a common grain, for instance."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def independent_blocks(start, resource, resources, size):  # type: ignore[no-untyped-def]
    """Fill blocks one after the other with the first remaining items that share no resource with it.

    Parameters
    ----------
    start : (c + 1,)
        Item k uses resource[start[k] : start[k + 1]].
    resource : (r,)
        Numbers from 0 to resources − 1; −1: none.
    resources : int
    size : int
        Greatest number of items of a block.

    Returns
    -------
    tuple
        Items (c,) by block, and the place (blocks + 1,) of each block's first one.
    """
    count = len(start) - 1
    following = np.arange(1, count + 1)  # linked list of the remaining items
    used = np.full(resources, -1)  # last block of each resource
    items, begin = np.empty(count, np.int64), np.zeros(count + 1, np.int64)
    head, blocks, placed = 0, 0, 0
    while head < count:
        predecessor, k = -1, head
        while k < count and placed - begin[blocks] < size:
            free = True
            for q in range(start[k], start[k + 1]):
                free = free and (resource[q] < 0 or used[resource[q]] != blocks)
            if free:
                for q in range(start[k], start[k + 1]):
                    if resource[q] >= 0:
                        used[resource[q]] = blocks
                items[placed] = k
                placed += 1
                if predecessor < 0:
                    head = following[k]
                else:
                    following[predecessor] = following[k]
            else:
                predecessor = k
            k = following[k]
        blocks += 1
        begin[blocks] = placed
    return items, begin[: blocks + 1]
