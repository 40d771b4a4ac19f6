"""Sums of residuals and forces over eight contacts or grains at a time, in registers.

Sums are kept per lane, eight numbers each in one flat array. The plain functions define the results up to rounding;
compiled code uses the vector implementations.
"""

from __future__ import annotations

from typing import NamedTuple

from llvmlite import ir
from numba import njit
from numba.core import cgutils

from ...grain_records import RECORD, WIDTH, places_of, store_records, transpose
from ...vectors import (
    INDEX,
    NUMBER,
    add_product,
    broadcast,
    llvm_implementation_of,
    load,
    shuffle,
    store,
    subtract_product,
)
from .contact_law import relax_contact
from .ordering import GROUP as L

# Offsets of the sums: squared residuals, squared forces, f_n, bearing contacts, greatest |Δf|² / |f|² of a contact as a
# fraction, greatest |ΣF|² of a grain.
RESIDUAL, SQUARES, NORMAL, BEARING, CHANGE, SIZE, UNBALANCE, SUMS = (WIDTH * k for k in range(8))
FORCE_SUMS = (SQUARES, NORMAL, BEARING, CHANGE, SIZE)
THIRD = 1.0 / 3.0  # W_nn over W_tt between two solid rods
CELL_ROWS = 5  # rows of a pair block in a cell
_INTERLEAVED = [[k // 2 + WIDTH * (k % 2) for k in range(start, start + WIDTH)] for start in (0, WIDTH)]


@njit(inline="always")
def contact_residual(fn, ft, un, ut, wn, wt, mu):  # type: ignore[no-untyped-def]
    """Squared residual |f − P(f − D⁻¹ u)|² of one contact, without the subtraction f − f, which would cancel digits."""
    normal = min(wn * un, fn)
    limit = mu * (fn - normal)
    tangential = min(max(wt * ut, ft - limit), ft + limit)
    return normal * normal + tangential * tangential


@njit(inline="always")
def add_force(sums, k, fn, ft, old_n, old_t):  # type: ignore[no-untyped-def]
    """Add a force to the sums of a lane, and its change to the greatest one; a lost force counts as changed by 1."""
    size = fn * fn + ft * ft
    sums[SQUARES + k] += size
    sums[NORMAL + k] += fn
    sums[BEARING + k] += 1.0 if fn > 0.0 else 0.0
    # Fractions are compared without division: a/b > c/d where a d > c b.
    change = (fn - old_n) * (fn - old_n) + (ft - old_t) * (ft - old_t)
    size = size if fn > 0.0 else change
    top, bottom = sums[CHANGE + k], sums[SIZE + k]
    greater = change * bottom > top * size
    sums[CHANGE + k] = change if greater else top
    sums[SIZE + k] = size if greater else bottom


@njit(inline="always")
def clear_sums(sums):  # type: ignore[no-untyped-def]
    sums[:SIZE] = 0.0
    sums[SIZE:UNBALANCE] = 1.0
    sums[UNBALANCE:] = 0.0


def add_residuals(pair, rows, ids, body, force, block, mu, sums):  # type: ignore[no-untyped-def]
    """Add the squared residuals of a group of L contacts under the velocities body."""
    p, e = block * rows * L, block * 2 * L
    for k in range(L):
        i, j = ids[e + k], ids[e + L + k]
        nx, ny, wn = pair[p + k], pair[p + L + k], pair[p + 2 * L + k]
        dx, dy = body[j] - body[i], body[j + 1] - body[i + 1]
        un = dx * nx + dy * ny + pair[p + 3 * L + k]
        ut = dy * nx - dx * ny - (body[i + 2] + body[j + 2])
        if rows == CELL_ROWS:
            ut += pair[p + 4 * L + k]
        fn, ft = force[e + 2 * k], force[e + 2 * k + 1]
        sums[RESIDUAL + k % WIDTH] += contact_residual(fn, ft, un, ut, wn, THIRD * wn, mu)


def relax_and_measure(pair, rows, ids, both, force, block, relaxation, mu, work, sums):  # type: ignore[no-untyped-def]
    """Add the residuals of a group of L contacts after the last sweep, relax it, and add its new forces.

    both: the present record of every grain, followed by that at the end of the last sweep; work: 2 RECORD L numbers.
    """
    add_residuals(pair, rows, 2 * ids, both[RECORD:], force, block, mu, sums)
    p, e = block * rows * L, block * 2 * L
    for k in range(L):
        i, j = 2 * ids[e + k], 2 * ids[e + L + k]
        nx, ny, wn = pair[p + k], pair[p + L + k], relaxation * pair[p + 2 * L + k]
        dx, dy, ci, cj = both[j] - both[i], both[j + 1] - both[i + 1], both[i + 3], both[j + 3]
        un = dx * nx + dy * ny + pair[p + 3 * L + k]
        ut = dy * nx - dx * ny - both[i + 2] - both[j + 2]
        if rows == CELL_ROWS:
            ut += pair[p + 4 * L + k]
        fn, ft = force[e + 2 * k], force[e + 2 * k + 1]
        new_n, new_t = relax_contact(fn, ft, un, ut, wn, THIRD * wn, mu)
        force[e + 2 * k], force[e + 2 * k + 1] = new_n, new_t
        add_force(sums, k % WIDTH, new_n, new_t, fn, ft)
        dn, dt = new_n - fn, new_t - ft
        for q, effect in enumerate((dn * nx - dt * ny, dn * ny + dt * nx)):
            both[i + q] -= ci * effect
            both[j + q] += cj * effect
        both[i + 2] -= ci * (2.0 * dt)
        both[j + 2] -= cj * (2.0 * dt)


def add_forces(force, first, before, second, sums):  # type: ignore[no-untyped-def]
    """Add WIDTH forces from force[first] on, which were those from before[second] on."""
    for k in range(WIDTH):
        f, b = first + 2 * k, second + 2 * k
        add_force(sums, k, force[f], force[f + 1], before[b], before[b + 1])


def add_unbalance(body, equilibrium, block, sums):  # type: ignore[no-untyped-def]
    """Take the greatest force residual of L grains; equilibrium: of `find_equilibrium`, flat."""
    for k in range(L):
        add_unbalance_of(body, 1, equilibrium, block * L + k, sums)


def finish_grains(both, equilibrium, block, sums):  # type: ignore[no-untyped-def]
    """Take the greatest force residual of L grains, and keep their records as those at the end of the sweep."""
    for k in range(L):
        g = block * L + k
        add_unbalance_of(both, 2, equilibrium, g, sums)
        for q in range(2 * RECORD * g, 2 * RECORD * g + RECORD):
            both[q + RECORD] = both[q]


@njit(inline="always")
def add_unbalance_of(body, records, equilibrium, g, sums):  # type: ignore[no-untyped-def]
    """Take the force residual of one grain, which has this number of records in body."""
    r, t, at = records * RECORD * g, g // L * 3 * L + g % L, UNBALANCE + g % WIDTH
    x, y, impedance = body[r] - equilibrium[t], body[r + 1] - equilibrium[t + L], equilibrium[t + 2 * L]
    sums[at] = max((x * x + y * y) * (impedance * impedance), sums[at])


@llvm_implementation_of(add_residuals)
def _residuals(builder, kinds, values):  # type: ignore[no-untyped-def]
    pair, rows, ids, body, force, block, mu, sums = values
    friction, total = broadcast(builder, mu, WIDTH), _load_at(builder, sums, INDEX(RESIDUAL))
    for k in range(0, L, WIDTH):
        contacts = _load_contacts(builder, pair, rows, ids, force, block, k)
        places = [places_of(builder, body, ids, first) for first in contacts.ids]
        total = _add_residual(builder, total, contacts, places, friction)
    _store_at(builder, total, sums, INDEX(RESIDUAL))


@llvm_implementation_of(relax_and_measure)
def _relax_and_measure(builder, kinds, values):  # type: ignore[no-untyped-def]
    pair, rows, ids, both, force, block, relaxation, mu, work, sums = values
    relaxation, friction = broadcast(builder, relaxation, WIDTH), broadcast(builder, mu, WIDTH)
    total = _load_at(builder, sums, INDEX(RESIDUAL))
    # Three phases, each without a chain of dependencies between contacts: gather, relax, scatter.
    for k in range(0, L, WIDTH):
        contacts = _load_contacts(builder, pair, rows, ids, force, block, k)
        places = [places_of(builder, both, ids, first, 2) for first in contacts.ids]
        last = [[builder.gep(place, [INDEX(RECORD)]) for place in each] for each in places]
        total = _add_residual(builder, total, contacts, last, friction)
        for at, each in zip((k, RECORD * L + k), places, strict=True):
            _store_rows(builder, transpose(builder, [load(builder, place, RECORD) for place in each]), work, at)
    _store_at(builder, total, sums, INDEX(RESIDUAL))
    found = _load_sums(builder, sums)
    for k in range(0, L, WIDTH):
        contacts = _load_contacts(builder, pair, rows, ids, force, block, k)
        i, j = (_load_rows(builder, work, at) for at in (k, RECORD * L + k))
        new_n, new_t, i, j = _relax(builder, contacts, i, j, relaxation, friction)
        low, high = (shuffle(builder, new_n, new_t, lanes) for lanes in _INTERLEAVED)
        _store_at(builder, low, force, contacts.force)
        _store_at(builder, high, force, builder.add(contacts.force, INDEX(WIDTH)))
        _store_rows(builder, i[:3], work, k)
        _store_rows(builder, j[:3], work, RECORD * L + k)
        found = _add_force(builder, found, (new_n, new_t), (contacts.fn, contacts.ft))
    _store_sums(builder, found, sums)
    for k in range(0, L, WIDTH):
        e = builder.add(builder.mul(block, INDEX(2 * L)), INDEX(k))
        for at, first in ((k, e), (RECORD * L + k, builder.add(e, INDEX(L)))):
            places = places_of(builder, both, ids, first, 2)
            store_records(builder, _load_rows(builder, work, at), places)


def _store_rows(builder, rows, work, at):  # type: ignore[no-untyped-def]
    for q, row in enumerate(rows):
        _store_at(builder, row, work, INDEX(at + q * L))


def _load_rows(builder, work, at):  # type: ignore[no-untyped-def]
    return [_load_at(builder, work, INDEX(at + q * L)) for q in range(RECORD)]


class _Contacts(NamedTuple):
    """Eight contacts in registers."""

    nx: ir.Value
    ny: ir.Value
    wn: ir.Value  # 1 / W_nn
    offset_n: ir.Value
    offset_t: ir.Value
    fn: ir.Value
    ft: ir.Value
    force: ir.Value  # place of the first force
    ids: tuple[ir.Value, ir.Value]  # places of the first grains i and j


def _load_contacts(builder, pair, rows, ids, force, block, k):  # type: ignore[no-untyped-def]
    p = builder.add(builder.mul(builder.mul(block, rows), INDEX(L)), INDEX(k))
    e = builder.mul(block, INDEX(2 * L))
    nx, ny, wn, offset_n = (_load_at(builder, pair, builder.add(p, INDEX(q * L))) for q in range(4))
    in_cell, last = builder.icmp_signed("==", rows, INDEX(CELL_ROWS)), builder.sub(rows, INDEX(1))
    drift = _load_at(builder, pair, builder.add(p, builder.mul(last, INDEX(L))))
    offset_t = builder.select(in_cell, drift, _constant(0.0))
    first = builder.add(e, INDEX(2 * k))
    fn, ft = _load_forces(builder, force, first)
    return _Contacts(
        nx, ny, wn, offset_n, offset_t, fn, ft, first, (builder.add(e, INDEX(k)), builder.add(e, INDEX(L + k)))
    )


def _add_residual(builder, total, contacts, places, friction):  # type: ignore[no-untyped-def]
    """`contact_residual` of eight contacts whose grains have records at these places."""
    # One product of exact factors instead of a difference, a sum and their selection.
    signs = ir.Constant(ir.VectorType(NUMBER, RECORD), [-1.0, -1.0, 1.0, 1.0])
    fused = ir.FunctionType(signs.type, [signs.type] * 3)
    fused = cgutils.get_or_insert_function(builder.module, fused, f"llvm.fmuladd.v{RECORD}f64")
    differences = [
        builder.call(fused, [load(builder, a, RECORD), signs, load(builder, b, RECORD)])
        for a, b in zip(*places, strict=True)
    ]
    dx, dy, spin, _ = transpose(builder, differences)
    nx, ny, fn, ft = contacts.nx, contacts.ny, contacts.fn, contacts.ft
    un = add_product(builder, add_product(builder, contacts.offset_n, dx, nx), dy, ny)
    ut = add_product(builder, subtract_product(builder, builder.fsub(contacts.offset_t, spin), dx, ny), dy, nx)
    normal = _least(builder, builder.fmul(contacts.wn, un), fn)
    limit = builder.fmul(friction, builder.fsub(fn, normal))
    tangential = builder.fmul(builder.fmul(_constant(THIRD), contacts.wn), ut)
    tangential = _greatest(builder, tangential, builder.fsub(ft, limit))
    tangential = _least(builder, tangential, builder.fadd(ft, limit))
    return add_product(builder, add_product(builder, total, normal, normal), tangential, tangential)


def _relax(builder, contacts, i, j, relaxation, friction):  # type: ignore[no-untyped-def]
    """Relax eight contacts: store the records of their grains and return the new forces, bit by bit as `advance`."""
    plus, minus, times = builder.fadd, builder.fsub, builder.fmul
    (ax, ay, aw, ci), (bx, by, bw, cj) = i, j
    nx, ny, fn, ft = contacts.nx, contacts.ny, contacts.fn, contacts.ft
    dx, dy, wn = minus(bx, ax), minus(by, ay), times(relaxation, contacts.wn)
    un = plus(plus(times(dx, nx), times(dy, ny)), contacts.offset_n)
    ut = plus(minus(minus(minus(times(dy, nx), times(dx, ny)), aw), bw), contacts.offset_t)
    new_n = _greatest(builder, minus(fn, times(un, wn)), _constant(0.0))
    limit = times(friction, new_n)
    new_t = minus(ft, times(ut, times(_constant(THIRD), wn)))
    new_t = _least(builder, _greatest(builder, new_t, minus(_constant(-0.0), limit)), limit)
    dn, dt = minus(new_n, fn), minus(new_t, ft)
    fx, fy = minus(times(dn, nx), times(dt, ny)), plus(times(dn, ny), times(dt, nx))
    torque = times(_constant(2.0), dt)
    ax, ay, aw = minus(ax, times(ci, fx)), minus(ay, times(ci, fy)), minus(aw, times(ci, torque))
    bx, by, bw = plus(bx, times(cj, fx)), plus(by, times(cj, fy)), minus(bw, times(cj, torque))
    return new_n, new_t, (ax, ay, aw, ci), (bx, by, bw, cj)


@llvm_implementation_of(add_forces)
def _forces(builder, kinds, values):  # type: ignore[no-untyped-def]
    force, first, before, second, sums = values
    forces = _load_forces(builder, force, first), _load_forces(builder, before, second)
    _store_sums(builder, _add_force(builder, _load_sums(builder, sums), *forces), sums)


def _add_force(builder, found, force, before):  # type: ignore[no-untyped-def]
    """Add forces to the sums of squares, f_n, and bearing contacts, and to the greatest fraction (change, size)."""
    (fn, ft), (old_n, old_t), (squares, normal, bearing, change, whole) = force, before, found
    zero, one = _constant(0.0), _constant(1.0)
    dn, dt = builder.fsub(fn, old_n), builder.fsub(ft, old_t)
    size, moved = _squares(builder, fn, ft), _squares(builder, dn, dt)
    carries = builder.fcmp_ordered(">", fn, zero)
    squares, normal = builder.fadd(squares, size), builder.fadd(normal, fn)
    bearing = builder.fadd(bearing, builder.select(carries, one, zero))
    size = builder.select(carries, size, moved)
    # Fractions are compared without division: a/b > c/d where a d > c b.
    greater = builder.fcmp_ordered(">", builder.fmul(moved, whole), builder.fmul(change, size))
    change, whole = builder.select(greater, moved, change), builder.select(greater, size, whole)
    return squares, normal, bearing, change, whole


def _load_sums(builder, sums):  # type: ignore[no-untyped-def]
    return [_load_at(builder, sums, INDEX(at)) for at in FORCE_SUMS]


def _store_sums(builder, found, sums):  # type: ignore[no-untyped-def]
    for at, each in zip(FORCE_SUMS, found, strict=True):
        _store_at(builder, each, sums, INDEX(at))


@llvm_implementation_of(add_unbalance)
def _unbalance(builder, kinds, values):  # type: ignore[no-untyped-def]
    _add_unbalance(builder, *values, records=1)


@llvm_implementation_of(finish_grains)
def _finish(builder, kinds, values):  # type: ignore[no-untyped-def]
    _add_unbalance(builder, *values, records=2)


def _add_unbalance(builder, body, equilibrium, block, sums, records):  # type: ignore[no-untyped-def]
    """Take the greatest force residual of L grains; copy the first of two records to the second."""
    worst = _load_at(builder, sums, INDEX(UNBALANCE))
    first, at = builder.mul(block, INDEX(records * RECORD * L)), builder.mul(block, INDEX(3 * L))
    for start in range(0, L, WIDTH):
        places = [builder.gep(body, [builder.add(first, INDEX(records * RECORD * (start + k)))]) for k in range(WIDTH)]
        found = [load(builder, place, RECORD) for place in places]
        for record, place in zip(found, places if records == 2 else (), strict=False):
            store(builder, record, builder.gep(place, [INDEX(RECORD)]))
        x, y, _, _ = transpose(builder, found)
        goal_x, goal_y, impedance = (
            _load_at(builder, equilibrium, builder.add(at, INDEX(start + q * L))) for q in range(3)
        )
        size = _squares(builder, builder.fsub(x, goal_x), builder.fsub(y, goal_y))
        worst = _greatest(builder, builder.fmul(size, builder.fmul(impedance, impedance)), worst)
    _store_at(builder, worst, sums, INDEX(UNBALANCE))


def _squares(builder, a, b):  # type: ignore[no-untyped-def]
    """a² + b², not fused: the same bits as one by one."""
    return builder.fadd(builder.fmul(a, a), builder.fmul(b, b))


def _load_forces(builder, force, first):  # type: ignore[no-untyped-def]
    """f_n and f_t of WIDTH contacts."""
    low, high = _load_at(builder, force, first), _load_at(builder, force, builder.add(first, INDEX(WIDTH)))
    return [shuffle(builder, low, high, range(component, 2 * WIDTH, 2)) for component in range(2)]


def _load_at(builder, array, at):  # type: ignore[no-untyped-def]
    return load(builder, builder.gep(array, [at]), WIDTH)


def _store_at(builder, vector, array, at):  # type: ignore[no-untyped-def]
    store(builder, vector, builder.gep(array, [at]))


def _constant(number):  # type: ignore[no-untyped-def]
    return ir.Constant(ir.VectorType(NUMBER, WIDTH), [number] * WIDTH)


def _greatest(builder, a, b):  # type: ignore[no-untyped-def]
    return builder.select(builder.fcmp_ordered(">", a, b), a, b)


def _least(builder, a, b):  # type: ignore[no-untyped-def]
    return builder.select(builder.fcmp_ordered("<", a, b), a, b)
