"""The loop over blocks of pairs: whether each bears force, with which force, or how far apart its surfaces are."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from ...aligned_memory import aligned_numbers, aligned_singles
from ...grain_records import WIDTH, gather_records, scatter_records
from .blocks import (
    BALANCE_I,
    BALANCE_J,
    FACTOR,
    FRICTION,
    GAP,
    GAP_SD,
    LEVER_I,
    LEVER_J,
    NORMAL_PRECISION,
    NX,
    NY,
    OWN_SD,
    PRESENT,
    PRESSURE_I,
    PRESSURE_J,
    PRESSURE_WEIGHT_I,
    PRESSURE_WEIGHT_J,
    PRIOR,
    ROOT_T,
    ROWS,
)
from .lanes import HALF, LANES, ONE, TWO, ZERO, draw_uniform, exponential, logarithm
from .truncated_normal import distance_above, normal_of, scaled_log_tail

L = LANES
DRAWS = 6  # uniform numbers of a pair: z, f, t, another t and whether it is taken, f or γ
UNBOUND = np.float32(1e15)  # μ over the ratio of both standard deviations, where there is no tangential force
# Rows of a block between its parts, in single precision.
X, Y, MEAN_T, LOG_ODDS, ODDS, CONE, OLD_F, OLD_T, OLD_Z, NEW_Z, DISTANCE, NEW_T, SINGLES = range(13)


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def weigh_pairs(chain, model):  # type: ignore[no-untyped-def]
    """Set what follows from the parameters alone: b and 1/b² of every pair, A without its term in κ, and √A_t.

    Notes
    -----
    b² = gap_law_sd² + gap_sd²; A and A_t as in `draw_contacts`.
    """
    value, grouped, group = chain.pairs.value.reshape(chain.pairs.value.size), chain.pairs.grouped, chain.pairs.group
    weights, gap_law = chain.workspace.precision, model.gap_law_sd * model.gap_law_sd
    w, tangential, gauge = 1.0 / model.balance_sd**2, 1.0 / model.tangential_sd**2, model.mean_gauge / chain.pair_count
    for block in range(len(grouped)):
        p, first = block * ROWS * L, block * L
        for k in range(L):
            own, present = value[p + OWN_SD * L + k], value[p + PRESENT * L + k]
            b = math.sqrt(gap_law + own * own)
            wi, wj = w * value[p + BALANCE_I * L + k], w * value[p + BALANCE_J * L + k]
            li, lj = value[p + LEVER_I * L + k], value[p + LEVER_J * L + k]
            a = wi + wj + value[p + PRESSURE_WEIGHT_I * L + k] + value[p + PRESSURE_WEIGHT_J * L + k] + gauge
            value[p + GAP_SD * L + k], weights[first + k] = b, present / (b * b)
            value[p + NORMAL_PRECISION * L + k] = a + 1.0 - present  # of an absent pair, so that its draws are finite
            value[p + ROOT_T * L + k] = math.sqrt(tangential + wi * (1.0 + li * li) + wj * (1.0 + lj * lj))
        if grouped[block]:
            for k in range(L):
                if group[first + k] >= 0:
                    factor = value[p + FACTOR * L + k]
                    value[p + NORMAL_PRECISION * L + k] += w * factor * factor


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def draw_contacts(chain, model):  # type: ignore[no-untyped-def]
    """Draw z, f, t and γ of block after block of pairs; leave the gap residuals at ε = δ = 0 in the workspace.

    Notes
    -----
    Given all else, and without Coulomb's bound, f and t of a bearing contact are independent Gaussians of logarithms
    −½ A f² + B f (f ≥ 0) and −½ A_t t² + B_t t, where F_k, M_k are the sums on grain k without this contact, l_k its
    radius over the mean radius, e = Σ z (f − 1) and N = Σ z the sums over the other contacts, c the number of pairs,
    S the sum of the other forces of the group times their factors, L its load, a the factor of this one, P_k the sum of
    the other normal forces on grain k (terms with j only between grains, with S and a only in a group):

        A   = w_i + w_j + v_i + v_j + w a² + K/c + κ²/b²
        B   = n·(w_i F_i − w_j F_j) − v_i (P_i − p_i) − v_j (P_j − p_j) − κ h/b² − w a (S − L) − K (e − 1)/c − λ
        A_t = w_i (1 + l_i²) + w_j (1 + l_j²) + 1/τ²
        B_t = t̂·(w_i F_i − w_j F_j) + w_i l_i M_i + w_j l_j M_j

    With x = B/√A, y = h/b − b/ℓ and R(u) = √(2π) Φ(u) exp(u²/2), integrals over f, t and γ give the odds

        p(z=0)/p(z=1) = (1 − P)/P · (b √A/ℓ) · R(y)/R(x) · τ √A_t exp(−B_t²/(2 A_t))
                        · exp(K_N (N − Σ P + ½)/c + K (1 − 2 e)/(2c)),

    without the factors of t where friction is zero. (z, f, t) drawn so replace the old ones unless |t| > μ f, where the
    old ones stay: a Metropolis-Hastings step whose acceptance is 0 or 1. If z = 1, another t is then proposed, uniform
    between −μ f and μ f, and accepted by Metropolis' rule, and f given t is drawn from the Gaussian on [|t|/μ, ∞). If
    z = 0, γ ~ N(h − b²/ℓ, b²), γ ≥ 0. The pairs of a block see e and N as they were before it.
    """
    blocks, state, workspace = chain.pairs, chain.state, chain.workspace
    ids, value, group = blocks.body.reshape(blocks.body.size), blocks.value.reshape(blocks.value.size), blocks.group
    grouped, z, fn, ft, open_gap, random = (
        blocks.grouped,
        state.bearing,
        state.fn,
        state.ft,
        state.open_gap,
        state.random,
    )
    body, group_sum, group_load = state.force.reshape(state.force.size), state.group_sum, workspace.group_load
    height, residual, weights = workspace.height, workspace.residual, workspace.precision
    kappa, offset, excess, count = state.common
    w, open_rate, tangential_sd = 1.0 / model.balance_sd**2, 1.0 / model.mean_open_gap, model.tangential_sd
    mean_gauge, count_gauge = model.mean_gauge / chain.pair_count, model.count_gauge / chain.pair_count
    # Rows: ΣF, ΣM, Σ f of the grains i and j; slope of a known sum; 1/√A; 1/√A_t; change of f; changes of e and N.
    work, uniform, single = aligned_numbers(14 * L), aligned_singles(DRAWS * L), aligned_singles(SINGLES * L)
    for block in range(len(grouped)):
        first, p = block * L, block * ROWS * L
        for k in range(0, L, WIDTH):
            gather_records(body, ids, 2 * first + k, work, k, L)
            gather_records(body, ids, 2 * first + L + k, work, 4 * L + k, L)
        for k in range(0, DRAWS * L, L):
            draw_uniform(random, uniform, k)
        for k in range(L):
            work[8 * L + k] = 0.0
        if grouped[block]:
            for k in range(L):
                g, factor = group[first + k], value[p + FACTOR * L + k]
                if g >= 0:
                    work[8 * L + k] = w * factor * (group_sum[g] - factor * fn[first + k] - group_load[g])
        for k in range(L):
            c = first + k
            nx, ny, old_z, old_fn, old_ft = value[p + NX * L + k], value[p + NY * L + k], z[c], fn[c], ft[c]
            other_excess, other_count = excess - old_z * (old_fn - 1.0), count - old_z
            wi, li = w * value[p + BALANCE_I * L + k], value[p + LEVER_I * L + k]
            wj, lj = w * value[p + BALANCE_J * L + k], value[p + LEVER_J * L + k]
            # ΣF and ΣM without this contact.
            fx, fy = old_fn * nx - old_ft * ny, old_fn * ny + old_ft * nx
            rx, ry, rm = work[k] + fx, work[L + k] + fy, work[2 * L + k] + li * old_ft
            b, bt = wi * (rx * nx + ry * ny), wi * (ry * nx - rx * ny + li * rm)
            rx, ry, rm = work[4 * L + k] - fx, work[5 * L + k] - fy, work[6 * L + k] + lj * old_ft
            b -= wj * (rx * nx + ry * ny)
            bt += wj * (lj * rm - ry * nx + rx * ny)
            b -= value[p + PRESSURE_WEIGHT_I * L + k] * (work[3 * L + k] - old_fn - value[p + PRESSURE_I * L + k])
            b -= value[p + PRESSURE_WEIGHT_J * L + k] * (work[7 * L + k] - old_fn - value[p + PRESSURE_J * L + k])
            h, precision, gap_sd = height[c] - offset, weights[c], value[p + GAP_SD * L + k]
            b -= kappa * h * precision + mean_gauge * (other_excess - 1.0) + model.force_rate + work[8 * L + k]
            root_n = math.sqrt(value[p + NORMAL_PRECISION * L + k] + kappa * kappa * precision)
            friction, root_t, fn_sd = value[p + FRICTION * L + k], value[p + ROOT_T * L + k], 1.0 / root_n
            ft_sd = 1.0 / root_t if friction > 0.0 else 0.0
            ratio = gap_sd * open_rate
            x, y, mean_t = b * fn_sd, h * gap_sd * precision - ratio, bt * ft_sd
            log_odds = count_gauge * (other_count - model.expected_count + 0.5) - value[p + PRIOR * L + k]
            log_odds += 0.5 * mean_gauge * (1.0 - 2.0 * other_excess) - 0.5 * mean_t * mean_t
            log_odds -= 0.5 * x * x if x > 0.0 else 0.0
            log_odds += 0.5 * y * y if y > 0.0 else 0.0
            single[X * L + k], single[Y * L + k], single[MEAN_T * L + k] = x, y, mean_t
            single[LOG_ODDS * L + k] = log_odds
            single[ODDS * L + k] = ratio * root_n * (root_t * tangential_sd if friction > 0.0 else 1.0)
            single[CONE * L + k] = friction * fn_sd * root_t if friction > 0.0 else UNBOUND
            single[OLD_F * L + k], single[OLD_T * L + k], single[OLD_Z * L + k] = (
                old_fn * root_n,
                old_ft * root_t,
                old_z,
            )
            work[9 * L + k], work[10 * L + k] = fn_sd, ft_sd
        _draw_block(single, uniform)
        for k in range(L):
            c = first + k
            nx, ny, old_z, old_fn, old_ft = value[p + NX * L + k], value[p + NY * L + k], z[c], fn[c], ft[c]
            new_z, distance = np.float64(single[NEW_Z * L + k]), np.float64(single[DISTANCE * L + k])
            new_fn, new_ft = new_z * work[9 * L + k] * distance, new_z * work[10 * L + k] * single[NEW_T * L + k]
            gamma = (1.0 - new_z) * value[p + GAP_SD * L + k] * distance
            residual[c] = value[p + GAP * L + k] - offset + kappa * new_fn - gamma
            dn, dt = new_fn - old_fn, new_ft - old_ft
            fx, fy = dn * nx - dt * ny, dn * ny + dt * nx
            work[k] -= fx
            work[L + k] -= fy
            work[2 * L + k] -= value[p + LEVER_I * L + k] * dt
            work[3 * L + k] += dn
            work[4 * L + k] += fx
            work[5 * L + k] += fy
            work[6 * L + k] -= value[p + LEVER_J * L + k] * dt
            work[7 * L + k] += dn
            work[11 * L + k] = dn
            work[12 * L + k] = new_z * (new_fn - 1.0) - old_z * (old_fn - 1.0)
            work[13 * L + k] = new_z - old_z
            z[c], fn[c], ft[c], open_gap[c] = new_z, new_fn, new_ft, gamma
        for k in range(L):
            excess += work[12 * L + k]
            count += work[13 * L + k]
        if grouped[block]:
            for k in range(L):
                if group[first + k] >= 0:
                    group_sum[group[first + k]] += value[p + FACTOR * L + k] * work[11 * L + k]
        for k in range(0, L, WIDTH):
            scatter_records(work, k, L, body, ids, 2 * first + k)
            scatter_records(work, 4 * L + k, L, body, ids, 2 * first + L + k)
    state.common[2], state.common[3] = excess, count


@njit(forceinline=True, error_model="numpy", fastmath={"contract"})
def _draw_block(single, uniform):  # type: ignore[no-untyped-def]
    """Draw z, t √A_t, and f √A or γ/b, of the pairs of a block."""
    for k in range(L):
        x, y, mean_t, cone = single[X * L + k], single[Y * L + k], single[MEAN_T * L + k], single[CONE * L + k]
        scaled_x, log_tail_x = scaled_log_tail(-x)
        scaled_y, _ = scaled_log_tail(-y)
        against = single[LOG_ODDS * L + k] + logarithm(single[ODDS * L + k]) + scaled_y - scaled_x
        drawn = uniform[k] * (ONE + exponential(against)) < ONE
        f = distance_above(-x, log_tail_x, logarithm(uniform[L + k]))
        t = mean_t + normal_of(logarithm(uniform[2 * L + k]))
        inside = abs(t) <= cone * f
        new_z = (ONE if inside else single[OLD_Z * L + k]) if drawn else ZERO  # outside of the cone: the old state
        f = f if inside else single[OLD_F * L + k]
        t = t if inside else single[OLD_T * L + k]
        other = cone * f * (TWO * uniform[3 * L + k] - ONE)
        step, step_other = t - mean_t, other - mean_t
        accepted = uniform[4 * L + k] < exponential(HALF * (step - step_other) * (step + step_other))
        t = other if accepted else t
        least = abs(t) / cone if new_z > ZERO else ZERO
        low = least - x if new_z > ZERO else -y
        _, log_tail = scaled_log_tail(low)
        distance = distance_above(low, log_tail, logarithm(uniform[5 * L + k]))
        single[NEW_Z * L + k], single[DISTANCE * L + k], single[NEW_T * L + k] = new_z, least + distance, t
