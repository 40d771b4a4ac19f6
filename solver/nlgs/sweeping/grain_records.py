"""Transposition of the records of eight grains between array of structures and structure of arrays.

The record of a grain is four adjacent numbers: vx, vy, ω R, 1/Z. Vector instructions need one row per quantity. Number
by number, copying between the two takes longer than the mechanics. Here every record is loaded and stored at once, and
eight records are transposed in registers. The plain functions define the results; compiled code uses the vector
implementations.
"""

from __future__ import annotations

from ...vectors import INDEX, llvm_implementation_of, load, shuffle, store

RECORD = 4  # numbers of a grain
WIDTH = 8  # grains of a transposition

_EVEN, _ODD = [0, 8, 2, 10, 4, 12, 6, 14], [1, 9, 3, 11, 5, 13, 7, 15]
_LOW, _HIGH = [0, 1, 8, 9, 4, 5, 12, 13], [2, 3, 10, 11, 6, 7, 14, 15]


def gather_records(body, ids, first, rows, at, stride):  # type: ignore[no-untyped-def]
    """Copy the records of the grains ids[first : first + WIDTH] to rows[at + q * stride], q the quantity.

    body (4 n,), ids int32, rows: flat arrays, contiguous.
    """
    for k in range(WIDTH):
        for q in range(RECORD):
            rows[at + q * stride + k] = body[RECORD * ids[first + k] + q]


def gather_differences(body, ids, first, second, rows, at, stride):  # type: ignore[no-untyped-def]
    """Copy to rows[at + q * stride] the differences ids[second :] − ids[first :] of vx and vy, and the sums of ω R."""
    for k in range(WIDTH):
        for q in range(RECORD - 1):
            a, b = body[RECORD * ids[first + k] + q], body[RECORD * ids[second + k] + q]
            rows[at + q * stride + k] = b + a if q == 2 else b - a


def transpose_records(body, first, rows, at, stride):  # type: ignore[no-untyped-def]
    """Copy WIDTH adjacent records from body[first] on to rows[at + q * stride]."""
    for k in range(WIDTH):
        for q in range(RECORD):
            rows[at + q * stride + k] = body[first + RECORD * k + q]


def scatter_records(rows, at, stride, body, ids, first):  # type: ignore[no-untyped-def]
    """Copy rows[at + q * stride] to the records of the distinct grains ids[first : first + WIDTH]."""
    for k in range(WIDTH):
        for q in range(RECORD):
            body[RECORD * ids[first + k] + q] = rows[at + q * stride + k]


@llvm_implementation_of(gather_records)
def _gather(builder, kinds, values):  # type: ignore[no-untyped-def]
    body, ids, first, rows, at, stride = values
    records = [load(builder, place, RECORD) for place in _records(builder, body, ids, first)]
    halves = range(RECORD)  # a vector of eight holds grains k and k + 4
    pairs = [shuffle(builder, records[k], records[k + RECORD], range(WIDTH)) for k in halves]
    for row, place in zip(_transposed(builder, pairs), _rows(builder, rows, at, stride), strict=True):
        store(builder, row, place)


@llvm_implementation_of(gather_differences)
def _differences(builder, kinds, values):  # type: ignore[no-untyped-def]
    body, ids, first, second, rows, at, stride = values
    both = zip(_records(builder, body, ids, first), _records(builder, body, ids, second), strict=True)
    records = []
    for one, other in both:
        a, b = load(builder, one, RECORD), load(builder, other, RECORD)
        difference, sum_ = builder.fsub(b, a), builder.fadd(b, a)
        records.append(shuffle(builder, difference, sum_, [0, 1, RECORD + 2, 3]))
    pairs = [shuffle(builder, records[k], records[k + RECORD], range(WIDTH)) for k in range(RECORD)]
    for row, place in zip(_transposed(builder, pairs)[: RECORD - 1], _rows(builder, rows, at, stride), strict=False):
        store(builder, row, place)


@llvm_implementation_of(transpose_records)
def _transpose(builder, kinds, values):  # type: ignore[no-untyped-def]
    body, first, rows, at, stride = values
    places = [builder.gep(body, [builder.add(first, INDEX(RECORD * k))]) for k in range(WIDTH)]
    records = [load(builder, place, RECORD) for place in places]
    pairs = [shuffle(builder, records[k], records[k + RECORD], range(WIDTH)) for k in range(RECORD)]
    for row, place in zip(_transposed(builder, pairs), _rows(builder, rows, at, stride), strict=True):
        store(builder, row, place)


@llvm_implementation_of(scatter_records)
def _scatter(builder, kinds, values):  # type: ignore[no-untyped-def]
    rows, at, stride, body, ids, first = values
    pairs = _transposed(builder, [load(builder, place, WIDTH) for place in _rows(builder, rows, at, stride)])
    records = [shuffle(builder, pair, pair, range(RECORD)) for pair in pairs]
    records += [shuffle(builder, pair, pair, range(RECORD, WIDTH)) for pair in pairs]
    for record, place in zip(records, _records(builder, body, ids, first), strict=True):
        store(builder, record, place)


def _records(builder, body, ids, first):  # type: ignore[no-untyped-def]
    """Pointers to the records of eight grains."""
    for k in range(WIDTH):
        grain = builder.load(builder.gep(ids, [builder.add(first, INDEX(k))]))
        yield builder.gep(body, [builder.mul(builder.zext(grain, INDEX), INDEX(RECORD))])


def _rows(builder, rows, at, stride):  # type: ignore[no-untyped-def]
    """Pointers to the rows of the four quantities."""
    for q in range(RECORD):
        yield builder.gep(rows, [builder.add(at, builder.mul(stride, INDEX(q)))])


def _transposed(builder, rows):  # type: ignore[no-untyped-def]
    """Transpose both halves, 4 × 4 each, of four vectors of eight."""
    even = [shuffle(builder, rows[k], rows[k + 1], _EVEN) for k in (0, 2)]
    odd = [shuffle(builder, rows[k], rows[k + 1], _ODD) for k in (0, 2)]
    return [shuffle(builder, pair[0], pair[1], half) for half in (_LOW, _HIGH) for pair in (even, odd)]
