import numpy as np
import pytest
from rodsight.solver.factor.blocks import PAIR, TRIPLE
from rodsight.solver.factor.cholesky import factorize, solve
from rodsight.solver.factor.pattern import find_pattern

from tests.solver.factor.matrices import flat, lattice, square

BLOCK = {2: PAIR, 3: TRIPLE}
EXACT = 1e-10  # relative, of matrices whose eigenvalues span a few hundred


@pytest.mark.parametrize("size", [2, 3])
@pytest.mark.parametrize(("side", "far"), [(1, 0), (2, 0), (7, 0), (7, 20)])
def test_the_solution_is_that_of_the_dense_matrix(size: int, side: int, far: int):
    pattern, blocks, dense = lattice(side, size, far)
    rhs = np.random.default_rng(1).normal(size=len(dense))
    expected = np.linalg.solve(dense, rhs)
    assert factorize(pattern, blocks, np.empty(pattern.node_count, np.int64), BLOCK[size])
    padded = np.zeros((pattern.node_count, size + size % 2))
    padded[:, :size] = rhs.reshape(-1, size)
    solve(pattern, blocks, padded.reshape(-1), BLOCK[size])
    assert not padded[:, size:].any()
    rhs = padded[:, :size].ravel()
    np.testing.assert_allclose(rhs, expected, rtol=0, atol=EXACT * np.abs(expected).max())


@pytest.mark.parametrize("size", [2, 3])
def test_the_factor_is_that_of_the_dense_matrix(size: int):
    pattern, blocks, dense = lattice(5, size)
    factorize(pattern, blocks, np.empty(25, np.int64), BLOCK[size])
    factor = np.linalg.cholesky(dense)
    for k, found in enumerate(square(blocks, size)):
        i, j = pattern.row[k] * size, pattern.column[k] * size
        expected = factor[i : i + size, j : j + size]
        expected = np.linalg.inv(expected) if i == j else expected
        np.testing.assert_allclose(found, expected, rtol=0, atol=EXACT)


@pytest.mark.parametrize("size", [2, 3])
@pytest.mark.parametrize("wrong", [-1.0, 0.0, np.nan])
def test_a_matrix_that_is_not_positive_definite_is_refused(size: int, wrong: float):
    pattern = find_pattern(2, np.array([0]), np.array([1]))
    blocks = np.zeros((3, size, size))
    blocks[[0, 2]] = np.eye(size)
    blocks[2, -1, -1] = wrong
    assert not factorize(pattern, flat(blocks), np.empty(2, np.int64), BLOCK[size])
