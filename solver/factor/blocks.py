"""Small blocks and what a factorisation does with a column of them: nearly all of its work, in vector instructions.

A block's columns lie one after the other, each filled up to as many numbers as a vector takes: of a 3 × 3 block, number
(a, b) is its 4 b + a th, and every fourth is zero. What stands beside a matrix has as many numbers for every node.

The functions say in Python what they do; compiled code takes the vectors instead.
"""

from __future__ import annotations

from llvmlite import ir
from numba.core import cgutils
from numba.extending import register_jitable

from solver.vectors import INDEX, NUMBER, add_product, compiled, load, spread, store, subtract_product, total

# The size of the blocks is the length of a tuple, which is part of its type: the compiler unrolls what loops over it.
PAIR, TRIPLE = (0, 0), (0, 0, 0)


@register_jitable
def lanes_of(block):  # type: ignore[no-untyped-def]
    """Numbers of a block's column, those included that fill it up."""
    return len(block) + len(block) % 2


@register_jitable
def area_of(block):  # type: ignore[no-untyped-def]
    """Numbers of a block."""
    return len(block) * lanes_of(block)


def take_products(row, blocks, where, first, end, block):  # type: ignore[no-untyped-def]
    """From the column that `where` (n,) points into take what an earlier one, from entry first to its end, contributes.

    That is, of every entry its block times the transposed first one.
    """
    size, lanes = len(block), lanes_of(block)
    area = size * lanes
    for p in range(first, end):
        for b in range(size):
            for a in range(lanes):
                for m in range(size):
                    of_row, of_column = blocks[p * area + m * lanes + a], blocks[first * area + m * lanes + b]
                    blocks[where[row[p]] + b * lanes + a] -= of_row * of_column


def scale_column(blocks, first, end, block):  # type: ignore[no-untyped-def]
    """Multiply the entries after the first, up to the end, by the transposed lower triangle that the first holds."""
    size, lanes = len(block), lanes_of(block)
    area = size * lanes
    for p in range(first + 1, end):
        for a in range(lanes):
            for b in range(size - 1, -1, -1):
                scaled = 0.0
                for m in range(b + 1):
                    scaled += blocks[p * area + m * lanes + a] * blocks[first * area + m * lanes + b]
                blocks[p * area + b * lanes + a] = scaled


def take_from_rows(row, blocks, first, end, right, at, block):  # type: ignore[no-untyped-def]
    """From the rows of the entries take their blocks times the vector at right[at]."""
    size, lanes = len(block), lanes_of(block)
    for p in range(first, end):
        for m in range(size):
            for a in range(lanes):
                right[row[p] * lanes + a] -= blocks[(p * size + m) * lanes + a] * right[at + m]


def take_rows(row, blocks, first, end, right, at, block):  # type: ignore[no-untyped-def]
    """From the vector at right[at] take the transposed blocks of the entries times their rows."""
    size, lanes = len(block), lanes_of(block)
    for p in range(first, end):
        for m in range(size):
            for a in range(lanes):
                right[at + m] -= blocks[(p * size + m) * lanes + a] * right[row[p] * lanes + a]


@compiled(take_products)
def _take_products(builder, kinds, values):  # type: ignore[no-untyped-def]
    size, lanes = _shape(kinds)
    row, blocks, where, first, end, _ = values
    of_column = _numbers(builder, blocks, first, size, lanes)
    with cgutils.for_range(builder, end, first) as loop:
        p = loop.index
        of_row = [load(builder, place, lanes) for place in _columns(builder, blocks, p, size, lanes)]
        target = builder.gep(blocks, [builder.load(builder.gep(where, [builder.load(builder.gep(row, [p]))]))])
        for b in range(size):
            place = _at(builder, target, b * lanes)
            column = load(builder, place, lanes)
            for m in range(size):
                column = subtract_product(builder, column, of_row[m], of_column[m][b])
            store(builder, column, place)


@compiled(scale_column)
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


@compiled(take_from_rows)
def _take_from_rows(builder, kinds, values):  # type: ignore[no-untyped-def]
    size, lanes = _shape(kinds)
    row, blocks, first, end, right, at, _ = values
    own = builder.gep(right, [at])
    numbers = [spread(builder, builder.load(_at(builder, own, m)), lanes) for m in range(size)]
    with cgutils.for_range(builder, end, first) as loop:
        p = loop.index
        place = _row(builder, row, right, p, lanes)
        there = load(builder, place, lanes)
        for m, column in enumerate(_columns(builder, blocks, p, size, lanes)):
            there = subtract_product(builder, there, load(builder, column, lanes), numbers[m])
        store(builder, there, place)


@compiled(take_rows)
def _take_rows(builder, kinds, values):  # type: ignore[no-untyped-def]
    size, lanes = _shape(kinds)
    row, blocks, first, end, right, at, _ = values
    nothing = ir.Constant(ir.VectorType(NUMBER, lanes), None)
    sums = [cgutils.alloca_once_value(builder, nothing) for _ in range(size)]
    with cgutils.for_range(builder, end, first) as loop:
        p = loop.index
        there = load(builder, _row(builder, row, right, p, lanes), lanes)
        for so_far, column in zip(sums, _columns(builder, blocks, p, size, lanes), strict=True):
            more = add_product(builder, builder.load(so_far), load(builder, column, lanes), there)
            builder.store(more, so_far)
    own = builder.gep(right, [at])
    for m, sum_ in enumerate(sums):
        place = _at(builder, own, m)
        builder.store(builder.fsub(builder.load(place), total(builder, builder.load(sum_))), place)


def _shape(kinds):  # type: ignore[no-untyped-def]
    """Rows of a block and numbers of its column; the last argument is the kind of block."""
    return len(kinds[-1]), lanes_of(kinds[-1])


def _numbers(builder, blocks, entry, size, lanes):  # type: ignore[no-untyped-def]
    """Every number of an entry's block, spread over a vector, column by column."""
    return [
        [spread(builder, builder.load(_at(builder, place, b)), lanes) for b in range(size)]
        for place in _columns(builder, blocks, entry, size, lanes)
    ]


def _columns(builder, blocks, entry, size, lanes):  # type: ignore[no-untyped-def]
    """Where the columns of an entry's block begin."""
    start = builder.gep(blocks, [builder.mul(entry, INDEX(size * lanes))])
    for m in range(size):
        yield _at(builder, start, m * lanes)


def _row(builder, row, right, entry, lanes):  # type: ignore[no-untyped-def]
    """Where the vector of an entry's row begins."""
    return builder.gep(right, [builder.mul(builder.load(builder.gep(row, [entry])), INDEX(lanes))])


def _at(builder, place, number):  # type: ignore[no-untyped-def]
    return builder.gep(place, [INDEX(number)])
