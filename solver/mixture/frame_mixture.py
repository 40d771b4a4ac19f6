"""The mixture of the motion estimate and the position-only estimate on the contacts of a frame.

Weights follow from `solver.mixture.field_mixing`. Soft grains show their forces one by one in their overlaps; the
motion estimate, which assumes hard grains, then gets less weight, the larger the overlap over the sliding distance.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..assessment.mixture_trust import expected_of_motion, soft_mixture_trust
from ..bodies.grains import Array
from ..contacts.contacts import Contacts
from ..contacts.pairs import match_values
from ..posterior.frame_posterior import FramePosterior
from ..statistics.agreement import pearson
from ..statistics.balance import sum_on_grains
from .field_mixing import ForceField, mix_fields

HALF_WEIGHT_OVERLAP = 0.6  # overlap over the neighbours' displacement at which motion has half the weight
FEWEST_DISCS, LEAST_CORRELATION = 20, 0.3  # discs whose pressures are compared; of fringes and true pressures
MIN_OFFERED_PROBABILITY = 0.3  # P(bears) above which a pair is added to the network of the motion estimate


@dataclass(frozen=True, slots=True)
class Mixture:
    """A mixed field on the contacts of a frame."""

    fn: Array  # (c,) [N]
    ft: Array  # (c,) [N]
    fn_sd: Array  # (c,) [N] standard deviation of both estimates, their difference included
    ft_sd: Array  # (c,) [N]
    bearing_probability: Array  # (c,) P(bears force)
    position_weight: float  # of the position-only estimate, 0 … 1
    trust: float  # expected correlation with the truth


@dataclass(frozen=True, slots=True)
class ForceEstimate:
    """Forces on contacts (c,) [N], with their standard deviations."""

    fn: Array
    ft: Array
    fn_sd: Array
    ft_sd: Array


class Softness(NamedTuple):
    """How far overlaps of soft grains and their motion count."""

    trust: float  # greatest trust in the overlaps
    motion_weight: float = 1.0  # see `motion_weight`


def mix_on_contacts(
    contacts: Contacts,
    motion: ForceEstimate,
    positions: FramePosterior,
    motion_trust: float,
    *,
    scale_known: bool,
    softness: Softness | None = None,
    position_weight: float | None = None,
) -> Mixture:
    """Mix the motion estimate with the position-only estimate on the contacts of the motion estimate.

    Parameters
    ----------
    contacts : Contacts
        Contacts (c) of the motion estimate.
    motion : ForceEstimate
        Motion estimate on these contacts.
    positions : FramePosterior
        Position-only estimate.
    motion_trust : float
        Lower bound of the motion estimate's correlation with the truth; NaN where no motion leads to the frame.
    scale_known : bool
        Whether loads or weight determine the scale of the position-only estimate.
    softness : Softness, optional
        None: grains are hard.
    position_weight : float, optional
        Weight of the position-only estimate; None: from the trusts of both.

    Raises
    ------
    ValueError
        If either estimate is without force.

    Notes
    -----
    With u the position weight of `mix_fields` and q the ratio of both sums of f_n (motion over positions, those after
    the stress factors), the variance of a force is that of a mixture of two distributions:

        sd² = (1 − u) sd_m² + u (q sd_p)² + u (1 − u) (f_m − q f_p)².

    The sum of f_n is the motion's. For soft grains with a known scale it is multiplied by q^(weight − 1); without
    motion and with a known scale it is that of the positions.
    """
    weight = 1.0 if softness is None else 0.0 if np.isnan(motion_trust) else softness.motion_weight
    expected = expected_of_motion(motion_trust, scale_known=scale_known)
    field = ForceField(contacts.key, np.column_stack([motion.fn, motion.ft]), motion_trust, expected)
    found = mix_fields(field, positions, weight, position_weight)
    placed = _after_stress_factors(positions)
    other = ForceEstimate(*(match_values(contacts.key, positions.contacts.key, each, fill=0.0) for each in placed))
    factor = float(motion.fn.sum() / placed[0].sum())
    force, trust = match_values(contacts.key, found.key, found.force, fill=0.0), found.trust
    if softness is not None:
        trust = soft_mixture_trust(trust, positions.trust, softness.trust, weight)
        if scale_known:  # the stress along free walls follows from sliding, which overlaps do not show
            force, factor = force * factor ** (weight - 1.0), factor**weight
    elif scale_known and np.isnan(motion_trust):  # an initial guess has no scale, and any other violates the loads
        force, factor = force / factor, 1.0
    u = found.position_weight
    return Mixture(
        force[:, 0],
        force[:, 1],
        _mixture_sd(u, motion.fn, factor * other.fn, motion.fn_sd, factor * other.fn_sd),
        _mixture_sd(u, motion.ft, factor * other.ft, motion.ft_sd, factor * other.ft_sd),
        match_values(contacts.key, positions.contacts.key, positions.bearing_probability, fill=0.0),
        u,
        trust,
    )


def motion_weight(overlap: float, moved: float) -> float:
    """Compute the weight of motion of soft grains, 1 of hard ones.

    Parameters
    ----------
    overlap : float
        Overlap [m] of a contact with the mean force.
    moved : float
        Displacement [m] of neighbours against each other; 0 or NaN: the weight is 0.

    Notes
    -----
    weight = 1/(1 + (overlap/(0.6 moved))²).
    """
    return 1.0 / (1.0 + (overlap / (HALF_WEIGHT_OVERLAP * moved)) ** 2) if moved > 0.0 else 0.0


def limit_by_fringes(reliability: float, contacts: Contacts, fn: Array, positions: FramePosterior) -> float:
    """Limit the reliability of the motion estimate to the agreement of its pressures with the fringes.

    Parameters
    ----------
    reliability : float
        Correlation with the truth that the motion estimate claims; NaN stays.
    contacts : Contacts
        Contacts (c) of the motion estimate.
    fn : (c,)
        Its normal forces [N].
    positions : FramePosterior
        With the fringes that it has used.

    Notes
    -----
    Errors of both are independent: the correlation of pressures is the product of those with the truth.
    """
    if positions.fringes is None or np.isnan(reliability):
        return reliability
    measured = positions.fringes.pressure
    pressure = sum_on_grains(contacts, fn)
    known = np.isfinite(measured)
    if known.sum() < FEWEST_DISCS:
        return reliability
    agreement = pearson(pressure[known], measured[known]) / max(positions.fringes.correlation, LEAST_CORRELATION)
    return min(reliability, float(np.clip(agreement, 0.0, 1.0)))


def overlap_scale(positions: FramePosterior, total: float, unit: float) -> float:
    """Compute the factor of forces of soft grains whose scale no load determines, so that it follows their overlaps.

    Parameters
    ----------
    positions : FramePosterior
        Position-only estimate, whose mean force is one unit in every frame.
    total : float
        Sum of f_n of the field to be multiplied [N].
    unit : float
        Overlap [m] of a contact with the unit of force, the same in all frames; NaN: that of this frame.

    Returns
    -------
    float
        (S_p/total) (overlap/unit), S_p the sum of f_n of the positions: stiffness is constant, so that the force of a
        contact is proportional to its overlap. 1 where there is no overlap or no force.
    """
    unit = positions.overlap if np.isnan(unit) else unit
    if not (positions.overlap > 0.0 and unit > 0.0 and total > 0.0):
        return 1.0
    return float(positions.fn.sum()) / total * positions.overlap / unit


def offered_pairs(positions: FramePosterior) -> Contacts:
    """Select the pairs that bear force by positions and balance, to be added to the network of the motion estimate."""
    return positions.contacts.select(positions.bearing_probability > MIN_OFFERED_PROBABILITY)


def _after_stress_factors(positions: FramePosterior) -> tuple[Array, ...]:
    """Forces (p,) of the position-only estimate and their standard deviations, times the stress factors."""
    columns = positions.fn, positions.ft, positions.fn_sd, positions.ft_sd
    factor = positions.stress_factor
    return columns if factor is None else tuple(factor * each for each in columns)


def _mixture_sd(weight: float, one: Array, two: Array, one_sd: Array, two_sd: Array) -> Array:
    """Compute the standard deviation of a mixture of two distributions, `weight` that of the second."""
    own = (1.0 - weight) * one_sd**2 + weight * two_sd**2
    return np.sqrt(own + weight * (1.0 - weight) * (one - two) ** 2)
