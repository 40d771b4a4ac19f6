"""Pairs of bodies by key: a number that names a pair in every frame, and how sets of named pairs are matched.

Bodies are the grains and after them the walls; the key of (i, j) is i · bodies + j with i < j, so that keys ascend as
pairs do. Nobody else takes keys apart. Sets of keys name every pair once, in any order unless said.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Keys = NDArray[np.int64]


def make_keys(i: NDArray[np.integer], j: NDArray[np.integer], bodies: int) -> Keys:
    """Name pairs of bodies i < j (c,); bodies: grains and walls together."""
    return np.asarray(i).astype(np.int64) * bodies + j


def make_key(a: int, b: int, bodies: int) -> int:
    """Name one pair, given from either side."""
    return min(a, b) * bodies + max(a, b)


def split_keys(key: Keys, bodies: int) -> tuple[Keys, Keys]:
    """Tell the bodies i and j of every pair (c,)."""
    return key // bodies, key % bodies


def split_key(key: int, bodies: int) -> tuple[int, int]:
    """Tell the bodies i and j of one pair."""
    return divmod(key, bodies)


def are_there(key: Keys, present: NDArray[np.bool_], bodies: int) -> NDArray[np.bool_]:
    """Which pairs (c,) have both bodies there; present (n,) of the grains, walls always are."""
    i, j = split_keys(key, bodies)
    here = np.concatenate([present, np.ones(bodies - len(present), np.bool_)])
    return here[i] & here[j]


def are_among(key: Keys, others: Keys) -> NDArray[np.bool_]:
    """Which pairs (c,) others name too."""
    return np.isin(key, others)


def join_keys(*keys: Keys) -> Keys:
    """Every pair that any of the sets names, ascending."""
    return np.unique(np.concatenate(keys)) if keys else np.empty(0, np.int64)


def common_rows(key: Keys, others: Keys) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows of the pairs that both sets name, in the one and in the other, by ascending key."""
    _, here, there = np.intersect1d(key, others, assume_unique=True, return_indices=True)
    return here, there


def find_rows(key: Keys, former: Keys) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Row of every pair (c,) among former ones, and whether it is there at all; else the row means nothing."""
    if len(former) == 0:
        return np.zeros(len(key), np.intp), np.zeros(len(key), np.bool_)
    order = np.argsort(former, kind="stable")
    row = order[np.minimum(np.searchsorted(former, key, sorter=order), len(former) - 1)]
    return row, former[row] == key


def recall(key: Keys, former: Keys, value: NDArray[Any], *, fill: float = 0.0) -> NDArray[Any]:
    """Values (m, …) of former pairs (m,) on these (c, …); `fill` where a pair was not among them."""
    row, known = find_rows(key, former)
    found = np.full((len(key), *value.shape[1:]), fill, value.dtype)
    found[known] = value[row[known]]
    return found


def align(
    key: Keys, value: NDArray[Any], other_key: Keys, other: NDArray[Any]
) -> tuple[Keys, NDArray[np.float64], NDArray[np.float64]]:
    """Bring values (c, …) and (t, …) of two sets onto the union of their pairs: its keys, and both; absent is 0."""
    union = join_keys(key, other_key)
    one, two = np.zeros((len(union), *value.shape[1:])), np.zeros((len(union), *other.shape[1:]))
    one[np.searchsorted(union, key)] = value
    two[np.searchsorted(union, other_key)] = other
    return union, one, two
