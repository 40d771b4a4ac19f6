"""The order in which a sweep visits contacts.

Solutions are not unique and the order selects one, so it is fixed by the geometry alone. It is also
what makes a sweep fast: neighbours in memory are neighbours in the packing (Morton order), and inside a
tile no two contacts in a row share a grain (colours), so that the processor need not wait for the last one.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from solver.grains import Array

TILE = 256  # contacts; their grains fill a small part of the first-level cache
MAX_COLOURS = 64


def visiting_order(point: Array, i: NDArray[np.int32], j: NDArray[np.int32]) -> NDArray[np.int64]:
    """Order contacts by Morton tile, then by colour inside the tile.

    point (c, 2) [m] of the contacts; i, j (c,) their bodies. Returns a permutation (c,).
    """
    if len(point) == 0:
        return np.empty(0, np.int64)
    order = np.argsort(_morton_code(point), kind="stable")
    colour = _colour_tiles(i[order].astype(np.int64), j[order].astype(np.int64), TILE)
    tile = np.arange(len(order)) // TILE
    return order[np.argsort(tile * MAX_COLOURS + colour, kind="stable")]


def _morton_code(point: Array) -> NDArray[np.uint64]:
    """Interleave the bits of the coordinates, 16 bits each."""
    low = point.min(axis=0)
    extent = max(float((point.max(axis=0) - low).max()), 1e-30)
    cell = np.minimum((point - low) / extent * 65536.0, 65535.0).astype(np.uint64)
    return _spread(cell[:, 0]) | (_spread(cell[:, 1]) << np.uint64(1))


def _spread(x: NDArray[np.uint64]) -> NDArray[np.uint64]:
    for shift, mask in ((8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555)):
        x = (x | (x << np.uint64(shift))) & np.uint64(mask)
    return x


@njit(cache=True)
def _colour_tiles(i, j, tile):  # type: ignore[no-untyped-def]
    """Give every contact the first colour that none of its two bodies has in the tile so far."""
    count = len(i)
    bodies = max(i.max(), j.max()) + 1
    used = np.zeros(bodies, np.uint64)
    colour = np.zeros(count, np.int64)
    for start in range(0, count, tile):
        stop = min(start + tile, count)
        for c in range(start, stop):
            used[i[c]] = 0
            used[j[c]] = 0
        for c in range(start, stop):
            taken = used[i[c]] | used[j[c]]
            k = 0
            while k < 63 and (taken >> np.uint64(k)) & np.uint64(1):
                k += 1
            colour[c] = k
            bit = np.uint64(1) << np.uint64(k)
            used[i[c]] |= bit
            used[j[c]] |= bit
    return colour
