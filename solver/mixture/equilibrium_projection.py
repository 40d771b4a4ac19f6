"""Projection of a mixed field onto equilibrium, relaxed where the list of contacts must lack pairs.

Grains whose contacts are missing from the list, for instance where fringes were too faint, are held by no force. Strict
equilibrium then removes all forces around them. The standard deviations of the field limit how much it may change.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..bodies.grains import Array
from ..convex.program import Balance, ConvexForces, ConvexSettings, project_onto_equilibrium

# Greatest rms change of f_n by strict equilibrium, over its rms standard deviation: up to .4 where the model holds, .7
# to 3 where pairs are missing from the list, or the balance lacks forces, as those of a base with friction. Strict
# equilibrium then spoils a good field; relaxed equilibrium may change it by less.
MAX_CHANGE, MAX_CHANGE_RELAXED = 0.45, 0.15
RELAXATION = (0.1, 0.03, 0.01, 0.003, 0.001)  # factors on the price of a force residual, tried in this order


def project_mixed_field(balance: Balance, fn: Array, ft: Array, fn_sd: Array, settings: ConvexSettings) -> ConvexForces:
    """Find the field in equilibrium that is nearest to a given one; relax equilibrium where it contradicts the field.

    Parameters
    ----------
    balance : Balance
        Force and torque balance of the frame.
    fn, ft : array (c,)
        Given field [N].
    fn_sd : array (c,)
        Standard deviations of f_n [N].
    settings : ConvexSettings
        Settings of the convex program; `balance` is the price of a force residual.

    Notes
    -----
    The strict projection is accepted if rms(Δf_n) ≤ 0.45 rms(fn_sd). Otherwise the price is multiplied by 0.1, 0.03,
    0.01, 0.003 or 0.001, the first for which rms(Δf_n) ≤ 0.15 rms(fn_sd), else the last.
    """
    sd = float(np.sqrt(np.mean(fn_sd**2))) if len(fn_sd) else 0.0
    found = project_onto_equilibrium(balance, fn, ft, settings)
    if found.converged and _rms_change(found.fn, fn) <= MAX_CHANGE * sd:
        return found
    for factor in RELAXATION:
        found = project_onto_equilibrium(balance, fn, ft, replace(settings, balance=factor * settings.balance))
        if found.converged and _rms_change(found.fn, fn) <= MAX_CHANGE_RELAXED * sd:
            break
    return found


def _rms_change(found: Array, given: Array) -> float:
    return float(np.sqrt(np.mean((found - given) ** 2))) if len(given) else 0.0
