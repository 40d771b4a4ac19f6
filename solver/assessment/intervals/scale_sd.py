"""Standard deviation of the scale of all forces of a frame."""

from __future__ import annotations

import math

from ..evidence import Evidence
from ..fitted import FITTED

LEAST: float = FITTED["scale_sd"]["least"]
PER_LOAD: float = FITTED["scale_sd"]["per_load"]


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
    σ² = a² + (b ln q)², q the mean stress of the field over that of the loads. Wrong input makes part of the load
    vanish, so that q is far from 1; an anisotropic stress does so, too, and widens σ without need. Fitted on simulated
    packings (fitted.toml).
    """
    if not evidence.assessed or math.isnan(evidence.disagreement):
        return math.nan
    quotient = evidence.load_fraction
    return math.hypot(LEAST, PER_LOAD * math.log(quotient) if quotient > 0.0 else 0.0)
