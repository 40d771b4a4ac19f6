"""Correlation with the truth that a frame's evidence leads to expect, and its lower bound.

Two estimates of a frame whose errors have different causes, from its motion and from its positions, agree only where
both are right. Their agreement and what contradicts the forces are weighed in one additive model.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..bodies.grains import Array
from .evidence import Evidence
from .fitted import FITTED

# Evidence against the forces, larger values being worse, by the names of the tables in fitted.toml.
MEASURES: dict[str, Callable[[Evidence], float]] = {
    "disagreement_of_estimates": lambda e: 1.0 - e.agreement,
    # positions may err alone: one confirmation of the motion estimate is enough
    "disagreement_with_either": lambda e: 1.0 - float(np.fmax(e.agreement, e.overlap_agreement)),
    "correction": lambda e: unexplained_correction(e),
    "previous_residual": lambda e: e.old_unbalance,
    "disagreement_of_members": lambda e: e.disagreement,
    "gap_error": lambda e: e.information.gap_error / e.information.diameter,
    "force_change": lambda e: e.force_change,
    # friction that opposes the measured sliding less than it could: another friction, walls, a base, wrong rotations
    "power_gap": lambda e: e.power_gap,
    # sliding that noise hides, or that there is not: the motion then shows little, and its estimators agree by chance
    "hidden_sliding": lambda e: 1.0 / (LEAST_SIGNAL + e.information.slide_signal),
    "load_mismatch": lambda e: abs(math.log(e.load_fraction)) if e.load_fraction > 0.0 else math.nan,
    # a grain that no forces of the network hold in balance: friction, walls or contacts are not as stated
    "force_residual": lambda e: e.unbalance,
    "inertial_number": lambda e: e.inertial_number,
    "coarse_step": lambda e: e.shear,
    # two readings of the positions: the posterior, and the balance of overlaps
    "disagreement_of_positions": lambda e: 1.0 - e.position_agreement,
    # without a load: boundary grains, whose forces satisfy no balance, leave more of the others open
    "undetermined": lambda e: e.information.undetermined,
    "noise": lambda e: e.information.noise / e.information.diameter,
    "few_interior": lambda e: 1.0 / max(e.interior, 1.0),
}
# Where nothing slides, these are small for want of motion, which is no evidence for the forces: estimates that know the
# balance of forces alone agree, too.
BY_SLIDING = frozenset({
    "correction", "disagreement_of_estimates", "disagreement_with_either", "disagreement_of_members", "force_change",
    "power_gap",
})  # fmt: skip
CORRECTED_NOISE = 1.2  # ε of a motion that is noise: at most 1.14 in simulated packings at rest with right input
# Below the agreement of both estimates: in 167 frames of nine kinds of simulated soft grains (seeds 42, 60 to 66) T is
# then above r + .03 in .6 %, as before, and below r − .15 in 13 instead of 22 %.
CONFIRMED_MARGIN = 0.05
MOSTLY_OVERLAPS = 0.5  # weight of the position-only estimate of soft grains above which only its evidence counts
CONTRADICTED: float = FITTED["expected_correlation"]["contradicted"]  # change of arctanh r where a cause is named
CERTAIN = 1.0 - 1e-9  # r up to which arctanh r is finite
WIDEST: float = FITTED["expected_correlation"]["widest_gap_error"]  # gap error that simulated frames have reached
CLOSED: float = FITTED["expected_correlation"]["closed_overlap"]  # at which r is half of what other evidence shows
# Fraction of `closed_overlap` that counts where errors of centres were found again by forces. In four tests of rods at
# rest (rising and stepped loads, 150 rods, seeds 60 and 61) r is .80, .79, .92 and .90, expected without this
# fraction .77, .76, .83 and .81; with .5 the means are equal.
CLOSED_BY_FORCES = 0.5
BEST_EIGHTH = 1  # knot of a table: quantiles of the frames of the fit, an eighth apart
# Of arctanh r: by so much more than with a load, the same evidence may speak for forces without one. The table of these
# knows few kinds of missing physics: by it alone T is above r + .03 in 33 % of the frames of rolling resistance and
# inertia, and with this limit in 3 %. Chosen on seeds 20, 22, 43, 60 and 61 of 24 kinds without a load.
UNLOADED_GAIN = 0.1
# Of arctanh T without a known load, times the interior grains, as far as they are fewer than …: the correlation of few
# contacts scatters. In crops of 60 to 200 rods T was above r + .03 in 3.8 % of 704 frames (seeds 101 to 104), of 60 to
# 100 rods in 11 % of 495 (seeds 105 to 107); with it in 1.1 and 2.6 %.
FEW_INTERIOR_MARGIN, MANY_INTERIOR = 8.0, 80
LEAST = 1e-4  # of a measure: its logarithm is taken
LEAST_SIGNAL = 1e-2  # of sliding over its noise, below which no sliding is seen


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
    r = tanh(max(b + Σ h_j(ln x_j), least)) with non-increasing, piecewise linear h_j of the measures x_j, fitted on
    simulated packings (fitted.toml). A measure that is not known adds nothing; `least` belongs to the worst evidence
    that was fitted, beyond which nothing is known. What speaks for the forces by BY_SLIDING counts in proportion to the
    sliding over its noise, up to one. r is multiplied by x_0/(x_0 + x), x the `closed_overlap`.
    """
    expected = max(math.tanh(correlation_score(evidence)), 0.0) * _shown_fraction(evidence)
    return max(_as_with_a_load(expected, expect_correlation, evidence), confirmed_correlation(evidence))


def bound_correlation(evidence: Evidence) -> float:
    """Lower bound T of the correlation of f_n with the truth, in [0, 1).

    T exceeds r by more than .03 in at most three frames of a hundred.

    Notes
    -----
    T = tanh(g − max(a + b g, 0)) with g the argument of `expect_correlation`: a quantile of the errors of g, fitted on
    kinds of input left out (fitted.toml). A margin that depended on measures as well fitted better the kinds that it
    had read, and worse the others. Where the gap error x exceeds the greatest one x_0 that was fitted, nothing is known
    of r, and T is multiplied by x_0/x. Without a load arctanh T is lower by 8 (1/n − 1/80) with n < 80 interior grains.
    Of soft grains T is at least the `confirmed_correlation`.
    """
    return max(_beside_few(_limited_bound(evidence), evidence), confirmed_correlation(evidence))


def predict_correlation(evidence: Sequence[Evidence], *, contradicted: bool = False) -> tuple[float, float, float]:
    """Predict r(f_n) of a whole test from its first photographs.

    Parameters
    ----------
    evidence : sequence of Evidence
        Of the first photographs.
    contradicted : bool
        Whether a cause of wrong forces was named, which the evidence shows only in part.

    Returns
    -------
    tuple of float
        Predicted r, and an interval that holds two of three tests.

    Notes
    -----
    As `expect_correlation`, by the mean of ln x_j over the photographs; the interval is tanh(g ± sd).
    """
    loaded = all(each.loaded for each in evidence)
    table = FITTED["expected_correlation"]["prediction" if loaded else "unloaded_prediction"]
    score = float(table["constant"])
    for name, each in _terms(table):
        known = [_logarithm(each, x) for x in map(MEASURES[name], evidence) if not math.isnan(x)]
        if known:
            value = float(np.interp(np.mean(known), np.log(each["at"]), each["value"]))
            score += _as_far_as_seen(name, value, float(np.mean([fraction_seen(e) for e in evidence])))
    score += CONTRADICTED if contradicted else 0.0
    score, sd = max(score, float(table["least"])), float(table["sd"])
    shown = float(np.mean([_shown_fraction(each) for each in evidence]))
    r, low, high = (shown * max(math.tanh(each), 0.0) for each in (score, score - sd, score + sd))
    return r, low, high


def contradict(correlation: float) -> float:
    """Lower a correlation, expected or a bound, for a named cause of wrong forces, of which frames show a part only."""
    return max(math.tanh(math.atanh(min(correlation, CERTAIN)) + CONTRADICTED), 0.0)


def confirmed_correlation(evidence: Evidence) -> float:
    """Correlation that the motion confirms for a field of overlaps, as far as sliding is seen; 0 for other fields.

    Notes
    -----
    max(k s c − .05, 0) with c the agreement of both estimates, s the fraction of the sliding that is seen, and k the
    factor by which T falls where gaps are wider than any that was fitted. Estimates whose errors have different causes
    correlate by c = r_1 r_2, so that neither is below c; errors of the positions as large as that are in both.
    """
    if not rests_on_overlaps(evidence) or math.isnan(evidence.agreement):
        return 0.0
    known = fraction_seen(evidence) * _known_fraction(evidence)
    return max(known * evidence.agreement - CONFIRMED_MARGIN, 0.0)


def rests_on_overlaps(evidence: Evidence) -> bool:
    """Whether the field follows from the overlaps of soft grains: a contradiction with the motion then means little."""
    return bool(evidence.information.soft and evidence.position_weight > MOSTLY_OVERLAPS)


def losses(evidence: Evidence) -> dict[str, float]:
    """By how much the bound would rise if one measure were as in the best eighth of the fit, for each known measure.

    Where the bound is what it would be under a load, the greater of what both tables show.
    """
    own = _losses(evidence)
    if _is_limited(evidence):
        loaded = _losses(replace(evidence, loaded=True))
        own = {name: max(own.get(name, 0.0), loaded.get(name, 0.0)) for name in {**own, **loaded}}
    if "few_interior" in own:
        bound = _limited_bound(evidence)
        own["few_interior"] += bound - _beside_few(bound, evidence)
    return own


def _losses(evidence: Evidence) -> dict[str, float]:
    table, score, shown = _table(evidence), correlation_score(evidence), _shown_fraction(evidence)
    known, seen = shown * _known_fraction(evidence), fraction_seen(evidence)
    best = {
        name: max(_as_far_as_seen(name, float(each["value"][BEST_EIGHTH]), seen) - _term(name, each, evidence), 0.0)
        for name, each in _terms(table)
    }
    least = confirmed_correlation(evidence)
    alone = known * _bound(score, evidence)
    bound = max(alone, least)
    found = {
        name: max((shown if name == "gap_error" else known) * _bound(score + rise, evidence), least) - bound
        for name, rise in best.items()
    }
    return {**found, "closed_overlap": max(alone / shown, least) - bound}


def _as_with_a_load(found: float, measure: Callable[[Evidence], float], evidence: Evidence) -> float:
    """Limit a correlation to what the same evidence would mean under a known load, which can only add knowledge."""
    if not _is_unloaded(evidence):
        return found
    loaded = min(measure(replace(evidence, loaded=True)), CERTAIN)
    return min(found, math.tanh(math.atanh(loaded) + UNLOADED_GAIN))


def _beside_few(bound: float, evidence: Evidence) -> float:
    """Lower the bound without a known load for the scatter of few interior grains."""
    if not _is_unloaded(evidence):
        return bound
    few = max(1.0 / max(evidence.interior, 1.0) - 1.0 / MANY_INTERIOR, 0.0)
    return max(math.tanh(math.atanh(min(bound, CERTAIN)) - FEW_INTERIOR_MARGIN * few), 0.0)


def _is_limited(evidence: Evidence) -> bool:
    """Whether the trust is what it would be under a known load."""
    return _limited_bound(evidence) < _bound_by_table(evidence)


def _limited_bound(evidence: Evidence) -> float:
    """Bound by the table of the evidence, at most what it would be under a load."""
    return _as_with_a_load(_bound_by_table(evidence), bound_correlation, evidence)


def _known_fraction(evidence: Evidence) -> float:
    """Fraction of the bound that is left where gaps, without overlaps by the forces, are wider than any fitted."""
    found = evidence.information
    unexplained = min(found.gap_error, found.unexplained_gap) / found.diameter
    return WIDEST / unexplained if unexplained > WIDEST else 1.0


def _shown_fraction(evidence: Evidence) -> float:
    """Fraction of r that is left where gaps were closed that would show forces."""
    return CLOSED / (CLOSED + closed_overlap(evidence))


def _bound_by_table(evidence: Evidence) -> float:
    return _bound(correlation_score(evidence), evidence) * _known_fraction(evidence) * _shown_fraction(evidence)


def _bound(score: float, evidence: Evidence) -> float:
    bound = _table(evidence)["bound"]
    margin = float(bound["constant"]) + float(bound["score"]) * score
    return max(math.tanh(score - max(margin, 0.0)), 0.0)


def correlation_score(evidence: Evidence) -> float:
    """Argument g of the expected correlation tanh(g), which may be negative."""
    table = _table(evidence)
    score = float(table["constant"]) + sum(_term(name, each, evidence) for name, each in _terms(table))
    return max(score, float(table["least"]))


def _term(name: str, table: dict[str, Any], evidence: Evidence) -> float:
    measure = MEASURES[name](evidence)
    if math.isnan(measure):
        return 0.0
    value = float(np.interp(_logarithm(table, measure), np.log(table["at"]), table["value"]))
    return _as_far_as_seen(name, value, fraction_seen(evidence))


def _as_far_as_seen(name: str, value: float, seen: float) -> float:
    """What a measure adds, where a fraction of the sliding is seen."""
    return float(weaken(value, seen)) if name in BY_SLIDING else value


def weaken(value: Array | float, strength: Array | float) -> Array:
    """Multiply values (f,) above zero, which speak for the forces, by strengths in [0, 1]; others count wholly."""
    return np.where(np.greater(value, 0.0), strength * value, value)


def unexplained_correction(evidence: Evidence) -> float:
    """Correction ε of the measured motion beyond that of noise: where nothing slides, the motion is noise.

    Without any sliding no ε contradicts the forces: that of noise is 2.4 in a heap of several sizes.
    """
    seen = fraction_seen(evidence)
    beyond = max(evidence.correction - CORRECTED_NOISE * (1.0 - seen), 0.0)
    return min(beyond, seen * evidence.correction)


def closed_overlap(evidence: Evidence) -> float:
    """Corrections of gaps as errors of single grains, beyond noise, over the diameter, as far as forces rest on gaps.

    Overlaps that show forces are corrected with such errors; the motion distinguishes both only where grains slide, and
    forces do in part.
    """
    found = evidence.information
    beyond = evidence.corrected_gap - found.noise
    if not beyond > 0.0:
        return 0.0
    counts = CLOSED_BY_FORCES if evidence.centres_by_forces else 1.0
    return counts * evidence.position_weight * (1.0 - fraction_seen(evidence)) * beyond / found.diameter


def seen_sliding(hidden: Array | np.float64) -> Array:
    """Sliding over its noise, at most 1, of values (f,) of the measure "hidden_sliding"."""
    return np.minimum(1.0 / hidden - LEAST_SIGNAL, 1.0)


def fraction_seen(evidence: Evidence) -> float:
    """Fraction of the sliding that is seen; 1 where that is not known."""
    hidden = MEASURES["hidden_sliding"](evidence)
    return 1.0 if math.isnan(hidden) else float(seen_sliding(np.float64(hidden)))


def _logarithm(table: dict[str, Any], measure: float) -> float:
    """ln of a measure within the range in which it was fitted."""
    return math.log(min(max(measure, LEAST, table["at"][0]), table["at"][-1]))


def _table(evidence: Evidence) -> dict[str, Any]:
    """Return the fitted table for the kind of evidence.

    There is one for overlaps of soft grains, one for the motion alone, and two for both estimates: under a known load,
    and without one, where balance determines less of the forces.
    """
    tables = FITTED["expected_correlation"]
    if rests_on_overlaps(evidence) and not math.isnan(evidence.position_agreement) and "overlaps" in tables:
        return tables["overlaps"]
    if math.isnan(evidence.agreement):
        return tables["motion"]
    return tables["both" if evidence.loaded else "unloaded"]


def _is_unloaded(evidence: Evidence) -> bool:
    """Whether the table of both estimates without a load counts."""
    return _table(evidence) is FITTED["expected_correlation"]["unloaded"]


def _terms(table: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    return [(name, each) for name, each in table.items() if name in MEASURES]
