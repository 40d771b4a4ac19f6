"""Cholesky's factor of a sparse matrix of small blocks, and solutions with it.

A matrix is its lower blocks in the order of `Pattern`, flat: entry k lies in blocks[k b² : (k + 1) b²], row by row.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import njit

# The size b of the blocks is the length of a tuple, which is part of its type: the compiler unrolls what loops over it.
PAIR, TRIPLE = (0, 0), (0, 0, 0)
U = np.uint64
U1, U2, U3, U4, U5, U6, U7, U8 = U(1), U(2), U(3), U(4), U(5), U(6), U(7), U(8)


@njit(cache=True, nogil=True, error_model="numpy")
def factorize(pattern, blocks, where, block):  # type: ignore[no-untyped-def]
    """Turn a matrix into its factor L; its diagonal blocks are inverted where they stand. Whether it is definite.

    blocks: flat, in and out; where (n,) integers: scratch; block: PAIR or TRIPLE.
    """
    size = len(block)
    area = size * size
    start, row, left_start, left = pattern.start, pattern.row, pattern.left_start, pattern.left
    for j in range(len(start) - 1):
        for p in range(start[j], start[j + 1]):
            where[row[p]] = p * area
        for q in range(left_start[j], left_start[j + 1]):
            end = start[pattern.column[left[q]] + 1]
            if size == 2:
                _subtract_pairs(row, blocks, where, left[q], end)
            else:
                _subtract_triples(row, blocks, where, left[q], end)
        d = start[j] * area
        if not _invert_factor(blocks, d, size):
            return False
        for p in range(start[j] + 1, start[j + 1]):
            o = p * area
            for a in range(size):
                for b in range(size - 1, -1, -1):
                    total = 0.0
                    for m in range(b + 1):
                        total += blocks[o + a * size + m] * blocks[d + b * size + m]
                    blocks[o + a * size + b] = total
    return True


@njit(inline="always")
def _invert_factor(blocks, d, size):  # type: ignore[no-untyped-def]
    """Put the inverse of its factor in place of a block on the diagonal."""
    for a in range(size):
        for b in range(a + 1):
            total = blocks[d + a * size + b]
            for m in range(b):
                total -= blocks[d + a * size + m] * blocks[d + b * size + m]
            if a > b:
                blocks[d + a * size + b] = total / blocks[d + b * size + b]
            elif total > 0.0:
                blocks[d + a * size + a] = sqrt(total)
            else:
                return False
    for a in range(size):
        blocks[d + a * size + a] = 1.0 / blocks[d + a * size + a]
        for b in range(a):
            total = 0.0
            for m in range(b, a):
                total += blocks[d + a * size + m] * blocks[d + m * size + b]
            blocks[d + a * size + b] = -total * blocks[d + a * size + a]
            blocks[d + b * size + a] = 0.0
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def solve(pattern, blocks, right, block):  # type: ignore[no-untyped-def]
    """Solve with a factor, in place: right (b n,), rows of nodes in the order of elimination."""
    size = len(block)
    area = size * size
    start, row = pattern.start, pattern.row
    n = len(start) - 1
    for j in range(n):
        d, x = start[j] * area, j * size
        for a in range(size - 1, -1, -1):
            total = 0.0
            for m in range(a + 1):
                total += blocks[d + a * size + m] * right[x + m]
            right[x + a] = total
        for p in range(start[j] + 1, start[j + 1]):
            o, y = p * area, row[p] * size
            for a in range(size):
                for m in range(size):
                    right[y + a] -= blocks[o + a * size + m] * right[x + m]
    for j in range(n - 1, -1, -1):
        d, x = start[j] * area, j * size
        for p in range(start[j] + 1, start[j + 1]):
            o, y = p * area, row[p] * size
            for a in range(size):
                for m in range(size):
                    right[x + m] -= blocks[o + a * size + m] * right[y + a]
        for a in range(size):
            total = 0.0
            for m in range(a, size):
                total += blocks[d + m * size + a] * right[x + m]
            right[x + a] = total


# Nearly all the work of a factorisation: from the column that `where` points into take what an earlier column, from
# its entry `first` to its end, contributes. Written out, with unsigned indices, it is twice as fast.


@njit(inline="always")
def _subtract_pairs(row, blocks, where, first, end):  # type: ignore[no-untyped-def]
    k = U4 * U(first)
    k0, k1, k2, k3 = blocks[k], blocks[k + U1], blocks[k + U2], blocks[k + U3]
    for p in range(first, end):
        o, t = U4 * U(p), U(where[row[U(p)]])
        for _ in range(2):
            x, y = blocks[o], blocks[o + U1]
            blocks[t] -= x * k0 + y * k1
            blocks[t + U1] -= x * k2 + y * k3
            o += U2
            t += U2


@njit(inline="always")
def _subtract_triples(row, blocks, where, first, end):  # type: ignore[no-untyped-def]
    k = U(9) * U(first)
    k0, k1, k2, k3, k4 = blocks[k], blocks[k + U1], blocks[k + U2], blocks[k + U3], blocks[k + U4]
    k5, k6, k7, k8 = blocks[k + U5], blocks[k + U6], blocks[k + U7], blocks[k + U8]
    for p in range(first, end):
        o, t = U(9) * U(p), U(where[row[U(p)]])
        for _ in range(3):
            x, y, z = blocks[o], blocks[o + U1], blocks[o + U2]
            blocks[t] -= x * k0 + y * k1 + z * k2
            blocks[t + U1] -= x * k3 + y * k4 + z * k5
            blocks[t + U2] -= x * k6 + y * k7 + z * k8
            o += U3
            t += U3
