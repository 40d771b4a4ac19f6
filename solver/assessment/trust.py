"""Trust in one frame's forces: the correlation with the truth that is expected, and a lower bound of it.

This module and `penalties` are the only place where either number is computed. The estimators report what they
measured (`Evidence`); nothing outside multiplies, caps or replaces the result.

"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..bodies.grains import Array
from ..statistics.agreement import pearson
from .evidence import Evidence
from .expected_correlation import bound_correlation, expect_correlation
from .fitted import FITTED

CHAIN_CORRECTION: tuple[float, float] = tuple(FITTED["trust"]["single_chain_correction"])
CHAIN_REACH: float = FITTED["trust"]["single_chain_reach"]
INFERRED_PENALTY: float = FITTED["trust"]["inferred_penalty"]
TRUST_PER_INTERIOR_GRAIN = 0.05  # few grains agree by chance, and most of their forces follow from the boundary
MAX_UNSEEN_FRACTION = 0.2  # of the grains; a tracker rarely loses more than one in ten


class Assessment(NamedTuple):
    """Both measures of how far the forces of a frame agree with the true ones."""

    expected_correlation: float  # best estimate of r(f_n)
    trust: float  # lower bound: r(f_n) is more than .03 below it in at most three frames of a hundred


def motion_assessment(evidence: Evidence) -> Assessment:
    """Expected correlation and lower bound before the penalties that only the assessment of a frame adds.

    Parameters
    ----------
    evidence : Evidence
        Of one frame.

    Returns
    -------
    Assessment
        Both in [0, 1]; NaN where they are not assessed.

    Notes
    -----
    Of the ensemble both follow from `expected_correlation`. Of a single chain 1 − T = a ε^p + b (gap threshold / mean
    diameter), for both. A frame to which no motion leads has the trust of its mixture. Inferred, unseen and bridged
    grains reduce both by a factor each.
    """
    if not evidence.assessed:
        found = Assessment(evidence.mixed_trust, evidence.mixed_trust)
    elif math.isnan(evidence.disagreement):
        if math.isnan(evidence.correction):
            return Assessment(math.nan, math.nan)
        loss = CHAIN_CORRECTION[0] * max(evidence.correction, 0.0) ** CHAIN_CORRECTION[1]
        bound = 1.0 - loss - CHAIN_REACH * evidence.reach
        found = Assessment(bound, bound)
    else:
        found = Assessment(expect_correlation(evidence), bound_correlation(evidence))
    return Assessment(*(_reduce_for_unseen(each, evidence) for each in found))


def interior_limit(evidence: Evidence) -> float:
    """Greatest trust in a packing with so few interior grains; at least 1 with twenty of them."""
    return TRUST_PER_INTERIOR_GRAIN * evidence.interior


def unseen_penalty(evidence: Evidence) -> float:
    """Fraction of the trust lost to inferred grains, which no photograph shows."""
    return INFERRED_PENALTY * evidence.inferred / max(evidence.grains, 1)


def hidden_fraction(fn: Array, shown: NDArray[np.bool_]) -> float:
    """1 − correlation of f_n (c,) with itself where only some contacts (c,) are shown; the others count as zero."""
    return 1.0 - pearson(np.where(shown, fn, 0.0), fn)


def _reduce_for_unseen(trust: float, evidence: Evidence) -> float:
    trust = min(trust, interior_limit(evidence))
    if evidence.unseen_fraction > MAX_UNSEEN_FRACTION:
        trust *= 1.0 - evidence.unseen_fraction
    seen = max(1.0 - unseen_penalty(evidence), 0.0)
    return float(np.clip(trust, 0.0, 1.0) * seen) * (1.0 - evidence.hidden_fraction)
