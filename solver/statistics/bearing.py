"""Which of the listed contacts bear force: probabilities, so that counts are not biased.

A reported field is a mean of several. It leaves a little force on contacts that bear none, and counting what is above
zero counts too many. The probability is a logistic function fitted on discrete-element truths (`rodsight study
numbers` prints how statistics weighted with it do on others).
"""

from __future__ import annotations

import numpy as np

from solver.bodies.grains import Array

# Log odds of bearing: constant, ln(f_n/⟨f_n⟩ + FAINT), ln P(touch); without P(touch): constant, ln(f_n/⟨f_n⟩ + FAINT).
BEARING = (4.65, 1.13, 3.05)
BEARING_WITHOUT_TOUCH = (4.48, 1.06)
FAINT = 1e-3  # of the mean force
LEAST_TOUCH = 1e-3  # P(touch) that a smaller one counts as


def bearing_probability(fn: Array, touch: Array) -> Array:
    """P(bears force) of contacts (c,) with reported f_n [N] and P(touch), NaN where that is not known.

    0 where f_n is 0. A contact that only people saw has P(touch) 0 as detected: pass 1 for it.
    """
    bearing = fn > 0
    if not bearing.any():
        return np.zeros_like(fn)
    faint = np.log(np.maximum(fn, 0.0) / fn[bearing].mean() + FAINT)
    with np.errstate(invalid="ignore"):
        told = BEARING[0] + BEARING[1] * faint + BEARING[2] * np.log(np.clip(touch, LEAST_TOUCH, 1.0))
    alone = BEARING_WITHOUT_TOUCH[0] + BEARING_WITHOUT_TOUCH[1] * faint
    return np.where(bearing, logistic(np.where(np.isnan(touch), alone, told)), 0.0)


def logistic(odds: Array) -> Array:
    """Probabilities of log odds."""
    return 1.0 / (1.0 + np.exp(-odds))
