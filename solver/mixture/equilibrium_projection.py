"""Projection of a mixed field onto equilibrium, relaxed where the list of contacts must lack pairs.

Grains whose contacts are missing from the list, for instance where fringes were too faint, are held by no force. Strict
equilibrium then removes all forces around them. The standard deviations of the field limit how much it may change.

The mean of several fields is out of equilibrium by their errors, and the nearest field in equilibrium is smaller: on
six packings in the apparatus of corner discs by 2 % on average, all of it along walls without a load.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..bodies.grains import Array
from ..convex.program import Balance, ConvexForces, ConvexSettings, project_onto_equilibrium
from ..statistics.balance import mean_normal_force

# Greatest rms change of f_n by strict equilibrium, over its rms standard deviation: up to .4 where the model holds, .7
# to 3 where pairs are missing from the list, or the balance lacks forces, as those of a base with friction. Strict
# equilibrium then spoils a good field; relaxed equilibrium may change it by less.
MAX_CHANGE, MAX_CHANGE_RELAXED = 0.45, 0.15
# Hard grains: the same where exact equilibrium is possible, and leaves no residual above this, over the mean f_n. On 20
# packings of another program such changes are .5 to 1, and the residual is below .001. With wrong friction, a wall that
# is missing, inertia or a base with friction it is .02 to .15, with cohesion or rolling resistance .001 to .025.
MAX_CHANGE_EXACT, MAX_RESIDUAL = 1.0, 0.005
# The same for soft grains, whose position-only estimate is in balance on average only: .15, .35 and .45 give a mean r
# of .597, .608 and .611 on three sets of photoelastic discs, .929, .927 and .925 on simulated loose soft discs.
MAX_CHANGE_SOFT = 0.35
EXACT = 100.0  # factor on the price of a force residual in exact equilibrium, which leaves a hundredth of them
RELAXATION = (0.1, 0.03, 0.01, 0.003, 0.001)  # factors on the price of a force residual, tried in this order
KEPT_TOTAL = 1e-3  # relative change of a sum of forces that is tolerated
RAISED = 3.0  # the second field that is projected is this often as much larger as the sum of the first is too small
MAX_RAISED = 0.3  # … but by no more than this fraction


class WeightedSum(NamedTuple):
    """A sum of f_n that the field in equilibrium is to have, as far as it counts."""

    total: float  # [N]
    weight: float  # 0 … 1 beside the sum that the projection gives


def project_mixed_field(
    balance: Balance,
    fn: Array,
    ft: Array,
    fn_sd: Array,
    settings: ConvexSettings,
    wanted: WeightedSum | None = None,
    *,
    soft: bool = False,
) -> ConvexForces:
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
    wanted : WeightedSum, optional
        Sum of f_n that the field in equilibrium is to have; None: any.
    soft : bool
        Whether forces follow from the overlaps of soft grains.

    Notes
    -----
    The exact projection of hard grains, at a hundred times the price, is accepted if it leaves no residual over .005 of
    the mean f_n and rms(Δf_n) ≤ rms(fn_sd); else the strict one if rms(Δf_n) ≤ 0.45 rms(fn_sd). Otherwise the price is
    multiplied by 0.1, 0.03, 0.01, 0.003 or 0.001, the first for which rms(Δf_n) ≤ 0.15 rms(fn_sd), 0.35 of it for soft
    grains, else the last.

    Where the sum S_1 of the accepted f_n differs from S = (1 − w) S_1 + w S_0 with the wanted sum S_0 and its weight w,
    a multiple of the given field is projected, too, and

        f = f_1 + θ (f_2 − f_1),  θ = (S − S_1)/(S_2 − S_1),  0 ≤ θ ≤ 1,

    is in equilibrium and inside the Coulomb cones as both are. θ = 1 at most: loads may leave no other sum.
    """
    found, price = _project_within(balance, (fn, ft, fn_sd), settings, soft=soft)
    if wanted is None or not found.converged:
        return found
    reached = float(found.fn.sum())
    total = reached + wanted.weight * (wanted.total - reached)
    if not reached > 0.0 or abs(total - reached) <= KEPT_TOTAL * reached:
        return found
    raised = 1.0 + float(np.clip(RAISED * (total / reached - 1.0), -MAX_RAISED, MAX_RAISED))
    other = project_onto_equilibrium(balance, raised * fn, raised * ft, replace(settings, balance=price))
    change = float(other.fn.sum()) - reached
    if not (other.converged and change * (total - reached) > 0.0):
        return found
    step = min((total - reached) / change, 1.0)
    return replace(
        found, fn=found.fn + step * (other.fn - found.fn), ft=found.ft + step * (other.ft - found.ft),
        iterations=found.iterations + other.iterations,
    )  # fmt: skip


def _project_within(
    balance: Balance, field: tuple[Array, Array, Array], settings: ConvexSettings, *, soft: bool
) -> tuple[ConvexForces, float]:
    """Project with the least relaxation that keeps the change within the standard deviations; return the price, too."""
    fn, ft, fn_sd = field
    sd = float(np.sqrt(np.mean(fn_sd**2))) if len(fn_sd) else 0.0
    if not soft:
        price = EXACT * settings.balance
        found = project_onto_equilibrium(balance, fn, ft, replace(settings, balance=price))
        near = _rms_change(found.fn, fn) <= MAX_CHANGE_EXACT * sd
        if found.converged and near and _residual(balance, found) <= MAX_RESIDUAL:
            return found, price
    found = project_onto_equilibrium(balance, fn, ft, settings)
    if found.converged and _rms_change(found.fn, fn) <= MAX_CHANGE * sd:
        return found, settings.balance
    price, limit = settings.balance, MAX_CHANGE_SOFT if soft else MAX_CHANGE_RELAXED
    for factor in RELAXATION:
        price = factor * settings.balance
        found = project_onto_equilibrium(balance, fn, ft, replace(settings, balance=price))
        if found.converged and _rms_change(found.fn, fn) <= limit * sd:
            break
    return found, price


def _residual(balance: Balance, found: ConvexForces) -> float:
    """Greatest residual of a force, a torque over the mean radius, or a load, over the mean f_n; infinite without."""
    mean = mean_normal_force(found.fn) / balance.force_unit
    left = balance.matrix @ np.concatenate([found.fn, found.ft]) / balance.force_unit - balance.load
    return float(np.abs(left).max(initial=0.0) / mean) if mean > 0.0 else np.inf


def _rms_change(found: Array, given: Array) -> float:
    return float(np.sqrt(np.mean((found - given) ** 2))) if len(given) else 0.0
