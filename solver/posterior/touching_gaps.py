"""Which candidate pairs touch, from the distribution of their gaps: a mixture fitted by expectation maximisation."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from jaxtyping import Float

from ..bodies.grains import Array
from ..even_subset import even_subset
from ..parallel import parallel_map
from .touching_kernels import accumulate_gaps, compute_touch_probabilities

SEARCH_FRAMES = 8  # evenly spaced, for the first search; the result is refined on all frames
MAX_ROUNDS = 60
TOLERANCE = 1e-5  # rise of the log likelihood in a round below which the fit has converged
SEARCH_TOLERANCE = 1e-2  # the same in the first search
START_QUANTILE = 0.2  # of all gaps: initial mean of touching gaps
START_FRACTION = 0.6  # initial touching fraction
MIN_FRACTION = 0.3  # of touching pairs: strong friction with the ground would drive it to zero otherwise
MAX_FRACTION = 0.97
MAX_SD = 0.4  # standard deviation of touching gaps over the reach: above it open gaps cannot be separated
MIN_TOUCHING = 30  # touching pairs needed to fit the mean
RANK_TOLERANCE = 1e-13  # relative singular value below which a covariate counts as constant


@dataclass(frozen=True, slots=True)
class TouchingGaps:
    """The fitted mixture of touching and open gaps.

    Notes
    -----
    With m = a + q·β for a pair with covariates q, p the touching fraction of the frame, ℓ the reach less m and φ, Φ the
    standard normal density and distribution function, a gap g has the density

        p φ((g − m)/s)/s + (1 − p) (Φ((g − m)/s) − Φ((g − m − ℓ)/s))/max(ℓ, s):

    touching gaps are N(m, s²), open ones are uniform from m to the reach plus noise of the same standard deviation. The
    difference between m and the overlap of touching surfaces is an error that all gaps share.
    """

    offset: float  # a [m], mean gap of touching pairs
    slope: Float[Array, " t"]  # β [m] per unit of each covariate
    sd: float  # s [m] of touching gaps about their mean
    touching_fraction: Float[Array, " f"]  # p of the pairs within reach
    offset_sd: float  # [m] standard error of a

    def mean_at(self, covariate: Array) -> Array:
        """Compute the mean gap (c,) [m] of touching pairs with these covariates (c, t)."""
        return self.offset + covariate @ self.slope

    def probability(self, gap: Array, covariate: Array, reach: float) -> Array:
        """Compute P(touch) (f, c) of gaps (f, c) [m]; 0 where a gap is unknown or beyond the reach [m]."""
        mean, touch = self.mean_at(covariate), np.empty(gap.shape)
        compute_touch_probabilities(gap, mean, reach - mean, self.sd, self.touching_fraction, touch)
        return touch


def fit_touching(gap: Array, covariate: Array, reach: float, narrow_sd: float) -> TouchingGaps:
    """Fit the mixture to gaps by maximum likelihood.

    Parameters
    ----------
    gap : array (f, c)
        Gaps [m], NaN where a pair is not within reach.
    covariate : array (c, t)
        Covariates of the pairs, zero on average.
    reach : float
        Greatest possible gap [m].
    narrow_sd : float
        Initial standard deviation of touching gaps [m] of one of two searches; the other starts from that of all gaps.

    Returns
    -------
    TouchingGaps
        The end of the search with the greater likelihood.

    Raises
    ------
    ValueError
        Without any gap.

    Notes
    -----
    Expectation maximisation: w = P(touch) of every gap; β and a by least squares weighted by w; s² = Σ w (g − m)²/Σ w,
    s ≤ 0.4 (reach − a); p = Σ w over the gaps of a frame, over their number, within 0.3 … 0.97.
    """
    known = np.isfinite(gap)
    if not known.any():
        raise ValueError("no pair of bodies is within reach: nothing can touch")
    g = gap[known]
    low, high = np.quantile(g, [0.25, 0.75])
    starts = (
        (float(np.quantile(g, START_QUANTILE)), narrow_sd),
        (float(np.median(g)), max(0.75 * float(high - low), narrow_sd)),
    )
    rows = even_subset(len(gap), SEARCH_FRAMES)
    thinned = len(rows) < len(gap)
    tolerance = SEARCH_TOLERANCE if thinned else TOLERANCE
    tasks = [
        partial(_maximise, gap[rows], covariate, reach, _start(a, s, covariate, len(rows)), tolerance)
        for a, s in starts
    ]
    found = max(parallel_map(tasks, None), key=lambda each: each[0])[1]
    if not thinned:
        return found
    found = replace(found, touching_fraction=np.full(len(gap), found.touching_fraction.mean()))
    return _maximise(gap, covariate, reach, found, TOLERANCE)[1]


def _start(a: float, s: float, covariate: Array, frames: int) -> TouchingGaps:
    return TouchingGaps(a, np.zeros(covariate.shape[1]), s, np.full(frames, START_FRACTION), np.inf)


def _maximise(
    gap: Array, covariate: Array, reach: float, start: TouchingGaps, tolerance: float
) -> tuple[float, TouchingGaps]:
    """Iterate from a mixture until a round raises the log likelihood by less than the tolerance; return both."""
    frames, pairs = gap.shape
    known = np.maximum(np.isfinite(gap).sum(axis=1), 1)
    plane, found = np.column_stack([np.ones(pairs), covariate]), np.append(start.offset, start.slope)
    s, fraction, min_sd = start.sd, start.touching_fraction, start.sd
    total, likelihood = 0.0, -np.inf
    by_pair, touched = np.empty((3, pairs)), np.empty(frames)
    for _ in range(MAX_ROUNDS):
        mean, former = plane @ found, likelihood
        likelihood = accumulate_gaps(gap, mean, reach - mean, s, fraction, by_pair, touched)
        total = float(touched.sum())
        if total < MIN_TOUCHING or abs(likelihood - former) < tolerance:
            break
        weight, first, second = by_pair
        change = _fit_plane(plane, weight, first)
        found, moved = found + change, plane @ change
        square = float(np.sum(second + moved * (moved * weight - 2.0 * first)))
        s = min(float(np.sqrt(max(square, 0.0) / total)), MAX_SD * max(reach - float(found[0]), min_sd))
        fraction = np.clip(touched / known, MIN_FRACTION, MAX_FRACTION)
    independent = max(total / max(frames, 1), 1.0)  # touching pairs per frame: frames show the same pairs again
    return likelihood, TouchingGaps(float(found[0]), found[1:], s, fraction, s / np.sqrt(independent))


def _fit_plane(plane: Array, weight: Array, weighted_sum: Array) -> Array:
    """Fit coefficients of the columns of `plane` (c, 1 + t) by weighted least squares; zero along constant ones."""
    normal = plane.T @ (plane * weight[:, None])
    return np.asarray(np.linalg.lstsq(normal, plane.T @ weighted_sum, rcond=RANK_TOLERANCE)[0], dtype=np.float64)
