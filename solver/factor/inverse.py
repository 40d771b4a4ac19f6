"""The entries of an inverse where its matrix's factor has some: variances without the whole inverse."""

from __future__ import annotations

from numba import njit


@njit(cache=True, nogil=True, error_model="numpy")
def invert_on_pattern(pattern, blocks, inverse, unit, where, block):  # type: ignore[no-untyped-def]
    """Set inverse to the blocks of A⁻¹ on the pattern of A's factor, as blocks, whole ones on the diagonal.

    blocks: the factor, of `factorize`; unit: scratch of the same size; where (n,) integers: scratch. After
    Takahashi, Fagan & Chen 1973: what lies on the pattern follows from the factor alone, last column first.
    """
    size = len(block)
    area = size * size
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
                        total += blocks[p * area + a * size + m] * blocks[d + m * size + b]
                    unit[p * area + a * size + b] = total
                    inverse[p * area + a * size + b] = 0.0
        # Z_ij = −Σ_k Z_ik U_kj; each known block of the symmetric Z serves both of its rows.
        for q in range(start[j] + 1, start[j + 1]):
            u, first = q * area, start[row[q]]
            _subtract_product(inverse, u, first * area, unit, u, size)
            for e in range(first + 1, start[row[q] + 1]):
                t = where[row[e]]
                if t >= 0:
                    _subtract_product(inverse, t, e * area, unit, u, size)
                    _subtract_transposed_product(inverse, u, inverse, e * area, unit, t, size)
        for a in range(size):
            for b in range(size):
                total = 0.0
                for m in range(max(a, b), size):
                    total += blocks[d + m * size + a] * blocks[d + m * size + b]
                inverse[d + a * size + b] = total
        for p in range(start[j] + 1, start[j + 1]):
            _subtract_transposed_product(inverse, d, unit, p * area, inverse, p * area, size)
            where[row[p]] = -1


@njit(inline="always")
def _subtract_product(inverse, t, e, unit, u, size):  # type: ignore[no-untyped-def]
    """From the block at t take that at e times the unit block at u."""
    for a in range(size):
        for b in range(size):
            total = 0.0
            for m in range(size):
                total += inverse[e + a * size + m] * unit[u + m * size + b]
            inverse[t + a * size + b] -= total


@njit(inline="always")
def _subtract_transposed_product(inverse, t, first, e, second, u, size):  # type: ignore[no-untyped-def]
    """From the block at t take the transposed first block at e times the second at u."""
    for a in range(size):
        for b in range(size):
            total = 0.0
            for m in range(size):
                total += first[e + m * size + a] * second[u + m * size + b]
            inverse[t + a * size + b] -= total
