"""Former forces onto this frame's contacts: the memory that lets a sequence settle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.contacts.contacts import Contacts


@dataclass(frozen=True, slots=True)
class ForceMemory:
    """The last known force of every contact, by its key. Keys ascend."""

    key: NDArray[np.int64]  # (m,)
    force: Array  # (m, 2) [N]

    @classmethod
    def empty(cls) -> ForceMemory:
        return cls(np.empty(0, np.int64), np.empty((0, 2)))

    def recall(self, contacts: Contacts) -> Array:
        """The remembered forces on these contacts (c, 2) [N], zero for new ones."""
        force = np.zeros((contacts.count, 2))
        if len(self.key):
            place = np.minimum(np.searchsorted(self.key, contacts.key), len(self.key) - 1)
            known = self.key[place] == contacts.key
            force[known] = self.force[place[known]]
        return force

    def renew(self, contacts: Contacts, force: Array, present: NDArray[np.bool_]) -> ForceMemory:
        """Take over new forces; contacts of grains that are not present are remembered as they were.

        A lost grain thus comes back with the forces that it had, instead of as a stranger.
        """
        bodies = contacts.grain_count + contacts.wall_count
        i, j = self.key // bodies, self.key % bodies
        seen = np.concatenate([present, np.ones(contacts.wall_count, np.bool_)])
        unseen = ~(seen[i] & seen[j])
        key = np.concatenate([self.key[unseen], contacts.key])
        order = np.argsort(key, kind="stable")
        return ForceMemory(key[order], np.concatenate([self.force[unseen], force])[order])
