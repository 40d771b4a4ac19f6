"""Near pairs that the balance demands: contacts that detection missed come back, whatever their measured gap.

One strong contact below the least probability bends all forces around it, without a sign in the balance itself. Its
price tells. A pair whose price stands out is offered to all members with a probability; it wins or loses by force.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.contacts.contacts import Contacts, detect_contacts
from solver.contacts.pairs import Keys, are_among, join_keys, recall
from solver.convex.prices import price_pairs
from solver.convex.program import Balance
from solver.sequence.frame_problem import FrameProblem

REACH = 0.012  # of the mean diameter: gaps beyond which no error of radii and centres explains a contact
DEMANDED = 1.5  # price of a pair that touches; it grows with the gap …
DEAREST = 0.3  # of the dearest pair's price: cheaper ones are asked again once that is there
GAP_SIGMAS = 2.0  # … by as much again for so many standard deviations of it
SURELY = 0.95  # P(touch) that a demanded pair is offered with at most
ROUNDS = 3  # of demanding: a second missed contact shows once the first is back
WINS = 0.05  # of the mean force: a demanded pair that bears less has lost


@dataclass(frozen=True, slots=True)
class Demand:
    """Pairs that are offered to a frame, and how likely they touch."""

    key: Keys  # (m,) ascending
    probability: Float[Array, " m"]

    @property
    def count(self) -> int:
        return len(self.key)

    def joined(self, other: Demand) -> Demand:
        key = join_keys(self.key, other.key)
        one, two = (recall(key, each.key, each.probability) for each in (self, other))
        return Demand(key, np.maximum(one, two))

    def only(self, keys: Keys) -> Demand:
        """Those of its pairs that are among others."""
        kept = are_among(self.key, keys)
        return Demand(self.key[kept], self.probability[kept])


NO_DEMAND = Demand(np.empty(0, np.int64), np.empty(0))


def find_demand(
    problem: FrameProblem, contacts: Contacts, balance: Balance, forces: list[Float[Array, "c 2"]]
) -> Demand:
    """The pairs that the convex members demand beside their contacts (c,); forces [N] of each of them."""
    if not forces:
        return NO_DEMAND
    grains, snapshot, walls = problem.packing.grains, problem.snapshot, problem.walls
    reach = REACH * 2.0 * float(grains.radius.mean())
    near = detect_contacts(grains, snapshot.position, snapshot.present, walls, reach)
    known = join_keys(contacts.key, problem.verdicts.forbidden)
    near = near.select(~are_among(near.key, known))
    if near.count == 0:
        return NO_DEMAND
    balanced = snapshot.present & grains.free
    price = price_pairs(near, balance, forces, walls, balanced, problem.settings.ensemble.convex)
    sigma = float(np.hypot(2.0**0.5 * snapshot.sigma, problem.settings.ensemble.probability.overlap))
    asked = price / (1.0 + (np.maximum(near.gap, 0.0) / (GAP_SIGMAS * sigma)) ** 2)
    wanted = _dearest(near, asked)
    return Demand(near.key[wanted], np.minimum(asked[wanted] / (1.0 + asked[wanted]), SURELY))


def _dearest(near: Contacts, asked: Array) -> NDArray[np.intp]:
    """Rows of the pairs whose price stands out, one for a grain: where one contact is missed, others close, too."""
    taken = np.zeros(near.body_count, bool)
    least = max(DEMANDED, DEAREST * float(asked.max()))
    rows = []
    for row in np.argsort(-asked, kind="stable"):
        if not asked[row] > least:
            break
        i, j = near.i[row], near.j[row]
        if taken[i] or taken[j]:
            continue
        taken[[i, j]] = True
        taken[near.grain_count :] = False  # a wall may miss any number
        rows.append(row)
    return np.sort(np.array(rows, np.intp))
