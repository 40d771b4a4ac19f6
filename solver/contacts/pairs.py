"""Keys of pairs of bodies, the same in every frame, and operations on sets of keys.

Bodies are the grains followed by the walls. The key of (i, j) is i · bodies + j with i < j, so that keys ascend in the
order of the pairs. A set of keys contains every pair once, in any order unless stated. All other modules use keys
through these functions.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Keys = NDArray[np.int64]


def make_keys(i: NDArray[np.integer], j: NDArray[np.integer], bodies: int) -> Keys:
    """Return the keys of pairs i < j (c,); bodies: number of grains and walls together."""
    return np.asarray(i).astype(np.int64) * bodies + j


def make_key(a: int, b: int, bodies: int) -> int:
    """Return the key of one pair, given in either order."""
    return min(a, b) * bodies + max(a, b)


def split_keys(key: Keys, bodies: int) -> tuple[Keys, Keys]:
    """Return the bodies i and j of every pair (c,)."""
    return key // bodies, key % bodies


def split_key(key: int, bodies: int) -> tuple[int, int]:
    """Return the bodies i and j of one pair."""
    return divmod(key, bodies)


def are_present(key: Keys, present: NDArray[np.bool_], bodies: int) -> NDArray[np.bool_]:
    """Return which pairs (c,) have both bodies present; present (n,) of the grains, walls are always present."""
    i, j = split_keys(key, bodies)
    here = np.concatenate([present, np.ones(bodies - len(present), np.bool_)])
    return here[i] & here[j]


def are_among(key: Keys, others: Keys) -> NDArray[np.bool_]:
    """Return which pairs (c,) are also in the other set."""
    return np.isin(key, others)


def join_keys(*keys: Keys) -> Keys:
    """Return the union of the sets, ascending."""
    if not keys:
        return np.empty(0, np.int64)
    joined = np.sort(np.concatenate(keys), kind="stable")  # merges sets that ascend
    return joined[np.append(True, joined[1:] != joined[:-1])[: len(joined)]]


def common_rows(key: Keys, others: Keys) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the rows of the common pairs in the one and in the other set, by ascending key."""
    _, here, there = np.intersect1d(key, others, assume_unique=True, return_indices=True)
    return here, there


def find_rows(key: Keys, former: Keys) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Return the row of every pair (c,) in a former set, and whether it is there; otherwise the row is arbitrary."""
    if len(former) == 0:
        return np.zeros(len(key), np.intp), np.zeros(len(key), np.bool_)
    if np.all(former[1:] > former[:-1]):
        row = np.minimum(np.searchsorted(former, key), len(former) - 1)
    else:
        order = np.argsort(former, kind="stable")
        row = order[np.minimum(np.searchsorted(former, key, sorter=order), len(former) - 1)]
    return row, former[row] == key


def match_values(key: Keys, former: Keys, value: NDArray[Any], *, fill: float = 0.0) -> NDArray[Any]:
    """Return the values (c, …) of pairs from those of former pairs (m, …); `fill` where a pair is not among them."""
    if np.array_equal(key, former):
        return value.copy()
    row, known = find_rows(key, former)
    found = np.full((len(key), *value.shape[1:]), fill, value.dtype)
    found[known] = value[row[known]]
    return found


def align(
    key: Keys, value: NDArray[Any], other_key: Keys, other: NDArray[Any]
) -> tuple[Keys, NDArray[np.float64], NDArray[np.float64]]:
    """Return the union of two sets of pairs and their values (c, …), (t, …) on it; 0 where a pair is absent."""
    union = join_keys(key, other_key)
    one, two = np.zeros((len(union), *value.shape[1:])), np.zeros((len(union), *other.shape[1:]))
    one[np.searchsorted(union, key)] = value
    two[np.searchsorted(union, other_key)] = other
    return union, one, two
