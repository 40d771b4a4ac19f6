"""Precision and recall of the detector, estimated from the verdicts given so far, with their intervals.

Each stratum is a population of known size of which a random part was judged. Its unjudged rest is drawn from the
posterior of the share of contacts, so that an interval closes to a point once everything was judged. The prior is
worth one verdict and lies where the detector believes the share to be, though never nearer to certainty than one in
twenty: a flat one would invent a few contacts in every large stratum that has none. Verdicts on pairs that a person
picked are counted as known, but say nothing about the rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array

DRAWS = 4000
CREDIBLE = 0.95

SUREST = 0.95  # share of contacts that the prior takes for the surest stratum

UNJUDGED, NO, YES = -1, 0, 1  # outcome of a candidate


@dataclass(frozen=True, slots=True)
class Interval:
    value: float  # the median
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class DetectorEstimate:
    """How well the detector does, as far as the verdicts tell."""

    precision: Interval  # of the detected, the share that are contacts
    recall: Interval  # of the contacts, the share that is detected
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
    """Estimate precision and recall over a population of candidates (c,).

    probability (c,): P(touch) by the detector; outcome (c,): UNJUDGED, NO or YES; chosen (c,): judged because the
    queue chose it. missed: contacts added by hand that no candidate stands for.
    """
    true = np.zeros((2, DRAWS))  # contacts among the undetected and the detected
    true[0] += missed
    for h in np.unique(stratum):
        for found in (False, True):
            here = (stratum == h) & (detected == found)
            if not here.any():
                continue
            fair = outcome[here & chosen]
            yes, judged = int((fair == YES).sum()), int((fair != UNJUDGED).sum())
            rest = int((outcome[here] == UNJUDGED).sum())
            belief = float(np.clip(probability[here].mean(), 1.0 - SUREST, SUREST))
            share = rng.beta(belief + yes, 1.0 - belief + judged - yes, DRAWS)
            true[int(found)] += int((outcome[here] == YES).sum()) + rng.binomial(rest, share)
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
