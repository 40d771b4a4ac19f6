"""Correlation with the truth that a frame's evidence leads to expect, and its lower bound.

Two estimates of a frame whose errors have different causes, from its motion and from its positions, agree only where
both are right. Their agreement and what contradicts the forces are weighed in one additive model.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from .evidence import Evidence
from .fitted import FITTED

# Evidence against the forces, larger values being worse, by the names of the tables in fitted.toml.
MEASURES: dict[str, Callable[[Evidence], float]] = {
    "disagreement_of_estimates": lambda e: 1.0 - e.agreement,
    # positions may err alone: one confirmation of the motion estimate is enough
    "disagreement_with_either": lambda e: 1.0 - float(np.fmax(e.agreement, e.overlap_agreement)),
    "correction": lambda e: e.correction,
    "previous_residual": lambda e: e.old_unbalance,
    "disagreement_of_members": lambda e: e.disagreement,
    "gap_error": lambda e: e.information.gap_error / e.information.diameter,
    "force_change": lambda e: e.force_change,
    # friction that opposes the measured sliding less than it could: another friction, walls, a base, wrong rotations
    "power_gap": lambda e: e.power_gap,
    # two readings of the positions: the posterior, and the balance of overlaps
    "disagreement_of_positions": lambda e: 1.0 - e.position_agreement,
}
ONE_SIDED = 1.645  # standard deviations of a normal distribution that 5 % are beyond, on one side
MOSTLY_OVERLAPS = 0.5  # weight of the position-only estimate of soft grains above which only its evidence counts
LEAST = 1e-4  # of a measure: its logarithm is taken


def expect_correlation(evidence: Evidence) -> float:
    """Correlation of f_n with the truth that the evidence leads to expect.

    Parameters
    ----------
    evidence : Evidence
        Of a frame that the ensemble solved from its motion.

    Returns
    -------
    float
        In [0, 1).

    Notes
    -----
    r = tanh(b + Σ h_j(ln x_j)) with non-increasing, piecewise linear h_j of the measures x_j, fitted on simulated
    packings (fitted.toml). A measure that is not known adds nothing.
    """
    return max(math.tanh(correlation_score(evidence)), 0.0)


def bound_correlation(evidence: Evidence) -> float:
    """Lower bound of the correlation of f_n with the truth, in [0, 1); at most one frame in twenty is below it.

    Notes
    -----
    T = tanh(g − s_0 − s_1 max(2.6 − g, 0)) with g the argument of `expect_correlation`: the less is expected, the less
    certain it is.
    """
    return _bound(correlation_score(evidence), _table(evidence))


def expected_interval(evidence: Evidence) -> tuple[float, float, float]:
    """Expected correlation, and an interval that holds two thirds of the true ones.

    Notes
    -----
    The bound is 1.64 standard deviations of a normal distribution of g below the expected one.
    """
    score, table = correlation_score(evidence), _table(evidence)
    sd = _margin(score, table) / ONE_SIDED
    expected, low, high = (max(math.tanh(each), 0.0) for each in (score, score - sd, score + sd))
    return expected, low, high


def rests_on_overlaps(evidence: Evidence) -> bool:
    """Whether the field follows from the overlaps of soft grains: a contradiction with the motion then means little."""
    return bool(evidence.information.soft and evidence.position_weight > MOSTLY_OVERLAPS)


def losses(evidence: Evidence) -> dict[str, float]:
    """By how much the bound would rise if one measure were at its best, for each known measure."""
    table, score = _table(evidence), correlation_score(evidence)
    best = {name: float(each["value"][0]) - _term(each, MEASURES[name](evidence)) for name, each in _terms(table)}
    return {name: _bound(score + rise, table) - _bound(score, table) for name, rise in best.items()}


def _bound(score: float, table: dict[str, Any]) -> float:
    return max(math.tanh(score - _margin(score, table)), 0.0)


def _margin(score: float, table: dict[str, Any]) -> float:
    margin, slope, start = (float(table[name]) for name in ("margin", "slope", "start"))
    return margin + slope * max(start - score, 0.0)


def correlation_score(evidence: Evidence) -> float:
    """Argument g of the expected correlation tanh(g), which may be negative."""
    table = _table(evidence)
    return float(table["constant"]) + sum(_term(each, MEASURES[name](evidence)) for name, each in _terms(table))


def _term(table: dict[str, Any], measure: float) -> float:
    if math.isnan(measure):
        return 0.0
    return float(np.interp(math.log(max(measure, LEAST)), np.log(table["at"]), table["value"]))


def _table(evidence: Evidence) -> dict[str, Any]:
    """The table for the evidence at hand: of overlaps of soft grains, of both estimates, or of the motion alone."""
    tables = FITTED["expected_correlation"]
    if rests_on_overlaps(evidence) and not math.isnan(evidence.position_agreement) and "overlaps" in tables:
        return tables["overlaps"]
    return tables["motion" if math.isnan(evidence.agreement) else "both"]


def _terms(table: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    return [(name, each) for name, each in table.items() if isinstance(each, dict)]
