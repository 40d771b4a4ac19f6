"""What all contacts share: overlap per force, the error of all gaps, and the scale of all forces."""

from __future__ import annotations

import math

from numba import njit

from solver.posterior.sampler.draws import draw_above
from solver.posterior.sampler.records import CX, CY, DELTA, FX, FY, KNOWN, TORQUE

SCALE_STEPS = 4  # of Metropolis, a sweep


@njit(cache=True, nogil=True, error_model="numpy")
def draw_common(rng, pairs, law, room, state):  # type: ignore[no-untyped-def]
    """Draw κ, then the offset; recompute the sums, which would else gather rounding."""
    first, second, normal, gap = pairs.i, pairs.j, pairs.normal, pairs.gap
    bears, fn, open_gap, body, common, told = state.bears, state.fn, state.open_gap, state.body, state.common, room.told
    precision = heights = forces = squares = products = opened = excess = bearing = 0.0  # weighted by 1/b²
    for c in range(len(gap)):
        i, j, nx, ny, tight = first[c], second[c], normal[c, 0], normal[c, 1], told[c, 0]
        h = gap[c] + nx * body[i, CX] + ny * body[i, CY] - body[i, DELTA]
        if j >= 0:
            h -= nx * body[j, CX] + ny * body[j, CY] + body[j, DELTA]
        precision += tight
        heights += tight * h
        if bears[c]:
            f = fn[c]
            forces += tight * f
            squares += tight * f * f
            products += tight * f * h
            excess += f - 1.0
            bearing += 1.0
        else:
            opened += tight * open_gap[c]
    common[2], common[3] = excess, bearing
    a = 1.0 / law.stiffness_sd**2 + squares
    b = law.stiffness_mean / law.stiffness_sd**2 - products + common[1] * forces
    root = math.sqrt(a)
    common[0] = (b / root + draw_above(rng, -b / root)) / root
    a = 1.0 / law.offset_sd**2 + precision
    common[1] = (heights + common[0] * forces - opened) / a + rng.standard_normal() / math.sqrt(a)


@njit(cache=True, nogil=True, error_model="numpy")
def draw_scale(rng, pairs, centres, law, state):  # type: ignore[no-untyped-def]
    """Multiply all forces and divide κ by one number: contact by contact this would take thousands of sweeps.

    What the number λ changes is known in closed form, a few steps of Metropolis draw its logarithm; forces and κ
    transform with the Jacobian λ^(their count).
    """
    bears, fn, ft, friction, common = state.bears, state.fn, state.ft, pairs.friction, state.common
    body, load, group_sum, group_load = state.body, centres.load, state.group_sum, centres.group_load
    w = 1.0 / law.balance**2
    square = cross = total = 0.0
    moved = -1.0
    for c in range(len(fn)):
        if bears[c]:
            total += fn[c]
            square += (ft[c] / law.shear) ** 2
            moved += 2.0 if friction[c] > 0.0 else 1.0
    for g in range(len(load)):
        fx, fy, wg = body[g, FX] - load[g, 0], body[g, FY] - load[g, 1], w * body[g, KNOWN]
        square += wg * (fx * fx + fy * fy + body[g, TORQUE] ** 2)
        cross += wg * (fx * load[g, 0] + fy * load[g, 1])
    for g in range(len(group_sum)):
        square += w * group_sum[g] ** 2
        cross -= w * group_sum[g] * group_load[g]
    if total == 0.0:
        return
    pull, bearing = law.gauge / len(fn), common[3]
    step, log_scale, now = 1.0 / math.sqrt(abs(moved) + 1.0), 0.0, 0.0
    for k in range(SCALE_STEPS + 1):
        trial = log_scale + step * rng.standard_normal() if k > 0 else 0.0
        x = math.exp(trial)
        level = (
            moved * trial
            - 0.5 * square * x * x
            - (cross + law.rarity * total) * x
            - 0.5 * pull * (x * total - bearing) ** 2
        )
        level -= 0.5 * ((common[0] / x - law.stiffness_mean) / law.stiffness_sd) ** 2
        if k == 0 or rng.random() < math.exp(min(level - now, 0.0)):
            log_scale, now = trial, level
    scale = math.exp(log_scale)
    common[0] /= scale
    common[2] = scale * total - bearing
    for c in range(len(fn)):
        fn[c] *= scale
        ft[c] *= scale
    for g in range(len(load)):
        body[g, FX] = load[g, 0] + scale * (body[g, FX] - load[g, 0])
        body[g, FY] = load[g, 1] + scale * (body[g, FY] - load[g, 1])
        body[g, TORQUE] *= scale
    for g in range(len(group_sum)):
        group_sum[g] *= scale
