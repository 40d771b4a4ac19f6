"""Who touches whom: coordination numbers and rattlers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.contacts.contacts import Contacts


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


def coordination_number(
    contacts: Contacts, bearing: NDArray[np.bool_], present: NDArray[np.bool_], *, without_rattlers: bool = False
) -> float:
    """Mean number of bearing contacts of a present grain; a contact with a wall counts once. 0 without grains."""
    count = contacts_per_grain(contacts, bearing)
    counted = present.copy()
    if without_rattlers:
        loose = rattlers(contacts, bearing, present)
        counted &= ~loose
        pair = contacts.j < contacts.grain_count
        kept = bearing & ~loose[contacts.i]
        kept[pair] &= ~loose[contacts.j[pair]]
        count = contacts_per_grain(contacts, kept)
    return float(count[counted].mean()) if counted.any() else 0.0
