"""Keys of pairs: conversion both ways, and operations on sets compared with dictionaries."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray
from rodsight.solver.contacts.pairs import (
    align,
    are_among,
    are_present,
    common_rows,
    find_rows,
    join_keys,
    make_key,
    make_keys,
    match_values,
    split_key,
    split_keys,
)

BODIES = st.integers(2, 70_000)  # the square of which leaves 32 bits
KEYS = hnp.arrays(np.int64, st.integers(0, 12), elements=st.integers(0, 30), unique=True)  # in any order


def values_of(key: NDArray[np.int64]) -> NDArray[np.float64]:
    """Values (c, 2) that identify their pairs."""
    return np.column_stack([key + 0.5, -key.astype(float)])


def as_dictionary(key: NDArray[np.int64]) -> dict[int, list[float]]:
    return dict(zip(key.tolist(), values_of(key).tolist(), strict=True))


@given(BODIES, st.data())
def test_pair_is_recovered_from_its_key(bodies: int, data: st.DataObject) -> None:
    j = data.draw(st.integers(1, bodies - 1))
    i = data.draw(st.integers(0, j - 1))
    key = make_keys(np.array([i], np.int32), np.array([j], np.int32), bodies)
    assert [int(each[0]) for each in split_keys(key, bodies)] == [i, j]
    assert make_key(j, i, bodies) == make_key(i, j, bodies) == int(key[0])
    assert split_key(int(key[0]), bodies) == (i, j)


@given(BODIES, st.data())
def test_key_is_recovered_from_its_pair(bodies: int, data: st.DataObject) -> None:
    key = data.draw(hnp.arrays(np.int64, 5, elements=st.integers(0, bodies**2 - 1)))
    np.testing.assert_array_equal(make_keys(*split_keys(key, bodies), bodies), key)


def test_keys_of_many_bodies_do_not_wrap_around() -> None:
    i, j = np.array([69_998], np.int32), np.array([69_999], np.int32)
    assert make_keys(i, j, 70_000).tolist() == [69_998 * 70_000 + 69_999]


def test_keys_ascend_in_the_order_of_pairs() -> None:
    i, j = np.triu_indices(7, 1)
    assert np.all(np.diff(make_keys(i, j, 7)) > 0)


def test_pair_is_present_if_both_bodies_are() -> None:
    present = np.array([True, False, True])  # and two walls
    i, j = np.array([0, 0, 1, 2, 1]), np.array([1, 2, 2, 4, 3])
    np.testing.assert_array_equal(are_present(make_keys(i, j, 5), present, 5), [False, True, False, True, False])


@given(KEYS, KEYS)
def test_values_are_matched_as_by_a_dictionary(key: NDArray[np.int64], former: NDArray[np.int64]) -> None:
    known = as_dictionary(former)
    found = match_values(key, former, values_of(former), fill=7.0)
    assert found.tolist() == [known.get(each, [7.0, 7.0]) for each in key.tolist()]
    row, there = find_rows(key, former)
    assert there.tolist() == [each in known for each in key.tolist()]
    np.testing.assert_array_equal(former[row[there]], key[there])


def test_matched_values_keep_their_dtype() -> None:
    former, age = np.array([4, 9]), np.array([2, 5], np.int32)
    assert match_values(np.array([9, 1]), former, age, fill=-1).tolist() == [5, -1]
    assert match_values(np.array([9, 1]), former, age, fill=-1).dtype == np.int32


@given(KEYS, KEYS)
def test_sets_are_aligned_as_dictionaries(key: NDArray[np.int64], other: NDArray[np.int64]) -> None:
    union, one, two = align(key, values_of(key), other, values_of(other))
    assert union.tolist() == sorted({*key.tolist(), *other.tolist()}) == join_keys(key, other).tolist()
    for found, source in ((one, key), (two, other)):
        expected = as_dictionary(source)
        assert found.tolist() == [expected.get(each, [0.0, 0.0]) for each in union.tolist()]


@given(KEYS, KEYS)
def test_common_pairs_are_found_in_both(key: NDArray[np.int64], other: NDArray[np.int64]) -> None:
    both = sorted({*key.tolist()} & {*other.tolist()})
    here, there = common_rows(key, other)
    assert key[here].tolist() == both == other[there].tolist()
    assert are_among(key, other).sum() == len(both)


def test_union_of_no_sets_is_empty() -> None:
    assert join_keys().tolist() == []


def test_rows_are_found_among_many_ascending_keys_in_any_order() -> None:
    rng = np.random.default_rng(4)
    former = np.unique(rng.integers(0, 5000, 1000))
    for key in (former[::3], rng.permutation(former), rng.integers(-10, 5100, 2000), np.array([4999, 5100, 0])):
        row, known = find_rows(key, former)
        assert np.array_equal(known, np.isin(key, former))
        assert np.array_equal(former[row[known]], key[known])
        assert np.array_equal(row, np.minimum(np.searchsorted(former, key), len(former) - 1))
