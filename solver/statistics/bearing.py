"""Which of the listed contacts bear force, and which of those slide: probabilities, so that counts are not biased.

A reported field is a mean of several. It leaves a little force on contacts that bear none, and takes forces that
are on the Coulomb cone a little off it. Counting what is above zero, or on the cone, therefore counts too many
contacts and hardly any that slide. Both probabilities are logistic functions fitted on discrete-element truths
(`rodsight study numbers` prints how statistics weighted with them do on others).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array

# Log odds of bearing: constant, ln(f_n/⟨f_n⟩ + FAINT), ln P(touch); without P(touch): constant, ln(f_n/⟨f_n⟩ + FAINT).
BEARING = (4.65, 1.13, 3.05)
BEARING_WITHOUT_TOUCH = (4.48, 1.06)
FAINT = 1e-3  # of the mean force
LEAST_TOUCH = 1e-3  # P(touch) that a smaller one counts as
# Log odds of sliding: constant, (|f_t| / μ f_n)², share of the convex members on the cone, share of the chains on it.
SLIDING = (-4.09, 1.56, 2.26, 1.42)
SLIDING_WITHOUT_MEMBERS = (-3.84, 1.68, 2.34)  # constant, (|f_t| / μ f_n)², (|f_t| / μ f_n)⁸
ON_THE_CONE = 0.995  # of μ f_n: a member's force is there


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
    return np.where(bearing, _logistic(np.where(np.isnan(touch), alone, told)), 0.0)


def sliding_probability(mobilised: Array, cone_share: Array | None) -> Array:
    """P(slides) of contacts (c,) that bear force, from |f_t| / (μ f_n) of the reported field.

    cone_share (c, 2): shares of the convex members and of the chains whose force is on the Coulomb cone; None: there
    are no members.
    """
    used = np.minimum(mobilised, 1.0)
    if cone_share is None:
        constant, square, eighth = SLIDING_WITHOUT_MEMBERS
        return _logistic(constant + square * used**2 + eighth * used**8)
    constant, square, convex, chains = SLIDING
    return _logistic(constant + square * used**2 + convex * cone_share[:, 0] + chains * cone_share[:, 1])


def cone_share(fn: Array, ft: Array, friction: Array, convex: NDArray[np.bool_]) -> Array:
    """Shares of the convex members and of the others whose force is on the Coulomb cone (c, 2).

    fn, ft (m, c) [N] of the members; friction (c,); convex (m,). A kind without members has share 0.
    """
    bearing = fn > 0
    on = bearing & (np.abs(ft) >= ON_THE_CONE * friction * fn)
    kinds = [on[convex], on[~convex]]
    return np.column_stack([each.mean(axis=0) if len(each) else np.zeros(fn.shape[1]) for each in kinds])


def _logistic(odds: Array) -> Array:
    return 1.0 / (1.0 + np.exp(-odds))
