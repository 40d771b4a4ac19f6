"""Compiled code takes vectors: it must find what the plain loops find, and touch nothing else."""

import numpy as np
import pytest
from numba import njit

from solver.convex.legs import FILLED, LEG, ROWS, couple_nodes, push_node

LEGS, AT, ONE, OTHER = 6, 8, 4, 1
EXACT = 1e-14  # of numbers near one: products may be rounded once or twice
STIFFNESS = 2.0, -0.5, 0.75  # nn, nt, tt


@njit
def push(rows, at, leg, one):
    push_node(rows, at, leg, one, 0.5, -2.0)


@njit
def couple(blocks, at, leg, one, other, nn, nt, tt):
    couple_nodes(blocks, at, leg, one, other, nn, nt, tt)


@pytest.fixture(params=[0, 1])
def leg(request):
    """Legs that begin at any number of an array: nothing may ask for more than a number's alignment."""
    drawn = np.random.default_rng(1).normal(size=LEG * LEGS + request.param)[request.param :]
    drawn.reshape(-1, FILLED)[:, ROWS:] = 0.0
    return drawn


def test_a_node_is_pushed_by_both_forces(leg):
    rows = np.random.default_rng(2).normal(size=5 * FILLED)
    found, expected = rows.copy(), rows.copy()
    push(found, AT, leg, ONE)
    push_node(expected, AT, leg, ONE, 0.5, -2.0)
    np.testing.assert_allclose(found, expected, rtol=0, atol=EXACT)
    of_n, of_t = leg.reshape(LEGS, 2, FILLED)[ONE]
    np.testing.assert_allclose((found - rows)[AT : AT + FILLED], 0.5 * of_n - 2.0 * of_t, atol=EXACT)
    assert np.flatnonzero(found != rows).tolist() == [AT, AT + 1, AT + 2]


def test_two_nodes_are_coupled_as_the_contact_gives_way(leg):
    blocks = np.random.default_rng(3).normal(size=4 * ROWS * FILLED)
    found, expected = blocks.copy(), blocks.copy()
    couple(found, AT, leg, ONE, OTHER, *STIFFNESS)
    getattr(couple_nodes, "py_func", couple_nodes)(expected, AT, leg, ONE, OTHER, *STIFFNESS)
    np.testing.assert_allclose(found, expected, rtol=0, atol=EXACT)
    nn, nt, tt = STIFFNESS
    one, other = (leg.reshape(LEGS, 2, FILLED)[k] for k in (ONE, OTHER))
    whole = one.T @ np.array([[nn, nt], [nt, tt]]) @ other[:, :ROWS]
    changed = (found - blocks)[AT : AT + ROWS * FILLED].reshape(ROWS, FILLED)
    np.testing.assert_allclose(changed, whole.T, atol=EXACT)
    assert np.array_equal(found[:AT], blocks[:AT])
    assert np.array_equal(found[AT + ROWS * FILLED :], blocks[AT + ROWS * FILLED :])
