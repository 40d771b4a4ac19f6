"""Standard deviation of the scale of all forces of a frame."""

from __future__ import annotations

import math

from ..evidence import Evidence
from ..expected_correlation import correlation_score
from ..fitted import FITTED

TABLE = FITTED["scale_sd"]


def scale_sd(evidence: Evidence) -> float:
    """Relative standard deviation of the scale.

    Parameters
    ----------
    evidence : Evidence
        Of a frame whose scale a load or weight sets.

    Returns
    -------
    float
        NaN where the frame is not assessed.

    Notes
    -----
    σ² = a² + (b ln q)² + (c ε)² + (d p)² + (e (1 − r)/(1 + r))²: q the mean stress of the field over that of the loads,
    ε the correction of the measured motion, p the power gap and r the expected correlation. Wrong input makes part of
    the load vanish, so that q is far from 1; an anisotropic stress does so, too, and widens σ without need. Fitted on
    simulated packings (fitted.toml).
    """
    if not evidence.assessed or math.isnan(evidence.disagreement):
        return math.nan
    quotient = evidence.load_fraction
    return math.hypot(
        TABLE["least"],
        TABLE["per_load"] * (math.log(quotient) if quotient > 0.0 else 0.0),
        TABLE["per_correction"] * _known(evidence.correction),
        TABLE["per_power_gap"] * _known(evidence.power_gap),
        TABLE["per_error"] * math.exp(-2.0 * correlation_score(evidence)),
    )


def _known(value: float) -> float:
    return 0.0 if math.isnan(value) else value
