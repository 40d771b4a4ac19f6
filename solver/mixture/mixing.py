"""The mixture of both witnesses on the contacts of a frame, with its deviations.

What either counts is said by `solver.posterior.mixing`. Where grains are soft their overlaps tell the forces one by
one, and the motion, which takes them for hard, is heard the less the more they are pressed beside how far they slide.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.bodies.grains import Array
from solver.contacts.contacts import Contacts
from solver.contacts.pairs import recall
from solver.posterior.frame_posterior import FramePosterior
from solver.posterior.mixing import ForceField, expected_correlation, mix_fields

PRESSED = 0.6  # overlap over what neighbours move by, at which motion is worth half of what it is for hard grains
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
    worth: float = 1.0,
) -> Mixture:
    """Mix the motion's field on `contacts` with what positions tell of them.

    motion_trust: NaN where no motion led to the frame; own_scale: loads or weight tell positions the scale of forces,
    which counts there, and of soft grains; soft_trust: the most that overlaps of soft grains are believed, None: grains
    are hard; worth: of the motion, as `worth_of_motion` says. Errors: ValueError where either is without force.
    """
    worth = 1.0 if soft_trust is None else 0.0 if np.isnan(motion_trust) else worth
    # Where no load tells the size of forces, elastic loading passes for sound motion: no more is expected of it.
    expected = expected_correlation(motion_trust) if own_scale else motion_trust
    field = ForceField(contacts.key, np.column_stack([motion.fn, motion.ft]), motion_trust, expected)
    found = mix_fields(field, positions, worth)
    told = _on(contacts, positions)
    factor = float(motion.fn.sum() / positions.fn.sum())
    force, share, trust = recall(contacts.key, found.key, found.force, fill=0.0), found.share, found.trust
    if soft_trust is not None:
        trust = worth * trust + (1.0 - worth) * min(positions.trust, soft_trust)
        if own_scale:  # the stress along free walls follows from sliding, which overlaps do not show
            force, factor = force * factor ** (worth - 1.0), factor**worth
    elif own_scale and np.isnan(motion_trust):  # a guess knows no scale, and loads at another one are out of balance
        force, factor = force / factor, 1.0
    return Mixture(
        force[:, 0],
        force[:, 1],
        _spread(share, motion.fn, factor * told.fn, motion.fn_sd, factor * told.fn_sd),
        _spread(share, motion.ft, factor * told.ft, motion.ft_sd, factor * told.ft_sd),
        recall(contacts.key, positions.contacts.key, positions.bears, fill=0.0),
        share,
        trust,
    )


def worth_of_motion(overlap: float, moved: float) -> float:
    """What motion is worth of soft grains, 1 of hard ones. overlap [m]: of a mean force; moved [m]: of neighbours."""
    return 1.0 / (1.0 + (overlap / (PRESSED * moved)) ** 2) if moved > 0.0 else 0.0


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
