"""Resultant forces on the grains, ΣF, of any set of contact forces: the residual of force equilibrium."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..bodies.grains import Array
from ..contacts.contacts import Contacts
from .force_statistics import mean_normal_force


def resultant_forces(contacts: Contacts, fn: NDArray[np.floating], ft: NDArray[np.floating], weight: Array) -> Array:
    """Return ΣF on every grain (…, n, 2) [N] of one or many sets of forces fn, ft (…, c) [N].

    weight (n, 2) [N]: weights of the grains.
    """
    normal, tangent, pair = contacts.normal, contacts.tangent, ~contacts.with_wall
    sets, n = fn.shape[:-1], len(weight)
    # The rows of all sets are concatenated, so that each sum is one pass in the order of the contacts.
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


def sum_on_grains(contacts: Contacts, value: Array) -> Array:
    """Return the sum of a value (c,) of the contacts over those of every grain (n,), wall contacts included."""
    total, pair = np.zeros(contacts.grain_count), ~contacts.with_wall
    np.add.at(total, contacts.i, value)
    np.add.at(total, contacts.j[pair], value[pair])
    return total


def resultant_norms(contacts: Contacts, fn: NDArray[np.floating], ft: NDArray[np.floating], weight: Array) -> Array:
    """Return |ΣF| on every grain (…, n) [N]; arguments as of `resultant_forces`."""
    return np.linalg.norm(resultant_forces(contacts, fn, ft, weight), axis=-1)


def grain_unbalance(contacts: Contacts, fn: Array, ft: Array, weight: Array, present: NDArray[np.bool_]) -> Array:
    """Return |ΣF| on every grain over the mean f_n (n,); NaN for an absent grain or without forces."""
    unbalance = resultant_norms(contacts, fn, ft, weight) / mean_normal_force(fn)
    unbalance[~present] = np.nan
    return unbalance


class ForceResidual(NamedTuple):
    """What is left of the equilibrium of all grains."""

    worst: float  # greatest |ΣF| of a grain over the mean f_n
    missing: float  # Σ |ΣF|² of the grains over 2 Σ f_n²: at least so much of the squared forces is missing


def measure_force_residual(
    contacts: Contacts, fn: Array, ft: Array, weight: Array, present: NDArray[np.bool_]
) -> ForceResidual:
    """Measure what is left of the equilibrium of the present grains (n,).

    Means are over contacts that bear force; both are 0 where none does, NaN for forces that are not finite.

    Notes
    -----
    A force f that is missing between two grains leaves ΣF = f on both.
    """
    if not (np.isfinite(fn).all() and np.isfinite(ft).all()):
        return ForceResidual(float("nan"), float("nan"))
    mean = mean_normal_force(fn)
    if not np.isfinite(mean):
        return ForceResidual(0.0, 0.0)
    residual = resultant_norms(contacts, fn, ft, weight)[present]
    return ForceResidual(float(residual.max(initial=0.0) / mean), float(residual @ residual / (2.0 * (fn @ fn))))
