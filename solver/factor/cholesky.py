"""Cholesky's factor of a sparse matrix of small blocks, and solutions with it.

A matrix is its lower blocks in the order of `Pattern`, flat, as `blocks` lays them out.
"""

from __future__ import annotations

from math import sqrt

from numba import njit

from solver.factor.blocks import area_of, lanes_of, scale_column, take_from_rows, take_products, take_rows


@njit(cache=True, nogil=True, error_model="numpy")
def factorize(pattern, blocks, where, block):  # type: ignore[no-untyped-def]
    """Turn a matrix into its factor L; its diagonal blocks are inverted where they stand. Whether it is definite.

    blocks: flat, in and out; where (n,) integers: scratch; block: PAIR or TRIPLE.
    """
    area = area_of(block)
    start, row, left_start, left = pattern.start, pattern.row, pattern.left_start, pattern.left
    for j in range(len(start) - 1):
        for p in range(start[j], start[j + 1]):
            where[row[p]] = p * area
        for q in range(left_start[j], left_start[j + 1]):
            take_products(row, blocks, where, left[q], start[pattern.column[left[q]] + 1], block)
        if not _invert_factor(blocks, start[j] * area, block):
            return False
        scale_column(blocks, start[j], start[j + 1], block)
    return True


@njit(inline="always")
def _invert_factor(blocks, d, block):  # type: ignore[no-untyped-def]
    """Put the inverse of its factor in place of a block on the diagonal; above it, zeros."""
    lanes = lanes_of(block)
    for a in range(len(block)):
        for b in range(a + 1):
            total = blocks[d + b * lanes + a]
            for m in range(b):
                total -= blocks[d + m * lanes + a] * blocks[d + m * lanes + b]
            if a > b:
                blocks[d + b * lanes + a] = total * blocks[d + b * lanes + b]
            elif total > 0.0:
                blocks[d + a * lanes + a] = 1.0 / sqrt(total)
            else:
                return False
    for a in range(len(block)):
        for b in range(a):
            total = 0.0
            for m in range(b, a):
                total += blocks[d + m * lanes + a] * blocks[d + b * lanes + m]
            blocks[d + b * lanes + a] = -total * blocks[d + a * lanes + a]
            blocks[d + a * lanes + b] = 0.0
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def solve(pattern, blocks, right, block):  # type: ignore[no-untyped-def]
    """Solve with a factor, in place.

    right: flat, rows of nodes in the order of elimination, filled up as the columns of blocks are, with zeros.
    """
    size, lanes, area = len(block), lanes_of(block), area_of(block)
    start, row = pattern.start, pattern.row
    n = len(start) - 1
    for j in range(n):
        d, x = start[j] * area, j * lanes
        for a in range(size - 1, -1, -1):
            total = 0.0
            for m in range(a + 1):
                total += blocks[d + m * lanes + a] * right[x + m]
            right[x + a] = total
        take_from_rows(row, blocks, start[j] + 1, start[j + 1], right, x, block)
    for j in range(n - 1, -1, -1):
        d, x = start[j] * area, j * lanes
        take_rows(row, blocks, start[j] + 1, start[j + 1], right, x, block)
        for a in range(size):
            total = 0.0
            for m in range(a, size):
                total += blocks[d + a * lanes + m] * right[x + m]
            right[x + a] = total
