"""Derivatives of gaps with respect to constant errors: those of its two grains, and a few that many gaps share."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..bodies.grains import Array

OF_GRAIN = 3  # unknowns of a grain: x and y of its centre, its radius


class Derivatives(NamedTuple):
    """Sparse matrix A (m, u), a row for each gap; unknowns: x and y of every centre, radii, then shared ones."""

    first: NDArray[np.int64]  # (m,) a grain
    second: NDArray[np.int64]  # (m,) another, or the same where the gap is to a wall
    own: Array  # (m, 3) with respect to the errors of the first
    other: Array  # (m, 3) of the second, zero at a wall
    column: NDArray[np.int64]  # (m, s) shared unknowns
    value: Array  # (m, s) with respect to these
    grain_count: int
    shared_count: int

    @property
    def unknown_count(self) -> int:
        return OF_GRAIN * self.grain_count + self.shared_count

    def restrict_to(self, free: NDArray[np.bool_]) -> Derivatives:
        """Set the columns of unknowns (u,) that are not free to zero."""
        if free.all():
            return self
        by_grain, shared = split_unknowns(free.astype(np.float64), self.grain_count)
        found = self if shared.all() else self._replace(value=self.value * shared[self.column])
        if by_grain.all():
            return found
        return found._replace(own=self.own * by_grain[self.first], other=self.other * by_grain[self.second])

    def select(self, rows: NDArray) -> Derivatives:
        """Keep some rows (mask, or ascending indices)."""
        return self._replace(
            first=self.first[rows], second=self.second[rows], own=self.own[rows], other=self.other[rows],
            column=self.column[rows], value=self.value[rows],
        )  # fmt: skip

    def times(self, x: Array) -> Array:
        """Compute A x (m,)."""
        out = np.empty(len(self.first))
        _multiply(*self[:6], *split_unknowns(x, self.grain_count), out)
        return out

    def transposed_times(self, v: Array) -> Array:
        """Compute Aᵀ v (u,)."""
        grains, shared = np.zeros((self.grain_count, OF_GRAIN)), np.zeros(self.shared_count)
        _multiply_transposed(*self[:6], v, grains, shared)
        return join_unknowns(grains, shared)


def split_unknowns(x: Array, grain_count: int) -> tuple[Array, Array]:
    """Split a vector of unknowns (u,) into those of every grain (n, 3) and shared ones (q,)."""
    n = grain_count
    grains = np.concatenate([x[: 2 * n].reshape(n, 2), x[2 * n : 3 * n, None]], axis=1)
    return np.ascontiguousarray(grains), np.ascontiguousarray(x[OF_GRAIN * n :])


def join_unknowns(grains: Array, shared: Array) -> Array:
    """Join the unknowns of grains and shared ones into one vector (u,)."""
    return np.concatenate([grains[:, :2].ravel(), grains[:, 2], shared])


@njit(cache=True, nogil=True, error_model="numpy")
def _multiply(first, second, own, other, column, value, grains, shared, out):  # type: ignore[no-untyped-def]
    for c in range(len(out)):
        i, j, total = first[c], second[c], 0.0
        for a in range(OF_GRAIN):
            total += own[c, a] * grains[i, a] + other[c, a] * grains[j, a]
        for s in range(column.shape[1]):
            if value[c, s] != 0.0:  # most are zero
                total += value[c, s] * shared[column[c, s]]
        out[c] = total


@njit(cache=True, nogil=True, error_model="numpy")
def _multiply_transposed(first, second, own, other, column, value, v, grains, shared):  # type: ignore[no-untyped-def]
    for c in range(len(v)):
        i, j = first[c], second[c]
        for a in range(OF_GRAIN):
            grains[i, a] += own[c, a] * v[c]
            grains[j, a] += other[c, a] * v[c]
        for s in range(column.shape[1]):
            if value[c, s] != 0.0:
                shared[column[c, s]] += value[c, s] * v[c]
