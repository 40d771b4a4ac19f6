"""Coverage of errors by their standard deviations, and the factor that brings it to that of normal errors."""

from __future__ import annotations

import numpy as np

from ...solver.bodies.grains import Array

COVERED = (0.683, 0.954)  # of one and of two standard deviations


def coverage_scale(ratio: Array) -> float:
    """Return √(q_68 q_95 / 2) of errors over their standard deviations (n,): the factor of the latter; NaN without any.

    It is the geometric mean of the two factors with which one, or two standard deviations cover as many as of normal
    errors.
    """
    return float(np.sqrt(np.prod(np.quantile(ratio, COVERED) / (1.0, 2.0)))) if len(ratio) else float("nan")
