"""Draws of the unknowns that all contacts share: overlap per force, common gap error, scale of the forces."""

from __future__ import annotations

import math

from numba import njit

from .draws import draw_above
from .records import BALANCE_WEIGHT, CX, CY, DELTA, FX, FY, TORQUE

SCALE_STEPS = 4  # Metropolis steps in a sweep


@njit(cache=True, nogil=True, error_model="numpy")
def draw_common(rng, pairs, model, workspace, state):  # type: ignore[no-untyped-def]
    """Draw κ, then the offset o; recompute the sums over bearing pairs, which would otherwise gather rounding.

    Notes
    -----
    With h_0 = h + o, the gap corrected for ε and δ alone, and κ_0, σ_κ, σ_o the parameters of the priors:

        κ | rest ~ N(B/A, 1/A), κ ≥ 0:  A = 1/σ_κ² + Σ z f²/b²,  B = κ_0/σ_κ² − Σ z f (h_0 − o)/b²
        o | rest ~ N(D/C, 1/C):         C = 1/σ_o² + Σ 1/b²,     D = Σ (h_0 + z κ f − (1 − z) γ)/b²
    """
    first, second, normal, gap = pairs.i, pairs.j, pairs.normal, pairs.gap
    bearing, fn, open_gap, body, common = state.bearing, state.fn, state.open_gap, state.body, state.common
    observation = workspace.observation
    precision = heights = forces = squares = products = opened = excess = count = 0.0  # weighted by 1/b²
    for c in range(len(gap)):
        i, j, nx, ny, weight = first[c], second[c], normal[c, 0], normal[c, 1], observation[c, 0]
        h = gap[c] + nx * body[i, CX] + ny * body[i, CY] - body[i, DELTA]
        if j >= 0:
            h -= nx * body[j, CX] + ny * body[j, CY] + body[j, DELTA]
        precision += weight
        heights += weight * h
        if bearing[c]:
            f = fn[c]
            forces += weight * f
            squares += weight * f * f
            products += weight * f * h
            excess += f - 1.0
            count += 1.0
        else:
            opened += weight * open_gap[c]
    common[2], common[3] = excess, count
    a = 1.0 / model.compliance_sd**2 + squares
    b = model.compliance_mean / model.compliance_sd**2 - products + common[1] * forces
    root = math.sqrt(a)
    common[0] = (b / root + draw_above(rng, -b / root)) / root
    a = 1.0 / model.offset_sd**2 + precision
    common[1] = (heights + common[0] * forces - opened) / a + rng.standard_normal() / math.sqrt(a)


@njit(cache=True, nogil=True, error_model="numpy")
def draw_scale(rng, pairs, grains, model, state):  # type: ignore[no-untyped-def]
    """Multiply all forces by a number x and divide κ by it; contact by contact this would take thousands of sweeps.

    Notes
    -----
    The products κ f stay as they are, so that minus the logarithm of the posterior depends on x in closed form, with
    q_i the weight of grain i, F_i, M_i and P_i the sums of the contact forces, torques and normal forces on it, p_i and
    v_i the measured P_i and its inverse variance, L_g the load of a group:

        ½ x² (Σ_i w_i (|F_i|² + M_i²) + Σ_i v_i P_i² + Σ_g w (Σ f)² + Σ t²/τ²)
        + x (Σ_i w_i F_i·q_i − Σ_i v_i p_i P_i − Σ_g w L_g Σ f + λ Σ f)
        + K/(2c) (x Σ f − Σ z)² + (κ/x − κ_0)²/(2 σ_κ²) − q ln x,

    where q is the number of force components that are drawn less one, for κ: the Jacobian of the move. ln x is drawn
    by SCALE_STEPS steps of random-walk Metropolis from ln x = 0 with a step of standard deviation 1/√(|q| + 1).
    """
    bearing, fn, ft, friction, common = state.bearing, state.fn, state.ft, pairs.friction, state.common
    body, load, group_sum, group_load = state.body, grains.load, state.group_sum, grains.group_load
    normal_sum, pressure, pressure_weight = state.normal_sum, grains.pressure, grains.pressure_weight
    w = 1.0 / model.balance_sd**2
    square = cross = total = 0.0
    exponent = -1.0
    for c in range(len(fn)):
        if bearing[c]:
            total += fn[c]
            square += (ft[c] / model.tangential_sd) ** 2
            exponent += 2.0 if friction[c] > 0.0 else 1.0
    for g in range(len(load)):
        fx, fy, wg = body[g, FX] - load[g, 0], body[g, FY] - load[g, 1], w * body[g, BALANCE_WEIGHT]
        square += wg * (fx * fx + fy * fy + body[g, TORQUE] ** 2)
        cross += wg * (fx * load[g, 0] + fy * load[g, 1])
        square += pressure_weight[g] * normal_sum[g] ** 2
        cross -= pressure_weight[g] * pressure[g] * normal_sum[g]
    for g in range(len(group_sum)):
        square += w * group_sum[g] ** 2
        cross -= w * group_sum[g] * group_load[g]
    if total == 0.0:
        return
    gauge, count = model.mean_gauge / len(fn), common[3]
    step, log_scale, now = 1.0 / math.sqrt(abs(exponent) + 1.0), 0.0, 0.0
    for k in range(SCALE_STEPS + 1):
        trial = log_scale + step * rng.standard_normal() if k > 0 else 0.0
        x = math.exp(trial)
        level = (
            exponent * trial
            - 0.5 * square * x * x
            - (cross + model.force_rate * total) * x
            - 0.5 * gauge * (x * total - count) ** 2
        )
        level -= 0.5 * ((common[0] / x - model.compliance_mean) / model.compliance_sd) ** 2
        if k == 0 or rng.random() < math.exp(min(level - now, 0.0)):
            log_scale, now = trial, level
    scale = math.exp(log_scale)
    common[0] /= scale
    common[2] = scale * total - count
    for c in range(len(fn)):
        fn[c] *= scale
        ft[c] *= scale
    for g in range(len(load)):
        body[g, FX] = load[g, 0] + scale * (body[g, FX] - load[g, 0])
        body[g, FY] = load[g, 1] + scale * (body[g, FY] - load[g, 1])
        body[g, TORQUE] *= scale
        normal_sum[g] *= scale
    for g in range(len(group_sum)):
        group_sum[g] *= scale
