"""The equilibrium matrix H in blocks of three rows: the two force equations and the torque equation of a grain.

The equations of loaded walls fill further nodes of three rows. A contact acts on its two bodies alone. With a 2 × 2
matrix E for every contact, H E Hᵀ is a matrix of 3 × 3 blocks between neighbours. The pattern of its Cholesky factor
does not depend on E.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import sparse

from ..bodies.grains import Array
from ..factor.pattern import Ids, Pattern, find_pattern
from .contact_jacobian import JACOBIAN_SIZE, PADDED_ROWS, ROWS


class GrainBlocks(NamedTuple):
    """H and b sorted by contacts; a node is three rows and is numbered in the order of elimination.

    A Jacobian block holds the column of f_n and the column of f_t of a contact in the rows of a node.
    """

    jacobian_start: Ids  # (c + 1,) first block of every contact; the blocks of a contact ascend by node
    node: Ids  # (l,) node of every block
    jacobian: Array  # (8 l,)
    entry_start: Ids  # (c + 1,) first entry of every contact in `entry`
    entry: Ids  # (e,) of the pattern: each block with the first block of its contact … with itself
    load: Array  # (4 n,) b by nodes, 0 in padding
    pattern: Pattern

    @property
    def node_count(self) -> int:
        return self.pattern.node_count


def block_balance(matrix: sparse.csr_matrix, load: Array, grain_count: int, contacts: int) -> GrainBlocks:
    """Sort H (m, 2c) and b (m,) of n grains and c contacts into blocks.

    The rows of H are x of all grains, y of all grains, torque of all grains, then those of walls.
    """
    node, component = _nodes_of_rows(len(load), grain_count)
    entries, count = matrix.tocoo(), int(node.max(initial=-1)) + 1
    pair = entries.col.astype(np.int64) % contacts * count + node[entries.row]  # beyond 32 bits from 50 000 grains on
    block, place = np.unique(pair, return_inverse=True)
    contact, node_of_block = block // count, block % count
    at = place * JACOBIAN_SIZE + entries.col // contacts * PADDED_ROWS + component[entries.row]
    jacobian = np.asarray(np.bincount(at, entries.data, len(block) * JACOBIAN_SIZE), np.float64)
    jacobian = jacobian.reshape(-1, JACOBIAN_SIZE)

    block_count = np.bincount(contact, minlength=contacts)
    coupled = [np.flatnonzero(contact[d:] == contact[: len(contact) - d]) for d in range(1, block_count.max(initial=1))]
    first = np.concatenate([*coupled, np.zeros(0, np.int64)])
    second = np.concatenate([*(each + d for d, each in enumerate(coupled, start=1)), np.zeros(0, np.int64)])
    pattern = find_pattern(count, node_of_block[first], node_of_block[second])

    order = np.argsort(contact * count + pattern.place[node_of_block])
    node_of_block, jacobian = node_of_block[order], jacobian[order]
    jacobian_start, entry_start = _starts(block_count), _starts(block_count * (block_count + 1) // 2)
    entry = np.empty(entry_start[-1], np.int64)
    for x in range(block_count.max(initial=0)):
        with_block = np.flatnonzero(block_count > x)
        for y in range(x + 1):
            at = entry_start[with_block] + x * (x + 1) // 2 + y
            entry[at] = pattern.locate(
                node_of_block[jacobian_start[with_block] + x], node_of_block[jacobian_start[with_block] + y]
            )
    by_node = np.zeros((count, PADDED_ROWS))
    by_node[pattern.place[node], component] = load
    return GrainBlocks(
        jacobian_start, pattern.place[node_of_block], jacobian.ravel(), entry_start, entry, by_node.ravel(), pattern
    )


def _nodes_of_rows(row_count: int, grain_count: int) -> tuple[Ids, Ids]:
    """Node and component (m,) of every row: one node per grain, then one per three rows of walls."""
    rest = np.arange(row_count - ROWS * grain_count)
    node = np.concatenate([np.tile(np.arange(grain_count), ROWS), grain_count + rest // ROWS])
    return node, np.concatenate([np.repeat(np.arange(ROWS), grain_count), rest % ROWS])


def _starts(size: Ids) -> Ids:
    return np.append(0, np.cumsum(size)).astype(np.int64)
