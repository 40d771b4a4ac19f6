import numpy as np
import pytest
from rodsight.solver.factor.pattern import find_pattern

from tests.solver.factor.matrices import coupled_nodes, definite, lattice

ZERO = 1e-14  # bound of a zero entry of a random factor


def test_it_has_the_entries_of_the_factor_and_no_others():
    pattern, _, dense = lattice(6, 1, far=9)
    row, column = np.nonzero(np.abs(np.linalg.cholesky(dense)) > ZERO)
    found = set(zip(pattern.row.tolist(), pattern.column.tolist(), strict=True))
    assert found == set(zip(row.tolist(), column.tolist(), strict=True))


def test_columns_begin_with_their_diagonal_and_ascend():
    pattern = lattice(5, 1)[0]
    assert np.array_equal(pattern.row[pattern.start[:-1]], np.arange(25))
    assert np.array_equal(np.sort(pattern.place), np.arange(25))
    for j in range(25):
        assert np.all(np.diff(pattern.row[pattern.start[j] : pattern.start[j + 1]]) > 0)


def test_rows_list_the_entries_left_of_their_diagonal():
    pattern = lattice(5, 1)[0]
    for i in range(25):
        listed = pattern.left[pattern.left_start[i] : pattern.left_start[i + 1]]
        assert set(listed) == set(np.flatnonzero((pattern.row == i) & (pattern.column < i)))


def test_fill_of_a_plane_lattice_is_small():
    """A banded factor of this lattice has 41 entries per column, nested dissection about 16."""
    pattern = find_pattern(1600, *coupled_nodes(40))
    assert pattern.entry_count < 14 * 1600


def test_nodes_are_found_in_either_order():
    a, b = coupled_nodes(4, far=3)
    pattern = find_pattern(17, a, b)
    entry = pattern.locate(a, b)
    assert np.array_equal(entry, pattern.locate(b, a))
    assert np.array_equal(pattern.column[entry], np.minimum(pattern.place[a], pattern.place[b]))
    assert np.array_equal(pattern.row[entry], np.maximum(pattern.place[a], pattern.place[b]))


def test_nodes_that_are_not_coupled_are_refused():
    pattern = find_pattern(3, np.array([0]), np.array([1]))
    with pytest.raises(ValueError, match="not coupled"):
        pattern.locate(np.array([0]), np.array([2]))


def test_nodes_without_neighbours_stand_alone():
    none = np.zeros(0, np.int64)
    assert find_pattern(0, none, none).entry_count == 0
    pattern = find_pattern(3, none, none)
    assert pattern.row.tolist() == [0, 1, 2]
    assert definite(pattern, none, none, 2)[0].shape == (12,)


def test_every_pair_that_the_pattern_lacks_is_refused():
    pattern = find_pattern(17, *coupled_nodes(4, far=3))
    filled = set(zip(pattern.column.tolist(), pattern.row.tolist(), strict=True))
    lacking = [
        (a, b) for a in range(17) for b in range(a) if tuple(sorted(pattern.place[[a, b]].tolist())) not in filled
    ]
    assert len(lacking) > 20
    for a, b in lacking:
        with pytest.raises(ValueError, match="not coupled"):
            pattern.locate(np.array([a]), np.array([b]))
