"""Which near pairs touch, from the distribution of their gaps alone: a mixture fitted by expectation maximisation.

Touching pairs scatter about a mean, N(m, s²); open ones stand anywhere between that mean and the reach, with the same
scatter. The mean of a pair is m = a + what is linear in given traits of it, such as its size or its place: what m
differs from the overlap of touching surfaces is an error that all gaps share.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from jaxtyping import Float

from solver.bodies.grains import Array
from solver.posterior.touching_kernels import add_gaps, weigh_gaps
from solver.together import work_together

SEARCHED = 8  # frames, spread evenly, that tell where to climb; then all do
ROUNDS = 60  # at most
SETTLED = 1e-5  # by which a round raises the logarithm of the likelihood when nothing that matters changes
NEARLY = 1e-2  # the same of a search whose end is climbed from again
START = 0.2  # quantile of all gaps near which those of touching pairs are looked for first
FIRST_SHARE = 0.6  # that touches
LEAST_SHARE = 0.3  # that touches: strong friction with the ground would drive it to zero otherwise
MOST_SHARE = 0.97
WIDEST = 0.4  # scatter of touching gaps over the reach: open ones must be told from them
ENOUGH = 30  # touching pairs to fit the mean by
FLAT = 1e-13  # share of the greatest variance below which a trait does not vary


@dataclass(frozen=True, slots=True)
class TouchingGaps:
    """The mixture that fits the gaps."""

    offset: float  # a [m], mean gap of touching pairs
    slope: Float[Array, " t"]  # [m] per unit of each trait
    deviation: float  # s [m] of touching pairs about their mean
    share: Float[Array, " f"]  # p of the pairs within reach that touch
    offset_deviation: float  # [m] standard error of a

    def mean_at(self, trait: Array) -> Array:
        """Mean gap (c,) [m] of touching pairs of such traits (c, t)."""
        return self.offset + trait @ self.slope

    def probability(self, gap: Array, trait: Array, reach: float) -> Array:
        """P(touch) (f, c) of gaps (f, c) [m]; 0 where a gap is not known or beyond the reach [m]."""
        mean, touch = self.mean_at(trait), np.empty(gap.shape)
        weigh_gaps(gap, mean, reach - mean, self.deviation, self.share, touch)
        return touch


def fit_touching(gap: Array, trait: Array, reach: float, narrow: float) -> TouchingGaps:
    """Fit the mixture to gaps (f, c) [m], NaN where a pair is not within reach.

    trait (c, t): of the pairs, zero on average; reach [m]: the greatest gap there may be; narrow [m]: scatter of
    touching gaps from which one of two searches begins, the other begins with that of all gaps.
    Errors: ValueError without a single gap.
    """
    known = np.isfinite(gap)
    if not known.any():
        raise ValueError("no pair of bodies is within reach: nothing can touch")
    g = gap[known]
    low, high = np.quantile(g, [0.25, 0.75])
    starts = ((float(np.quantile(g, START)), narrow), (float(np.median(g)), max(0.75 * float(high - low), narrow)))
    some = np.unique(np.linspace(0, len(gap) - 1, min(SEARCHED, len(gap))).astype(int))
    thinned = len(some) < len(gap)
    tasks = [
        partial(_maximise, gap[some], trait, reach, _start(a, s, trait, len(some)), NEARLY if thinned else SETTLED)
        for a, s in starts
    ]
    found = max(work_together(tasks, None), key=lambda each: each[0])[1]
    if not thinned:
        return found
    found = replace(found, share=np.full(len(gap), found.share.mean()))
    return _maximise(gap, trait, reach, found, SETTLED)[1]


def _start(a: float, s: float, trait: Array, frames: int) -> TouchingGaps:
    return TouchingGaps(a, np.zeros(trait.shape[1]), s, np.full(frames, FIRST_SHARE), np.inf)


def _maximise(
    gap: Array, trait: Array, reach: float, start: TouchingGaps, settled: float
) -> tuple[float, TouchingGaps]:
    """Climb from a mixture; gives the logarithm of the likelihood with what was found.

    settled: by which a round raises the likelihood when it is the last.
    """
    frames, pairs = gap.shape
    known = np.maximum(np.isfinite(gap).sum(axis=1), 1)
    plane, found = np.column_stack([np.ones(pairs), trait]), np.append(start.offset, start.slope)
    s, share, least = start.deviation, start.share, start.deviation
    total, likelihood = 0.0, -np.inf
    by_pair, touched = np.empty((3, pairs)), np.empty(frames)
    for _ in range(ROUNDS):
        mean, former = plane @ found, likelihood
        likelihood = add_gaps(gap, mean, reach - mean, s, share, by_pair, touched)
        total = float(touched.sum())
        if total < ENOUGH or abs(likelihood - former) < settled:
            break
        weight, first, second = by_pair
        change = _fit_plane(plane, weight, first)
        found, moved = found + change, plane @ change
        square = float(np.sum(second + moved * (moved * weight - 2.0 * first)))
        s = min(float(np.sqrt(max(square, 0.0) / total)), WIDEST * max(reach - float(found[0]), least))
        share = np.clip(touched / known, LEAST_SHARE, MOST_SHARE)
    often = max(total / max(frames, 1), 1.0)  # frames tell of the same pairs again
    return likelihood, TouchingGaps(float(found[0]), found[1:], s, share, s / np.sqrt(often))


def _fit_plane(plane: Array, weight: Array, sum_: Array) -> Array:
    """The plane over ones and traits (c, 1 + t) through values of weighted sum `sum_` (c,), by weight (c,).

    Flat along traits that do not vary.
    """
    normal = plane.T @ (plane * weight[:, None])
    return np.asarray(np.linalg.lstsq(normal, plane.T @ sum_, rcond=FLAT)[0], dtype=np.float64)
