"""Normal equations of gaps, factorised: sparse blocks for grains, a dense border for shared unknowns.

Pairs of neighbours make an almost planar graph, where a direct factorisation is cheap and exact. Unknowns that are
coupled with all grains come last: their Schur complement is small and dense.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..bodies.grains import Array
from ..factor.blocks import TRIPLE, block_size, padded_rows
from ..factor.cholesky import factorize, solve
from ..factor.pattern import Ids, Pattern, find_pattern
from .derivatives import OF_GRAIN, Derivatives, join_unknowns, split_unknowns

AREA, FILLED = block_size(TRIPLE), padded_rows(TRIPLE)  # stored numbers of a block, and of a node's right side


class Couplings(NamedTuple):
    """Sparsity pattern of the normal equations: which grains have gaps with each other in any row."""

    pattern: Pattern
    entry: Ids  # (m,) entry of the pattern for every row

    @classmethod
    def of(cls, grain_count: int, first: NDArray[np.integer], second: NDArray[np.integer]) -> Couplings:
        """Build the pattern; first, second (m,): the grains of every row."""
        key, row = np.unique(first.astype(np.int64) * grain_count + second, return_inverse=True)
        one, two = key // grain_count, key % grain_count
        pattern = find_pattern(grain_count, one, two)
        return cls(pattern, pattern.locate(one, two)[row])

    def select(self, rows: NDArray) -> Couplings:
        """Select some rows; the pattern stays."""
        return Couplings(self.pattern, self.entry[rows])


class NormalEquations:
    """Cholesky factorisation of Aᵀ P A + D.

    Notes
    -----
    With G the block of the grains, B that of grains and shared unknowns, C that of shared unknowns, a right side
    (r, q) has the solution y = S⁻¹ (q − Bᵀ G⁻¹ r), x = G⁻¹ (r − B y), S = C − Bᵀ G⁻¹ B.
    """

    def __init__(self, derivatives: Derivatives, couplings: Couplings, precision: Array, penalty: Array) -> None:
        """Assemble and factorise.

        Parameters
        ----------
        derivatives : Derivatives
            A (m, u).
        couplings : Couplings
            Pattern of its rows.
        precision : array (m,)
            Diagonal of P.
        penalty : array (u,)
            Diagonal of D; an unknown of infinite penalty is held at zero, and its derivatives must be zero.

        Raises
        ------
        numpy.linalg.LinAlgError
            If the errors of a grain are not determined.
        """
        self._free = np.isfinite(penalty)
        d, pattern = derivatives, couplings.pattern
        n, q = d.grain_count, d.shared_count
        of_grain, of_shared = split_unknowns(np.where(self._free, penalty, 1.0), n)
        blocks, corner = np.zeros(AREA * pattern.entry_count), np.diag(of_shared)
        border = np.zeros((n, FILLED, q))  # nodes in the order of elimination
        _assemble(
            d.first, d.second, d.own, d.other, d.column, d.value, couplings.entry, pattern.place, pattern.start,
            precision, of_grain, blocks, border, corner,
        )  # fmt: skip
        if not factorize(pattern, blocks, np.empty(n, np.int64), TRIPLE):
            raise np.linalg.LinAlgError("the errors of a grain are not determined by its gaps and priors")
        solved = np.empty((q, FILLED * n))
        for k in range(q):
            solved[k] = border[:, :, k].ravel()
            if solved[k].any():
                solve(pattern, blocks, solved[k], TRIPLE)
        self._pattern, self._blocks, self._solved, self._grains = pattern, blocks, solved, n
        self._corner = np.linalg.inv(corner - solved @ border.reshape(FILLED * n, q))

    def solve(self, right: Array) -> Array:
        """Compute (Aᵀ P A + D)⁻¹ of a right side (u,)."""
        of_grain, shared = split_unknowns(np.where(self._free, right, 0.0), self._grains)
        x = np.zeros((self._grains, FILLED))
        x[self._pattern.place, :OF_GRAIN] = of_grain
        flat = x.ravel()
        rest = self._corner @ (shared - self._solved @ flat)
        solve(self._pattern, self._blocks, flat, TRIPLE)
        flat -= rest @ self._solved
        return np.where(self._free, join_unknowns(flat.reshape(-1, FILLED)[self._pattern.place, :OF_GRAIN], rest), 0.0)


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
