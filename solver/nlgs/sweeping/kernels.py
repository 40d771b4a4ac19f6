"""The loop over contacts and nothing else.

A state is three arrays: body (n, 4), plate (w, 2) as in ContactProblem but under the present forces, and
force (p + q, 2) [N] in visiting order.

A group of contacts that share no grain is worked on in three steps: the records of its grains into a small
workspace, one row per quantity; the law on rows, which the compiler turns into vector instructions; the records back.
Arrays are read flat, since the compiler knows the strides of those alone, and ids as unsigned numbers, since
a signed index is first looked at for being negative.
"""

# ruff: noqa: E501
from __future__ import annotations

import numpy as np
from numba import njit

from solver.nlgs.sweeping.contact_law import relax_contact
from solver.nlgs.sweeping.grain_records import WIDTH, gather_differences, gather_records, scatter_records
from solver.nlgs.sweeping.ordering import GROUP as L

THIRD = 1.0 / 3.0  # W_nn over W_tt between two solid rods
IDS = 2 * L  # numbers in a block
ROWS, CELL_ROWS = 4, 5  # of numbers on pairs; the fifth, which every sweep would wait for, is there in a cell alone
U = np.uint64
U1, U2, U3, U4 = U(1), U(2), U(3), U(4)


@njit(cache=True, nogil=True, error_model="numpy")
def apply_forces(problem, body, plate, force):  # type: ignore[no-untyped-def]
    """Set body and plate to the velocities under the given forces."""
    body[:] = problem.body
    plate[:] = problem.plate
    first = len(force) - len(problem.wall)
    for c in range(first):
        block, lane = c // L, c % L
        i, j = problem.pair_body[block, 0, lane], problem.pair_body[block, 1, lane]
        nx, ny = problem.pair[block, 0, lane], problem.pair[block, 1, lane]
        ci, cj = body[i, 3], body[j, 3]
        fx, fy = force[c, 0] * nx - force[c, 1] * ny, force[c, 0] * ny + force[c, 1] * nx
        body[i, 0] -= ci * fx
        body[i, 1] -= ci * fy
        body[i, 2] -= ci * (2.0 * force[c, 1])  # torque −R f_t over ½ Z R², times R
        body[j, 0] += cj * fx
        body[j, 1] += cj * fy
        body[j, 2] -= cj * (2.0 * force[c, 1])
    flat = body.reshape(body.size)
    for c in range(len(problem.wall)):
        i, w = U4 * U(problem.wall_body[c, 0]), problem.wall_body[c, 1]
        _push_from_wall(
            flat, plate, i, w, problem.wall[c, 0], problem.wall[c, 1], force[first + c, 0], force[first + c, 1]
        )


@njit(inline="always")
def _push_from_wall(body, plate, i, w, nx, ny, fn, ft):  # type: ignore[no-untyped-def]
    """Add the action of a force (or of its change) on grain and plate; the tangent is (−ny, nx)."""
    ci = body[i + U3]
    body[i] -= ci * (fn * nx - ft * ny)
    body[i + U1] -= ci * (fn * ny + ft * nx)
    body[i + U2] -= ci * (2.0 * ft)
    plate[w, 0] += plate[w, 1] * fn


@njit(cache=True, nogil=True, error_model="numpy")
def advance(problem, body, plate, force, sweeps, relaxation):  # type: ignore[no-untyped-def]
    """Advance by a number of Gauss-Seidel sweeps, in place.

    relaxation 1 is the paper's scheme; above it, the change of a contact's force is extrapolated before it is
    projected, which selects another solution.
    """
    mu, wall_mu = problem.friction
    pair, ids = problem.pair.reshape(problem.pair.size), problem.pair_body.reshape(problem.pair_body.size)
    flat, flat_force = body.reshape(body.size), force.reshape(force.size)
    first = len(force) - len(problem.wall)
    work = workspace(8 * L)
    in_cell = problem.pair.shape[1] == CELL_ROWS
    for _ in range(sweeps):
        if in_cell:
            for block in range(problem.grouped // L):
                _relax_group(pair, ids, flat, flat_force, work, block, CELL_ROWS, relaxation, mu)
            for c in range(problem.grouped, first):
                relax_pair(pair, ids, flat, flat_force, c, CELL_ROWS, relaxation, mu)
        else:
            for block in range(problem.grouped // L):
                _relax_group(pair, ids, flat, flat_force, work, block, ROWS, relaxation, mu)
            for c in range(problem.grouped, first):
                relax_pair(pair, ids, flat, flat_force, c, ROWS, relaxation, mu)
        for c in range(len(problem.wall)):
            relax_wall(problem.wall, problem.wall_body, flat, plate, flat_force, first + c, c, relaxation, wall_mu)


@njit(inline="always")
def workspace(size):  # type: ignore[no-untyped-def]
    """Room for `size` numbers on the bounds of a cache line: made here, so that the compiler knows it overlaps nothing."""
    room = np.empty(size + 8)
    start = (-(room.ctypes.data >> 3)) & 7
    return room[start : start + size]


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
def relax_pair(pair, ids, body, force, c, rows, relaxation, mu):  # type: ignore[no-untyped-def]
    k = c % L
    p, e = (c // L) * rows * L + k, (c // L) * IDS + k
    i, j = U4 * U(ids[e]), U4 * U(ids[e + L])
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
    fx, fy, turn = dn * nx - dt * ny, dn * ny + dt * nx, 2.0 * dt
    body[i] -= ci * fx
    body[i + U1] -= ci * fy
    body[i + U2] -= ci * turn
    body[j] += cj * fx
    body[j + U1] += cj * fy
    body[j + U2] -= cj * turn


@njit(inline="always")
def relax_wall(wall, wall_body, body, plate, force, row, c, relaxation, mu):  # type: ignore[no-untyped-def]
    i, w = U4 * U(wall_body[c, 0]), U(wall_body[c, 1])
    nx, ny = wall[c, 0], wall[c, 1]
    un = plate[w, 0] - body[i] * nx - body[i + U1] * ny + wall[c, 4]
    ut = body[i] * ny - body[i + U1] * nx - body[i + U2] + wall[c, 5]
    fn, ft = force[2 * row], force[2 * row + 1]
    new_n, new_t = relax_contact(fn, ft, un, ut, relaxation * wall[c, 2], relaxation * wall[c, 3], mu)
    force[2 * row] = new_n
    force[2 * row + 1] = new_t
    _push_from_wall(body, plate, i, w, nx, ny, new_n - fn, new_t - ft)


@njit(inline="always")
def relative_size(squares, norm):  # type: ignore[no-untyped-def]
    if norm == 0.0:
        return 0.0 if squares == 0.0 else np.inf
    return np.sqrt(squares) / norm


@njit(inline="always")
def miss_of_wall(wall, wall_body, body, plate, force, row, c, mu):  # type: ignore[no-untyped-def]
    i, w = U4 * U(wall_body[c, 0]), U(wall_body[c, 1])
    nx, ny = wall[c, 0], wall[c, 1]
    un = plate[w, 0] - (body[i] * nx + body[i + U1] * ny) + wall[c, 4]
    ut = (body[i] * ny - body[i + U1] * nx) - body[i + U2] + wall[c, 5]
    return miss_of(force[2 * row], force[2 * row + 1], un, ut, wall[c, 2], wall[c, 3], mu)


@njit(cache=True, nogil=True, error_model="numpy")
def measure_state(problem, body, plate, force):  # type: ignore[no-untyped-def]
    """Natural-map residual, and the worst unbalance over the mean f_n."""
    _, norm, mean = measure_forces(force, force)
    worst, _ = measure_unbalance(problem, body)
    return measure_natural_map(problem, body, plate, force, norm), worst / mean if mean > 0.0 else 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def measure_forces(force, before):  # type: ignore[no-untyped-def]
    """Greatest relative change, Euclidean norm [N], and mean f_n of bearing contacts [N].

    The first is the paper's ε_f, the greatest |Δf| / |f| over contacts, where a contact that loses its whole force
    counts as 1.
    """
    f, old, count = force.reshape(force.size), before.reshape(before.size), len(force)
    work = workspace(5 * L)  # squares, f_n, bearing, and the greatest change as a fraction: one of each per lane
    work[: 4 * L] = 0.0
    work[4 * L :] = 1.0
    for block in range((count + L - 1) // L):
        first = block * IDS
        for k in range(min(L, count - block * L)):
            c = first + 2 * k
            fn, ft = f[c], f[c + 1]
            size = fn * fn + ft * ft
            work[k] += size
            work[L + k] += fn
            work[2 * L + k] += 1.0 if fn > 0.0 else 0.0
            # The greatest of fractions is found without dividing: a/b > c/d where a d > c b.
            change = (fn - old[c]) * (fn - old[c]) + (ft - old[c + 1]) * (ft - old[c + 1])
            size = size if size > 0.0 else change
            top, bottom = work[3 * L + k], work[4 * L + k]
            greater = change * bottom > top * size
            work[3 * L + k] = change if greater else top
            work[4 * L + k] = size if greater else bottom
    squares, total, bearing, greatest = 0.0, 0.0, 0.0, 0.0
    for k in range(L):
        squares += work[k]
        total += work[L + k]
        bearing += work[2 * L + k]
        greatest = max(greatest, work[3 * L + k] / work[4 * L + k])
    return np.sqrt(greatest), np.sqrt(squares), total / max(bearing, 1.0)


@njit(cache=True, nogil=True, error_model="numpy")
def measure_natural_map(problem, body, plate, force, norm):  # type: ignore[no-untyped-def]
    """‖f − P(f − D⁻¹ u)‖ / ‖f‖ under the present velocities u, zero exactly at a solution; norm: ‖f‖ [N].

    D is the diagonal of the local operators.
    """
    mu, wall_mu = problem.friction
    pair, ids = problem.pair.reshape(problem.pair.size), problem.pair_body.reshape(problem.pair_body.size)
    flat, f = body.reshape(body.size), force.reshape(force.size)
    first = len(force) - len(problem.wall)
    work = workspace(4 * L)  # differences of the grains' records, and the sum of squares per lane
    work[3 * L :] = 0.0
    total = 0.0
    if problem.pair.shape[1] == CELL_ROWS:
        for block in range(problem.grouped // L):
            _miss_group(pair, ids, flat, f, work, block, CELL_ROWS, mu)
        for c in range(problem.grouped, first):
            total += miss_of_pair(pair, ids, flat, f, c, CELL_ROWS, mu)
    else:
        for block in range(problem.grouped // L):
            _miss_group(pair, ids, flat, f, work, block, ROWS, mu)
        for c in range(problem.grouped, first):
            total += miss_of_pair(pair, ids, flat, f, c, ROWS, mu)
    for k in range(L):
        total += work[3 * L + k]
    wall_total = 0.0
    for c in range(len(problem.wall)):
        wall_total += miss_of_wall(problem.wall, problem.wall_body, flat, plate, f, first + c, c, wall_mu)
    return relative_size(total + wall_total, norm)


@njit(inline="always")
def _miss_group(pair, ids, body, force, work, block, rows, mu):  # type: ignore[no-untyped-def]
    """Add a group's squares to those of its lanes."""
    p, e = block * rows * L, block * IDS
    for k in range(0, L, WIDTH):
        gather_differences(body, ids, e + k, e + L + k, work, k, L)
    for k in range(L):
        nx, ny, wn, dx, dy = pair[p + k], pair[p + L + k], pair[p + 2 * L + k], work[k], work[L + k]
        un = dx * nx + dy * ny + pair[p + 3 * L + k]
        ut = dy * nx - dx * ny - work[2 * L + k]
        if rows == CELL_ROWS:
            ut += pair[p + 4 * L + k]
        work[3 * L + k] += miss_of(force[e + 2 * k], force[e + 2 * k + 1], un, ut, wn, THIRD * wn, mu)


@njit(inline="always")
def miss_of_pair(pair, ids, body, force, c, rows, mu):  # type: ignore[no-untyped-def]
    p, e = (c // L) * rows * L + c % L, (c // L) * IDS + c % L
    i, j = U4 * U(ids[e]), U4 * U(ids[e + L])
    nx, ny, wn = pair[p], pair[p + L], pair[p + 2 * L]
    dx, dy = body[j] - body[i], body[j + U1] - body[i + U1]
    un = dx * nx + dy * ny + pair[p + 3 * L]
    ut = dy * nx - dx * ny - (body[i + U2] + body[j + U2])
    if rows == CELL_ROWS:
        ut += pair[p + 4 * L]
    return miss_of(force[2 * c], force[2 * c + 1], un, ut, wn, THIRD * wn, mu)


@njit(inline="always")
def miss_of(fn, ft, un, ut, wn, wt, mu):  # type: ignore[no-untyped-def]
    """|f − P(f − D⁻¹ u)|² of one contact, without taking a force from itself: that would cost digits."""
    normal = min(wn * un, fn)
    limit = mu * (fn - normal)
    tangential = min(max(wt * ut, ft - limit), ft + limit)
    return normal * normal + tangential * tangential


@njit(cache=True, nogil=True, error_model="numpy")
def measure_unbalance(problem, body):  # type: ignore[no-untyped-def]
    """Worst and mean |ΣF| [N] on a grain, from what the forces have added to its velocity."""
    now, free, external = (
        body.reshape(body.size),
        problem.body.reshape(body.size),
        problem.external.reshape(problem.external.size),
    )
    count = len(body)
    work = workspace(3 * L)  # worst, sum and number of grains: one of each per lane
    work[:] = 0.0
    for block in range((count + L - 1) // L):
        first, second = block * (4 * L), block * (2 * L)
        for k in range(min(L, count - block * L)):
            row, at = first + 4 * k, second + 2 * k
            compliance = now[row + 3]
            present = 1.0 if compliance > 0.0 else 0.0  # else the grain is lost, and its record zero
            impedance = present / (compliance if compliance > 0.0 else 1.0)
            x = external[at] + (now[row] - free[row]) * impedance
            y = external[at + 1] + (now[row + 1] - free[row + 1]) * impedance
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
