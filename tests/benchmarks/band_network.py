"""Reference of the refinement: the same least squares in banded form, factor and inverse within the band."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray
from rodsight.solver.bodies.grains import Array
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.sparse import coo_array
from scipy.sparse.csgraph import reverse_cuthill_mckee


class BandNetwork:
    """Pairs (c,) of grains, without walls, in the reverse Cuthill-McKee order."""

    def __init__(self, count: int, i: NDArray[np.int64], j: NDArray[np.int64]) -> None:
        graph = coo_array((np.ones(2 * len(i)), (np.append(i, j), np.append(j, i))), shape=(count, count)).tocsr()
        self.place = np.empty(count, np.int64)
        self.place[reverse_cuthill_mckee(graph, symmetric_mode=True)] = np.arange(count)
        self.i, self.j = self.place[i], self.place[j]
        self.low, self.high = np.minimum(self.i, self.j), np.maximum(self.i, self.j)
        self.band = 2 * int((self.high - self.low).max()) + 1

    def refine(self, normal: Array, force: Array, weight: Array, sigma: Array) -> tuple[Array, Array]:
        """Displacements (n, 2) and the variance of every gap (c,)."""
        n = len(self.place)
        matrix, right = np.zeros((self.band + 1, 2 * n)), np.zeros(2 * n)
        matrix[0, np.repeat(2 * self.place, 2) + np.tile([0, 1], n)] = np.repeat(sigma**-2.0, 2)
        for a in range(2):
            np.add.at(right, 2 * self.i + a, -force * normal[:, a])
            np.add.at(right, 2 * self.j + a, force * normal[:, a])
            for b in range(2):
                block = weight * normal[:, a] * normal[:, b]
                if b <= a:
                    np.add.at(matrix[a - b], 2 * self.i + b, block)
                    np.add.at(matrix[a - b], 2 * self.j + b, block)
                np.add.at(matrix, (2 * (self.high - self.low) + a - b, 2 * self.low + b), -block)
        factor = cholesky_banded(matrix, lower=True, check_finite=False)
        moved = cho_solve_banded((factor, True), right, check_finite=False).reshape(n, 2)
        inverse = np.zeros((2 * n, self.band + 1))
        _invert(np.ascontiguousarray(factor.T), inverse)
        variance = np.zeros(len(weight))
        for a in range(2):
            for b in range(2):
                own = inverse[2 * self.i + min(a, b), abs(a - b)] + inverse[2 * self.j + min(a, b), abs(a - b)]
                cross = inverse[2 * self.low + b, 2 * (self.high - self.low) + a - b]
                variance += normal[:, a] * normal[:, b] * (own - 2.0 * cross)
        return moved[self.place], variance


@njit(cache=True)
def _invert(factor: Array, inverse: Array) -> None:
    """Invert within the band; factor, inverse (n, b + 1): factor[k, d] = L[k + d, k], inverse[k, d] = A⁻¹[k + d, k]."""
    n, width = factor.shape
    row = np.empty(width)
    for k in range(n - 1, -1, -1):
        reach = min(width - 1, n - 1 - k)
        for a in range(reach + 1):
            row[a] = 0.0
        for d in range(1, reach + 1):
            value = factor[k, d]
            total = value * inverse[k + d, 0]
            for a in range(d + 1, reach + 1):
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
