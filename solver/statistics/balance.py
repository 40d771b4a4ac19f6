"""How far any set of forces is from balance, judged apart from the method that found it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.bodies.packing import Packing
from solver.contacts.contacts import Contacts
from solver.statistics.stress import contact_force_vectors


def unbalanced_forces(packing: Packing, contacts: Contacts, fn: Array, ft: Array) -> Array:
    """ΣF on every grain (n, 2) [N], its weight included, of forces fn, ft (c,) [N]."""
    force = contact_force_vectors(contacts, fn, ft)
    total = packing.grains.mass[:, None] * np.asarray(packing.material.gravity)
    np.subtract.at(total, contacts.i, force)
    pair = ~contacts.with_wall
    np.add.at(total, contacts.j[pair], force[pair])
    return total


def worst_unbalance(packing: Packing, contacts: Contacts, fn: Array, ft: Array, present: NDArray[np.bool_]) -> float:
    """Worst |ΣF| on a present grain over the mean f_n of the contacts that bear force; 0 where none does."""
    bearing = fn > 0
    if not bearing.any():
        return 0.0
    total = unbalanced_forces(packing, contacts, fn, ft)[present]
    return float(np.linalg.norm(total, axis=1).max(initial=0.0) / fn[bearing].mean())
