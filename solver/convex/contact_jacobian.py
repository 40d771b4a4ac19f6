"""Products with blocks of the contact Jacobian, in vector instructions.

A block maps the force (f_n, f_t) of a contact to the three equilibrium equations of a node. It is stored as its two
columns, four numbers each; the fourth is padding and zero. The plain functions define the results; compiled code uses
the vector implementations.
"""

from __future__ import annotations

from numba import njit

from ..factor.blocks import TRIPLE, padded_rows
from ..vectors import INDEX, add_product, broadcast, llvm_implementation_of, load, store

ROWS = len(TRIPLE)  # equations of a node
PADDED_ROWS = padded_rows(TRIPLE)  # rows with padding
JACOBIAN_SIZE = 2 * PADDED_ROWS  # numbers of a block


def add_jacobian_columns(rows, at, jacobian, one, fn, ft):  # type: ignore[no-untyped-def]
    """Add H f of one Jacobian block to the node at rows[at]; jacobian: all blocks, flat."""
    for a in range(PADDED_ROWS):
        rows[at + a] += jacobian[one * JACOBIAN_SIZE + a] * fn + jacobian[one * JACOBIAN_SIZE + PADDED_ROWS + a] * ft


@llvm_implementation_of(add_jacobian_columns)
def _add_jacobian_columns(builder, kinds, values):  # type: ignore[no-untyped-def]
    rows, at, jacobian, one, fn, ft = values
    place = builder.gep(rows, [at])
    start = builder.gep(jacobian, [builder.mul(one, INDEX(JACOBIAN_SIZE))])
    updated = load(builder, place, PADDED_ROWS)
    for k, force in enumerate((fn, ft)):
        column = load(builder, builder.gep(start, [INDEX(k * PADDED_ROWS)]), PADDED_ROWS)
        updated = add_product(builder, updated, column, broadcast(builder, force, PADDED_ROWS))
    store(builder, updated, place)


@njit(inline="always")
def add_coupling_block(blocks, at, jacobian, one, other, nn, nt, tt):  # type: ignore[no-untyped-def]
    """Add J_one E J_otherᵀ to the block at blocks[at]; E = ((nn, nt), (nt, tt)) is symmetric."""
    for b in range(ROWS):
        hn, ht = jacobian[other * JACOBIAN_SIZE + b], jacobian[other * JACOBIAN_SIZE + PADDED_ROWS + b]
        add_jacobian_columns(blocks, at + b * PADDED_ROWS, jacobian, one, nn * hn + nt * ht, nt * hn + tt * ht)
