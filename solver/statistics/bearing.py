"""Probability that a contact bears force, for unbiased counts.

The reported forces are a mean over several ensemble members, with small forces on contacts that bear none; the number
of positive forces is therefore too large. The probability is a logistic function fitted on discrete-element
simulations (`rodsight study numbers` compares statistics weighted with it on other simulations).
"""

from __future__ import annotations

import numpy as np

from ..bodies.grains import Array

# Coefficients of the log odds: constant, ln(f_n/⟨f_n⟩ + FAINT), ln P(touch); without P(touch) the first two.
BEARING = (4.65, 1.13, 3.05)
BEARING_WITHOUT_TOUCH = (4.48, 1.06)
FAINT = 1e-3  # of the mean force
LEAST_TOUCH = 1e-3  # lower bound of P(touch)


def bearing_probability(fn: Array, touch: Array) -> Array:
    """Return P(bears force) of contacts.

    Parameters
    ----------
    fn : (c,)
        Reported normal forces [N].
    touch : (c,)
        P(touch), NaN where unknown; 1 for a contact that a reviewer added.

    Returns
    -------
    (c,)
        Probability; 0 where f_n is 0.

    Notes
    -----
    ln(p / (1 − p)) = 4.65 + 1.13 ln(f_n/⟨f_n⟩ + 10⁻³) + 3.05 ln P(touch), or 4.48 + 1.06 ln(f_n/⟨f_n⟩ + 10⁻³) without
    P(touch).
    """
    bearing = fn > 0
    if not bearing.any():
        return np.zeros_like(fn)
    faint = np.log(np.maximum(fn, 0.0) / fn[bearing].mean() + FAINT)
    with np.errstate(invalid="ignore"):
        with_touch = BEARING[0] + BEARING[1] * faint + BEARING[2] * np.log(np.clip(touch, LEAST_TOUCH, 1.0))
    without_touch = BEARING_WITHOUT_TOUCH[0] + BEARING_WITHOUT_TOUCH[1] * faint
    return np.where(bearing, logistic(np.where(np.isnan(touch), without_touch, with_touch)), 0.0)


def logistic(odds: Array) -> Array:
    """Return the probabilities of log odds."""
    return 1.0 / (1.0 + np.exp(-odds))
