"""The loops of the interior point: over contacts, 2 × 2 at a time, and over the legs that join them with grains.

The unknowns of a contact are the two parts w ≥ 0 of its force along the edges of its Coulomb cone: f_n = w₀ + w₁ and
f_t = μ (w₁ − w₀). So the cone needs no further constraint, friction may be zero, and nothing cancels near an edge.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from solver.bodies.grains import Array
from solver.convex.legs import FILLED, LEG, ROWS, couple_nodes, push_node
from solver.factor.blocks import TRIPLE, area_of
from solver.factor.cholesky import factorize, solve
from solver.factor.pattern import Ids

AREA = area_of(TRIPLE)
LONGEST = 0.99  # of the step to the boundary
# Corrections of the centre in a step: as many as entries of the factor over so many a grain, for they cost solutions.
ENTRIES, MOST_CORRECTIONS = 7, 3
LONG_ENOUGH = 1.8  # shares of w and z together, from which on none is tried
FARTHER, GAIN = 0.3, 0.03  # shares: how much longer a step is tried to be made, and how much longer it must become
LEAST_PRODUCT, MOST_PRODUCT = 0.3, 5.0  # of w z over the centre
RESIDUAL = 1e-3  # rms of what a step leaves of gradient or balance, in units of sliding and of force
REACHED, ENOUGH, BROKEN = range(3)  # how it ends


class Program(NamedTuple):
    """Minimise cost·f + λ/2 |f − centre|² + ρ/2 |H f − b|² over the Coulomb cones."""

    friction: Array  # (c,)
    cost: Array  # (c, 2) of f_n and f_t
    centre: Array  # (c, 2)
    pull: float  # λ
    price: float  # ρ


class Iterate(NamedTuple):
    """Where the iteration stands, or a step of it."""

    part: Array  # (c, 2) w > 0
    multiplier: Array  # (c, 2) z > 0 of w
    velocity: Array  # (4 n,) v = ρ (H f − b), by nodes


class Room(NamedTuple):
    """What a step needs besides; no number lasts from one step to the next, but for the best parts."""

    gradient: Array  # (c, 2) residual of the gradient
    balance: Array  # (4 n,) H f − b − v/ρ
    excess: Array  # (c, 2) of w z over what the step aims at
    flexibility: Array  # (c, 3) E: 00, 01, 11
    right: Array  # (c, 2) of the contacts' own equations
    blocks: Array  # (k,) I/ρ + H E Hᵀ, then its factor
    where: Ids  # (n,) scratch of the factorisation
    move: Iterate  # the step
    other: Iterate  # one that may be longer
    best: Array  # (c, 2)


@njit(cache=True, nogil=True, error_model="numpy")
def iterate(grains, program, at, room, tolerance, most):  # type: ignore[no-untyped-def]
    """Go on until the mean of w z is below the tolerance and the rms of either residual below RESIDUAL.

    most: number of steps. The best parts are left in `room.best`; gives how it ended, the number of steps, and
    mean of w z and worst rms of the best.
    """
    best_gap, best_residual = np.inf, np.inf
    steps, corrections = 0, min(grains.pattern.start[-1] // (ENTRIES * len(room.where)), MOST_CORRECTIONS)
    while True:
        gap, residual = _measure(grains, program, at, room)
        # Rounding may spoil late iterates: of those that leave no residual the one nearest to the end is kept.
        doubt, least = max(residual, RESIDUAL), max(best_residual, RESIDUAL)
        if doubt < least or (doubt == least and gap < best_gap):
            best_gap, best_residual = gap, residual
            room.best[:] = at.part
        if gap <= tolerance and residual <= RESIDUAL:
            return REACHED, steps, best_gap, best_residual
        if steps == most:
            return ENOUGH, steps, best_gap, best_residual
        _assemble(grains, program, at, room)
        # What is no number is not positive either.
        if not factorize(grains.pattern, room.blocks, room.where, TRIPLE):
            return BROKEN, steps, best_gap, best_residual
        _aim(at, room, 0.0, False)
        primal, dual = _find_step(grains, program, at, room, room.move)
        # What the plain step would leave of w z says how much of it the true one may aim at.
        left = _foresee(at, room.move, primal, dual)
        centre = gap * (left / gap) ** 3
        _aim(at, room, centre, True)
        primal, dual = _find_step(grains, program, at, room, room.move)
        for _ in range(corrections):
            if primal + dual > LONG_ENOUGH:
                break
            recentre(at, room, min(1.0, primal + FARTHER), min(1.0, dual + FARTHER), centre)
            longer_primal, longer_dual = _find_step(grains, program, at, room, room.other)
            if longer_primal + longer_dual < primal + dual + GAIN:
                break
            primal, dual = longer_primal, longer_dual
            _copy(room.other, room.move)
        _advance(at, room.move, LONGEST * primal, LONGEST * dual)
        steps += 1


@njit(cache=True, nogil=True, error_model="numpy")
def _measure(grains, program, at, room):  # type: ignore[no-untyped-def]
    """Residuals into the room; gives the mean of w z and the worse rms of the two residuals."""
    inverse = 1.0 / program.price
    for k in range(len(at.velocity)):
        room.balance[k] = -grains.load[k] - at.velocity[k] * inverse
    gap, gradient, balance = 0.0, 0.0, 0.0
    count = len(at.part)
    for c in range(count):
        mu = program.friction[c]
        w0, w1 = at.part[c, 0], at.part[c, 1]
        fn, ft = w0 + w1, mu * (w1 - w0)
        un = program.cost[c, 0] + program.pull * (fn - program.centre[c, 0])
        ut = program.cost[c, 1] + program.pull * (ft - program.centre[c, 1])
        for q in range(grains.leg_start[c], grains.leg_start[c + 1]):
            x = FILLED * grains.node[q]
            push_node(room.balance, x, grains.leg, q, fn, ft)
            for a in range(ROWS):
                hn, ht = grains.leg[LEG * q + a], grains.leg[LEG * q + FILLED + a]
                un += hn * at.velocity[x + a]
                ut += ht * at.velocity[x + a]
        z0, z1 = at.multiplier[c, 0], at.multiplier[c, 1]
        r0, r1 = un - mu * ut - z0, un + mu * ut - z1
        room.gradient[c, 0], room.gradient[c, 1] = r0, r1
        gap += w0 * z0 + w1 * z1
        gradient += r0 * r0 + r1 * r1
    for k in range(len(at.velocity)):
        balance += room.balance[k] ** 2
    return gap / (2 * count), max(np.sqrt(gradient / (2 * count)), np.sqrt(balance / (ROWS * len(room.where))))


@njit(cache=True, nogil=True, error_model="numpy")
def _assemble(grains, program, at, room):  # type: ignore[no-untyped-def]
    """E = (Λ + D)⁻¹ of every contact, Λ what λ is for w, D = z/w, in closed form; and I/ρ + H E Hᵀ."""
    blocks, start = room.blocks, grains.pattern.start
    for k in range(len(blocks)):
        blocks[k] = 0.0
    for j in range(len(start) - 1):
        for a in range(ROWS):
            blocks[AREA * start[j] + (FILLED + 1) * a] = 1.0 / program.price
    for c in range(len(at.part)):
        mu, square = program.friction[c], program.friction[c] ** 2
        own, mixed = program.pull * (1.0 + square), program.pull * (1.0 - square)
        d0, d1 = at.multiplier[c, 0] / at.part[c, 0], at.multiplier[c, 1] / at.part[c, 1]
        # Sums of what is positive: differences would cancel where one of d is large.
        whole = 1.0 / (d0 * d1 + own * (d0 + d1) + 4.0 * program.pull * program.pull * square)
        room.flexibility[c, 0] = (own + d1) * whole
        room.flexibility[c, 1] = -mixed * whole
        room.flexibility[c, 2] = (own + d0) * whole
        nn, nt = (4.0 * program.pull * square + d0 + d1) * whole, mu * (d0 - d1) * whole
        tt = square * (4.0 * program.pull + d0 + d1) * whole
        e = grains.entry_start[c]
        for p in range(grains.leg_start[c], grains.leg_start[c + 1]):
            for q in range(grains.leg_start[c], p + 1):
                o = AREA * grains.entry[e]
                e += 1
                couple_nodes(blocks, o, grains.leg, p, q, nn, nt, tt)


@njit(cache=True, nogil=True, error_model="numpy")
def _aim(at, room, centre, corrected):  # type: ignore[no-untyped-def]
    """Set by how much w z exceeds the centre; corrected: with what the plain step leaves out of account."""
    move = room.move
    for c in range(len(at.part)):
        for k in range(2):
            excess = at.part[c, k] * at.multiplier[c, k] - centre
            if corrected:
                excess += move.part[c, k] * move.multiplier[c, k]
            room.excess[c, k] = excess


@njit(cache=True, nogil=True, error_model="numpy")
def _find_step(grains, program, at, room, move):  # type: ignore[no-untyped-def]
    """The Newton step to residuals of zero and w z less by the excess; gives the longest shares of w and of z."""
    v = move.velocity
    v[:] = room.balance
    for c in range(len(at.part)):
        mu = program.friction[c]
        r0 = -room.gradient[c, 0] - room.excess[c, 0] / at.part[c, 0]
        r1 = -room.gradient[c, 1] - room.excess[c, 1] / at.part[c, 1]
        e00, e01, e11 = room.flexibility[c, 0], room.flexibility[c, 1], room.flexibility[c, 2]
        w0, w1 = e00 * r0 + e01 * r1, e01 * r0 + e11 * r1
        fn, ft = w0 + w1, mu * (w1 - w0)
        room.right[c, 0], room.right[c, 1] = r0, r1
        for q in range(grains.leg_start[c], grains.leg_start[c + 1]):
            x = FILLED * grains.node[q]
            push_node(v, x, grains.leg, q, fn, ft)
    solve(grains.pattern, room.blocks, v, TRIPLE)
    primal, dual = 1.0, 1.0
    for c in range(len(at.part)):
        un, ut = 0.0, 0.0
        for q in range(grains.leg_start[c], grains.leg_start[c + 1]):
            x = FILLED * grains.node[q]
            for a in range(ROWS):
                un += grains.leg[LEG * q + a] * v[x + a]
                ut += grains.leg[LEG * q + FILLED + a] * v[x + a]
        ut *= program.friction[c]
        r0, r1 = room.right[c, 0] - un + ut, room.right[c, 1] - un - ut
        e00, e01, e11 = room.flexibility[c, 0], room.flexibility[c, 1], room.flexibility[c, 2]
        move.part[c, 0], move.part[c, 1] = e00 * r0 + e01 * r1, e01 * r0 + e11 * r1
        for k in range(2):
            w, z, dw = at.part[c, k], at.multiplier[c, k], move.part[c, k]
            dz = -(room.excess[c, k] + z * dw) / w
            move.multiplier[c, k] = dz
            if w + primal * dw < 0.0:
                primal = -w / dw
            if z + dual * dz < 0.0:
                dual = -z / dz
    return primal, dual


@njit(cache=True, nogil=True, error_model="numpy")
def recentre(at, room, primal, dual, centre):  # type: ignore[no-untyped-def]
    """Aim at other products where a step of these shares would leave w z far from the centre.

    After Gondzio (1996): single contacts whose w or z would vanish long before the others keep every step short.
    """
    move, low, high = room.move, LEAST_PRODUCT * centre, MOST_PRODUCT * centre
    for c in range(len(at.part)):
        for k in range(2):
            w = at.part[c, k] + primal * move.part[c, k]
            left = w * (at.multiplier[c, k] + dual * move.multiplier[c, k])
            if left < low:
                room.excess[c, k] -= low - left
            elif left > high:
                room.excess[c, k] += min(left - high, high)


@njit(cache=True, nogil=True, error_model="numpy")
def _copy(move, to):  # type: ignore[no-untyped-def]
    to.part[:] = move.part
    to.multiplier[:] = move.multiplier
    to.velocity[:] = move.velocity


@njit(cache=True, nogil=True, error_model="numpy")
def _foresee(at, move, primal, dual):  # type: ignore[no-untyped-def]
    """Mean of w z after these shares of a step."""
    total = 0.0
    for c in range(len(at.part)):
        for k in range(2):
            part = at.part[c, k] + primal * move.part[c, k]
            total += part * (at.multiplier[c, k] + dual * move.multiplier[c, k])
    return total / (2 * len(at.part))


@njit(cache=True, nogil=True, error_model="numpy")
def _advance(at, move, primal, dual):  # type: ignore[no-untyped-def]
    for c in range(len(at.part)):
        for k in range(2):
            at.part[c, k] += primal * move.part[c, k]
            at.multiplier[c, k] += dual * move.multiplier[c, k]
    for k in range(len(at.velocity)):
        at.velocity[k] += dual * move.velocity[k]
