"""Kernels of the sweeps and of their residuals.

A state is three arrays: body (n, 4) and plate (w, 2) as in ContactProblem but under the present forces, and
force (p + q, 2) [N] in visiting order.

A group of contacts that share no grain is relaxed in three steps: gather the records of its grains in a small
workspace, one row per quantity; apply the contact law to rows, which the compiler vectorises; scatter the records.
Arrays are read flat, because only then the strides are known to the compiler. Ids are unsigned, because signed indices
are tested for negative values.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ...aligned_memory import aligned_numbers
from ...array_copies import copy_matrix
from ...grain_records import WIDTH, gather_records, scatter_records
from .contact_law import relax_contact
from .measured_groups import (
    BEARING,
    CELL_ROWS,
    CHANGE,
    NORMAL,
    RESIDUAL,
    SIZE,
    SQUARES,
    SUMS,
    THIRD,
    add_force,
    add_forces,
    add_residuals,
    clear_sums,
    contact_residual,
)
from .ordering import GROUP as L

IDS = 2 * L  # ids of a block
ROWS = 4  # rows of a pair block outside a cell; the fifth costs time in every sweep and exists only in a cell
U = np.uint64
U1, U2, U3, U4 = U(1), U(2), U(3), U(4)


@njit(cache=True, nogil=True, error_model="numpy")
def apply_forces(problem, body, plate, force):  # type: ignore[no-untyped-def]
    """Set body and plate to the velocities under these forces."""
    copy_matrix(problem.body, body)
    copy_matrix(problem.plate, plate)
    flat, first = body.reshape(body.size), len(force) - len(problem.wall)
    for c in range(first):
        block, lane = c // L, c % L
        i, j = U(problem.pair_body[block, 0, lane]), U(problem.pair_body[block, 1, lane])
        nx, ny = problem.pair[block, 0, lane], problem.pair[block, 1, lane]
        ci, cj = flat[i + U3], flat[j + U3]
        fx, fy = force[c, 0] * nx - force[c, 1] * ny, force[c, 0] * ny + force[c, 1] * nx
        flat[i] -= ci * fx
        flat[i + U1] -= ci * fy
        flat[i + U2] -= ci * (2.0 * force[c, 1])  # torque −R f_t over ½ Z R², times R
        flat[j] += cj * fx
        flat[j + U1] += cj * fy
        flat[j + U2] -= cj * (2.0 * force[c, 1])
    for c in range(len(problem.wall)):
        i, w = U4 * U(problem.wall_body[c, 0]), problem.wall_body[c, 1]
        _apply_wall_force(problem.wall, c, flat, plate, i, w, force[first + c, 0], force[first + c, 1])


@njit(inline="always")
def _apply_wall_force(wall, c, body, plate, i, w, fn, ft):  # type: ignore[no-untyped-def]
    """Add the effect of a force, or of its change, on grain and plate; the tangent is (−ny, nx)."""
    nx, ny, ci = wall[c, 0], wall[c, 1], body[i + U3]
    body[i] -= ci * (fn * nx - ft * ny)
    body[i + U1] -= ci * (fn * ny + ft * nx)
    body[i + U2] -= ci * (2.0 * ft)
    plate[w, 0] += plate[w, 1] * (wall[c, 6] * fn + wall[c, 7] * ft)


@njit(cache=True, nogil=True, error_model="numpy")
def advance(problem, body, plate, force, sweeps, relaxation):  # type: ignore[no-untyped-def]
    """Advance by a number of Gauss-Seidel sweeps, in place.

    A relaxation of 1 is the paper's scheme. Above 1, the change of a contact's force is extrapolated before projection,
    which selects another solution.
    """
    mu, wall_mu = problem.friction
    pair, ids = problem.pair.reshape(problem.pair.size), problem.pair_body.reshape(problem.pair_body.size)
    flat, flat_force = body.reshape(body.size), force.reshape(force.size)
    first = len(force) - len(problem.wall)
    work = aligned_numbers(8 * L)
    in_cell = problem.pair.shape[1] == CELL_ROWS
    for _ in range(sweeps):
        if in_cell:
            for block in range(problem.grouped // L):
                _relax_group(pair, ids, flat, flat_force, work, block, CELL_ROWS, relaxation, mu)
            for c in range(problem.grouped, first):
                relax_pair(pair, ids, flat, 1, flat_force, c, CELL_ROWS, relaxation, mu)
        else:
            for block in range(problem.grouped // L):
                _relax_group(pair, ids, flat, flat_force, work, block, ROWS, relaxation, mu)
            for c in range(problem.grouped, first):
                relax_pair(pair, ids, flat, 1, flat_force, c, ROWS, relaxation, mu)
        for c in range(len(problem.wall)):
            relax_wall(problem.wall, problem.wall_body, flat, 1, plate, flat_force, first + c, c, relaxation, wall_mu)


@njit(inline="always")
def _relax_group(pair, ids, body, force, work, block, rows, relaxation, mu):  # type: ignore[no-untyped-def]
    p, e, f = block * rows * L, block * IDS, block * IDS
    for k in range(0, L, WIDTH):
        gather_records(body, ids, e + k, work, k, L)
        gather_records(body, ids, e + L + k, work, 4 * L + k, L)
    for k in range(L):
        nx, ny, wn = pair[p + k], pair[p + L + k], relaxation * pair[p + 2 * L + k]
        ax, ay, aw, ci = work[k], work[L + k], work[2 * L + k], work[3 * L + k]
        bx, by, bw, cj = work[4 * L + k], work[5 * L + k], work[6 * L + k], work[7 * L + k]
        dx, dy = bx - ax, by - ay
        un = dx * nx + dy * ny + pair[p + 3 * L + k]
        ut = dy * nx - dx * ny - aw - bw
        if rows == CELL_ROWS:
            ut += pair[p + 4 * L + k]
        fn, ft = force[f + 2 * k], force[f + 2 * k + 1]
        new_n, new_t = relax_contact(fn, ft, un, ut, wn, THIRD * wn, mu)
        force[f + 2 * k] = new_n
        force[f + 2 * k + 1] = new_t
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
def relax_pair(pair, ids, body, records, force, c, rows, relaxation, mu):  # type: ignore[no-untyped-def]
    k = c % L
    p, e = (c // L) * rows * L + k, (c // L) * IDS + k
    i, j = U(records) * U(ids[e]), U(records) * U(ids[e + L])
    nx, ny, wn, ci, cj = pair[p], pair[p + L], relaxation * pair[p + 2 * L], body[i + U3], body[j + U3]
    dx, dy = body[j] - body[i], body[j + U1] - body[i + U1]
    un = dx * nx + dy * ny + pair[p + 3 * L]
    ut = dy * nx - dx * ny - body[i + U2] - body[j + U2]
    if rows == CELL_ROWS:
        ut += pair[p + 4 * L]
    fn, ft = force[2 * c], force[2 * c + 1]
    new_n, new_t = relax_contact(fn, ft, un, ut, wn, THIRD * wn, mu)
    force[2 * c] = new_n
    force[2 * c + 1] = new_t
    dn, dt = new_n - fn, new_t - ft
    fx, fy, torque = dn * nx - dt * ny, dn * ny + dt * nx, 2.0 * dt
    body[i] -= ci * fx
    body[i + U1] -= ci * fy
    body[i + U2] -= ci * torque
    body[j] += cj * fx
    body[j + U1] += cj * fy
    body[j + U2] -= cj * torque


@njit(inline="always")
def relax_wall(wall, wall_body, body, records, plate, force, row, c, relaxation, mu):  # type: ignore[no-untyped-def]
    i, w = U(records) * U4 * U(wall_body[c, 0]), U(wall_body[c, 1])
    nx, ny = wall[c, 0], wall[c, 1]
    un = plate[w, 0] * wall[c, 6] - body[i] * nx - body[i + U1] * ny + wall[c, 4]
    ut = plate[w, 0] * wall[c, 7] + body[i] * ny - body[i + U1] * nx - body[i + U2] + wall[c, 5]
    fn, ft = force[2 * row], force[2 * row + 1]
    new_n, new_t = relax_contact(fn, ft, un, ut, relaxation * wall[c, 2], relaxation * wall[c, 3], mu)
    force[2 * row] = new_n
    force[2 * row + 1] = new_t
    _apply_wall_force(wall, c, body, plate, i, w, new_n - fn, new_t - ft)


@njit(inline="always")
def relative_size(squares, norm):  # type: ignore[no-untyped-def]
    if norm == 0.0:
        return 0.0 if squares == 0.0 else np.inf
    return np.sqrt(squares) / norm


@njit(inline="always")
def wall_residual(wall, wall_body, body, records, plate, force, row, c, mu):  # type: ignore[no-untyped-def]
    i, w = U(records) * U4 * U(wall_body[c, 0]), U(wall_body[c, 1])
    nx, ny = wall[c, 0], wall[c, 1]
    un = plate[w, 0] * wall[c, 6] - (body[i] * nx + body[i + U1] * ny) + wall[c, 4]
    ut = plate[w, 0] * wall[c, 7] + (body[i] * ny - body[i + U1] * nx) - body[i + U2] + wall[c, 5]
    return contact_residual(force[2 * row], force[2 * row + 1], un, ut, wall[c, 2], wall[c, 3], mu)


@njit(cache=True, nogil=True, error_model="numpy")
def measure_state(problem, body, plate, force):  # type: ignore[no-untyped-def]
    """Compute the natural-map residual, and the worst force residual over the mean f_n."""
    _, norm, mean = measure_forces(force, force)
    worst, _ = measure_force_residual(problem, body)
    return measure_natural_map(problem, body, plate, force, norm), worst / mean if mean > 0.0 else 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def measure_forces(force, before):  # type: ignore[no-untyped-def]
    """Compute the greatest relative change, the Euclidean norm [N], and the mean f_n of bearing contacts [N].

    The first is the paper's ε_f = max |Δf| / |f| over contacts; a contact that loses its whole force counts as 1.
    """
    f, old, count = force.reshape(force.size), before.reshape(before.size), len(force)
    sums = aligned_numbers(SUMS)
    clear_sums(sums)
    for block in range(count // WIDTH):
        add_forces(f, 2 * WIDTH * block, old, 2 * WIDTH * block, sums)
    for c in range(count // WIDTH * WIDTH, count):
        add_force(sums, c % WIDTH, f[2 * c], f[2 * c + 1], old[2 * c], old[2 * c + 1])
    return measures_of(sums)


@njit(inline="always")
def measures_of(sums):  # type: ignore[no-untyped-def]
    """The results of `measure_forces` from the sums of all forces."""
    squares, total, bearing, greatest = 0.0, 0.0, 0.0, 0.0
    for k in range(WIDTH):
        squares += sums[SQUARES + k]
        total += sums[NORMAL + k]
        bearing += sums[BEARING + k]
        greatest = max(greatest, sums[CHANGE + k] / sums[SIZE + k])
    return np.sqrt(greatest), np.sqrt(squares), total / max(bearing, 1.0)


@njit(cache=True, nogil=True, error_model="numpy")
def measure_natural_map(problem, body, plate, force, norm):  # type: ignore[no-untyped-def]
    """Compute the natural-map residual ‖f − P(f − D⁻¹ u)‖ / ‖f‖ under the present velocities u; norm: ‖f‖ [N].

    D is the diagonal of the local operators. The residual is zero exactly at a solution.
    """
    mu, wall_mu = problem.friction
    pair, ids = problem.pair.reshape(problem.pair.size), problem.pair_body.reshape(problem.pair_body.size)
    flat, f = body.reshape(body.size), force.reshape(force.size)
    first = len(force) - len(problem.wall)
    sums = aligned_numbers(SUMS)
    clear_sums(sums)
    total = 0.0
    if problem.pair.shape[1] == CELL_ROWS:
        for block in range(problem.grouped // L):
            add_residuals(pair, CELL_ROWS, ids, flat, f, block, mu, sums)
        for c in range(problem.grouped, first):
            total += pair_residual(pair, ids, flat, 1, f, c, CELL_ROWS, mu)
    else:
        for block in range(problem.grouped // L):
            add_residuals(pair, ROWS, ids, flat, f, block, mu, sums)
        for c in range(problem.grouped, first):
            total += pair_residual(pair, ids, flat, 1, f, c, ROWS, mu)
    for k in range(WIDTH):
        total += sums[RESIDUAL + k]
    wall_total = 0.0
    for c in range(len(problem.wall)):
        wall_total += wall_residual(problem.wall, problem.wall_body, flat, 1, plate, f, first + c, c, wall_mu)
    return relative_size(total + wall_total, norm)


@njit(inline="always")
def pair_residual(pair, ids, body, records, force, c, rows, mu):  # type: ignore[no-untyped-def]
    p, e = (c // L) * rows * L + c % L, (c // L) * IDS + c % L
    i, j = U(records) * U(ids[e]), U(records) * U(ids[e + L])
    nx, ny, wn = pair[p], pair[p + L], pair[p + 2 * L]
    dx, dy = body[j] - body[i], body[j + U1] - body[i + U1]
    un = dx * nx + dy * ny + pair[p + 3 * L]
    ut = dy * nx - dx * ny - (body[i + U2] + body[j + U2])
    if rows == CELL_ROWS:
        ut += pair[p + 4 * L]
    return contact_residual(force[2 * c], force[2 * c + 1], un, ut, wn, THIRD * wn, mu)


@njit(cache=True, nogil=True, error_model="numpy")
def measure_force_residual(problem, body):  # type: ignore[no-untyped-def]
    """Compute worst and mean |ΣF| [N] on a grain from the velocity that the forces have added to it."""
    current, free, external = (
        body.reshape(body.size),
        problem.body.reshape(body.size),
        problem.external.reshape(problem.external.size),
    )
    count = len(body)
    work = aligned_numbers(3 * L)  # worst, sum and number of grains, per lane
    work[:] = 0.0
    for block in range((count + L - 1) // L):
        first, second = block * (4 * L), block * (3 * L)
        for k in range(min(L, count - block * L)):
            row, at = first + 4 * k, second + 3 * k
            compliance = current[row + 3]
            present = external[at + 2]
            impedance = present / (compliance if compliance > 0.0 else 1.0)
            x = external[at] + (current[row] - free[row]) * impedance
            y = external[at + 1] + (current[row + 1] - free[row + 1]) * impedance
            size = np.sqrt(x * x + y * y)
            greatest = work[k]
            work[k] = size if size > greatest else greatest
            work[L + k] += size
            work[2 * L + k] += present
    worst, total, grains = 0.0, 0.0, 0.0
    for k in range(L):
        worst = max(worst, work[k])
        total += work[L + k]
        grains += work[2 * L + k]
    return worst, total / max(grains, 1.0)
