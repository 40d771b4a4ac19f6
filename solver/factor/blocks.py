"""Operations on columns of small blocks, nearly all the work of a factorisation, in vector instructions.

A block is stored by columns, each padded to the length of a vector: number (a, b) of a 3 × 3 block stands at 4 b + a,
and every fourth number is zero. Vectors beside the matrix are padded in the same way. The plain functions define the
results; compiled code uses the vector implementations.
"""

from __future__ import annotations

from llvmlite import ir
from numba.core import cgutils
from numba.extending import register_jitable

from ..vectors import (
    INDEX,
    NUMBER,
    add_product,
    broadcast,
    llvm_implementation_of,
    load,
    store,
    subtract_product,
    total,
)

# The length of a tuple is part of its type, so the compiler unrolls loops over the size of a block.
PAIR, TRIPLE = (0, 0), (0, 0, 0)


@register_jitable
def padded_rows(block):  # type: ignore[no-untyped-def]
    """Numbers of a block's column, padding included."""
    return len(block) + len(block) % 2


@register_jitable
def block_size(block):  # type: ignore[no-untyped-def]
    """Numbers of a block, padding included."""
    return len(block) * padded_rows(block)


def schur_update(row, blocks, row_offset, first, end, block):  # type: ignore[no-untyped-def]
    """Subtract the contribution of an earlier column from the column that `row_offset` (n,) points into.

    Notes
    -----
    A_ij −= L_ik L_jkᵀ for every entry p = first … end − 1 of column k, with j the row of the first entry.
    """
    size, lanes = len(block), padded_rows(block)
    area = size * lanes
    for p in range(first, end):
        for b in range(size):
            for a in range(lanes):
                for m in range(size):
                    of_row, of_column = blocks[p * area + m * lanes + a], blocks[first * area + m * lanes + b]
                    blocks[row_offset[row[p]] + b * lanes + a] -= of_row * of_column


def scale_column(blocks, first, end, block):  # type: ignore[no-untyped-def]
    """Multiply the entries after the first by the transpose of the lower triangle in the first entry."""
    size, lanes = len(block), padded_rows(block)
    area = size * lanes
    for p in range(first + 1, end):
        for a in range(lanes):
            for b in range(size - 1, -1, -1):
                scaled = 0.0
                for m in range(b + 1):
                    scaled += blocks[p * area + m * lanes + a] * blocks[first * area + m * lanes + b]
                blocks[p * area + b * lanes + a] = scaled


def forward_substitution(row, blocks, first, end, rhs, at, block):  # type: ignore[no-untyped-def]
    """Subtract blocks times the vector at rhs[at] from the rows of the entries: x_i −= L_ij x_j."""
    size, lanes = len(block), padded_rows(block)
    for p in range(first, end):
        for m in range(size):
            for a in range(lanes):
                rhs[row[p] * lanes + a] -= blocks[(p * size + m) * lanes + a] * rhs[at + m]


def backward_substitution(row, blocks, first, end, rhs, at, block):  # type: ignore[no-untyped-def]
    """Subtract transposed blocks times the rows of the entries from the vector at rhs[at]: x_j −= Σ_i L_ijᵀ x_i."""
    size, lanes = len(block), padded_rows(block)
    for p in range(first, end):
        for m in range(size):
            for a in range(lanes):
                rhs[at + m] -= blocks[(p * size + m) * lanes + a] * rhs[row[p] * lanes + a]


@llvm_implementation_of(schur_update)
def _schur_update(builder, kinds, values):  # type: ignore[no-untyped-def]
    size, lanes = _shape(kinds)
    row, blocks, row_offset, first, end, _ = values
    of_column = _numbers(builder, blocks, first, size, lanes)
    with cgutils.for_range(builder, end, first) as loop:
        p = loop.index
        of_row = [load(builder, place, lanes) for place in _columns(builder, blocks, p, size, lanes)]
        target = builder.gep(blocks, [builder.load(builder.gep(row_offset, [builder.load(builder.gep(row, [p]))]))])
        for b in range(size):
            place = _at(builder, target, b * lanes)
            column = load(builder, place, lanes)
            for m in range(size):
                column = subtract_product(builder, column, of_row[m], of_column[m][b])
            store(builder, column, place)


@llvm_implementation_of(scale_column)
def _scale_column(builder, kinds, values):  # type: ignore[no-untyped-def]
    size, lanes = _shape(kinds)
    blocks, first, end, _ = values
    triangle = _numbers(builder, blocks, first, size, lanes)
    with cgutils.for_range(builder, end, builder.add(first, INDEX(1))) as loop:
        p = loop.index
        places = list(_columns(builder, blocks, p, size, lanes))
        columns = [load(builder, place, lanes) for place in places]
        for b in range(size):
            scaled = builder.fmul(columns[0], triangle[0][b])
            for m in range(1, b + 1):
                scaled = add_product(builder, scaled, columns[m], triangle[m][b])
            store(builder, scaled, places[b])


@llvm_implementation_of(forward_substitution)
def _forward_substitution(builder, kinds, values):  # type: ignore[no-untyped-def]
    size, lanes = _shape(kinds)
    row, blocks, first, end, rhs, at, _ = values
    own = builder.gep(rhs, [at])
    numbers = [broadcast(builder, builder.load(_at(builder, own, m)), lanes) for m in range(size)]
    with cgutils.for_range(builder, end, first) as loop:
        p = loop.index
        place = _row(builder, row, rhs, p, lanes)
        vector = load(builder, place, lanes)
        for m, column in enumerate(_columns(builder, blocks, p, size, lanes)):
            vector = subtract_product(builder, vector, load(builder, column, lanes), numbers[m])
        store(builder, vector, place)


@llvm_implementation_of(backward_substitution)
def _backward_substitution(builder, kinds, values):  # type: ignore[no-untyped-def]
    size, lanes = _shape(kinds)
    row, blocks, first, end, rhs, at, _ = values
    zeros = ir.Constant(ir.VectorType(NUMBER, lanes), None)
    sums = [cgutils.alloca_once_value(builder, zeros) for _ in range(size)]
    with cgutils.for_range(builder, end, first) as loop:
        p = loop.index
        vector = load(builder, _row(builder, row, rhs, p, lanes), lanes)
        for partial_sum, column in zip(sums, _columns(builder, blocks, p, size, lanes), strict=True):
            updated = add_product(builder, builder.load(partial_sum), load(builder, column, lanes), vector)
            builder.store(updated, partial_sum)
    own = builder.gep(rhs, [at])
    for m, sum_ in enumerate(sums):
        place = _at(builder, own, m)
        builder.store(builder.fsub(builder.load(place), total(builder, builder.load(sum_))), place)


def _shape(kinds):  # type: ignore[no-untyped-def]
    """Rows of a block and numbers of its column; the last argument has the type of the block."""
    return len(kinds[-1]), padded_rows(kinds[-1])


def _numbers(builder, blocks, entry, size, lanes):  # type: ignore[no-untyped-def]
    """Every number of an entry's block as a vector of equal numbers, column by column."""
    return [
        [broadcast(builder, builder.load(_at(builder, place, b)), lanes) for b in range(size)]
        for place in _columns(builder, blocks, entry, size, lanes)
    ]


def _columns(builder, blocks, entry, size, lanes):  # type: ignore[no-untyped-def]
    """Pointers to the columns of an entry's block."""
    start = builder.gep(blocks, [builder.mul(entry, INDEX(size * lanes))])
    for m in range(size):
        yield _at(builder, start, m * lanes)


def _row(builder, row, rhs, entry, lanes):  # type: ignore[no-untyped-def]
    """Pointer to the vector of an entry's row."""
    return builder.gep(rhs, [builder.mul(builder.load(builder.gep(row, [entry])), INDEX(lanes))])


def _at(builder, place, number):  # type: ignore[no-untyped-def]
    return builder.gep(place, [INDEX(number)])
