"""How far any set of forces is from balance, judged apart from the method that found it: the only ΣF on grains."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.contacts.contacts import Contacts
from solver.statistics.force_statistics import mean_normal_force


def unbalanced_forces(contacts: Contacts, fn: NDArray[np.floating], ft: NDArray[np.floating], weight: Array) -> Array:
    """ΣF on every grain (…, n, 2) [N] of forces fn, ft (…, c) [N], one set of them or many.

    weight (n, 2) [N] of the grains.
    """
    normal, tangent, pair = contacts.normal, contacts.tangent, ~contacts.with_wall
    sets, n = fn.shape[:-1], len(weight)
    # Rows of all sets laid end to end, so that each sum is made in one pass and in the order of the contacts.
    start = n * np.arange(int(np.prod(sets)))[:, None]
    i, j = (start + contacts.i).ravel(), (start + contacts.j[pair]).ravel()
    total = np.empty((*sets, n, 2))
    for axis in range(2):
        force = fn * normal[:, axis] + ft * tangent[:, axis]
        sums = np.tile(weight[:, axis], len(start))
        np.subtract.at(sums, i, force.ravel())
        np.add.at(sums, j, force[..., pair].ravel())
        total[..., axis] = sums.reshape(*sets, n)
    return total


def unbalances(contacts: Contacts, fn: NDArray[np.floating], ft: NDArray[np.floating], weight: Array) -> Array:
    """|ΣF| on every grain (…, n) [N], as for `unbalanced_forces`."""
    return np.linalg.norm(unbalanced_forces(contacts, fn, ft, weight), axis=-1)


def grain_unbalance(contacts: Contacts, fn: Array, ft: Array, weight: Array, present: NDArray[np.bool_]) -> Array:
    """|ΣF| on every grain over the mean f_n (n,); NaN for a grain that is not present, or without forces."""
    unbalance = unbalances(contacts, fn, ft, weight) / mean_normal_force(fn)
    unbalance[~present] = np.nan
    return unbalance


def worst_unbalance(contacts: Contacts, fn: Array, ft: Array, weight: Array, present: NDArray[np.bool_]) -> float:
    """Worst |ΣF| on a present grain over the mean f_n of the contacts that bear force; 0 where none does, NaN of
    forces that are not finite.
    """
    if not (np.isfinite(fn).all() and np.isfinite(ft).all()):
        return float("nan")
    mean = mean_normal_force(fn)
    return float(unbalances(contacts, fn, ft, weight)[present].max(initial=0.0) / mean) if np.isfinite(mean) else 0.0
