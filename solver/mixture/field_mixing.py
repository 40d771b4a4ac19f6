"""Weighted mean of the motion estimate and the position-only estimate, with weights from their expected accuracy.

The errors of the two are independent as far as they have different causes. The correlation c of both fields is then
the product of their correlations with the truth: neither is below c, and where c is below the product of both trusts,
one of them is too high. That is the posterior's, which assumes exact radii, friction and elastic law; the motion's
trust was fitted on simulated truths. A motion estimate without a trust, as in the first frame, has no weight. An error
of both, as of a wall, is not detected.

Weights use the expected correlations, the mixture's trust uses lower bounds: the motion's trust is a bound that most
frames exceed, and weights by bounds would favour the worse field.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ..assessment.mixture_trust import compute_position_weight, confirmed_trust, mixture_trust, reconcile_trusts
from ..bodies.grains import Array
from ..contacts.pairs import Keys, align
from ..posterior.frame_posterior import FramePosterior
from ..statistics.agreement import pearson


@dataclass(frozen=True, slots=True)
class ForceField:
    """Forces of one frame, by either method."""

    key: Keys  # (c,) ascending
    force: Float[Array, "c 2"]  # [N] f_n, f_t
    trust: float  # lower bound of the correlation with the truth; NaN: unknown
    expected: float | None = None  # expected correlation with the truth; None: the bound


@dataclass(frozen=True, slots=True)
class MixedField:
    """Both fields on the pairs of either."""

    key: Keys  # (c,) ascending
    force: Float[Array, "c 2"]  # [N], inside the Coulomb cone if both fields are
    position_weight: float  # of the posterior in the mixture, 0 … 1
    trust: float  # expected correlation with the truth
    agreement: float  # correlation of both fields' f_n; NaN where either is constant


def mix_fields(
    motion: ForceField, posterior: FramePosterior, weight: float = 1.0, given: float | None = None
) -> MixedField:
    """Mix a motion estimate with a posterior of the same frame.

    Parameters
    ----------
    motion : ForceField
        Motion estimate.
    posterior : FramePosterior
        Position-only estimate. The agreement is that without its stress factors, because they follow from the motion.
    weight : float
        Weight of motion, 1 for hard grains, less for soft ones, whose overlap hides their sliding.
    given : float, optional
        Position weight u; None: from the trusts of both.

    Raises
    ------
    ValueError
        If either field is without force.

    Notes
    -----
    With m and p both fields over their sums of f_n, the positions' after the stress factors, S_m the sum of the
    motion's and u the position weight,

        f = S_m ((1 − u) m + u p),
        trust = ((1 − u) s_m T_m + u s_p T_c)/√((1 − u)² s_m² + u² s_p² + 2 u (1 − u) s_m s_p c),

    where s_m, s_p are the standard deviations of m and p over the pairs, c their correlation, T_m and T_p from
    `reconcile_trusts` with the motion's bound, T_c = c' + T_m (T_p − c') with c' = min(max(c, 0), T_p), and u from
    `compute_position_weight` with the motion's expected correlation. The sum is the motion's: the stress along walls
    without a load follows from sliding, which positions do not show.
    """
    factor = np.ones_like(posterior.fn) if posterior.stress_factor is None else posterior.stress_factor
    geometry = np.column_stack([posterior.fn, posterior.ft, factor * posterior.fn, factor * posterior.ft])
    totals = float(motion.force[:, 0].sum()), float(posterior.fn.sum())
    if not min(totals) > 0.0:
        raise ValueError("a field without forces cannot be mixed")
    geometry[:, :2] /= totals[1]
    geometry[:, 2:] /= geometry[:, 2].sum()
    key, moved, both = align(motion.key, motion.force / totals[0], posterior.contacts.key, geometry)
    agreement, placed = pearson(moved[:, 0], both[:, 0]), both[:, 2:]
    claimed = min(posterior.trust, posterior.agreement if np.isfinite(posterior.agreement) else 1.0)
    expected = motion.trust if motion.expected is None else motion.expected
    position_weight = given
    if position_weight is None:
        position_weight = compute_position_weight(*reconcile_trusts(weight * expected, claimed, agreement), weight)
    motion_trust, posterior_trust = reconcile_trusts(weight * motion.trust, claimed, agreement)
    mixed = position_weight * placed + (1.0 - position_weight) * moved
    sds = np.std(moved[:, 0]), np.std(placed[:, 0])
    confirmed = confirmed_trust(motion_trust, posterior_trust, agreement)
    trust = mixture_trust(motion_trust, confirmed, agreement, position_weight, sds)
    return MixedField(key, totals[0] * mixed, position_weight, trust, agreement)
