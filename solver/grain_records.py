"""Transposition of the records of eight grains between array of structures and structure of arrays.

The record of a grain is four adjacent numbers: vx, vy, ω R, 1/Z. Vector instructions need one row per quantity. Number
by number, copying between the two takes longer than the mechanics. Here every record is loaded and stored at once, and
eight records are transposed in registers. The plain functions define the results; compiled code uses the vector
implementations.
"""

from __future__ import annotations

from .vectors import INDEX, llvm_implementation_of, load, shuffle, store

RECORD = 4  # numbers of a grain
WIDTH = 8  # grains of a transposition

_EVEN, _ODD = [0, 8, 2, 10, 4, 12, 6, 14], [1, 9, 3, 11, 5, 13, 7, 15]
_LOW, _HIGH = [0, 1, 8, 9, 4, 5, 12, 13], [2, 3, 10, 11, 6, 7, 14, 15]


def gather_records(body, ids, first, rows, at, stride):  # type: ignore[no-untyped-def]
    """Copy the records of the grains ids[first : first + WIDTH] to rows[at + q * stride], q the quantity.

    body (4 n,), ids int32, rows: flat arrays, contiguous; an id is the place of a record in body.
    """
    for k in range(WIDTH):
        for q in range(RECORD):
            rows[at + q * stride + k] = body[ids[first + k] + q]


def scatter_records(rows, at, stride, body, ids, first):  # type: ignore[no-untyped-def]
    """Copy rows[at + q * stride] to the records of the distinct grains ids[first : first + WIDTH]."""
    for k in range(WIDTH):
        for q in range(RECORD):
            body[ids[first + k] + q] = rows[at + q * stride + k]


@llvm_implementation_of(gather_records)
def _gather(builder, kinds, values):  # type: ignore[no-untyped-def]
    body, ids, first, rows, at, stride = values
    records = [load(builder, place, RECORD) for place in places_of(builder, body, ids, first)]
    for row, place in zip(transpose(builder, records), _rows(builder, rows, at, stride), strict=True):
        store(builder, row, place)


@llvm_implementation_of(scatter_records)
def _scatter(builder, kinds, values):  # type: ignore[no-untyped-def]
    rows, at, stride, body, ids, first = values
    found = [load(builder, place, WIDTH) for place in _rows(builder, rows, at, stride)]
    store_records(builder, found, places_of(builder, body, ids, first))


def places_of(builder, body, ids, first, records=1):  # type: ignore[no-untyped-def]
    """Pointers to the first records of the grains ids[first : first + WIDTH], where each has this number of records."""
    places = [builder.load(builder.gep(ids, [builder.add(first, INDEX(k))])) for k in range(WIDTH)]
    return [builder.gep(body, [builder.mul(builder.zext(place, INDEX), INDEX(records))]) for place in places]


def transpose(builder, records):  # type: ignore[no-untyped-def]
    """Rows of the four quantities of eight records."""
    # A vector of eight holds grains k and k + 4.
    halves = [shuffle(builder, records[k], records[k + RECORD], range(WIDTH)) for k in range(RECORD)]
    return _transposed(builder, halves)


def store_records(builder, rows, places):  # type: ignore[no-untyped-def]
    """Store the records whose quantities are these rows."""
    pairs = _transposed(builder, rows)
    records = [shuffle(builder, pair, pair, range(RECORD)) for pair in pairs]
    records += [shuffle(builder, pair, pair, range(RECORD, WIDTH)) for pair in pairs]
    for record, place in zip(records, places, strict=True):
        store(builder, record, place)


def _rows(builder, rows, at, stride):  # type: ignore[no-untyped-def]
    """Pointers to the rows of the four quantities."""
    for q in range(RECORD):
        yield builder.gep(rows, [builder.add(at, builder.mul(stride, INDEX(q)))])


def _transposed(builder, rows):  # type: ignore[no-untyped-def]
    """Transpose both halves, 4 × 4 each, of four vectors of eight."""
    even = [shuffle(builder, rows[k], rows[k + 1], _EVEN) for k in (0, 2)]
    odd = [shuffle(builder, rows[k], rows[k + 1], _ODD) for k in (0, 2)]
    return [shuffle(builder, pair[0], pair[1], half) for half in (_LOW, _HIGH) for pair in (even, odd)]
