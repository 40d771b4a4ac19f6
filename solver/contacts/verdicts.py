"""What people said of one frame, as an explicit input of contact detection: pairs that touch, pairs that do not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array, Grains
from solver.bodies.walls import Walls
from solver.contacts.contacts import Contacts, ContactSource, measure_pairs
from solver.contacts.pairs import Keys, are_among, are_there, find_rows, join_keys

DETECTED = 0.5  # P(touch) from which on a pair counts as detected


def _no_keys() -> Keys:
    return np.empty(0, np.int64)


@dataclass(frozen=True, slots=True)
class Verdicts:
    """Verdicts on one frame, by the keys of Contacts.key."""

    forced: Keys = field(default_factory=_no_keys)  # (m,) ascending: these pairs touch
    forbidden: Keys = field(default_factory=_no_keys)  # (p,) ascending: these do not
    rearrangement: bool = False  # the packing rearranged on the way to this frame
    reset: bool = False  # nothing of the former forces carries over to this frame
    ignored: bool = False  # the photograph is not to be believed

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
    """Drop forbidden contacts and add forced ones.

    position (n, 2) [m]; present (n,). Returns the contacts, and for each the row it had before (c,), −1 for one that
    was added. A forced pair of a grain that is not present is left out.
    """
    if len(verdicts.forced) == 0 and len(verdicts.forbidden) == 0:
        return contacts, np.arange(contacts.count)
    forced = verdicts.forced[are_there(verdicts.forced, present, contacts.body_count)]
    key = join_keys(contacts.key[~are_among(contacts.key, verdicts.forbidden)], forced)
    row, known = find_rows(key, contacts.key)
    return measure_pairs(grains, position, walls, key), np.where(known, row, -1)


def sources(contacts: Contacts, probability: Array, verdicts: Verdicts) -> NDArray[np.uint8]:
    """ContactSource of every contact (c,).

    probability (c,): P(touch) as detected, NaN where it was not computed. A forced pair that was detected anyway
    stays a detected one.
    """
    source = np.full(contacts.count, ContactSource.DETECTED, np.uint8)
    added = are_among(contacts.key, verdicts.forced) & (probability < DETECTED)
    source[added] = ContactSource.ADDED_BY_REVIEWER
    return source


def find_ignored(verdicts: Mapping[int, Verdicts]) -> set[int]:
    """The frames that are not to be believed."""
    return {k for k, each in verdicts.items() if each.ignored}
