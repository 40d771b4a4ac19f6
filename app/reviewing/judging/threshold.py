"""Gap threshold and correction of the radii by the verdicts: precision-recall curve and recommended values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...solver.bodies.grains import Array

RECALL_WEIGHT = 2.0  # β of F_β: a missed contact changes the forces more than a false one, which carries little
POINTS = 81  # of the curve
RESAMPLES = 400  # of the bootstrap of the radius correction


@dataclass(frozen=True, slots=True)
class ThresholdCurve:
    """Precision, recall and F1 of "touching below this gap" (m,)."""

    threshold: Array  # (m,) [m], ascending
    precision: Array
    recall: Array
    f1: Array
    f_beta: Array  # with β = RECALL_WEIGHT


@dataclass(frozen=True, slots=True)
class ThresholdFit:
    """Threshold and change of the radii that fit the verdicts best."""

    threshold: float  # [m] for radii as they are
    threshold_sigmas: float  # the same in standard deviations of a position
    radius_change: float  # [m] to be added to every radius
    radius_change_sd: float  # [m]
    threshold_with_change: float  # [m] once the radii are changed
    contacts: int  # verdicts that were fitted
    others: int


def threshold_curve(gap: Array, touching: Array, threshold: Array) -> ThresholdCurve:
    """Compute precision and recall of "touching below a threshold".

    Parameters
    ----------
    gap : (c,) array
        Gaps of the pairs [m].
    touching : (c,) array
        Weight of each pair as a contact, 0 … 1.
    threshold : (m,) array
        Thresholds [m].

    Notes
    -----
    F_β = (1 + β²) h / (b + β² t) with h the contacts below the threshold, b the pairs below it and t all contacts.
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
    position_sd: float,
    rng: np.random.Generator,
) -> ThresholdFit:
    """Fit threshold and radius correction to the pairs of judged frames.

    The threshold maximises F₂. The radius correction brings the median gap of contacts to zero; a gap between two
    grains decreases by twice the change, a gap to a wall by the change.

    Parameters
    ----------
    gap : (c,) array
        Gaps [m].
    touching : (c,) array
        Weight of each pair as a contact, 0 … 1.
    with_wall : (c,) bool array
        The second body is a wall.
    judged : (c,) bool array
        A reviewer judged the pair.
    position_sd : float
        Standard deviation of a position component [m].
    rng : numpy.random.Generator
        Source of the bootstrap.

    Raises
    ------
    ValueError
        No contact was judged, or nothing but contacts.
    """
    contacts, others = int((judged & (touching > 0.5)).sum()), int((judged & (touching <= 0.5)).sum())
    if contacts == 0 or others == 0:
        raise ValueError("a threshold needs verdicts of both kinds: contact and no contact")
    sides = np.where(with_wall, 1.0, 2.0)
    level = gap / sides
    change = _weighted_median(level, touching)
    rows = rng.integers(0, len(level), (RESAMPLES, len(level)))
    change_sd = float(np.std([_weighted_median(level[r], touching[r]) for r in rows]))
    best = _best(gap, touching)
    changed = _best(gap - sides * change, touching)
    sigmas = best / position_sd if position_sd > 0 else float("nan")
    return ThresholdFit(best, sigmas, change, change_sd, changed, contacts, others)


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
    cumulative = np.cumsum(weight[order]) - 0.5 * weight[order]
    return float(np.interp(0.5 * weight.sum(), cumulative, values[order]))
