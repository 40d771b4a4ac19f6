"""Cholesky factorisation of a sparse matrix of small blocks, and solution with the factor.

A matrix is stored as its lower blocks in the order of `Pattern`, flat, in the layout of `blocks`.
"""

from __future__ import annotations

from math import sqrt

from numba import njit

from .blocks import backward_substitution, block_size, forward_substitution, padded_rows, scale_column, schur_update


@njit(cache=True, nogil=True, error_model="numpy")
def factorize(pattern, blocks, row_offset, block):  # type: ignore[no-untyped-def]
    """Factorise A = L Lᵀ in place, with inverted diagonal blocks.

    Parameters
    ----------
    pattern : Pattern
        Entries of the factor.
    blocks : flat array
        Lower blocks of A, replaced by those of L.
    row_offset : (n,) int
        Scratch.
    block : tuple
        PAIR or TRIPLE, the size of the blocks.

    Returns
    -------
    bool
        Whether A is positive definite.
    """
    area = block_size(block)
    start, row, left_start, left = pattern.start, pattern.row, pattern.left_start, pattern.left
    for j in range(len(start) - 1):
        for p in range(start[j], start[j + 1]):
            row_offset[row[p]] = p * area
        for q in range(left_start[j], left_start[j + 1]):
            schur_update(row, blocks, row_offset, left[q], start[pattern.column[left[q]] + 1], block)
        if not _invert_factor(blocks, start[j] * area, block):
            return False
        scale_column(blocks, start[j], start[j + 1], block)
    return True


@njit(inline="always")
def _invert_factor(blocks, d, block):  # type: ignore[no-untyped-def]
    """Replace a diagonal block by the inverse of its Cholesky factor, with zeros above the diagonal."""
    lanes = padded_rows(block)
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
def solve(pattern, blocks, rhs, block):  # type: ignore[no-untyped-def]
    """Solve L Lᵀ x = b in place.

    Parameters
    ----------
    pattern : Pattern
        Entries of the factor.
    blocks : flat array
        The factor, of `factorize`.
    rhs : flat array
        b, replaced by x: vectors of the nodes in the order of elimination, padded with zeros like columns of blocks.
    block : tuple
        PAIR or TRIPLE, the size of the blocks.
    """
    size, lanes, area = len(block), padded_rows(block), block_size(block)
    start, row = pattern.start, pattern.row
    n = len(start) - 1
    for j in range(n):
        d, x = start[j] * area, j * lanes
        for a in range(size - 1, -1, -1):
            total = 0.0
            for m in range(a + 1):
                total += blocks[d + m * lanes + a] * rhs[x + m]
            rhs[x + a] = total
        forward_substitution(row, blocks, start[j] + 1, start[j + 1], rhs, x, block)
    for j in range(n - 1, -1, -1):
        d, x = start[j] * area, j * lanes
        backward_substitution(row, blocks, start[j] + 1, start[j + 1], rhs, x, block)
        for a in range(size):
            total = 0.0
            for m in range(a, size):
                total += blocks[d + a * lanes + m] * rhs[x + m]
            rhs[x + a] = total
