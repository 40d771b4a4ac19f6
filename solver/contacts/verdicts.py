"""Reviewers' verdicts on one frame, an input of contact detection: pairs that touch, pairs that do not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..bodies.grains import Array, Grains
from ..bodies.walls import Walls
from .contacts import Contacts, ContactSource, measure_pairs
from .pairs import Keys, are_among, are_present, find_rows, join_keys

DETECTED = 0.5  # P(touch) above which a pair counts as detected


def _no_keys() -> Keys:
    return np.empty(0, np.int64)


@dataclass(frozen=True, slots=True)
class Verdicts:
    """Verdicts on one frame, by the keys of Contacts.key."""

    forced: Keys = field(default_factory=_no_keys)  # (m,) ascending: these pairs touch
    forbidden: Keys = field(default_factory=_no_keys)  # (p,) ascending: these do not
    rearrangement: bool = False  # the packing rearranged in the interval before this frame
    reset: bool = False  # the previous forces are not carried over to this frame
    ignored: bool = False  # the photograph is invalid

    def __post_init__(self) -> None:
        both = are_among(self.forced, self.forbidden)
        if both.any():
            raise ValueError(f"pair {self.forced[both][0]} is both forced and forbidden")


NO_VERDICTS = Verdicts()


def apply_verdicts(
    contacts: Contacts,
    verdicts: Verdicts,
    grains: Grains,
    position: Array,
    present: NDArray[np.bool_],
    walls: Walls,
) -> tuple[Contacts, NDArray[np.int64]]:
    """Remove forbidden contacts and add forced ones.

    Parameters
    ----------
    contacts
        Detected contacts.
    verdicts
        Verdicts on the frame. A forced pair of an absent grain is ignored.
    grains, walls
        The bodies.
    position : (n, 2)
        Centres [m].
    present : (n,) bool
        Grains seen.

    Returns
    -------
    contacts
        The changed contacts.
    former_row : (c,) int
        Row of every contact in the detected ones, −1 for an added one.
    """
    if len(verdicts.forced) == 0 and len(verdicts.forbidden) == 0:
        return contacts, np.arange(contacts.count)
    forced = verdicts.forced[are_present(verdicts.forced, present, contacts.body_count)]
    key = join_keys(contacts.key[~are_among(contacts.key, verdicts.forbidden)], forced)
    row, known = find_rows(key, contacts.key)
    return measure_pairs(grains, position, walls, key), np.where(known, row, -1)


def contact_sources(contacts: Contacts, probability: Array, verdicts: Verdicts) -> NDArray[np.uint8]:
    """Return the ContactSource of every contact (c,).

    probability (c,): P(touch) as detected, NaN where it was not computed. A forced pair that was also detected counts
    as detected.
    """
    source = np.full(contacts.count, ContactSource.DETECTED, np.uint8)
    added = are_among(contacts.key, verdicts.forced) & (probability < DETECTED)
    source[added] = ContactSource.ADDED_BY_REVIEWER
    return source


def find_ignored(verdicts: Mapping[int, Verdicts]) -> set[int]:
    """Return the frames that reviewers marked as invalid."""
    return {k for k, each in verdicts.items() if each.ignored}
