"""Compiled code takes vectors: it must find what the plain loops find, and touch nothing else."""

import numpy as np
import pytest
from numba import njit

from solver.factor.blocks import (
    PAIR,
    TRIPLE,
    area_of,
    lanes_of,
    scale_column,
    take_from_rows,
    take_products,
    take_rows,
)

ENTRIES, NODES, FIRST, END, AT = 12, 20, 3, 8, 2
EXACT = 1e-14  # of numbers near one: products may be rounded once or twice


@njit
def products(row, blocks, where, block):
    take_products(row, blocks, where, FIRST, END, block)


@njit
def scale(blocks, block):
    scale_column(blocks, FIRST, END, block)


@njit
def from_rows(row, blocks, right, at, block):
    take_from_rows(row, blocks, FIRST, END, right, at, block)


@njit
def rows(row, blocks, right, at, block):
    take_rows(row, blocks, FIRST, END, right, at, block)


@pytest.fixture(params=[PAIR, TRIPLE], ids=["pairs", "triples"])
def block(request):
    return request.param


@pytest.fixture(params=[0, 1])
def blocks(block, request):
    """Blocks that begin at any number of an array: nothing may ask for more than a number's alignment."""
    drawn = np.random.default_rng(4).normal(size=ENTRIES * area_of(block) + request.param)[request.param :]
    drawn.reshape(ENTRIES, len(block), lanes_of(block))[:, :, len(block) :] = 0.0
    return drawn


@pytest.fixture
def row():
    return np.random.default_rng(5).permutation(NODES)[:ENTRIES]


def test_products_are_taken_where_the_rows_of_the_column_lie(block, blocks, row):
    where = np.zeros(NODES, np.int64)
    where[row[FIRST:END]] = area_of(block) * np.array([9, 11, 10, 8, 0])
    found, expected = blocks.copy(), blocks.copy()
    products(row, found, where, block)
    take_products(row, expected, where, FIRST, END, block)
    np.testing.assert_allclose(found, expected, rtol=0, atol=EXACT)
    changed = np.flatnonzero((found != blocks).reshape(ENTRIES, -1).any(axis=1))
    assert changed.tolist() == [0, 8, 9, 10, 11]
    square = blocks.reshape(ENTRIES, len(block), lanes_of(block))
    product = square[FIRST].T @ square[FIRST][:, : len(block)]  # of the first entry with itself
    np.testing.assert_allclose(found.reshape(square.shape)[9], square[9] - product.T, atol=EXACT)


def test_a_column_is_scaled_by_the_triangle_at_its_head(block, blocks):
    square = blocks.reshape(ENTRIES, len(block), lanes_of(block))
    square[FIRST, :, : len(block)] = np.triu(square[FIRST, :, : len(block)])  # columns lie in rows here
    found, expected = blocks.copy(), blocks.copy()
    scale(found, block)
    scale_column(expected, FIRST, END, block)
    np.testing.assert_allclose(found, expected, rtol=0, atol=EXACT)
    triangle = square[FIRST, :, : len(block)].T
    np.testing.assert_allclose(
        found.reshape(square.shape)[FIRST + 1 : END].swapaxes(1, 2),
        square[FIRST + 1 : END].swapaxes(1, 2) @ triangle.T,
        atol=EXACT,
    )
    assert np.array_equal(found.reshape(square.shape)[: FIRST + 1], square[: FIRST + 1])


@pytest.mark.parametrize(("compiled", "plain"), [(from_rows, take_from_rows), (rows, take_rows)])
def test_products_with_a_vector_are_taken_from_it_or_from_its_rows(block, blocks, row, compiled, plain):
    lanes = lanes_of(block)
    row[FIRST:END] = [5, 7, 6, 9, 12]
    right = np.random.default_rng(6).normal(size=NODES * lanes)
    right.reshape(NODES, lanes)[:, len(block) :] = 0.0
    found, expected = right.copy(), right.copy()
    compiled(row, blocks, found, AT * lanes, block)
    plain(row, blocks, FIRST, END, expected, AT * lanes, block)
    np.testing.assert_allclose(found, expected, rtol=0, atol=EXACT)
    changed = set(np.flatnonzero((found != right).reshape(NODES, lanes).any(axis=1)).tolist())
    assert changed == ({5, 6, 7, 9, 12} if plain is take_from_rows else {AT})
    square = blocks.reshape(ENTRIES, len(block), lanes)[FIRST:END].swapaxes(1, 2)[:, : len(block)]
    before, after = right.reshape(NODES, lanes)[:, : len(block)], found.reshape(NODES, lanes)[:, : len(block)]
    if plain is take_from_rows:
        np.testing.assert_allclose(after[5], before[5] - square[0] @ before[AT], atol=EXACT)
    else:
        taken = np.einsum("pab,pa->b", square, before[row[FIRST:END]])
        np.testing.assert_allclose(after[AT], before[AT] - taken, atol=EXACT)
