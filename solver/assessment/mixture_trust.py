"""Trust in the position-only estimate and in mixtures of estimates, and their weights.

Two estimates whose errors have different causes correlate by c = r_1 r_2, the product of their correlations with the
truth. Neither is then below c, and where c is below the product of both trusts, one of them is too high: that of the
position-only estimate, which assumes exact radii, friction and elastic law.
"""

from __future__ import annotations

import math

import numpy as np

from ..bodies.grains import Array
from .evidence import Evidence
from .expected_correlation import MEASURES
from .fitted import FITTED

POSTERIOR_CALIBRATION = 0.95  # true over self-estimated correlation of the posterior, where its input is right
MAX_TRUST = 0.995  # above it a field would have all the weight
RELIABILITY_DISAGREEMENT: tuple[float, float] = tuple(FITTED["motion_reliability"]["disagreement"])
RELIABILITY_CORRECTION: tuple[float, float] = tuple(FITTED["motion_reliability"]["correction"])
# of the weight in fitted.toml
WEIGHT_TERMS = (
    "constant", "correction", "unclear", "sliding", "members", "nearer", "hidden", "residual", "agreement",
    "shown",
)  # fmt: skip
LEAST_WEIGHT: float = FITTED["position_weight"]["least"]  # weights below it are not used
# Of 1 − R of a sound frame, the fraction that its motion estimate errs by on average (sixteen scenarios, seed 0). A
# reliability of LOW or less is taken as the expectation itself.
MEAN_ERROR_FRACTION = 0.45
LOW, SOUND = 0.6, 0.85
ALIKE = 0.5  # weight of either estimate
MAX_TRUST_CORRECTED = 0.9  # errors of centres and radii were separated from overlaps; r .87 to .98


def reconcile_trusts(motion_trust: float, posterior_trust: float, agreement: float) -> tuple[float, float]:
    """Make the trusts of both fields consistent with their agreement.

    Parameters
    ----------
    motion_trust, posterior_trust : float
        Each field's own trust; the motion's may be NaN.
    agreement : float
        Correlation c of both fields; NaN: unknown.

    Returns
    -------
    tuple of float
        T_m and T_p of the motion and the posterior, within 0 … 0.995.

    Notes
    -----
    T_m = max(motion_trust, c, 0), or 0 where it is NaN; T_p = min(0.95 posterior_trust, max(c, 0)/motion_trust), the
    latter where both c and motion_trust are known.
    """
    claimed = POSTERIOR_CALIBRATION * posterior_trust
    common = max(agreement, 0.0) if np.isfinite(agreement) else 0.0
    if not np.isfinite(motion_trust):
        return 0.0, min(claimed, MAX_TRUST)
    if np.isfinite(agreement):
        claimed = min(claimed, common / max(motion_trust, 1e-6))
    return float(np.clip(max(motion_trust, common), 0.0, MAX_TRUST)), float(np.clip(claimed, 0.0, MAX_TRUST))


def compute_position_weight(motion_trust: float, posterior_trust: float, weight: float = 1.0) -> float:
    """Compute the weight u of the posterior in the mixture; ½ where both trusts are zero.

    Notes
    -----
    u = S_p/(S_p + weight S_m), S = T²/(1 − T²): the signal-to-noise ratio of a field of correlation T.
    """
    motion, posterior = (trust**2 / (1.0 - trust**2) for trust in (motion_trust, posterior_trust))
    motion *= weight
    return posterior / (posterior + motion) if posterior + motion > 0.0 else 0.5


def confirmed_trust(motion_trust: float, posterior_trust: float, agreement: float) -> float:
    """Limit the posterior's trust to its agreement with the motion, beyond it as far as the motion has trust.

    With wrong input both fields are wrong, and only a low trust of the motion shows it.
    """
    common = min(max(agreement, 0.0), posterior_trust) if np.isfinite(agreement) else 0.0
    return common + motion_trust * (posterior_trust - common)


def mixture_trust(
    motion_trust: float,
    posterior_trust: float,
    agreement: float,
    position_weight: float,
    sds: tuple[np.floating, np.floating],
) -> float:
    """Compute the mixture's correlation with the truth from those of both fields."""
    one, two = (1.0 - position_weight) * float(sds[0]), position_weight * float(sds[1])
    both = agreement if np.isfinite(agreement) else 0.0
    size = np.sqrt(max(one**2 + two**2 + 2.0 * one * two * both, 1e-300))
    return float(np.clip((one * motion_trust + two * posterior_trust) / size, 0.0, MAX_TRUST))


def soft_mixture_trust(mixed: float, positions: float, greatest: float, weight: float) -> float:
    """Compute the trust in a mixture for soft grains.

    Parameters
    ----------
    mixed : float
        Trust of the mixture for hard grains.
    positions : float
        Trust of the position-only estimate by itself.
    greatest : float
        Largest trust in overlaps.
    weight : float
        Weight of motion, 0 where overlaps alone determine the forces.
    """
    return weight * mixed + (1.0 - weight) * min(positions, greatest)


def motion_reliability(evidence: Evidence) -> float:
    """Correlation with the truth that the motion estimate claims for its weight beside soft or unscaled positions.

    Notes
    -----
    1 − 0.83 D^2.65 − 0.42 ε^0.73, D the disagreement of the members and ε the correction; NaN where either is unknown
    or no motion leads to the frame.
    """
    if not evidence.assessed or math.isnan(evidence.correction) or math.isnan(evidence.disagreement):
        return math.nan
    (a, p), (b, q) = RELIABILITY_DISAGREEMENT, RELIABILITY_CORRECTION
    return float(np.clip(1.0 - a * evidence.disagreement**p - b * max(evidence.correction, 0.0) ** q, 0.0, 1.0))


def expected_of_motion(reliability: float, *, scale_known: bool) -> float:
    """Expected correlation of a motion estimate with a reliability; without a load elastic loading looks accurate.

    Notes
    -----
    1 − (1 − R)(1 − s (1 − m)), s rising from 0 at R = .6 to 1 at R = .85, m = .45; R itself without a load.
    """
    if not scale_known:
        return reliability
    sure = float(np.clip((reliability - LOW) / (SOUND - LOW), 0.0, 1.0))
    return 1.0 - (1.0 - reliability) * (1.0 - sure * (1.0 - MEAN_ERROR_FRACTION))


def evident_position_weight(evidence: Evidence) -> float:
    """Weight of the position-only estimate beside a motion estimate of hard grains.

    Parameters
    ----------
    evidence : Evidence
        Of the motion estimate: the correction ε, by which forces must correct the measured motion; the power gap p,
        by which friction opposes the sliding less than it could; the measure h of hidden sliding, without which motion
        shows little; the residual u that no forces balance, because walls, friction or contacts are not as stated; the
        correlation b with the position-only estimate; and the correlations c of that estimate and d of the motion with
        the motion-free balance of overlaps, and the overlap o of the mean force over the noise: what positions show.

    Returns
    -------
    float
        w = 1/(1 + exp(−s)) in (0, 1), with a from fitted.toml, others of grains without a known load, and
        s = a_0 + a_1 ln ε + a_2 ln(1 − c) + a_3 ln p + a_4 ln D + a_5 (arctanh c − arctanh d)
            + a_6 ln h + a_7 ln u + a_8 arctanh b + a_9 ln o.

    Where o is small, positions show which contacts bear, not how much, and sometimes less than the motion, which no
    other measure shows: w is at most .6 where o ≤ .06, and 1 from o = .12 on, linear in ln o between. Where errors of
    single grains were corrected, which o contains, nothing limits w.

    Errors of single grains that were corrected change gaps as forces do, which makes positions less certain in a way
    that none of these measures shows: without a known load both estimates then count alike.
    """
    if evidence.corrected_gap > 0.0 and not evidence.loaded:
        return ALIKE
    score = float(position_weight_terms(evidence) @ weight_coefficients(loaded=evidence.loaded))
    weight = 1.0 / (1.0 + math.exp(-score))
    return weight if evidence.corrected_gap > 0.0 else min(weight, _most_by_overlap(evidence.shown_overlap))


def _most_by_overlap(shown: float) -> float:
    """Greatest weight of positions that show so much of an overlap, over their noise; NaN: not known."""
    (low, least), (high, most) = FITTED["position_weight"]["most_by_overlap"]
    if math.isnan(shown):
        return most
    return float(np.interp(math.log(max(shown, low)), np.log([low, high]), [least, most]))


def weight_coefficients(*, loaded: bool) -> Array:
    """Coefficients (t,) of the terms of `evident_position_weight`."""
    table = FITTED["position_weight"]
    table = table if loaded else table["unloaded"]
    return np.array([table[name] for name in WEIGHT_TERMS])


def position_weight_terms(evidence: Evidence) -> Array:
    """The terms (t,) that WEIGHT_TERMS names, of `evident_position_weight`."""
    table = FITTED["position_weight"]

    def logarithm(value: float, default: float, limits: list[float]) -> float:
        low, high = limits
        return math.log(min(max(default if math.isnan(value) else value, low), high))

    return np.array([
        1.0,
        logarithm(evidence.correction, table["default_correction"], table["correction_range"]),
        logarithm(1.0 - evidence.position_agreement, table["default_unclear"], table["unclear_range"]),
        logarithm(evidence.power_gap, table["default_sliding"], table["sliding_range"]),
        logarithm(evidence.disagreement, table["default_members"], table["members_range"]),
        _how_much_nearer(evidence, table["nearer_range"]),
        logarithm(MEASURES["hidden_sliding"](evidence), table["default_hidden"], table["hidden_range"]),
        logarithm(evidence.unbalance, table["default_residual"], table["residual_range"]),
        float(np.nan_to_num(_arctanh(evidence.agreement, table["nearer_range"]))),
        logarithm(evidence.shown_overlap, table["default_shown"], table["shown_range"]),
    ])  # fmt: skip


def _how_much_nearer(evidence: Evidence, limits: list[float]) -> float:
    """How much nearer the position-only estimate is to the balance of overlaps than the motion is; 0: unknown."""
    nearer = _arctanh(evidence.position_agreement, limits) - _arctanh(evidence.overlap_agreement, limits)
    return float(np.nan_to_num(nearer))


def _arctanh(correlation: float, limits: list[float]) -> float:
    low, high = limits
    return float(np.arctanh(np.clip(correlation, low, high)))


def fused_trust(first: float, second: float, agreement: float, weight: float) -> float:
    """Compute the trust of a weighted mean of two estimates with independent errors.

    Parameters
    ----------
    first, second : float
        Correlation of each with the truth; `second` is limited to agreement / first.
    agreement : float
        Correlation c of both estimates.
    weight : float
        Weight w of the second.

    Returns
    -------
    float
        1 − (1 − w)² (1 − first) − w² (1 − second).
    """
    second = min(np.nan_to_num(second, nan=agreement), agreement / max(first, 1e-6))
    return float(np.clip(1.0 - (1.0 - weight) ** 2 * (1.0 - first) - weight**2 * (1.0 - second), 0.0, 1.0))
