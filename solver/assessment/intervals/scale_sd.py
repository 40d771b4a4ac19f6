"""Standard deviation of the scale of all forces of a frame."""

from __future__ import annotations

import math
from collections.abc import Callable

from ..evidence import Evidence
from ..expected_correlation import correlation_score, unexplained_correction
from ..fitted import FITTED

TABLE = FITTED["scale_sd"]
LEAST: float = TABLE["least"]
WITHOUT_MOTION: float = FITTED["force_intervals"]["first_scale"]
# Error of the first scale that is common with the second one, over the standard deviation of the latter: positions
# alone show nothing of the friction that motion, walls or a base mobilised before.
FIRST_BY_SECOND: float = TABLE["first_by_second"]
# Evidence that the scale is uncertain, by the name of its factor in fitted.toml; NaN: not known.
TERMS: dict[str, Callable[[Evidence], float]] = {
    "per_load": lambda e: abs(math.log(e.load_fraction)) if e.load_fraction > 0.0 else 0.0,
    "per_correction": unexplained_correction,
    "per_power_gap": lambda e: e.power_gap,
    "per_error": lambda e: math.exp(-2.0 * correlation_score(e)),
    "per_inertia": lambda e: e.inertial_number,
    "per_reaction": lambda e: e.boundary_reaction,
}


def scale_sd(evidence: Evidence) -> float:
    """Relative standard deviation of the scale.

    Parameters
    ----------
    evidence : Evidence
        Of a frame whose scale a load or weight sets.

    Returns
    -------
    float
        NaN where the frame is not assessed: a single chain, or a frame whose positions were not used.

    Notes
    -----
    Of a frame to which no motion leads, the fitted error common to all of its forces. Otherwise
    σ² = a² + (b ln q)² + (c ε)² + (d p)² + (e (1 − r)/(1 + r))² + (f I)² + (g R)²: q the mean stress of the field over
    that of the loads, ε the correction of the measured motion beyond that of noise, p the power gap, r the expected
    correlation, I the inertial number and R what boundary rods inside the packing bear, over all forces. Wrong input
    makes part of the load vanish, so that q is far from 1; an anisotropic stress does so, too, and widens σ without
    need. Fitted on simulated packings (fitted.toml). Where weight alone sets the scale, a wall that presses on the
    packing may add any force: the standard deviation of the scale among the ensemble members is added.
    """
    members = 0.0 if math.isnan(evidence.scale_disagreement) else evidence.scale_disagreement
    if not evidence.assessed:
        return math.nan if math.isnan(evidence.mixed_trust) else math.hypot(WITHOUT_MOTION, members)
    terms = scale_terms(evidence)
    return math.hypot(LEAST, members, *(TABLE[name] * each for name, each in zip(TERMS, terms, strict=True)))


def scale_terms(evidence: Evidence) -> list[float]:
    """The TERMS of a frame (t,), 0 where one is not known; NaN where the frame is not assessed."""
    if not evidence.assessed or math.isnan(evidence.disagreement):
        return [math.nan] * len(TERMS)
    return [0.0 if math.isnan(each := term(evidence)) else each for term in TERMS.values()]
