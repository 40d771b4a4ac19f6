"""Symbolic factorisation: the entries of the Cholesky factor of a sparse block matrix.

Neighbours in a plane cause little fill if nodes with few neighbours are eliminated first (the minimum-degree order of
SciPy's SuperLU). The pattern holds for every matrix with the same couplings.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.linalg import spilu

Ids = NDArray[np.int64]


class Pattern(NamedTuple):
    """Entries of the factor, column by column; rows and columns in the order of elimination."""

    place: Ids  # (n,) position of each node in the order of elimination
    start: Ids  # (n + 1,) first entry of every column, its diagonal
    row: Ids  # (k,) row of every entry, ascending in a column
    column: Ids  # (k,) column of every entry
    left_start: Ids  # (n + 1,) first entry of every row in `left`
    left: Ids  # (k − n,) entries left of the diagonal, row by row

    @property
    def node_count(self) -> int:
        return len(self.place)

    @property
    def entry_count(self) -> int:
        return len(self.row)

    def locate(self, a: Ids, b: Ids) -> Ids:
        """Find the entries (m,) of coupled nodes a and b (m,), in either order.

        Raises
        ------
        ValueError
            If a pair is not coupled.
        """
        found = np.empty(len(a), np.int64)
        if not _locate(self.start, self.row, self.place[a], self.place[b], found):
            raise ValueError("a pair of nodes is not coupled in this pattern")
        return found


def find_pattern(node_count: int, a: Ids, b: Ids) -> Pattern:
    """Order the nodes and find the entries of the factor.

    Parameters
    ----------
    node_count : int
        Number of nodes.
    a, b : (m,)
        Coupled nodes, in any order; repetitions are allowed.
    """
    itself = np.arange(node_count)
    value = np.ones(2 * len(a) + node_count)
    value[2 * len(a) :] = value.size  # definite: of a matrix with these couplings only the order is wanted
    at = np.concatenate([a, b, itself]), np.concatenate([b, a, itself])
    place = _order_by_degree(coo_array((value, at), shape=(node_count, node_count)).tocsc())
    first, second = place[a], place[b]
    low, high = np.minimum(first, second), np.maximum(first, second)
    distinct = low < high
    lower = coo_array(
        (np.ones(distinct.sum()), (high[distinct], low[distinct])), shape=(node_count, node_count)
    ).tocsr()
    lower.sum_duplicates()
    neighbour_start, neighbour = lower.indptr.astype(np.int64), lower.indices.astype(np.int64)
    size, left_size = np.empty(node_count, np.int64), np.empty(node_count, np.int64)
    parent, seen = np.empty(node_count, np.int64), np.empty(node_count, np.int64)
    _count(neighbour_start, neighbour, parent, seen, size, left_size)
    start, left_start = np.append(0, np.cumsum(size)), np.append(0, np.cumsum(left_size))
    row, left = np.empty(start[-1], np.int64), np.empty(left_start[-1], np.int64)
    _fill(neighbour_start, neighbour, parent, seen, start[:-1].copy(), left_start, row, left)
    return Pattern(place, start, row, np.repeat(np.arange(node_count), size), left_start, left)


def _order_by_degree(graph) -> Ids:  # type: ignore[no-untyped-def]
    if graph.shape[0] == 0:
        return np.zeros(0, np.int64)
    # Only the order is wanted: an incomplete factorisation that drops everything takes half of the time of a whole one.
    factor = spilu(
        graph, drop_tol=1.0, fill_factor=1.0, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )  # fmt: skip
    return factor.perm_c.astype(np.int64)


@njit(cache=True)
def _locate(start, row, first, second, found):  # type: ignore[no-untyped-def]
    """Set the entries of pairs of places by bisection of their columns; return whether the pattern has all of them."""
    for c in range(len(found)):
        wanted, column = max(first[c], second[c]), min(first[c], second[c])
        low, end = start[column], start[column + 1]
        high = end
        while low < high:
            middle = (low + high) // 2
            if row[middle] < wanted:
                low = middle + 1
            else:
                high = middle
        if low == end or row[low] != wanted:
            return False
        found[c] = low
    return True


@njit(cache=True)
def _count(neighbour_start, neighbour, parent, seen, size, left_size):  # type: ignore[no-untyped-def]
    """Build Liu's elimination tree; count the entries of every column and left of every diagonal."""
    for i in range(len(parent)):
        parent[i], seen[i], size[i], left_size[i] = -1, i, 1, 0
        for p in range(neighbour_start[i], neighbour_start[i + 1]):
            k = neighbour[p]
            while seen[k] != i:  # the entries of a row are paths of the tree from each neighbour up to the row
                if parent[k] == -1:
                    parent[k] = i
                seen[k] = i
                size[k] += 1
                left_size[i] += 1
                k = parent[k]


@njit(cache=True)
def _fill(neighbour_start, neighbour, parent, seen, free, left_start, row, left):  # type: ignore[no-untyped-def]
    """Fill the entries in ascending order of rows; free (n,): next free entry of every column."""
    for i in range(len(parent)):
        seen[i] = i
        row[free[i]] = i
        free[i] += 1
        q = left_start[i]
        for p in range(neighbour_start[i], neighbour_start[i + 1]):
            k = neighbour[p]
            while seen[k] != i:
                seen[k] = i
                row[free[k]] = i
                left[q] = free[k]
                free[k] += 1
                q += 1
                k = parent[k]
