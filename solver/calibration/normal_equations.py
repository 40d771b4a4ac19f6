"""Normal equations of gaps, factorised: grains among their neighbours as sparse blocks, what all share as a border.

Pairs of neighbours make an almost planar graph, where a direct factorisation is cheap and exact. What is coupled with
all grains comes last: its Schur complement is small and full.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.calibration.derivatives import OF_GRAIN, Derivatives, by_grains, in_order
from solver.factor.blocks import TRIPLE, area_of, lanes_of
from solver.factor.cholesky import factorize, solve
from solver.factor.pattern import Ids, Pattern, find_pattern

AREA, FILLED = area_of(TRIPLE), lanes_of(TRIPLE)  # numbers of a block, and of a node beside the matrix


class Couplings(NamedTuple):
    """Which grains have gaps with each other, whatever rows of them count."""

    pattern: Pattern
    entry: Ids  # (m,) of the pattern, of every row

    @classmethod
    def of(cls, grain_count: int, first: NDArray[np.integer], second: NDArray[np.integer]) -> Couplings:
        """first, second (m,): the grains of every row."""
        key, row = np.unique(first.astype(np.int64) * grain_count + second, return_inverse=True)
        one, two = key // grain_count, key % grain_count
        pattern = find_pattern(grain_count, one, two)
        return cls(pattern, pattern.locate(one, two)[row])

    def select(self, rows: NDArray) -> Couplings:
        """For some of the rows."""
        return Couplings(self.pattern, self.entry[rows])


class NormalEquations:
    """Aᵀ P A + D, factorised."""

    def __init__(self, derivatives: Derivatives, couplings: Couplings, precision: Array, penalty: Array) -> None:
        """Derivatives A (m, u) and couplings of their rows, precision (m,), penalties (u,).

        An unknown of infinite penalty is held: it stays zero, as its derivatives must be. Errors: LinAlgError where
        something is not determined.
        """
        self._free = np.isfinite(penalty)
        d, pattern = derivatives, couplings.pattern
        n, q = d.grain_count, d.shared_count
        of_grain, of_shared = by_grains(np.where(self._free, penalty, 1.0), n)
        blocks, corner = np.zeros(AREA * pattern.entry_count), np.diag(of_shared)
        border = np.zeros((n, FILLED, q))  # nodes in the order of elimination
        _assemble(
            d.first, d.second, d.own, d.other, d.column, d.value, couplings.entry, pattern.place, pattern.start,
            precision, of_grain, blocks, border, corner,
        )  # fmt: skip
        if not factorize(pattern, blocks, np.empty(n, np.int64), TRIPLE):
            raise np.linalg.LinAlgError("what is wrong of some grain is not determined")
        solved = np.empty((q, FILLED * n))
        for k in range(q):
            solved[k] = border[:, :, k].ravel()
            if solved[k].any():
                solve(pattern, blocks, solved[k], TRIPLE)
        self._pattern, self._blocks, self._solved, self._grains = pattern, blocks, solved, n
        self._corner = np.linalg.inv(corner - solved @ border.reshape(FILLED * n, q))

    def solve(self, right: Array) -> Array:
        """(Aᵀ P A + D)⁻¹ of a right side (u,)."""
        of_grain, shared = by_grains(np.where(self._free, right, 0.0), self._grains)
        x = np.zeros((self._grains, FILLED))
        x[self._pattern.place, :OF_GRAIN] = of_grain
        flat = x.ravel()
        rest = self._corner @ (shared - self._solved @ flat)
        solve(self._pattern, self._blocks, flat, TRIPLE)
        flat -= rest @ self._solved
        return np.where(self._free, in_order(flat.reshape(-1, FILLED)[self._pattern.place, :OF_GRAIN], rest), 0.0)


@njit(cache=True, nogil=True, error_model="numpy")
def _assemble(  # type: ignore[no-untyped-def]
    first, second, own, other, column, value, entry, place, start, precision, penalty, blocks, border, corner
):
    """Add Σ p a aᵀ of the rows and the penalties (n, 3) of grains; border (n, 4, q) by node, corner (q, q)."""
    for g in range(len(place)):
        for a in range(OF_GRAIN):
            blocks[AREA * start[place[g]] + (FILLED + 1) * a] += penalty[g, a]
    for c in range(len(precision)):
        i, j, p = place[first[c]], place[second[c]], precision[c]
        for a in range(OF_GRAIN):
            x, y = p * own[c, a], p * other[c, a]
            here, there = AREA * start[i] + a, AREA * start[j] + a
            for b in range(OF_GRAIN):
                blocks[here + FILLED * b] += x * own[c, b]
                blocks[there + FILLED * b] += y * other[c, b]
            between = AREA * entry[c] + a  # of a wall's row the diagonal: the other is zero
            for b in range(OF_GRAIN):
                blocks[between + FILLED * b] += x * other[c, b] if i > j else y * own[c, b]
            for s in range(column.shape[1]):
                v = value[c, s]
                if v != 0.0:
                    border[i, a, column[c, s]] += x * v
                    border[j, a, column[c, s]] += y * v
        for s in range(column.shape[1]):
            v = p * value[c, s]
            if v != 0.0:
                for t in range(column.shape[1]):
                    corner[column[c, s], column[c, t]] += v * value[c, t]
