import numpy as np
import pytest
from rodsight.solver.factor.blocks import PAIR, TRIPLE
from rodsight.solver.factor.cholesky import factorize
from rodsight.solver.factor.inverse import invert_on_pattern

from tests.solver.factor.matrices import lattice, square

EXACT = 1e-10  # relative, of matrices whose eigenvalues span a few hundred


@pytest.mark.parametrize("block", [PAIR, TRIPLE])
@pytest.mark.parametrize(("side", "far"), [(1, 0), (2, 0), (6, 0), (6, 20)])
def test_on_the_pattern_it_is_the_dense_inverse(block: tuple[int, ...], side: int, far: int):
    size = len(block)
    pattern, blocks, matrix = lattice(side, size, far)
    row_offset, found = np.empty(pattern.node_count, np.int64), np.zeros_like(blocks)
    assert factorize(pattern, blocks, row_offset, block)
    invert_on_pattern(pattern, blocks, found, np.empty_like(blocks), row_offset, block)
    dense = np.linalg.inv(matrix)
    expected = dense.reshape(-1, size, pattern.node_count, size).swapaxes(1, 2)[pattern.row, pattern.column]
    np.testing.assert_allclose(square(found, size), expected, rtol=0, atol=EXACT * np.abs(dense).max())
