"""Entries of an inverse on the pattern of the Cholesky factor: variances without the whole inverse."""

from __future__ import annotations

from numba import njit

from .blocks import block_size, padded_rows


@njit(cache=True, nogil=True, error_model="numpy")
def invert_on_pattern(pattern, blocks, inverse, unit, row_offset, block):  # type: ignore[no-untyped-def]
    """Compute the blocks of A⁻¹ on the pattern of A's factor.

    Parameters
    ----------
    pattern : Pattern
        Entries of the factor.
    blocks : flat array
        The factor, of `factorize`.
    inverse : flat array
        Result in the same layout; diagonal blocks are complete.
    unit : flat array
        Scratch of the same size.
    row_offset : (n,) int
        Scratch.
    block : tuple
        PAIR or TRIPLE, the size of the blocks.

    Notes
    -----
    Takahashi, Fagan & Chen 1973: with U = L / L_jj, Z_ij = −Σ_k Z_ik U_kj. The entries on the pattern follow from the
    factor alone, last column first.
    """
    size, lanes, area = len(block), padded_rows(block), block_size(block)
    start, row = pattern.start, pattern.row
    for k in range(len(row_offset)):
        row_offset[k] = -1
    for j in range(len(start) - 2, -1, -1):
        d = start[j] * area
        # Column of the factor with unit diagonal blocks: U = L / L_jj.
        for p in range(start[j] + 1, start[j + 1]):
            row_offset[row[p]] = p * area
            for a in range(size):
                for b in range(size):
                    total = 0.0
                    for m in range(b, size):
                        total += blocks[p * area + m * lanes + a] * blocks[d + b * lanes + m]
                    unit[p * area + b * lanes + a] = total
                    inverse[p * area + b * lanes + a] = 0.0
        # Z_ij = −Σ_k Z_ik U_kj; each known block of the symmetric Z contributes to both of its rows.
        for q in range(start[j] + 1, start[j + 1]):
            u, first = q * area, start[row[q]]
            _subtract_product(inverse, u, first * area, unit, u, block)
            for e in range(first + 1, start[row[q] + 1]):
                t = row_offset[row[e]]
                if t >= 0:
                    _subtract_product(inverse, t, e * area, unit, u, block)
                    _subtract_transposed_product(inverse, u, inverse, e * area, unit, t, block)
        for a in range(size):
            for b in range(size):
                total = 0.0
                for m in range(max(a, b), size):
                    total += blocks[d + a * lanes + m] * blocks[d + b * lanes + m]
                inverse[d + b * lanes + a] = total
        for p in range(start[j] + 1, start[j + 1]):
            _subtract_transposed_product(inverse, d, unit, p * area, inverse, p * area, block)
            row_offset[row[p]] = -1


@njit(inline="always")
def _subtract_product(inverse, t, e, unit, u, block):  # type: ignore[no-untyped-def]
    """Subtract the block at e times the unit block at u from the block at t."""
    size, lanes = len(block), padded_rows(block)
    for a in range(size):
        for b in range(size):
            total = 0.0
            for m in range(size):
                total += inverse[e + m * lanes + a] * unit[u + b * lanes + m]
            inverse[t + b * lanes + a] -= total


@njit(inline="always")
def _subtract_transposed_product(inverse, t, first, e, second, u, block):  # type: ignore[no-untyped-def]
    """Subtract the transposed first block at e times the second at u from the block at t."""
    size, lanes = len(block), padded_rows(block)
    for a in range(size):
        for b in range(size):
            total = 0.0
            for m in range(size):
                total += first[e + a * lanes + m] * second[u + b * lanes + m]
            inverse[t + b * lanes + a] -= total
