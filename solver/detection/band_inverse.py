"""The entries near the diagonal of the inverse of a banded symmetric matrix: variances without the whole inverse."""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy.linalg import cholesky_banded

from solver.bodies.grains import Array


def band_inverse(matrix: Array) -> tuple[Array, Array]:
    """Factor a positive definite banded matrix and invert it within its band.

    matrix (b + 1, n), lower form: matrix[d, k] = A[k + d, k]. Returns Cholesky's factor in the same form, and the
    inverse Z as (n, b + 1) with Z[k, d] = A⁻¹[k + d, k]; entries beyond the last row are zero. After Takahashi, Fagan &
    Chen 1973: what lies within the band of the inverse follows from the factor alone. Errors: LinAlgError if the
    matrix is not positive definite.
    """
    factor = cholesky_banded(matrix, lower=True, check_finite=False)
    inverse = np.zeros((matrix.shape[1], matrix.shape[0]))
    _invert(np.ascontiguousarray(factor.T), inverse)
    return factor, inverse


@njit(cache=True)
def _invert(factor: Array, inverse: Array) -> None:
    """factor (n, b + 1): factor[k, d] = L[k + d, k]; inverse (n, b + 1) out."""
    n, width = factor.shape
    row = np.empty(width)
    for k in range(n - 1, -1, -1):
        reach = min(width - 1, n - 1 - k)
        # Z[k + a, k] = −Σ_d Z[k + a, k + d] L[k + d, k] / L[k, k]; the window behind k is already known.
        for a in range(reach + 1):
            row[a] = 0.0
        for d in range(1, reach + 1):
            value = factor[k, d]
            total = value * inverse[k + d, 0]
            for a in range(d + 1, reach + 1):  # each entry of the symmetric window serves both of its rows
                other = inverse[k + d, a - d]
                row[a] += value * other
                total += factor[k, a] * other
            row[d] += total
        pivot = factor[k, 0]
        diagonal = 1.0 / (pivot * pivot)
        for a in range(1, reach + 1):
            inverse[k, a] = -row[a] / pivot
            diagonal -= factor[k, a] * inverse[k, a] / pivot
        inverse[k, 0] = diagonal
