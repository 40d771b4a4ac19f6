"""Former forces onto this frame's contacts: the memory that lets a sequence settle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.contacts.contacts import Contacts
from solver.contacts.pairs import Keys, are_there, recall


@dataclass(frozen=True, slots=True)
class ForceMemory:
    """The last known force of every contact, by its key. Keys ascend."""

    key: Keys  # (m,)
    force: Array  # (m, 2) [N]

    @classmethod
    def empty(cls) -> ForceMemory:
        return cls(np.empty(0, np.int64), np.empty((0, 2)))

    def recall(self, contacts: Contacts) -> Array:
        """The remembered forces on these contacts (c, 2) [N], zero for new ones."""
        return recall(contacts.key, self.key, self.force)

    def renew(self, contacts: Contacts, force: Array, present: NDArray[np.bool_]) -> ForceMemory:
        """Take over new forces; contacts of grains that are not present are remembered as they were.

        A lost grain thus comes back with the forces that it had, instead of as a stranger.
        """
        unseen = ~are_there(self.key, present, contacts.body_count)
        key = np.concatenate([self.key[unseen], contacts.key])
        order = np.argsort(key, kind="stable")
        return ForceMemory(key[order], np.concatenate([self.force[unseen], force])[order])
