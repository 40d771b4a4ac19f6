"""Memory of the last known force of every contact, for the warm start of the next frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..bodies.grains import Array
from ..contacts.contacts import Contacts
from ..contacts.pairs import Keys, are_present, match_values


@dataclass(frozen=True, slots=True)
class ForceMemory:
    """Last known force of every contact by its key; keys ascend."""

    key: Keys  # (m,)
    force: Array  # (m, 2) [N]

    @classmethod
    def empty(cls) -> ForceMemory:
        return cls(np.empty(0, np.int64), np.empty((0, 2)))

    def recall(self, contacts: Contacts) -> Array:
        """Look up the stored forces (c, 2) [N] of these contacts; zero for new contacts."""
        return match_values(contacts.key, self.key, self.force)

    def renew(self, contacts: Contacts, force: Array, present: NDArray[np.bool_]) -> ForceMemory:
        """Store new forces (c, 2) [N]; contacts of grains that are not present keep their stored forces.

        A lost grain thus has its last forces when it is found again.
        """
        if present.all():
            return ForceMemory(contacts.key, np.array(force, order="C"))
        absent = ~are_present(self.key, present, contacts.body_count)
        key = np.concatenate([self.key[absent], contacts.key])
        order = np.argsort(key, kind="stable")
        return ForceMemory(key[order], np.concatenate([self.force[absent], force])[order])
