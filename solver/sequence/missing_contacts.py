"""Missing contacts of a frame: pairs that its balance shows are offered to all ensemble members with a probability.

A pair is accepted if it then carries force.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ..contacts.contacts import Contacts
from ..contacts.pairs import Keys, are_among, join_keys, match_values
from ..convex.dual_prices import find_missing_pairs
from ..convex.program import Balance
from .frame_problem import FrameProblem

BEARING_FRACTION = 0.05  # of the mean force: a pair that carries less is not accepted


@dataclass(frozen=True, slots=True)
class MissingContacts:
    """Pairs that are offered to a frame, with their probability of touching."""

    key: Keys  # (m,) ascending
    probability: Float[np.ndarray, " m"]

    @property
    def count(self) -> int:
        return len(self.key)

    def joined(self, other: MissingContacts) -> MissingContacts:
        """The pairs of both, with the greater probability."""
        key = join_keys(self.key, other.key)
        one, two = (match_values(key, each.key, each.probability) for each in (self, other))
        return MissingContacts(key, np.maximum(one, two))

    def only(self, keys: Keys) -> MissingContacts:
        """Those pairs that are among `keys`."""
        kept = are_among(self.key, keys)
        return MissingContacts(self.key[kept], self.probability[kept])


NO_MISSING = MissingContacts(np.empty(0, np.int64), np.empty(0))


def find_missing_contacts(
    problem: FrameProblem, contacts: Contacts, balance: Balance, forces: list[Float[np.ndarray, "c 2"]]
) -> MissingContacts:
    """Find candidate pairs whose dual price shows that a contact is missing.

    Parameters
    ----------
    problem : FrameProblem
    contacts : Contacts
        Of the convex members (c,).
    balance : Balance
        Equilibrium on those contacts.
    forces : list of ndarray, shape (c, 2)
        Forces of each convex member [N].
    """
    if not forces:
        return NO_MISSING
    known, ensemble = join_keys(contacts.key, problem.verdicts.forbidden), problem.settings.ensemble
    found = find_missing_pairs(
        problem.packing.grains, problem.snapshot, problem.walls, known, (balance, forces),
        ensemble.probability.overlap, ensemble.convex,
    )  # fmt: skip
    return MissingContacts(*found)
