"""Sweeps with residuals of every sweep, in little more than one and a half times the time of plain sweeps.

The natural map of a sweep is measured while the next sweep reads the same contacts, with the stored velocities at the
end of the first. Force sums are accumulated as forces change. The forces are bit-identical to those of plain sweeps. A
single measured sweep is measured after it, with the same bits.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ...aligned_memory import aligned_numbers
from ...array_copies import copy_matrix, copy_vector
from ...grain_records import RECORD, WIDTH
from .kernels import (
    CELL_ROWS,
    ROWS,
    advance,
    measure_forces,
    measure_natural_map,
    measures_of,
    pair_residual,
    relative_size,
    relax_pair,
    relax_wall,
    wall_residual,
)
from .measured_groups import (
    RESIDUAL,
    SUMS,
    UNBALANCE,
    add_force,
    add_unbalance,
    add_unbalance_of,
    clear_sums,
    finish_grains,
    relax_and_measure,
)
from .ordering import GROUP as L


@njit(cache=True, nogil=True, error_model="numpy")
def advance_and_measure(problem, body, plate, force, equilibrium, relaxation, residuals):  # type: ignore[no-untyped-def]
    """Advance by one sweep per row of residuals (s, 3) and measure every sweep; equilibrium: of `find_equilibrium`.

    A row holds the greatest relative force change of the sweep, and the natural-map residual and the worst force
    residual over the mean f_n after it.
    """
    mu, wall_mu = problem.friction
    pair, ids, rows = problem.pair.reshape(problem.pair.size), problem.pair_body, problem.pair.shape[1]
    ids = ids.reshape(ids.size)
    flat_force, target = force.reshape(force.size), equilibrium.reshape(equilibrium.size)
    wall, wall_body, first = problem.wall, problem.wall_body, len(force) - len(problem.wall)
    # The present record of every grain is followed by that at the end of the last sweep, in one line of the cache.
    both, previous_plate = aligned_numbers(2 * RECORD * L * len(equilibrium)), plate.copy()
    previous = both[RECORD:]
    _set_both(body, both)
    work, sums = aligned_numbers(2 * RECORD * L), aligned_numbers(SUMS)
    norm = 0.0
    for row in range(len(residuals)):
        clear_sums(sums)
        # Written twice, for compile-time row counts: with a variable row count, the few contacts in no group would take
        # a quarter of a sweep.
        pair_squares, wall_squares = 0.0, 0.0
        if rows == CELL_ROWS:
            for block in range(problem.grouped // L):
                relax_and_measure(pair, CELL_ROWS, ids, both, flat_force, block, relaxation, mu, work, sums)
            for c in range(problem.grouped, first):
                pair_squares += _measure_pair(pair, ids, both, previous, flat_force, sums, c, CELL_ROWS, relaxation, mu)
        else:
            for block in range(problem.grouped // L):
                relax_and_measure(pair, ROWS, ids, both, flat_force, block, relaxation, mu, work, sums)
            for c in range(problem.grouped, first):
                pair_squares += _measure_pair(pair, ids, both, previous, flat_force, sums, c, ROWS, relaxation, mu)
        for c in range(len(wall)):
            at = first + c
            wall_squares += wall_residual(wall, wall_body, previous, 2, previous_plate, flat_force, at, c, wall_mu)
            fn, ft = flat_force[2 * at], flat_force[2 * at + 1]
            relax_wall(wall, wall_body, both, 2, plate, flat_force, at, c, relaxation, wall_mu)
            add_force(sums, at % WIDTH, flat_force[2 * at], flat_force[2 * at + 1], fn, ft)
        for block in range(len(equilibrium)):
            finish_grains(both, target, block, sums)
        copy_matrix(plate, previous_plate)
        if row > 0:
            for k in range(WIDTH):
                pair_squares += sums[RESIDUAL + k]
            residuals[row - 1, 1] = relative_size(pair_squares + wall_squares, norm)
        residuals[row, 0], norm, mean = measures_of(sums)
        residuals[row, 2] = _greatest_unbalance(sums) / mean if mean > 0.0 else 0.0
    for g in range(len(body)):
        for q in range(RECORD):
            body[g, q] = both[2 * RECORD * g + q]
    residuals[-1, 1] = measure_natural_map(problem, body, plate, force, norm)


@njit(inline="always")
def _set_both(body, both):  # type: ignore[no-untyped-def]
    both[:] = 0.0  # a whole number of blocks
    for g in range(len(body)):
        for q in range(RECORD):
            both[2 * RECORD * g + q] = body[g, q]
            both[2 * RECORD * g + RECORD + q] = body[g, q]


@njit(inline="always")
def _greatest_unbalance(sums):  # type: ignore[no-untyped-def]
    worst = 0.0
    for k in range(WIDTH):
        worst = max(worst, sums[UNBALANCE + k])
    return np.sqrt(worst)


@njit(cache=True, nogil=True, error_model="numpy")
def greatest_force_residual(equilibrium, body):  # type: ignore[no-untyped-def]
    """Compute the worst |ΣF| [N] on a grain from the distance of its velocity to the equilibrium velocity."""
    flat, target, sums = body.reshape(body.size), equilibrium.reshape(equilibrium.size), aligned_numbers(SUMS)
    clear_sums(sums)
    for block in range(len(body) // L):
        add_unbalance(flat, target, block, sums)
    for g in range(len(body) // L * L, len(body)):
        add_unbalance_of(flat, 1, target, g, sums)
    return _greatest_unbalance(sums)


@njit(cache=True, nogil=True, error_model="numpy")
def advance_and_sample(problem, body, plate, force, equilibrium, relaxation, residuals, spacing):  # type: ignore[no-untyped-def]
    """Advance by one sweep per row of residuals (s, 3), measure one in `spacing` and the last; NaN in other rows."""
    done, before = 0, np.empty_like(force)
    flat, flat_before = force.reshape(force.size), before.reshape(before.size)
    while done < len(residuals):
        last = min(done + spacing, len(residuals)) - 1
        residuals[done:last] = np.nan
        advance(problem, body, plate, force, last - done, relaxation)
        copy_vector(flat, flat_before)
        advance(problem, body, plate, force, 1, relaxation)
        residuals[last, 0], norm, mean = measure_forces(force, before)
        residuals[last, 1] = measure_natural_map(problem, body, plate, force, norm)
        residuals[last, 2] = greatest_force_residual(equilibrium, body) / mean if mean > 0.0 else 0.0
        done = last + 1


@njit(inline="always")
def _measure_pair(pair, ids, body, previous, force, sums, c, rows, relaxation, mu):  # type: ignore[no-untyped-def]
    squares = pair_residual(pair, ids, previous, 2, force, c, rows, mu)
    fn, ft = force[2 * c], force[2 * c + 1]
    relax_pair(pair, ids, body, 2, force, c, rows, relaxation, mu)
    add_force(sums, c % WIDTH, force[2 * c], force[2 * c + 1], fn, ft)
    return squares


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
        equilibrium[g // L, 2, g % L] = 1.0 / compliance if problem.external[g, 2] > 0.0 else 0.0
