"""The loop over contacts and nothing else.

A state is three arrays: body (n, 4), plate (w, 2) as in ContactProblem but under the present forces, and
force (p + q, 2) [N] in visiting order.
"""

# ruff: noqa: E501
from __future__ import annotations

import numpy as np
from numba import njit

from solver.contact_law import project_on_cone, relax_contact


@njit(cache=True, error_model="numpy")
def apply_forces(problem, body, plate, force):  # type: ignore[no-untyped-def]
    """Set body and plate to the velocities under the given forces."""
    body[:] = problem.body
    plate[:] = problem.plate
    for c in range(len(problem.pair)):
        i, j = problem.pair_body[c]
        nx, ny = problem.pair[c, 0], problem.pair[c, 1]
        _push(body, i, j, nx, ny, force[c, 0], force[c, 1])
    first = len(problem.pair)
    for c in range(len(problem.wall)):
        i, w = problem.wall_body[c]
        nx, ny = problem.wall[c, 0], problem.wall[c, 1]
        _push_from_wall(body, plate, i, w, nx, ny, force[first + c, 0], force[first + c, 1])


@njit(inline="always")
def _push(body, i, j, nx, ny, fn, ft):  # type: ignore[no-untyped-def]
    """Add the action of a force (or of its change) on both grains; the tangent is (−ny, nx)."""
    fx, fy = fn * nx - ft * ny, fn * ny + ft * nx
    ci, cj = body[i, 3], body[j, 3]
    body[i, 0] -= ci * fx
    body[i, 1] -= ci * fy
    body[i, 2] -= 2.0 * ci * ft  # torque −R f_t over ½ Z R², times R
    body[j, 0] += cj * fx
    body[j, 1] += cj * fy
    body[j, 2] -= 2.0 * cj * ft


@njit(inline="always")
def _push_from_wall(body, plate, i, w, nx, ny, fn, ft):  # type: ignore[no-untyped-def]
    ci = body[i, 3]
    body[i, 0] -= ci * (fn * nx - ft * ny)
    body[i, 1] -= ci * (fn * ny + ft * nx)
    body[i, 2] -= 2.0 * ci * ft
    plate[w, 0] += plate[w, 1] * fn


@njit(cache=True, error_model="numpy")
def advance(problem, body, plate, force, sweeps, relaxation):  # type: ignore[no-untyped-def]
    """Advance by a number of Gauss-Seidel sweeps, in place.

    relaxation 1 is the paper's scheme; above it, the change of a contact's force is extrapolated before it is
    projected, which selects another solution.
    """
    mu, wall_mu = problem.friction
    pair, pair_body, wall, wall_body, bias = (
        problem.pair,
        problem.pair_body,
        problem.wall,
        problem.wall_body,
        problem.bias,
    )
    first = len(pair)
    for _ in range(sweeps):
        for c in range(len(pair)):
            i, j = pair_body[c, 0], pair_body[c, 1]
            nx, ny = pair[c, 0], pair[c, 1]
            dx, dy = body[j, 0] - body[i, 0], body[j, 1] - body[i, 1]
            un = dx * nx + dy * ny + bias[c, 0]
            ut = dy * nx - dx * ny - body[i, 2] - body[j, 2]
            fn, ft = force[c, 0], force[c, 1]
            new_n, new_t = relax_contact(fn, ft, un, ut, relaxation * pair[c, 2], relaxation * pair[c, 3], mu)
            force[c, 0] = new_n
            force[c, 1] = new_t
            _push(body, i, j, nx, ny, new_n - fn, new_t - ft)
        for c in range(len(wall)):
            i, w = wall_body[c, 0], wall_body[c, 1]
            nx, ny = wall[c, 0], wall[c, 1]
            k = first + c
            un = plate[w, 0] - body[i, 0] * nx - body[i, 1] * ny + bias[k, 0]
            ut = body[i, 0] * ny - body[i, 1] * nx - body[i, 2] + bias[k, 1]
            fn, ft = force[k, 0], force[k, 1]
            new_n, new_t = relax_contact(fn, ft, un, ut, relaxation * wall[c, 2], relaxation * wall[c, 3], wall_mu)
            force[k, 0] = new_n
            force[k, 1] = new_t
            _push_from_wall(body, plate, i, w, nx, ny, new_n - fn, new_t - ft)


@njit(cache=True, error_model="numpy")
def contact_velocities(problem, body, plate, velocity):  # type: ignore[no-untyped-def]
    """Formal relative velocity (u_n, u_t) of every contact under the present state, into velocity (p + q, 2)."""
    first = len(problem.pair)
    for c in range(first):
        i, j = problem.pair_body[c]
        nx, ny = problem.pair[c, 0], problem.pair[c, 1]
        dx, dy = body[j, 0] - body[i, 0], body[j, 1] - body[i, 1]
        velocity[c, 0] = dx * nx + dy * ny + problem.bias[c, 0]
        velocity[c, 1] = dy * nx - dx * ny - body[i, 2] - body[j, 2] + problem.bias[c, 1]
    for c in range(len(problem.wall)):
        i, w = problem.wall_body[c]
        nx, ny = problem.wall[c, 0], problem.wall[c, 1]
        k = first + c
        velocity[k, 0] = plate[w, 0] - body[i, 0] * nx - body[i, 1] * ny + problem.bias[k, 0]
        velocity[k, 1] = body[i, 0] * ny - body[i, 1] * nx - body[i, 2] + problem.bias[k, 1]


@njit(cache=True, error_model="numpy")
def natural_map_residual(problem, velocity, force):  # type: ignore[no-untyped-def]
    """‖f − P(f − D⁻¹ u)‖ / ‖f‖, zero exactly at a solution; D: the diagonal of the local operators."""
    first = len(problem.pair)
    total, norm = 0.0, 0.0
    for c in range(len(force)):
        if c < first:
            wn, wt, mu = problem.pair[c, 2], problem.pair[c, 3], problem.friction[0]
        else:
            wn, wt, mu = problem.wall[c - first, 2], problem.wall[c - first, 3], problem.friction[1]
        fn, ft = force[c, 0], force[c, 1]
        pn, pt = project_on_cone(fn - wn * velocity[c, 0], ft - wt * velocity[c, 1], mu)
        total += (fn - pn) ** 2 + (ft - pt) ** 2
        norm += fn * fn + ft * ft
    if norm == 0.0:
        return 0.0 if total == 0.0 else np.inf
    return np.sqrt(total / norm)


@njit(cache=True, error_model="numpy")
def grain_unbalance(problem, force, total):  # type: ignore[no-untyped-def]
    """Sum of forces on every grain into total (n, 2) [N]; returns (worst |ΣF|, mean |ΣF|, mean f_n of bearing contacts)."""
    total[:] = problem.external
    first = len(problem.pair)
    sum_fn, bearing = 0.0, 0
    for c in range(len(force)):
        fn, ft = force[c, 0], force[c, 1]
        if fn > 0.0:
            sum_fn += fn
            bearing += 1
        if c < first:
            i, j = problem.pair_body[c]
            nx, ny = problem.pair[c, 0], problem.pair[c, 1]
            total[j, 0] += fn * nx - ft * ny
            total[j, 1] += fn * ny + ft * nx
        else:
            i = problem.wall_body[c - first, 0]
            nx, ny = problem.wall[c - first, 0], problem.wall[c - first, 1]
        total[i, 0] -= fn * nx - ft * ny
        total[i, 1] -= fn * ny + ft * nx
    worst, sum_size, count = 0.0, 0.0, 0
    for k in range(len(total)):
        if problem.body[k, 3] > 0.0:
            size = np.hypot(total[k, 0], total[k, 1])
            worst = max(worst, size)
            sum_size += size
            count += 1
    return worst, sum_size / max(count, 1), sum_fn / max(bearing, 1)


@njit(cache=True, error_model="numpy")
def greatest_force_change(before, after):  # type: ignore[no-untyped-def]
    """The paper's ε_f: the greatest |Δf| / |f| over contacts; a contact that loses its whole force counts as 1."""
    greatest = 0.0
    for c in range(len(after)):
        change = np.hypot(after[c, 0] - before[c, 0], after[c, 1] - before[c, 1])
        if change > 0.0:
            size = np.hypot(after[c, 0], after[c, 1])
            greatest = max(greatest, change / size if size > 0.0 else 1.0)
    return greatest
