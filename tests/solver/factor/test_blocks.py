"""The vector implementations give the results of the plain loops and change no other numbers."""

import numpy as np
import pytest
from numba import njit
from rodsight.solver.factor.blocks import (
    PAIR,
    TRIPLE,
    backward_substitution,
    block_size,
    forward_substitution,
    padded_rows,
    scale_column,
    schur_update,
)

ENTRIES, NODES, FIRST, END, AT = 12, 20, 3, 8, 2
EXACT = 1e-14  # of numbers near one: products may be rounded once or twice


@njit
def update(row, blocks, row_offset, block):
    schur_update(row, blocks, row_offset, FIRST, END, block)


@njit
def scale(blocks, block):
    scale_column(blocks, FIRST, END, block)


@njit
def forward(row, blocks, rhs, at, block):
    forward_substitution(row, blocks, FIRST, END, rhs, at, block)


@njit
def backward(row, blocks, rhs, at, block):
    backward_substitution(row, blocks, FIRST, END, rhs, at, block)


@pytest.fixture(params=[PAIR, TRIPLE], ids=["pairs", "triples"])
def block(request):
    return request.param


@pytest.fixture(params=[0, 1])
def blocks(block, request):
    """Blocks at any offset of an array: only the alignment of a number may be assumed."""
    random = np.random.default_rng(4).normal(size=ENTRIES * block_size(block) + request.param)[request.param :]
    random.reshape(ENTRIES, len(block), padded_rows(block))[:, :, len(block) :] = 0.0
    return random


@pytest.fixture
def row():
    return np.random.default_rng(5).permutation(NODES)[:ENTRIES]


def test_a_schur_update_changes_the_rows_of_the_earlier_column(block, blocks, row):
    row_offset = np.zeros(NODES, np.int64)
    row_offset[row[FIRST:END]] = block_size(block) * np.array([9, 11, 10, 8, 0])
    found, expected = blocks.copy(), blocks.copy()
    update(row, found, row_offset, block)
    schur_update(row, expected, row_offset, FIRST, END, block)
    np.testing.assert_allclose(found, expected, rtol=0, atol=EXACT)
    changed = np.flatnonzero((found != blocks).reshape(ENTRIES, -1).any(axis=1))
    assert changed.tolist() == [0, 8, 9, 10, 11]
    square = blocks.reshape(ENTRIES, len(block), padded_rows(block))
    product = square[FIRST].T @ square[FIRST][:, : len(block)]  # of the first entry with itself
    np.testing.assert_allclose(found.reshape(square.shape)[9], square[9] - product.T, atol=EXACT)


def test_a_column_is_scaled_by_its_diagonal_block(block, blocks):
    square = blocks.reshape(ENTRIES, len(block), padded_rows(block))
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


@pytest.mark.parametrize(("compiled", "plain"), [(forward, forward_substitution), (backward, backward_substitution)])
def test_substitution_subtracts_products_with_a_vector(block, blocks, row, compiled, plain):
    lanes = padded_rows(block)
    row[FIRST:END] = [5, 7, 6, 9, 12]
    rhs = np.random.default_rng(6).normal(size=NODES * lanes)
    rhs.reshape(NODES, lanes)[:, len(block) :] = 0.0
    found, expected = rhs.copy(), rhs.copy()
    compiled(row, blocks, found, AT * lanes, block)
    plain(row, blocks, FIRST, END, expected, AT * lanes, block)
    np.testing.assert_allclose(found, expected, rtol=0, atol=EXACT)
    changed = set(np.flatnonzero((found != rhs).reshape(NODES, lanes).any(axis=1)).tolist())
    assert changed == ({5, 6, 7, 9, 12} if plain is forward_substitution else {AT})
    square = blocks.reshape(ENTRIES, len(block), lanes)[FIRST:END].swapaxes(1, 2)[:, : len(block)]
    before, after = rhs.reshape(NODES, lanes)[:, : len(block)], found.reshape(NODES, lanes)[:, : len(block)]
    if plain is forward_substitution:
        np.testing.assert_allclose(after[5], before[5] - square[0] @ before[AT], atol=EXACT)
    else:
        product = np.einsum("pab,pa->b", square, before[row[FIRST:END]])
        np.testing.assert_allclose(after[AT], before[AT] - product, atol=EXACT)
