"""The entries of an inverse where its matrix's factor has some: variances without the whole inverse."""

from __future__ import annotations

from numba import njit

from solver.factor.blocks import area_of, lanes_of


@njit(cache=True, nogil=True, error_model="numpy")
def invert_on_pattern(pattern, blocks, inverse, unit, where, block):  # type: ignore[no-untyped-def]
    """Set inverse to the blocks of A⁻¹ on the pattern of A's factor, as blocks, whole ones on the diagonal.

    blocks: the factor, of `factorize`, laid out as `blocks` says, like the inverse; unit: scratch of the same size;
    where (n,) integers: scratch. After Takahashi, Fagan & Chen 1973: what lies on the pattern follows from the factor
    alone, last column first.
    """
    size, lanes, area = len(block), lanes_of(block), area_of(block)
    start, row = pattern.start, pattern.row
    for k in range(len(where)):
        where[k] = -1
    for j in range(len(start) - 2, -1, -1):
        d = start[j] * area
        # The column of a factor whose diagonal blocks are unit matrices: U = L / L_jj.
        for p in range(start[j] + 1, start[j + 1]):
            where[row[p]] = p * area
            for a in range(size):
                for b in range(size):
                    total = 0.0
                    for m in range(b, size):
                        total += blocks[p * area + m * lanes + a] * blocks[d + b * lanes + m]
                    unit[p * area + b * lanes + a] = total
                    inverse[p * area + b * lanes + a] = 0.0
        # Z_ij = −Σ_k Z_ik U_kj; each known block of the symmetric Z serves both of its rows.
        for q in range(start[j] + 1, start[j + 1]):
            u, first = q * area, start[row[q]]
            _subtract_product(inverse, u, first * area, unit, u, block)
            for e in range(first + 1, start[row[q] + 1]):
                t = where[row[e]]
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
            where[row[p]] = -1


@njit(inline="always")
def _subtract_product(inverse, t, e, unit, u, block):  # type: ignore[no-untyped-def]
    """From the block at t take that at e times the unit block at u."""
    size, lanes = len(block), lanes_of(block)
    for a in range(size):
        for b in range(size):
            total = 0.0
            for m in range(size):
                total += inverse[e + m * lanes + a] * unit[u + b * lanes + m]
            inverse[t + b * lanes + a] -= total


@njit(inline="always")
def _subtract_transposed_product(inverse, t, first, e, second, u, block):  # type: ignore[no-untyped-def]
    """From the block at t take the transposed first block at e times the second at u."""
    size, lanes = len(block), lanes_of(block)
    for a in range(size):
        for b in range(size):
            total = 0.0
            for m in range(size):
                total += first[e + a * lanes + m] * second[u + b * lanes + m]
            inverse[t + b * lanes + a] -= total
