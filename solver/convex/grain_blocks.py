"""The equilibrium matrix H in blocks of three rows: a grain's two forces and its torque, or what loaded walls demand.

A contact acts on its two bodies alone. With 2 × 2 numbers E for every contact, H E Hᵀ therefore is a matrix of 3 × 3
blocks between neighbours, and its Cholesky factor has one pattern whatever E is.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import sparse

from solver.bodies.grains import Array
from solver.convex.legs import FILLED, LEG, ROWS
from solver.factor.pattern import Ids, Pattern, find_pattern


class GrainBlocks(NamedTuple):
    """H and b of a balance, contact by contact; nodes are rows in threes, named by their order of elimination.

    A leg is what a contact does to a node: f_n to its rows, then f_t.
    """

    leg_start: Ids  # (c + 1,) first leg of every contact; its legs ascend by node
    node: Ids  # (l,) that each leg stands on
    leg: Array  # (8 l,)
    entry_start: Ids  # (c + 1,) where the entries of every contact begin in `entry`
    entry: Ids  # (e,) of the pattern: leg by leg, with the contact's first leg … with itself
    load: Array  # (4 n,) b by nodes, 0 in rows that fill up a node
    pattern: Pattern

    @property
    def node_count(self) -> int:
        return self.pattern.node_count


def block_balance(matrix: sparse.csr_matrix, load: Array, grain_count: int, contacts: int) -> GrainBlocks:
    """Sort H (m, 2c) and b (m,) of n grains and c contacts into blocks.

    Rows of H: x of all grains, y of all, torque of all, then those of walls.
    """
    node, component = _nodes_of_rows(len(load), grain_count)
    entries, count = matrix.tocoo(), int(node.max(initial=-1)) + 1
    pair = entries.col.astype(np.int64) % contacts * count + node[entries.row]  # beyond 32 bits from 50 000 grains on
    which, place = np.unique(pair, return_inverse=True)
    contact, of = which // count, which % count
    leg = np.zeros((len(which), LEG))
    np.add.at(leg, (place, entries.col // contacts * FILLED + component[entries.row]), entries.data)

    legs = np.bincount(contact, minlength=contacts)
    couples = [np.flatnonzero(contact[d:] == contact[: len(contact) - d]) for d in range(1, legs.max(initial=1))]
    first = np.concatenate([*couples, np.zeros(0, np.int64)])
    second = np.concatenate([*(each + d for d, each in enumerate(couples, start=1)), np.zeros(0, np.int64)])
    pattern = find_pattern(count, of[first], of[second])

    order = np.lexsort((pattern.place[of], contact))
    of, leg = of[order], leg[order]
    leg_start, entry_start = _starts(legs), _starts(legs * (legs + 1) // 2)
    entry = np.empty(entry_start[-1], np.int64)
    for x in range(legs.max(initial=0)):
        having = np.flatnonzero(legs > x)
        for y in range(x + 1):
            at = entry_start[having] + x * (x + 1) // 2 + y
            entry[at] = pattern.locate(of[leg_start[having] + x], of[leg_start[having] + y])
    by_node = np.zeros((count, FILLED))
    by_node[pattern.place[node], component] = load
    return GrainBlocks(leg_start, pattern.place[of], leg.ravel(), entry_start, entry, by_node.ravel(), pattern)


def _nodes_of_rows(row_count: int, grain_count: int) -> tuple[Ids, Ids]:
    """Node and component (m,) of every row: a node for each grain, then walls' rows three by three."""
    rest = np.arange(row_count - ROWS * grain_count)
    node = np.concatenate([np.tile(np.arange(grain_count), ROWS), grain_count + rest // ROWS])
    return node, np.concatenate([np.repeat(np.arange(ROWS), grain_count), rest % ROWS])


def _starts(size: Ids) -> Ids:
    return np.append(0, np.cumsum(size)).astype(np.int64)
