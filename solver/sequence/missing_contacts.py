"""Test for missing contacts: candidate pairs whose dual price in the balance shows that detection missed them.

One strong contact below the least probability distorts all forces around it, without an imbalance of its own; its dual
price shows it. A pair with an outstanding price is offered to all ensemble members with a probability, and is accepted
if it then carries force.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from ..bodies.grains import Array
from ..contacts.contacts import Contacts, detect_contacts
from ..contacts.pairs import Keys, are_among, join_keys, match_values
from ..convex.dual_prices import price_pairs
from ..convex.program import Balance
from .frame_problem import FrameProblem

REACH = 0.012  # of the mean diameter: gaps beyond which no error of radii and centres explains a contact
REQUIRED_PRICE = 1.5  # price of a touching pair above which it is offered; it grows with the gap …
GAP_SIGMAS = 2.0  # … the price counts half at a gap of so many standard deviations
RELATIVE_PRICE = 0.3  # of the highest price: cheaper pairs are tested again in the next round
MAX_PROBABILITY = 0.95  # P(touch) that a missing pair is offered with at most
ROUNDS = 3  # a second missing contact shows once the first is back
BEARING_FRACTION = 0.05  # of the mean force: a pair that carries less is not accepted


@dataclass(frozen=True, slots=True)
class MissingContacts:
    """Pairs that are offered to a frame, with their probability of touching."""

    key: Keys  # (m,) ascending
    probability: Float[Array, " m"]

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
    problem: FrameProblem, contacts: Contacts, balance: Balance, forces: list[Float[Array, "c 2"]]
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
    grains, snapshot, walls = problem.packing.grains, problem.snapshot, problem.walls
    reach = REACH * 2.0 * float(grains.radius.mean())
    near = detect_contacts(grains, snapshot.position, snapshot.present, walls, reach)
    known = join_keys(contacts.key, problem.verdicts.forbidden)
    near = near.select(~are_among(near.key, known))
    if near.count == 0:
        return NO_MISSING
    balanced = snapshot.present & grains.free
    price = price_pairs(near, balance, forces, walls, balanced, problem.settings.ensemble.convex)
    sigma = float(np.hypot(2.0**0.5 * snapshot.sigma, problem.settings.ensemble.probability.overlap))
    reduced = price / (1.0 + (np.maximum(near.gap, 0.0) / (GAP_SIGMAS * sigma)) ** 2)
    rows = _highest_prices(near, reduced)
    return MissingContacts(near.key[rows], np.minimum(reduced[rows] / (1.0 + reduced[rows]), MAX_PROBABILITY))


def _highest_prices(near: Contacts, price: Array) -> NDArray[np.intp]:
    """Rows of the pairs with outstanding prices, one of each grain: a missing contact raises all prices near it."""
    taken = np.zeros(near.body_count, bool)
    least = max(REQUIRED_PRICE, RELATIVE_PRICE * float(price.max()))
    rows = []
    for row in np.argsort(-price, kind="stable"):
        if not price[row] > least:
            break
        i, j = near.i[row], near.j[row]
        if taken[i] or taken[j]:
            continue
        taken[[i, j]] = True
        taken[near.grain_count :] = False  # a wall may lack any number of contacts
        rows.append(row)
    return np.sort(np.array(rows, np.intp))
