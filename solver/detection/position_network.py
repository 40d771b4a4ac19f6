"""Touching pairs as springs between positions: a sparse least-squares problem in the grains' displacements."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..bodies.grains import Array, Grains
from ..factor.blocks import PAIR
from ..factor.cholesky import factorize, solve
from ..factor.inverse import invert_on_pattern
from ..factor.pattern import Ids, Pattern, find_pattern
from .touch_probability import TouchCandidates

XY = 2  # components of a displacement


class Springs(NamedTuple):
    """Nodes and matrix entries of every pair; nodes are the grains in their order of elimination."""

    i: Ids  # (c,)
    j: Ids  # (c,) equal to i where the other body is a wall
    wall: NDArray[np.bool_]  # (c,)
    entry: Ids  # (c,) entry (i, j) of the pattern


@dataclass(frozen=True, slots=True)
class RefinedPositions:
    """Positions and gaps of one photograph after the update by the messages of the pairs."""

    displacement: Array  # (n, 2) [m] correction of every position
    gap: Array  # (c,) [m] refined gaps, NaN where unknown
    gap_variance: Array  # (c,) [m²]
    sliding_variance: Array  # (c,) [m²] of the pair's relative position along its tangent


@dataclass(frozen=True, slots=True)
class PositionNetwork:
    """Sparse system of the candidate pairs of a block of frames."""

    springs: Springs
    pattern: Pattern

    @classmethod
    def of(cls, grains: Grains, pairs: TouchCandidates) -> PositionNetwork:
        wall = pairs.j >= grains.count
        i = pairs.i.astype(np.int64)
        j = np.where(wall, i, pairs.j)
        pattern = find_pattern(grains.count, i, j)
        springs = Springs(pattern.place[i], pattern.place[j], wall, pattern.locate(i, j))
        return cls(springs, pattern)

    def refine(self, normal: Array, gap: Array, weight: Array, pull: Array, sigma: Array) -> RefinedPositions:
        """Find the displacements that fit the measured positions and the messages of the pairs best.

        Parameters
        ----------
        normal : (c, 2)
            Normals of the pairs.
        gap : (c,)
            Measured gaps [m], NaN where unknown.
        weight : (c,)
            Precision w of the messages [1/m²].
        pull : (c,)
            Precision times mean, h, of the messages [1/m].
        sigma : (n,)
            Standard deviation of a position component [m].

        Raises
        ------
        numpy.linalg.LinAlgError
            The system is not positive definite.

        Notes
        -----
        Minimises Σ_i |x_i|² / σ_i² + Σ_c (w_c g_c² − 2 h_c g_c) with g_c = gap_c + n_c·(x_j − x_i).
        """
        pattern, n = self.pattern, self.pattern.node_count
        known = np.isfinite(gap)
        normal, length = np.where(known[:, None], normal, 0.0), np.where(known, gap, 0.0)
        weight, pull = np.where(known, weight, 0.0), np.where(known, pull, 0.0)
        precision = np.empty(n)
        precision[pattern.place] = sigma**-2.0
        blocks, right, where = np.zeros(XY**2 * pattern.entry_count), np.zeros(XY * n), np.empty(n, np.int64)
        _assemble(pattern, self.springs, normal, weight, pull - weight * length, precision, blocks, right)
        if not factorize(pattern, blocks, where, PAIR):
            raise np.linalg.LinAlgError("the precision matrix of the positions is not positive definite")
        solve(pattern, blocks, right, PAIR)
        inverse, unit = np.empty_like(blocks), np.empty_like(blocks)
        invert_on_pattern(pattern, blocks, inverse, unit, where, PAIR)
        moved = right.reshape(n, XY)
        between = np.where(self.springs.wall[:, None], 0.0, moved[self.springs.j]) - moved[self.springs.i]
        nan = np.where(known, 0.0, np.nan)
        tangent = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
        return RefinedPositions(
            moved[pattern.place],
            length + np.einsum("ca,ca->c", normal, between) + nan,
            self._variance(inverse, normal) + nan,
            self._variance(inverse, tangent) + nan,
        )

    def _variance(self, inverse: Array, direction: Array) -> Array:
        """Return the variance (c,) [m²] of the pairs' relative positions along directions (c, 2)."""
        variance = np.empty(len(direction))
        _measure_variance(self.pattern, self.springs, inverse, direction, variance)
        return np.maximum(variance, 1e-30)


@njit(cache=True, nogil=True)
def _assemble(pattern, springs, normal, weight, force, precision, blocks, right):  # type: ignore[no-untyped-def]
    """Assemble Σ w n nᵀ of the springs and 1/σ² of the positions; force (c,): right-hand side along the normals."""
    for k in range(len(precision)):
        for a in range(XY):
            blocks[4 * pattern.start[k] + 3 * a] += precision[k]
    for c in range(len(weight)):
        i, j = springs.i[c], springs.j[c]
        for a in range(XY):
            for b in range(XY):
                value = weight[c] * normal[c, a] * normal[c, b]
                blocks[4 * pattern.start[i] + XY * a + b] += value
                if not springs.wall[c]:
                    blocks[4 * pattern.start[j] + XY * a + b] += value
                    blocks[4 * springs.entry[c] + XY * a + b] -= value
            right[XY * i + a] -= force[c] * normal[c, a]
            if not springs.wall[c]:
                right[XY * j + a] += force[c] * normal[c, a]


@njit(cache=True, nogil=True)
def _measure_variance(pattern, springs, inverse, direction, variance):  # type: ignore[no-untyped-def]
    for c in range(len(variance)):
        own, partner, cross = 4 * pattern.start[springs.i[c]], 4 * pattern.start[springs.j[c]], 4 * springs.entry[c]
        total = 0.0
        for a in range(XY):
            for b in range(XY):
                value = inverse[own + XY * a + b]
                if not springs.wall[c]:
                    value += inverse[partner + XY * a + b] - 2.0 * inverse[cross + XY * a + b]
                total += direction[c, a] * direction[c, b] * value
        variance[c] = total
