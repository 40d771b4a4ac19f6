"""A mixed field brought into balance, as strictly as its own deviations bear.

Pairs that are missing from the list, be it that fringes were too faint to show them, leave grains that no forces hold.
A strict balance then empties everything around them; what the field says of itself tells how much it may be changed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from solver.bodies.grains import Array
from solver.convex.program import Balance, ConvexForces, ConvexSettings, polish

# rms change of f_n by a strict balance, over its rms deviation, beyond which the list must lack pairs: overlaps of soft
# grains tell forces one by one, and the balance is to leave them; hard ones are told by the balance.
BROKEN_HARD, BROKEN_SOFT = 3.0, 0.6
LARGEST_CHANGE = 0.6  # the same by the looser balance that then stands
LOOSER = (0.3, 0.1, 0.03, 0.01, 0.003)  # of the price of an unbalance, tried one after the other


def bring_into_balance(
    balance: Balance, fn: Array, ft: Array, fn_sd: Array, settings: ConvexSettings, *, hardness: float = 1.0
) -> ConvexForces:
    """The field nearest to the given one (c,) [N] in balance; where pairs are missing, under a lower price.

    fn_sd (c,) [N]: deviations of f_n. The price of an unbalance is then the highest that leaves the field its own, or
    the lowest where none does. hardness: 1 of hard grains, 0 of soft ones, which overlaps alone tell of.
    """
    broken = hardness * BROKEN_HARD + (1.0 - hardness) * BROKEN_SOFT
    doubt = float(np.sqrt(np.mean(fn_sd**2))) if len(fn_sd) else 0.0
    found = polish(balance, fn, ft, settings)
    if found.converged and _change(found.fn, fn) <= broken * doubt:
        return found
    for share in LOOSER:
        found = polish(balance, fn, ft, replace(settings, balance=share * settings.balance))
        if found.converged and _change(found.fn, fn) <= LARGEST_CHANGE * doubt:
            break
    return found


def _change(found: Array, given: Array) -> float:
    return float(np.sqrt(np.mean((found - given) ** 2))) if len(given) else 0.0
