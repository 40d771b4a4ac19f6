"""The vector implementations give the results of the plain loops and change no other numbers."""

import numpy as np
import pytest
from numba import njit
from rodsight.solver.convex.contact_jacobian import (
    JACOBIAN_SIZE,
    PADDED_ROWS,
    ROWS,
    add_coupling_block,
    add_jacobian_columns,
)

BLOCKS, AT, ONE, OTHER = 6, 8, 4, 1
EXACT = 1e-14  # of numbers near one: products may be rounded once or twice
COMPLIANCE = 2.0, -0.5, 0.75  # nn, nt, tt


@njit
def add_columns(rows, at, jacobian, one):
    add_jacobian_columns(rows, at, jacobian, one, 0.5, -2.0)


@njit
def couple(blocks, at, jacobian, one, other, nn, nt, tt):
    add_coupling_block(blocks, at, jacobian, one, other, nn, nt, tt)


@pytest.fixture(params=[0, 1])
def jacobian(request):
    """Jacobian blocks at any offset of an array: only the alignment of a number may be assumed."""
    random = np.random.default_rng(1).normal(size=JACOBIAN_SIZE * BLOCKS + request.param)[request.param :]
    random.reshape(-1, PADDED_ROWS)[:, ROWS:] = 0.0
    return random


def test_both_columns_are_added_to_a_node(jacobian):
    rows = np.random.default_rng(2).normal(size=5 * PADDED_ROWS)
    found, expected = rows.copy(), rows.copy()
    add_columns(found, AT, jacobian, ONE)
    add_jacobian_columns(expected, AT, jacobian, ONE, 0.5, -2.0)
    np.testing.assert_allclose(found, expected, rtol=0, atol=EXACT)
    of_n, of_t = jacobian.reshape(BLOCKS, 2, PADDED_ROWS)[ONE]
    np.testing.assert_allclose((found - rows)[AT : AT + PADDED_ROWS], 0.5 * of_n - 2.0 * of_t, atol=EXACT)
    assert np.flatnonzero(found != rows).tolist() == [AT, AT + 1, AT + 2]


def test_a_coupling_block_is_the_product_with_the_compliance(jacobian):
    blocks = np.random.default_rng(3).normal(size=4 * ROWS * PADDED_ROWS)
    found, expected = blocks.copy(), blocks.copy()
    couple(found, AT, jacobian, ONE, OTHER, *COMPLIANCE)
    getattr(add_coupling_block, "py_func", add_coupling_block)(expected, AT, jacobian, ONE, OTHER, *COMPLIANCE)
    np.testing.assert_allclose(found, expected, rtol=0, atol=EXACT)
    nn, nt, tt = COMPLIANCE
    one, other = (jacobian.reshape(BLOCKS, 2, PADDED_ROWS)[k] for k in (ONE, OTHER))
    whole = one.T @ np.array([[nn, nt], [nt, tt]]) @ other[:, :ROWS]
    changed = (found - blocks)[AT : AT + ROWS * PADDED_ROWS].reshape(ROWS, PADDED_ROWS)
    np.testing.assert_allclose(changed, whole.T, atol=EXACT)
    assert np.array_equal(found[:AT], blocks[:AT])
    assert np.array_equal(found[AT + ROWS * PADDED_ROWS :], blocks[AT + ROWS * PADDED_ROWS :])
