"""What a contact does to a body, in vector instructions.

A leg is two vectors of four numbers, what f_n does to the three rows of a node and what f_t does; every fourth is zero.

The functions say in Python what they do; compiled code takes the vectors instead.
"""

from __future__ import annotations

from numba import types
from numba.extending import intrinsic, overload

from solver.factor.blocks import TRIPLE, lanes_of
from solver.vectors import INDEX, add_product, load, pointers, spread, store

ROWS = len(TRIPLE)  # of a node
FILLED = lanes_of(TRIPLE)  # numbers of a node in what stands beside the matrix, those included that fill it up
LEG = 2 * FILLED  # numbers


def push_node(rows, at, leg, one, fn, ft):  # type: ignore[no-untyped-def]
    """Add to the node at rows[at] what a force does by one leg; leg: all legs, flat."""
    for a in range(FILLED):
        rows[at + a] += leg[one * LEG + a] * fn + leg[one * LEG + FILLED + a] * ft


def couple_nodes(blocks, at, leg, one, other, nn, nt, tt):  # type: ignore[no-untyped-def]
    """Add to the block at blocks[at] one leg · E · the transposed other, E the symmetric ((nn, nt), (nt, tt))."""
    for b in range(ROWS):
        hn, ht = leg[other * LEG + b], leg[other * LEG + FILLED + b]
        n, t = nn * hn + nt * ht, nt * hn + tt * ht
        for a in range(FILLED):
            blocks[at + b * FILLED + a] += leg[one * LEG + a] * n + leg[one * LEG + FILLED + a] * t


@overload(push_node, inline="always")
def _compiled_push(rows, at, leg, one, fn, ft):  # type: ignore[no-untyped-def]
    def push(rows, at, leg, one, fn, ft):  # type: ignore[no-untyped-def]
        _add_leg(rows, at, leg, one, fn, ft)  # pyright: ignore[reportCallIssue]

    return push


@overload(couple_nodes, inline="always")
def _compiled_coupling(blocks, at, leg, one, other, nn, nt, tt):  # type: ignore[no-untyped-def]
    def couple(blocks, at, leg, one, other, nn, nt, tt):  # type: ignore[no-untyped-def]
        for b in range(ROWS):
            hn, ht = leg[other * LEG + b], leg[other * LEG + FILLED + b]
            _add_leg(blocks, at + b * FILLED, leg, one, nn * hn + nt * ht, nt * hn + tt * ht)  # pyright: ignore[reportCallIssue]

    return couple


@intrinsic
def _add_leg(typing, rows, at, leg, one, fn, ft):  # type: ignore[no-untyped-def]
    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        rows, at, leg, one, fn, ft = pointers(context, builder, signature, values)
        place = builder.gep(rows, [at])
        start = builder.gep(leg, [builder.mul(one, INDEX(LEG))])
        more = load(builder, place, FILLED)
        for k, force in enumerate((fn, ft)):
            part = load(builder, builder.gep(start, [INDEX(k * FILLED)]), FILLED)
            more = add_product(builder, more, part, spread(builder, force, FILLED))
        store(builder, more, place)
        return context.get_dummy_value()

    return types.void(rows, at, leg, one, fn, ft), generate
