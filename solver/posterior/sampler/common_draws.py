"""Draws of the unknowns that all contacts share: overlap per force, common gap error, scale of the forces."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from ...aligned_memory import aligned_numbers, aligned_singles
from ...grain_records import WIDTH, gather_records
from .blocks import FRICTION, GAP, NX, NY, RECORD, ROWS
from .lanes import LANES, draw_uniform, logarithm
from .state import CX, CY, DELTA, FX, FY, NORMAL_SUM, TORQUE
from .truncated_normal import draw_above, normal_of

L = LANES
SCALE_STEPS = 4  # Metropolis steps in a sweep
LOAD_X, LOAD_Y, BALANCE, PRESSURE, PRESSURE_WEIGHT = range(5)  # columns of Workspace.grain


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def draw_common(chain, model):  # type: ignore[no-untyped-def]
    """Draw κ, then the offset o; recompute the heights and the sums over bearing pairs, which would gather rounding.

    Notes
    -----
    With h_0 = h + o, the gap corrected for ε and δ alone, and κ_0, σ_κ, σ_o the parameters of the priors:

        κ | rest ~ N(B/A, 1/A), κ ≥ 0:  A = 1/σ_κ² + Σ z f²/b²,  B = κ_0/σ_κ² − Σ z f (h_0 − o)/b²
        o | rest ~ N(D/C, 1/C):         C = 1/σ_o² + Σ 1/b²,     D = Σ (h_0 + z κ f − (1 − z) γ)/b²
    """
    blocks, state, height, weights = chain.pairs, chain.state, chain.workspace.height, chain.workspace.precision
    body, ids, value = state.error.reshape(state.error.size), blocks.body.reshape(blocks.body.size), blocks.value
    value, z, fn, open_gap, common = value.reshape(value.size), state.bearing, state.fn, state.open_gap, state.common
    # Rows: errors of i and j; then sums, of which the first six are weighted by 1/b².
    work, uniform = aligned_numbers(16 * L), aligned_singles(L)
    for k in range(8 * L, 16 * L):
        work[k] = 0.0
    for block in range(len(blocks.grouped)):
        p, first = block * ROWS * L, block * L
        for k in range(0, L, WIDTH):
            gather_records(body, ids, 2 * first + k, work, k, L)
            gather_records(body, ids, 2 * first + L + k, work, 4 * L + k, L)
        for k in range(L):
            nx, ny, weight = value[p + NX * L + k], value[p + NY * L + k], weights[first + k]
            h = value[p + GAP * L + k] + nx * (work[CX * L + k] - work[(4 + CX) * L + k])
            h += ny * (work[CY * L + k] - work[(4 + CY) * L + k]) - work[DELTA * L + k] - work[(4 + DELTA) * L + k]
            f, bearing = fn[first + k], z[first + k]
            height[first + k] = h
            work[8 * L + k] += weight
            work[9 * L + k] += weight * h
            work[10 * L + k] += weight * f
            work[11 * L + k] += weight * f * f
            work[12 * L + k] += weight * f * h
            work[13 * L + k] += weight * open_gap[first + k]
            work[14 * L + k] += f - bearing
            work[15 * L + k] += bearing
    precision, heights, forces = _total(work, 8), _total(work, 9), _total(work, 10)
    squares, products, opened = _total(work, 11), _total(work, 12), _total(work, 13)
    common[2], common[3] = _total(work, 14), _total(work, 15)
    draw_uniform(state.random, uniform, 0)
    a = 1.0 / model.compliance_sd**2 + squares
    b = model.compliance_mean / model.compliance_sd**2 - products + common[1] * forces
    root = math.sqrt(a)
    common[0] = draw_above(-b / root, logarithm(uniform[0])) / root
    a = 1.0 / model.offset_sd**2 + precision
    drawn = np.float64(normal_of(logarithm(uniform[1])))
    common[1] = (heights + common[0] * forces - opened) / a + drawn / math.sqrt(a)


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def draw_scale(chain, model):  # type: ignore[no-untyped-def]
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
    state, common, group_load = chain.state, chain.state.common, chain.workspace.group_load
    fn, ft, group_sum = state.fn, state.ft, state.group_sum
    w = 1.0 / model.balance_sd**2
    work, uniform = aligned_numbers(5 * L), aligned_singles(L)
    for k in range(5 * L):
        work[k] = 0.0
    _add_contacts(chain, work)
    _add_grains(chain, w, work)
    total, exponent = _total(work, 0), _total(work, 2) - 1.0
    square, cross = _total(work, 1) / model.tangential_sd**2 + _total(work, 3), _total(work, 4)
    for g in range(len(group_sum)):
        square += w * group_sum[g] ** 2
        cross -= w * group_sum[g] * group_load[g]
    if total == 0.0:
        return
    draw_uniform(state.random, uniform, 0)
    gauge, count = model.mean_gauge / chain.pair_count, common[3]
    step, log_scale, now = 1.0 / math.sqrt(abs(exponent) + 1.0), 0.0, 0.0
    for k in range(SCALE_STEPS + 1):
        trial = log_scale + step * np.float64(normal_of(logarithm(uniform[2 * k]))) if k > 0 else 0.0
        x = math.exp(trial)
        level = (
            exponent * trial
            - 0.5 * square * x * x
            - (cross + model.force_rate * total) * x
            - 0.5 * gauge * (x * total - count) ** 2
        )
        level -= 0.5 * ((common[0] / x - model.compliance_mean) / model.compliance_sd) ** 2
        if k == 0 or np.float64(uniform[2 * k + 1]) < math.exp(min(level - now, 0.0)):
            log_scale, now = trial, level
    scale = math.exp(log_scale)
    common[0] /= scale
    common[2] = scale * total - count
    for c in range(len(fn)):
        fn[c] *= scale
        ft[c] *= scale
    _scale_sums(chain, scale)
    for g in range(len(group_sum)):
        group_sum[g] *= scale


@njit(forceinline=True, error_model="numpy", fastmath={"contract"})
def _add_contacts(chain, work):  # type: ignore[no-untyped-def]
    """Add Σ f, Σ t² and the number of force components that are drawn to the first three rows."""
    fn, ft, z, value = chain.state.fn, chain.state.ft, chain.state.bearing, chain.pairs.value
    value = value.reshape(value.size)
    for block in range(len(chain.pairs.grouped)):
        p, first = (block * ROWS + FRICTION) * L, block * L
        for k in range(L):
            work[k] += fn[first + k]
            work[L + k] += ft[first + k] * ft[first + k]
            work[2 * L + k] += z[first + k] * (2.0 if value[p + k] > 0.0 else 1.0)


@njit(forceinline=True, error_model="numpy", fastmath={"contract"})
def _add_grains(chain, w, work):  # type: ignore[no-untyped-def]
    """Add the coefficients of x² and of x that grains have to the last two rows."""
    body, grain = chain.state.force, chain.workspace.grain
    body, grain = body.reshape(body.size), grain.reshape(grain.size)
    for first in range(0, len(body) // RECORD, L):
        for k in range(L):
            r, g = RECORD * (first + k), 5 * (first + k)
            x, y = body[r + FX] - grain[g + LOAD_X], body[r + FY] - grain[g + LOAD_Y]
            wg, v, total = w * grain[g + BALANCE], grain[g + PRESSURE_WEIGHT], body[r + NORMAL_SUM]
            work[3 * L + k] += wg * (x * x + y * y + body[r + TORQUE] * body[r + TORQUE]) + v * total * total
            work[4 * L + k] += wg * (x * grain[g + LOAD_X] + y * grain[g + LOAD_Y]) - v * grain[g + PRESSURE] * total


@njit(forceinline=True, error_model="numpy", fastmath={"contract"})
def _scale_sums(chain, scale):  # type: ignore[no-untyped-def]
    body, grain = chain.state.force, chain.workspace.grain
    for g in range(len(body)):
        body[g, FX] = grain[g, LOAD_X] + scale * (body[g, FX] - grain[g, LOAD_X])
        body[g, FY] = grain[g, LOAD_Y] + scale * (body[g, FY] - grain[g, LOAD_Y])
        body[g, TORQUE] *= scale
        body[g, NORMAL_SUM] *= scale


@njit(forceinline=True, error_model="numpy", fastmath={"contract"})
def _total(work, row):  # type: ignore[no-untyped-def]
    total = 0.0
    for k in range(L):
        total += work[row * L + k]
    return total
