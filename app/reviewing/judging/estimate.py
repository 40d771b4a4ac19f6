"""Precision and recall of the detector with credible intervals, estimated from the verdicts given so far.

Each stratum is a population of known size of which a random part was judged. Its unjudged rest is drawn from the
posterior of the fraction of contacts, so that an interval closes to a point once everything was judged. The prior has
the weight of one verdict; its mean is the fraction that the detector estimates, but at least 0.05 from 0 and from 1: a
flat prior would add a few contacts to every large stratum that has none. Verdicts on pairs that a reviewer picked
count as known and contribute nothing to the estimate of the rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...solver.bodies.grains import Array

DRAWS = 4000
CREDIBLE = 0.95

LARGEST_PRIOR_MEAN = 0.95  # fraction of contacts in the most certain stratum

UNJUDGED, NO, YES = -1, 0, 1  # outcome of a candidate


@dataclass(frozen=True, slots=True)
class Interval:
    value: float  # the median
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class DetectorEstimate:
    """Accuracy of the detector by the verdicts."""

    precision: Interval  # fraction of detected pairs that are contacts
    recall: Interval  # fraction of contacts that are detected
    f1: Interval
    judged: int
    total: int


def estimate_detector(
    stratum: NDArray[np.int64],
    detected: NDArray[np.bool_],
    probability: Array,
    outcome: NDArray[np.int64],
    chosen: NDArray[np.bool_],
    missed: int,
    rng: np.random.Generator,
) -> DetectorEstimate:
    """Estimate precision and recall over a population of candidate pairs.

    Parameters
    ----------
    stratum : (c,) int array
        Stratum of each pair.
    detected : (c,) bool array
        The detector found the pair.
    probability : (c,) array
        P(touch) by the detector.
    outcome : (c,) int array
        UNJUDGED, NO or YES.
    chosen : (c,) bool array
        The queue chose the pair at random, rather than a reviewer.
    missed : int
        Contacts that a reviewer added and that are no candidate pairs.
    rng : numpy.random.Generator
        Source of the draws from the posterior.

    Notes
    -----
    In a stratum with y contacts among n randomly chosen verdicts and prior mean m, the fraction of contacts is drawn
    from Beta(m + y, 1 − m + n − y), the contacts among its unjudged pairs from the binomial distribution.
    """
    true = np.zeros((2, DRAWS))  # contacts among the undetected and the detected
    true[0] += missed
    for h in np.unique(stratum):
        for found in (False, True):
            here = (stratum == h) & (detected == found)
            if not here.any():
                continue
            sample = outcome[here & chosen]
            yes, judged = int((sample == YES).sum()), int((sample != UNJUDGED).sum())
            rest = int((outcome[here] == UNJUDGED).sum())
            prior_mean = float(np.clip(probability[here].mean(), 1.0 - LARGEST_PRIOR_MEAN, LARGEST_PRIOR_MEAN))
            fraction = rng.beta(prior_mean + yes, 1.0 - prior_mean + judged - yes, DRAWS)
            true[int(found)] += int((outcome[here] == YES).sum()) + rng.binomial(rest, fraction)
    found_count = max(int(detected.sum()), 1)
    precision = true[1] / found_count
    recall = true[1] / np.maximum(true.sum(axis=0), 1.0)
    f1 = 2.0 * true[1] / np.maximum(detected.sum() + true.sum(axis=0), 1.0)
    return DetectorEstimate(
        _interval(precision), _interval(recall), _interval(f1), int((outcome != UNJUDGED).sum()), len(outcome)
    )


def _interval(draws: NDArray[np.float64]) -> Interval:
    tail = 0.5 * (1.0 - CREDIBLE)
    low, middle, high = np.quantile(draws, [tail, 0.5, 1.0 - tail])
    return Interval(float(middle), float(low), float(high))
