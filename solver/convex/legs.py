"""What a contact does to a body, in vector instructions.

A leg is two vectors of four numbers, what f_n does to the three rows of a node and what f_t does; every fourth is zero.

`push_node` says in Python what it does; compiled code takes the vectors instead.
"""

from __future__ import annotations

from numba import njit

from solver.factor.blocks import TRIPLE, lanes_of
from solver.vectors import INDEX, add_product, compiled, load, spread, store

ROWS = len(TRIPLE)  # of a node
FILLED = lanes_of(TRIPLE)  # numbers of a node in what stands beside the matrix, those included that fill it up
LEG = 2 * FILLED  # numbers


def push_node(rows, at, leg, one, fn, ft):  # type: ignore[no-untyped-def]
    """Add to the node at rows[at] what a force does by one leg; leg: all legs, flat."""
    for a in range(FILLED):
        rows[at + a] += leg[one * LEG + a] * fn + leg[one * LEG + FILLED + a] * ft


@compiled(push_node)
def _push_node(builder, kinds, values):  # type: ignore[no-untyped-def]
    rows, at, leg, one, fn, ft = values
    place = builder.gep(rows, [at])
    start = builder.gep(leg, [builder.mul(one, INDEX(LEG))])
    more = load(builder, place, FILLED)
    for k, force in enumerate((fn, ft)):
        part = load(builder, builder.gep(start, [INDEX(k * FILLED)]), FILLED)
        more = add_product(builder, more, part, spread(builder, force, FILLED))
    store(builder, more, place)


@njit(inline="always")
def couple_nodes(blocks, at, leg, one, other, nn, nt, tt):  # type: ignore[no-untyped-def]
    """Add to the block at blocks[at] one leg · E · the transposed other, E the symmetric ((nn, nt), (nt, tt))."""
    for b in range(ROWS):
        hn, ht = leg[other * LEG + b], leg[other * LEG + FILLED + b]
        push_node(blocks, at + b * FILLED, leg, one, nn * hn + nt * ht, nt * hn + tt * ht)
