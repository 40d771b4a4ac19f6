"""Who touches whom: coordination numbers and rattlers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.contacts.contacts import Contacts

LEVELS = 8  # of P(bears force), over which rattlers are counted


def contacts_per_grain(contacts: Contacts, bearing: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Number of bearing contacts of every grain (n,), those with walls included."""
    i, j = contacts.i[bearing], contacts.j[bearing]
    n = contacts.grain_count
    return np.bincount(i, minlength=n) + np.bincount(j[j < n], minlength=n)[:n]


def rattlers(contacts: Contacts, bearing: NDArray[np.bool_], present: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Grains that cannot be in balance: fewer than two bearing contacts, found by peeling (n,)."""
    bearing = bearing.copy()
    n = contacts.grain_count
    pair = contacts.j < n
    while True:
        loose = present & (contacts_per_grain(contacts, bearing) < 2)
        lost = bearing & loose[contacts.i]
        lost[pair] |= bearing[pair] & loose[contacts.j[pair]]
        if not lost.any():
            return loose
        bearing &= ~lost


def expected_rattlers(contacts: Contacts, bears: Array, present: NDArray[np.bool_]) -> float:
    """Expected number of rattlers, from P(bears force) of the contacts (c,).

    A mean over LEVELS of the probability from which on a contact counts: contacts of one grain are doubtful together,
    and the grains that one level alone finds are fewer than there are, for a doubt frees more grains than it holds.
    """
    levels = (np.arange(LEVELS) + 0.5) / LEVELS
    return float(np.mean([rattlers(contacts, bears > level, present).sum() for level in levels]))


def coordination_number(
    contacts: Contacts,
    bearing: NDArray[np.bool_],
    present: NDArray[np.bool_],
    *,
    without_rattlers: bool = False,
    weight: Array | None = None,
) -> float:
    """Mean number of contacts of a present grain; a contact with a wall counts once. 0 without grains.

    bearing (c,): which contacts count, and which hold a grain, so that it is no rattler; weight (c,): how likely each
    contact, bearing or not, bears force, where counts are to be what is expected; None: as bearing says.
    """
    loose = rattlers(contacts, bearing, present) if without_rattlers else np.zeros(contacts.grain_count, np.bool_)
    pair, weight = ~contacts.with_wall, bearing.astype(np.float64) if weight is None else weight
    i, j = contacts.i, contacts.j[pair]
    held = ~loose[i]
    held[pair] &= ~loose[j]
    counted = present & ~loose
    total = float(weight @ (held & counted[i]) + weight[pair] @ (held[pair] & counted[j]))
    return total / int(counted.sum()) if counted.any() else 0.0
