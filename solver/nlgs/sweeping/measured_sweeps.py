"""Sweeps of which every one is measured, in little more than twice the time of silent ones.

The natural map of a sweep is measured while the next one reads the same contacts: the velocities that the sweep ended
with are kept for it. What the forces did is counted as they change. The forces are the bits of silent sweeps. The
relaxation of a group is written out here as it is in `kernels`: as a function that both inline it is no longer turned
into vector instructions, and either takes twice as long.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from solver.nlgs.sweeping.contact_law import relax_contact
from solver.nlgs.sweeping.grain_records import (
    RECORD,
    WIDTH,
    gather_differences,
    gather_records,
    scatter_records,
    transpose_records,
)
from solver.nlgs.sweeping.kernels import (
    CELL_ROWS,
    IDS,
    ROWS,
    THIRD,
    measure_natural_map,
    miss_of,
    miss_of_pair,
    miss_of_wall,
    relative_size,
    relax_pair,
    relax_wall,
    workspace,
)
from solver.nlgs.sweeping.ordering import GROUP as L

# Where in the workspace: records of the grains, what they differed by before the sweep, and sums, one of each per lane.
DIFFERENCES, MISS, SQUARES, NORMAL, BEARING, CHANGE, SIZE, WORKSPACE = (
    8 * L,
    11 * L,
    12 * L,
    13 * L,
    14 * L,
    15 * L,
    16 * L,
    17 * L,
)


@njit(cache=True, nogil=True, error_model="numpy")
def advance_and_measure(problem, body, plate, force, rest, relaxation, residuals):  # type: ignore[no-untyped-def]
    """Advance by as many sweeps as residuals has rows (s, 3), and measure every one; rest: of find_rest.

    A row holds the greatest force change, the natural-map residual and the worst unbalance over the mean f_n after
    that sweep.
    """
    mu, wall_mu = problem.friction
    pair, ids, rows = problem.pair.reshape(problem.pair.size), problem.pair_body, problem.pair.shape[1]
    ids = ids.reshape(ids.size)
    flat, flat_force, wall, wall_body = (
        body.reshape(body.size),
        force.reshape(force.size),
        problem.wall,
        problem.wall_body,
    )
    first = len(force) - len(wall)
    was, was_plate = body.copy(), plate.copy()
    flat_was = was.reshape(was.size)
    work = workspace(WORKSPACE)
    norm = 0.0
    for row in range(len(residuals)):
        work[MISS:SIZE] = 0.0
        work[SIZE:] = 1.0
        # Written twice, for numbers that are known when it is compiled: of a row's length in a variable alone, those
        # few contacts that are in no group would take a quarter of a sweep.
        miss, wall_miss = 0.0, 0.0
        if rows == CELL_ROWS:
            for block in range(problem.grouped // L):
                _relax_and_measure_group(pair, ids, flat, flat_was, flat_force, work, block, CELL_ROWS, relaxation, mu)
            for c in range(problem.grouped, first):
                miss += _measure_pair(pair, ids, flat, flat_was, flat_force, work, c, CELL_ROWS, relaxation, mu)
        else:
            for block in range(problem.grouped // L):
                _relax_and_measure_group(pair, ids, flat, flat_was, flat_force, work, block, ROWS, relaxation, mu)
            for c in range(problem.grouped, first):
                miss += _measure_pair(pair, ids, flat, flat_was, flat_force, work, c, ROWS, relaxation, mu)
        for c in range(len(wall)):
            at = first + c
            wall_miss += miss_of_wall(wall, wall_body, flat_was, was_plate, flat_force, at, c, wall_mu)
            fn, ft = flat_force[2 * at], flat_force[2 * at + 1]
            relax_wall(wall, wall_body, flat, plate, flat_force, at, c, relaxation, wall_mu)
            _count_force(work, c % L, flat_force[2 * at], flat_force[2 * at + 1], fn, ft)
        if row > 0:
            for k in range(L):
                miss += work[MISS + k]
            residuals[row - 1, 1] = relative_size(miss + wall_miss, norm)
        squares, total, bearing, greatest = 0.0, 0.0, 0.0, 0.0
        for k in range(L):
            squares += work[SQUARES + k]
            total += work[NORMAL + k]
            bearing += work[BEARING + k]
            greatest = max(greatest, work[CHANGE + k] / work[SIZE + k])
        norm, mean = np.sqrt(squares), total / max(bearing, 1.0)
        residuals[row, 0] = np.sqrt(greatest)
        residuals[row, 2] = worst_unbalance(rest, body) / mean if mean > 0.0 else 0.0
        flat_was[:] = flat
        was_plate[:] = plate
    residuals[-1, 1] = measure_natural_map(problem, body, plate, force, norm)


@njit(inline="always")
def _measure_pair(pair, ids, body, was, force, work, c, rows, relaxation, mu):  # type: ignore[no-untyped-def]
    miss = miss_of_pair(pair, ids, was, force, c, rows, mu)
    fn, ft = force[2 * c], force[2 * c + 1]
    relax_pair(pair, ids, body, force, c, rows, relaxation, mu)
    _count_force(work, c % L, force[2 * c], force[2 * c + 1], fn, ft)
    return miss


@njit(inline="always")
def _relax_and_measure_group(pair, ids, body, was, force, work, block, rows, relaxation, mu):  # type: ignore[no-untyped-def]
    p, e = block * rows * L, block * IDS
    for k in range(0, L, WIDTH):
        gather_differences(was, ids, e + k, e + L + k, work, DIFFERENCES + k, L)
        gather_records(body, ids, e + k, work, k, L)
        gather_records(body, ids, e + L + k, work, 4 * L + k, L)
    for k in range(L):
        nx, ny, once = pair[p + k], pair[p + L + k], pair[p + 2 * L + k]
        fn, ft = force[e + 2 * k], force[e + 2 * k + 1]
        dx, dy = work[DIFFERENCES + k], work[DIFFERENCES + L + k]
        un = dx * nx + dy * ny + pair[p + 3 * L + k]
        ut = dy * nx - dx * ny - work[DIFFERENCES + 2 * L + k]
        if rows == CELL_ROWS:
            ut += pair[p + 4 * L + k]
        work[MISS + k] += miss_of(fn, ft, un, ut, once, THIRD * once, mu)
        wn = relaxation * once
        ax, ay, aw, ci = work[k], work[L + k], work[2 * L + k], work[3 * L + k]
        bx, by, bw, cj = work[4 * L + k], work[5 * L + k], work[6 * L + k], work[7 * L + k]
        dx, dy = bx - ax, by - ay
        un = dx * nx + dy * ny + pair[p + 3 * L + k]
        ut = dy * nx - dx * ny - aw - bw
        if rows == CELL_ROWS:
            ut += pair[p + 4 * L + k]
        new_n, new_t = relax_contact(fn, ft, un, ut, wn, THIRD * wn, mu)
        force[e + 2 * k] = new_n
        force[e + 2 * k + 1] = new_t
        _count_force(work, k, new_n, new_t, fn, ft)
        dn, dt = new_n - fn, new_t - ft
        fx, fy, turn = dn * nx - dt * ny, dn * ny + dt * nx, 2.0 * dt
        work[k] = ax - ci * fx
        work[L + k] = ay - ci * fy
        work[2 * L + k] = aw - ci * turn
        work[4 * L + k] = bx + cj * fx
        work[5 * L + k] = by + cj * fy
        work[6 * L + k] = bw - cj * turn
    for k in range(0, L, WIDTH):
        scatter_records(work, k, L, body, ids, e + k)
        scatter_records(work, 4 * L + k, L, body, ids, e + L + k)


@njit(inline="always")
def _count_force(work, k, fn, ft, old_n, old_t):  # type: ignore[no-untyped-def]
    """Add a force to the sums of a lane: squares, f_n, bearing, and the greatest change as a fraction."""
    size = fn * fn + ft * ft
    work[SQUARES + k] += size
    work[NORMAL + k] += fn
    work[BEARING + k] += 1.0 if fn > 0.0 else 0.0
    # The greatest of fractions is found without dividing: a/b > c/d where a d > c b.
    change = (fn - old_n) * (fn - old_n) + (ft - old_t) * (ft - old_t)
    size = size if size > 0.0 else change
    top, bottom = work[CHANGE + k], work[SIZE + k]
    greater = change * bottom > top * size
    work[CHANGE + k] = change if greater else top
    work[SIZE + k] = size if greater else bottom


def rest_shape(count: int) -> tuple[int, int, int]:
    """Shape of what find_rest fills, for so many grains."""
    return count // L + 1, 3, L


@njit(cache=True, nogil=True, error_model="numpy")
def find_rest(problem, rest):  # type: ignore[no-untyped-def]
    """Blocks of L grains (blocks, 3, L): the velocity at which each is in balance, vx, vy [m/s], and its impedance.

    The impedance [N s/m] is 0 where nothing moves the grain.
    """
    rest[:] = 0.0
    for g in range(len(problem.body)):
        compliance = problem.body[g, 3]
        rest[g // L, 0, g % L] = problem.body[g, 0] - problem.external[g, 0] * compliance
        rest[g // L, 1, g % L] = problem.body[g, 1] - problem.external[g, 1] * compliance
        rest[g // L, 2, g % L] = 1.0 / compliance if compliance > 0.0 else 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def worst_unbalance(rest, body):  # type: ignore[no-untyped-def]
    """Worst |ΣF| [N] on a grain, from what the forces have added to its velocity."""
    now, still, full = body.reshape(body.size), rest.reshape(rest.size), len(body) // L
    work = workspace(5 * L)
    work[4 * L :] = 0.0
    for block in range(full):
        first, r = block * RECORD * L, block * 3 * L
        for k in range(0, L, WIDTH):
            transpose_records(now, first + RECORD * k, work, k, L)
        for k in range(L):
            x, y, impedance = work[k] - still[r + k], work[L + k] - still[r + L + k], still[r + 2 * L + k]
            size, greatest = (x * x + y * y) * (impedance * impedance), work[4 * L + k]
            work[4 * L + k] = size if size > greatest else greatest
    worst = 0.0
    for k in range(L):
        worst = max(worst, work[4 * L + k])
    for g in range(full * L, len(body)):
        x, y, impedance = body[g, 0] - rest[full, 0, g % L], body[g, 1] - rest[full, 1, g % L], rest[full, 2, g % L]
        worst = max(worst, (x * x + y * y) * (impedance * impedance))
    return np.sqrt(worst)
