"""Which near pairs touch, from the distribution of their gaps alone: a mixture fitted by expectation maximisation.

Touching pairs scatter about a mean, N(m, s²); open ones stand anywhere between that mean and the reach, with the same
scatter. The mean of a pair is m = a + what is linear in given traits of it, such as its size or its place: what m
differs from the overlap of touching surfaces is an error that all gaps share.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Float
from scipy.special import ndtr

from solver.bodies.grains import Array
from solver.together import work_together

ROUNDS = 60  # at most
SETTLED = 1e-7  # by which a round raises the logarithm of the likelihood when nothing that matters changes
START = 0.2  # quantile of all gaps near which those of touching pairs are looked for first
LEAST_SHARE = 0.3  # that touches: strong friction with the ground would drive it to zero otherwise
MOST_SHARE = 0.97
WIDEST = 0.4  # scatter of touching gaps over the reach: open ones must be told from them
NO_DENSITY = 1e-300
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
        mean = self.mean_at(trait)
        with np.errstate(invalid="ignore"):
            near = gap < reach
        rest = np.where(near, gap - mean, 0.0)
        touching, opened = _densities(rest, self.deviation, reach - mean, self.share[:, None])
        return np.where(near, touching / np.maximum(touching + opened, NO_DENSITY), 0.0)


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
    found = work_together([partial(_maximise, gap, trait, reach, *start) for start in starts], None)
    return max(found, key=lambda each: each[0])[1]


def _maximise(gap: Array, trait: Array, reach: float, a: float, s: float) -> tuple[float, TouchingGaps]:
    """Climb from a mean and a scatter [m]; gives the logarithm of the likelihood with what was found."""
    frame, column = np.nonzero(np.isfinite(gap))
    g, x = gap[frame, column], trait[column]
    per_frame = np.maximum(np.bincount(frame, minlength=len(gap)), 1)
    share, slope = np.full(len(gap), 0.6), np.zeros(trait.shape[1])
    plane = np.asfortranarray(np.column_stack([np.ones(len(g)), x]))
    least, total, likelihood = s, 0.0, -np.inf
    for _ in range(ROUNDS):
        mean, former = a + x @ slope, likelihood
        touching, opened = _densities(g - mean, s, reach - mean, share[frame])
        density = np.maximum(touching + opened, NO_DENSITY)
        likelihood, weight = float(np.log(density).sum()), touching / density
        total = float(weight.sum())
        if total < ENOUGH or abs(likelihood - former) < SETTLED:
            break
        a, slope = _fit_mean(g, plane, weight)
        s = min(float(np.sqrt(weight @ (g - a - x @ slope) ** 2 / total)), WIDEST * max(reach - a, least))
        share = np.clip(np.bincount(frame, weight, minlength=len(gap)) / per_frame, LEAST_SHARE, MOST_SHARE)
    pairs = max(total / max(len(gap), 1), 1.0)  # frames tell of the same pairs again
    return likelihood, TouchingGaps(a, slope, s, share, s / np.sqrt(pairs))


def _densities(rest: Array, s: float, room: Array, share: Array) -> tuple[Array, Array]:
    """Densities of touching and of open gaps that exceed the mean by `rest` [m], at most by room [m]."""
    scaled = rest / s
    touching = share * np.exp(-0.5 * scaled**2) / (s * np.sqrt(2.0 * np.pi))
    opened = (1.0 - share) * (ndtr(scaled) - ndtr((rest - room) / s)) / np.maximum(room, s)
    return touching, opened


def _fit_mean(g: Array, plane: Array, weight: Array) -> tuple[float, Array]:
    """Weighted plane through the gaps, over ones and traits (c, 1 + t); flat along traits that do not vary."""
    weighted = plane * weight[:, None]
    found = np.linalg.lstsq(weighted.T @ plane, weighted.T @ g, rcond=FLAT)[0]
    return float(found[0]), np.asarray(found[1:], dtype=np.float64)
