"""The vector implementations copy eight records at once, with the same result as the plain loops."""

import numpy as np
import pytest
from numba import njit
from rodsight.solver.grain_records import (
    RECORD,
    WIDTH,
    gather_records,
    scatter_records,
)

GRAINS, STRIDE = 40, 16


@njit
def gather(body, ids, first, rows, at):
    gather_records(body, ids, first, rows, at, STRIDE)


@njit
def scatter(rows, at, body, ids, first):
    scatter_records(rows, at, STRIDE, body, ids, first)


@pytest.fixture(params=[0, 1, 3])
def body(request):
    """Records at any offset of an array: only the alignment of a number may be assumed."""
    return np.random.default_rng(4).normal(size=RECORD * GRAINS + request.param)[request.param :]


@pytest.fixture
def ids():
    return RECORD * np.random.default_rng(5).permutation(GRAINS).astype(np.int32)


@pytest.mark.parametrize(("first", "at"), [(0, 0), (5, 8), (GRAINS - WIDTH, 3)])
def test_records_are_gathered_in_rows(body, ids, first, at):
    found, expected = np.zeros(RECORD * STRIDE + at), np.zeros(RECORD * STRIDE + at)
    gather(body, ids, first, found, at)
    gather_records(body, ids, first, expected, at, STRIDE)
    assert np.array_equal(found, expected)
    records = body.reshape(GRAINS, RECORD)[ids[first : first + WIDTH] // RECORD]
    assert np.array_equal(np.stack([found[at + q * STRIDE :][:WIDTH] for q in range(RECORD)], axis=1), records)


@pytest.mark.parametrize(("first", "at"), [(0, 0), (5, 8), (GRAINS - WIDTH, 3)])
def test_rows_are_scattered_to_their_records_only(body, ids, first, at):
    rows = np.random.default_rng(6).normal(size=RECORD * STRIDE + at)
    found, expected = body.copy(), body.copy()
    scatter(rows, at, found, ids, first)
    scatter_records(rows, at, STRIDE, expected, ids, first)
    assert np.array_equal(found, expected)
    changed = np.flatnonzero((found != body).reshape(GRAINS, RECORD).any(axis=1))
    assert np.array_equal(changed, np.sort(ids[first : first + WIDTH] // RECORD))
