"""Coordination numbers and rattlers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..bodies.grains import Array
from .contacts import Contacts

LEVELS = 8  # thresholds of P(bears force) over which the number of rattlers is averaged


def contacts_per_grain(contacts: Contacts, bearing: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the number of bearing contacts of every grain (n,), those with walls included."""
    i, j = contacts.i[bearing], contacts.j[bearing]
    n = contacts.grain_count
    return np.bincount(i, minlength=n) + np.bincount(j[j < n], minlength=n)[:n]


def rattlers(contacts: Contacts, bearing: NDArray[np.bool_], present: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the rattlers (n,): grains with fewer than two bearing contacts, removed until none is left."""
    bearing = bearing.copy()
    n = contacts.grain_count
    pair = contacts.j < n
    while True:
        loose = present & (contacts_per_grain(contacts, bearing) < 2)
        removed = bearing & loose[contacts.i]
        removed[pair] |= bearing[pair] & loose[contacts.j[pair]]
        if not removed.any():
            return loose
        bearing &= ~removed


def expected_rattlers(contacts: Contacts, bears: Array, present: NDArray[np.bool_]) -> float:
    """Return the expected number of rattlers, from P(bears force) of the contacts (c,).

    Notes
    -----
    The mean number of rattlers over LEVELS thresholds of the probability. The probabilities of the contacts of a grain
    are correlated, and a single threshold gives too few rattlers: an uncertain contact releases more grains than it
    holds.
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
    """Return the mean number of contacts of the present grains; a contact with a wall counts once.

    Parameters
    ----------
    contacts
        Contacts of the frame.
    bearing : (c,) bool
        Contacts that bear force; they decide which grains are rattlers.
    present : (n,) bool
        Grains that are counted.
    without_rattlers
        Exclude rattlers and their contacts.
    weight : (c,), optional
        P(bears force) of every contact, for the expected number; 1 for bearing contacts and 0 for others by default.

    Returns
    -------
    float
        The coordination number; 0 without grains.
    """
    loose = rattlers(contacts, bearing, present) if without_rattlers else np.zeros(contacts.grain_count, np.bool_)
    pair, weight = ~contacts.with_wall, bearing.astype(np.float64) if weight is None else weight
    i, j = contacts.i, contacts.j[pair]
    held = ~loose[i]
    held[pair] &= ~loose[j]
    counted = present & ~loose
    total = float(weight @ (held & counted[i]) + weight[pair] @ (held[pair] & counted[j]))
    return total / int(counted.sum()) if counted.any() else 0.0
