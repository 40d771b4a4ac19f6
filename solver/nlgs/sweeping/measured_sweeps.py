"""Sweeps with residuals of every sweep, in little more than twice the time of plain sweeps.

The natural map of a sweep is measured while the next sweep reads the same contacts, with the stored velocities at the
end of the first. Force sums are accumulated as forces change. The forces are bit-identical to those of plain sweeps.
The relaxation of a group is repeated here from `kernels`: as a function that both inline, it is no longer vectorised
and either kernel takes twice as long.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ...array_copies import copy_matrix, copy_vector
from .contact_law import relax_contact
from .grain_records import (
    RECORD,
    WIDTH,
    gather_differences,
    gather_records,
    scatter_records,
    transpose_records,
)
from .kernels import (
    CELL_ROWS,
    IDS,
    ROWS,
    THIRD,
    advance,
    contact_residual,
    measure_natural_map,
    pair_residual,
    relative_size,
    relax_pair,
    relax_wall,
    wall_residual,
    workspace,
)
from .ordering import GROUP as L

# Offsets in the workspace: records of the grains, their differences before the sweep, and sums per lane.
DIFFERENCES, RESIDUAL, SQUARES, NORMAL, BEARING, CHANGE, SIZE, WORKSPACE = (
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
def advance_and_measure(problem, body, plate, force, equilibrium, relaxation, residuals):  # type: ignore[no-untyped-def]
    """Advance by one sweep per row of residuals (s, 3) and measure every sweep; equilibrium: of `find_equilibrium`.

    A row holds the greatest relative force change of the sweep, and the natural-map residual and the worst force
    residual over the mean f_n after it.
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
    previous, previous_plate = body.copy(), plate.copy()
    flat_previous = previous.reshape(previous.size)
    work = workspace(WORKSPACE)
    norm = 0.0
    for row in range(len(residuals)):
        work[RESIDUAL:SIZE] = 0.0
        work[SIZE:] = 1.0
        # Written twice, for compile-time row counts: with a variable row count, the few contacts in no group would take
        # a quarter of a sweep.
        pair_squares, wall_squares = 0.0, 0.0
        if rows == CELL_ROWS:
            for block in range(problem.grouped // L):
                _relax_and_measure_group(
                    pair, ids, flat, flat_previous, flat_force, work, block, CELL_ROWS, relaxation, mu
                )
            for c in range(problem.grouped, first):
                pair_squares += _measure_pair(
                    pair, ids, flat, flat_previous, flat_force, work, c, CELL_ROWS, relaxation, mu
                )
        else:
            for block in range(problem.grouped // L):
                _relax_and_measure_group(pair, ids, flat, flat_previous, flat_force, work, block, ROWS, relaxation, mu)
            for c in range(problem.grouped, first):
                pair_squares += _measure_pair(pair, ids, flat, flat_previous, flat_force, work, c, ROWS, relaxation, mu)
        for c in range(len(wall)):
            at = first + c
            wall_squares += wall_residual(wall, wall_body, flat_previous, previous_plate, flat_force, at, c, wall_mu)
            fn, ft = flat_force[2 * at], flat_force[2 * at + 1]
            relax_wall(wall, wall_body, flat, plate, flat_force, at, c, relaxation, wall_mu)
            _accumulate_force(work, c % L, flat_force[2 * at], flat_force[2 * at + 1], fn, ft)
        if row > 0:
            for k in range(L):
                pair_squares += work[RESIDUAL + k]
            residuals[row - 1, 1] = relative_size(pair_squares + wall_squares, norm)
        squares, total, bearing, greatest = 0.0, 0.0, 0.0, 0.0
        for k in range(L):
            squares += work[SQUARES + k]
            total += work[NORMAL + k]
            bearing += work[BEARING + k]
            greatest = max(greatest, work[CHANGE + k] / work[SIZE + k])
        norm, mean = np.sqrt(squares), total / max(bearing, 1.0)
        residuals[row, 0] = np.sqrt(greatest)
        residuals[row, 2] = greatest_force_residual(equilibrium, body) / mean if mean > 0.0 else 0.0
        copy_vector(flat, flat_previous)
        copy_matrix(plate, previous_plate)
    residuals[-1, 1] = measure_natural_map(problem, body, plate, force, norm)


@njit(cache=True, nogil=True, error_model="numpy")
def advance_and_sample(problem, body, plate, force, equilibrium, relaxation, residuals, spacing):  # type: ignore[no-untyped-def]
    """Advance by one sweep per row of residuals (s, 3), measure one in `spacing` and the last; NaN in other rows."""
    done = 0
    while done < len(residuals):
        last = min(done + spacing, len(residuals)) - 1
        residuals[done:last] = np.nan
        advance(problem, body, plate, force, last - done, relaxation)
        advance_and_measure(problem, body, plate, force, equilibrium, relaxation, residuals[last : last + 1])
        done = last + 1


@njit(inline="always")
def _measure_pair(pair, ids, body, previous, force, work, c, rows, relaxation, mu):  # type: ignore[no-untyped-def]
    pair_squares = pair_residual(pair, ids, previous, force, c, rows, mu)
    fn, ft = force[2 * c], force[2 * c + 1]
    relax_pair(pair, ids, body, force, c, rows, relaxation, mu)
    _accumulate_force(work, c % L, force[2 * c], force[2 * c + 1], fn, ft)
    return pair_squares


@njit(inline="always")
def _relax_and_measure_group(pair, ids, body, previous, force, work, block, rows, relaxation, mu):  # type: ignore[no-untyped-def]
    p, e = block * rows * L, block * IDS
    for k in range(0, L, WIDTH):
        gather_differences(previous, ids, e + k, e + L + k, work, DIFFERENCES + k, L)
        gather_records(body, ids, e + k, work, k, L)
        gather_records(body, ids, e + L + k, work, 4 * L + k, L)
    for k in range(L):
        nx, ny, inverse_wnn = pair[p + k], pair[p + L + k], pair[p + 2 * L + k]
        fn, ft = force[e + 2 * k], force[e + 2 * k + 1]
        dx, dy = work[DIFFERENCES + k], work[DIFFERENCES + L + k]
        un = dx * nx + dy * ny + pair[p + 3 * L + k]
        ut = dy * nx - dx * ny - work[DIFFERENCES + 2 * L + k]
        if rows == CELL_ROWS:
            ut += pair[p + 4 * L + k]
        work[RESIDUAL + k] += contact_residual(fn, ft, un, ut, inverse_wnn, THIRD * inverse_wnn, mu)
        wn = relaxation * inverse_wnn
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
        _accumulate_force(work, k, new_n, new_t, fn, ft)
        dn, dt = new_n - fn, new_t - ft
        fx, fy, torque = dn * nx - dt * ny, dn * ny + dt * nx, 2.0 * dt
        work[k] = ax - ci * fx
        work[L + k] = ay - ci * fy
        work[2 * L + k] = aw - ci * torque
        work[4 * L + k] = bx + cj * fx
        work[5 * L + k] = by + cj * fy
        work[6 * L + k] = bw - cj * torque
    for k in range(0, L, WIDTH):
        scatter_records(work, k, L, body, ids, e + k)
        scatter_records(work, 4 * L + k, L, body, ids, e + L + k)


@njit(inline="always")
def _accumulate_force(work, k, fn, ft, old_n, old_t):  # type: ignore[no-untyped-def]
    """Add a force to the sums of a lane: squares, f_n, bearing, and the greatest change as a fraction."""
    size = fn * fn + ft * ft
    work[SQUARES + k] += size
    work[NORMAL + k] += fn
    work[BEARING + k] += 1.0 if fn > 0.0 else 0.0
    # Fractions are compared without division: a/b > c/d where a d > c b.
    change = (fn - old_n) * (fn - old_n) + (ft - old_t) * (ft - old_t)
    size = size if size > 0.0 else change
    top, bottom = work[CHANGE + k], work[SIZE + k]
    greater = change * bottom > top * size
    work[CHANGE + k] = change if greater else top
    work[SIZE + k] = size if greater else bottom


def equilibrium_shape(count: int) -> tuple[int, int, int]:
    """Shape of the array of `find_equilibrium` for this number of grains."""
    return count // L + 1, 3, L


@njit(cache=True, nogil=True, error_model="numpy")
def find_equilibrium(problem, equilibrium):  # type: ignore[no-untyped-def]
    """Set blocks of L grains (blocks, 3, L): equilibrium velocity vx, vy [m/s] and impedance [N s/m].

    At its equilibrium velocity, the force residual of a grain is zero. The impedance is 0 for grains that forces do not
    move.
    """
    equilibrium[:] = 0.0
    for g in range(len(problem.body)):
        compliance = problem.body[g, 3]
        equilibrium[g // L, 0, g % L] = problem.body[g, 0] - problem.external[g, 0] * compliance
        equilibrium[g // L, 1, g % L] = problem.body[g, 1] - problem.external[g, 1] * compliance
        equilibrium[g // L, 2, g % L] = 1.0 / compliance if compliance > 0.0 else 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def greatest_force_residual(equilibrium, body):  # type: ignore[no-untyped-def]
    """Compute the worst |ΣF| [N] on a grain from the distance of its velocity to the equilibrium velocity."""
    current, target, full = body.reshape(body.size), equilibrium.reshape(equilibrium.size), len(body) // L
    work = workspace(5 * L)
    work[4 * L :] = 0.0
    for block in range(full):
        first, r = block * RECORD * L, block * 3 * L
        for k in range(0, L, WIDTH):
            transpose_records(current, first + RECORD * k, work, k, L)
        for k in range(L):
            x, y, impedance = work[k] - target[r + k], work[L + k] - target[r + L + k], target[r + 2 * L + k]
            size, greatest = (x * x + y * y) * (impedance * impedance), work[4 * L + k]
            work[4 * L + k] = size if size > greatest else greatest
    worst = 0.0
    for k in range(L):
        worst = max(worst, work[4 * L + k])
    for g in range(full * L, len(body)):
        x, y, impedance = (
            body[g, 0] - equilibrium[full, 0, g % L],
            body[g, 1] - equilibrium[full, 1, g % L],
            equilibrium[full, 2, g % L],
        )
        worst = max(worst, (x * x + y * y) * (impedance * impedance))
    return np.sqrt(worst)
