"""What verdicts say about the gap threshold and the radii: the curve, and the values to recommend."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array

RECALL_WEIGHT = 2.0  # β of F_β: a contact that is missed costs the forces more than a false one, which bears little
POINTS = 81  # of the curve
RESAMPLES = 400  # of the bootstrap of the radius correction


@dataclass(frozen=True, slots=True)
class ThresholdCurve:
    """Precision, recall and F1 of "touching below this gap" (m,)."""

    threshold: Array  # (m,) [m], ascending
    precision: Array
    recall: Array
    f1: Array
    f_beta: Array  # recall weighed RECALL_WEIGHT times as much


@dataclass(frozen=True, slots=True)
class ThresholdFit:
    """The threshold and the change of radius that verdicts recommend."""

    threshold: float  # [m] for radii as they are
    threshold_sigmas: float  # the same in standard deviations of a position
    radius_change: float  # [m] to be added to every radius
    radius_change_sd: float  # [m]
    threshold_with_change: float  # [m] once the radii are changed
    contacts: int  # verdicts it rests on
    others: int


def threshold_curve(gap: Array, touching: Array, threshold: Array) -> ThresholdCurve:
    """Measure the curve on pairs: gap (c,) [m], touching (c,) 0 … 1, how far a pair counts as a contact.

    threshold (m,) [m].
    """
    order = np.argsort(gap, kind="stable")
    place = np.searchsorted(gap[order], threshold, side="left")  # pairs with a gap below the threshold
    below = place.astype(np.float64)
    hits = np.concatenate([[0.0], np.cumsum(touching[order], dtype=np.float64)])[place]
    total = float(touching.sum())
    with np.errstate(invalid="ignore", divide="ignore"):
        precision = np.where(below > 0, hits / below, np.nan)
        recall = hits / total if total > 0 else np.full(len(threshold), np.nan)
    f1, f_beta = _f(1.0, hits, below, total), _f(RECALL_WEIGHT, hits, below, total)
    return ThresholdCurve(threshold, precision, recall, f1, f_beta)


def fit_threshold(
    gap: Array,
    touching: Array,
    with_wall: NDArray[np.bool_],
    judged: NDArray[np.bool_],
    deviation: float,
    rng: np.random.Generator,
) -> ThresholdFit:
    """Fit threshold and radius correction to the pairs (c,) of frames that people judged.

    touching (c,) 0 … 1; judged (c,): a person said so, rather than the detector. The threshold maximises F₂. The
    radius correction brings the median gap of contacts to zero; a gap between two grains closes by twice the change,
    that to a wall by once. deviation [m]: of a position component. Raises ValueError where no contact, or nothing but
    contacts, was judged.
    """
    contacts, others = int((judged & (touching > 0.5)).sum()), int((judged & (touching <= 0.5)).sum())
    if contacts == 0 or others == 0:
        raise ValueError("a threshold needs verdicts of both kinds: contact and no contact")
    sides = np.where(with_wall, 1.0, 2.0)
    level = gap / sides
    change = _weighted_median(level, touching)
    rows = rng.integers(0, len(level), (RESAMPLES, len(level)))
    spread = float(np.std([_weighted_median(level[r], touching[r]) for r in rows]))
    best = _best(gap, touching)
    changed = _best(gap - sides * change, touching)
    sigmas = best / deviation if deviation > 0 else float("nan")
    return ThresholdFit(best, sigmas, change, spread, changed, contacts, others)


def even_thresholds(gap: Array) -> Array:
    """Thresholds (m,) [m] that span the judged gaps."""
    return np.linspace(float(gap.min()), float(gap.max()) + 1e-9, POINTS)


def _best(gap: Array, touching: Array) -> float:
    """The threshold with the greatest F_β, midway between the two judged gaps it separates."""
    values = np.unique(gap)
    between = np.concatenate([0.5 * (values[:-1] + values[1:]), values[-1:] + 1e-9])
    return float(between[np.argmax(threshold_curve(gap, touching, between).f_beta)])


def _f(beta: float, hits: Array, below: Array, total: float) -> Array:
    return (1.0 + beta**2) * hits / np.maximum(below + beta**2 * total, 1e-300)


def _weighted_median(values: Array, weight: Array) -> float:
    order = np.argsort(values, kind="stable")
    share = np.cumsum(weight[order]) - 0.5 * weight[order]
    return float(np.interp(0.5 * weight.sum(), share, values[order]))
