"""Pairs that touch as springs between positions: a sparse least-squares problem in the grains' displacements."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from solver.bodies.grains import Array, Grains
from solver.detection.touch_probability import Candidates
from solver.factor.blocks import PAIR
from solver.factor.cholesky import factorize, solve
from solver.factor.inverse import invert_on_pattern
from solver.factor.pattern import Ids, Pattern, find_pattern

XY = 2  # components of a displacement


class Springs(NamedTuple):
    """Where every pair stands; nodes are the grains, by their order of elimination."""

    i: Ids  # (c,)
    j: Ids  # (c,) where the other is a wall, i
    wall: NDArray[np.bool_]  # (c,)
    entry: Ids  # (c,) of the pattern, where i meets j


@dataclass(frozen=True, slots=True)
class Refinement:
    """What the messages make of one photograph."""

    displacement: Array  # (n, 2) [m] of every grain
    gap: Array  # (c,) [m] of every pair, NaN where it is not known
    gap_variance: Array  # (c,) [m²]
    slide_variance: Array  # (c,) [m²] of the pair's relative position along its tangent


@dataclass(frozen=True, slots=True)
class PositionNetwork:
    """The candidates of a block of frames."""

    springs: Springs
    pattern: Pattern

    @classmethod
    def of(cls, grains: Grains, pairs: Candidates) -> PositionNetwork:
        wall = pairs.j >= grains.count
        i = pairs.i.astype(np.int64)
        j = np.where(wall, i, pairs.j)
        pattern = find_pattern(grains.count, i, j)
        springs = Springs(pattern.place[i], pattern.place[j], wall, pattern.locate(i, j))
        return cls(springs, pattern)

    def refine(self, normal: Array, gap: Array, weight: Array, pull: Array, sigma: Array) -> Refinement:
        """Find the displacements that agree best with the messages of the pairs.

        normal (c, 2); gap (c,) [m] as measured, NaN where unknown; weight (c,) [1/m²] and pull (c,) [1/m] of the
        messages; sigma (n,) [m] of the positions.
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
            raise np.linalg.LinAlgError("the positions' precision is not positive definite")
        solve(pattern, blocks, right, PAIR)
        inverse, unit = np.empty_like(blocks), np.empty_like(blocks)
        invert_on_pattern(pattern, blocks, inverse, unit, where, PAIR)
        moved = right.reshape(n, XY)
        between = np.where(self.springs.wall[:, None], 0.0, moved[self.springs.j]) - moved[self.springs.i]
        nan = np.where(known, 0.0, np.nan)
        tangent = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
        return Refinement(
            moved[pattern.place],
            length + np.einsum("ca,ca->c", normal, between) + nan,
            self._variance(inverse, normal) + nan,
            self._variance(inverse, tangent) + nan,
        )

    def _variance(self, inverse: Array, direction: Array) -> Array:
        """Of the pairs' relative positions along directions (c, 2) (c,) [m²]."""
        variance = np.empty(len(direction))
        _measure_variance(self.pattern, self.springs, inverse, direction, variance)
        return np.maximum(variance, 1e-30)


@njit(cache=True, nogil=True)
def _assemble(pattern, springs, normal, weight, force, precision, blocks, right):  # type: ignore[no-untyped-def]
    """Σ w n nᵀ of the springs and the positions' own precision; force (c,): pull along the normals."""
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
