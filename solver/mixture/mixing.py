"""The mixture of both witnesses on the contacts of a frame, with its deviations.

What either counts is said by `solver.posterior.mixing`. Where grains are soft their overlaps tell the forces one by
one, and the motion, which takes them for hard, is not heard.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.bodies.grains import Array
from solver.contacts.contacts import Contacts
from solver.contacts.pairs import recall
from solver.posterior.frame_posterior import FramePosterior
from solver.posterior.mixing import ForceField, mix_fields

OFFERED = 0.3  # P(bears) from which on a pair that the motion's network lacks is offered to it


@dataclass(frozen=True, slots=True)
class Mixture:
    """A mixed field on the contacts of a frame."""

    fn: Array  # (c,) [N]
    ft: Array  # (c,) [N]
    spread_fn: Array  # (c,) [N] standard deviation of both witnesses and of their difference
    spread_ft: Array  # (c,) [N]
    bears: Array  # (c,) P(bears force)
    share: float  # of the positions in the mixture
    trust: float  # expected correlation with the truth


@dataclass(frozen=True, slots=True)
class Field:
    """Forces on contacts (c,) [N], with their standard deviations."""

    fn: Array
    ft: Array
    fn_sd: Array
    ft_sd: Array


def mix_on(
    contacts: Contacts,
    motion: Field,
    positions: FramePosterior,
    motion_trust: float,
    *,
    own_scale: bool,
    soft_trust: float | None,
) -> Mixture:
    """Mix the motion's field on `contacts` with what positions tell of them.

    motion_trust: NaN where no motion led to the frame; own_scale: loads or weight tell positions the scale of forces,
    which counts there, and of soft grains; soft_trust: the most that overlaps of soft grains are believed, None: grains
    are hard. Errors: ValueError where either is without force.
    """
    found = mix_fields(ForceField(contacts.key, np.column_stack([motion.fn, motion.ft]), motion_trust), positions)
    told = _on(contacts, positions)
    factor = float(motion.fn.sum() / positions.fn.sum())
    if soft_trust is not None:
        factor = 1.0 if own_scale else factor
        force = factor * np.column_stack([told.fn, told.ft])
        share, trust = 1.0, min(positions.trust, soft_trust)
    else:
        force = recall(contacts.key, found.key, found.force, fill=0.0)
        if own_scale and np.isnan(motion_trust):  # a guess knows no scale, and loads at another one are out of balance
            force, factor = force / factor, 1.0
        share, trust = found.share, found.trust
    return Mixture(
        force[:, 0],
        force[:, 1],
        _spread(share, motion.fn, factor * told.fn, motion.fn_sd, factor * told.fn_sd),
        _spread(share, motion.ft, factor * told.ft, motion.ft_sd, factor * told.ft_sd),
        recall(contacts.key, positions.contacts.key, positions.bears, fill=0.0),
        share,
        trust,
    )


def offered_pairs(positions: FramePosterior) -> Contacts:
    """Pairs that bear force by the balance, whatever the motion's network says of them."""
    return positions.contacts.select(positions.bears > OFFERED)


def _on(contacts: Contacts, positions: FramePosterior) -> Field:
    columns = positions.fn, positions.ft, positions.fn_deviation, positions.ft_deviation
    return Field(*(recall(contacts.key, positions.contacts.key, each, fill=0.0) for each in columns))


def _spread(share: float, one: Array, two: Array, one_sd: Array, two_sd: Array) -> Array:
    """Standard deviation of a force that is the one's with 1 − share and the other's with `share`."""
    own = (1.0 - share) * one_sd**2 + share * two_sd**2
    return np.sqrt(own + share * (1.0 - share) * (one - two) ** 2)
