"""The loop over contacts: whether each bears force, with which force, or how far apart its surfaces are."""

from __future__ import annotations

import math

from numba import njit

from .draws import draw_above, draw_between, scaled_cdf
from .records import BALANCE_WEIGHT, CX, CY, DELTA, FX, FY, LEVER, TORQUE

MAX_LOG_ODDS = 100.0  # logarithm of the odds against bearing beyond which a pair counts as open


@njit(cache=True, nogil=True, error_model="numpy")
def weigh_contacts(pairs, grains, model, workspace):  # type: ignore[no-untyped-def]
    """Set what follows from the parameters alone: b and 1/b² of every pair, A without its term in κ, and √A_t.

    Notes
    -----
    b² = gap_law_sd² + gap_sd²; A and A_t as in `draw_contacts`.
    """
    coefficients = workspace.coefficients
    w, tangential = 1.0 / model.balance_sd**2, 1.0 / model.tangential_sd**2
    for c in range(len(coefficients)):
        i, j, own = pairs.i[c], pairs.j[c], pairs.gap_sd[c]
        b = model.gap_law_sd if own == 0.0 else math.sqrt(model.gap_law_sd * model.gap_law_sd + own * own)
        wi, li = w * grains.balance_weight[i], grains.lever[i]
        a = wi + grains.pressure_weight[i] + model.mean_gauge / len(coefficients)
        at = tangential + wi * (1.0 + li * li)
        if j >= 0:
            wj, lj = w * grains.balance_weight[j], grains.lever[j]
            a += wj + grains.pressure_weight[j]
            at += wj * (1.0 + lj * lj)
        if pairs.group[c] >= 0:
            a += w * (pairs.factor[c] * pairs.factor[c])
        coefficients[c, 0], coefficients[c, 1] = b, 1.0 / (b * b)
        coefficients[c, 2], coefficients[c, 3] = a, math.sqrt(at)
        workspace.observation[c, 0] = coefficients[c, 1]


@njit(cache=True, nogil=True, error_model="numpy")
def draw_contacts(rng, pairs, grains, model, workspace, state):  # type: ignore[no-untyped-def]
    """Draw z, f, t and γ of contact after contact; leave the gap residuals at ε = δ = 0 in workspace.observation.

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
    old ones stay: a Metropolis-Hastings step whose acceptance is 0 or 1. If z = 1, t is then drawn given f from the
    Gaussian on [−μ f, μ f], and f given t from that on [|t|/μ, ∞). If z = 0, γ ~ N(h − b²/ℓ, b²), γ ≥ 0.
    """
    # Every field is read once: inside the loop each access would change a reference count.
    first, second, normal, gap = pairs.i, pairs.j, pairs.normal, pairs.gap
    prior, friction, group, factor = pairs.odds, pairs.friction, pairs.group, pairs.factor
    state_bearing, state_fn, state_ft, open_gap = state.bearing, state.fn, state.ft, state.open_gap
    body, group_sum, group_load = state.body, state.group_sum, grains.group_load
    normal_sum, pressure, pressure_weight = state.normal_sum, grains.pressure, grains.pressure_weight
    coefficients, observation = workspace.coefficients, workspace.observation
    kappa, offset, excess, count = state.common
    w, open_rate, tangential_sd = 1.0 / model.balance_sd**2, 1.0 / model.mean_open_gap, model.tangential_sd
    mean_gauge, count_gauge = model.mean_gauge / len(gap), model.count_gauge / len(gap)
    for c in range(len(gap)):
        i, j, g, nx, ny = first[c], second[c], group[c], normal[c, 0], normal[c, 1]
        gap_sd, precision, root_t = coefficients[c, 0], coefficients[c, 1], coefficients[c, 3]
        was_bearing, old_fn, old_ft = state_bearing[c], state_fn[c], state_ft[c]
        if was_bearing:
            excess -= old_fn - 1.0
            count -= 1.0
        # ΣF and ΣM without this contact.
        wi, li = w * body[i, BALANCE_WEIGHT], body[i, LEVER]
        fx, fy = old_fn * nx - old_ft * ny, old_fn * ny + old_ft * nx
        rx, ry, rm = body[i, FX] + fx, body[i, FY] + fy, body[i, TORQUE] + li * old_ft
        h = gap[c] - offset + nx * body[i, CX] + ny * body[i, CY] - body[i, DELTA]
        b, bt = wi * (rx * nx + ry * ny), wi * (ry * nx - rx * ny + li * rm)
        b -= pressure_weight[i] * (normal_sum[i] - old_fn - pressure[i])
        lj = 0.0
        if j >= 0:
            b -= pressure_weight[j] * (normal_sum[j] - old_fn - pressure[j])
            wj, lj = w * body[j, BALANCE_WEIGHT], body[j, LEVER]
            rx, ry, rm = body[j, FX] - fx, body[j, FY] - fy, body[j, TORQUE] + lj * old_ft
            h -= nx * body[j, CX] + ny * body[j, CY] + body[j, DELTA]
            b -= wj * (rx * nx + ry * ny)
            bt += wj * (lj * rm - ry * nx + rx * ny)
        b -= kappa * h * precision + mean_gauge * (excess - 1.0) + model.force_rate
        if g >= 0:
            b -= w * factor[c] * (group_sum[g] - factor[c] * old_fn - group_load[g])

        fn_sd, frictional = 1.0 / math.sqrt(coefficients[c, 2] + kappa * kappa * precision), friction[c] > 0.0
        ratio = gap_sd * open_rate
        x, y = b * fn_sd, h * gap_sd * precision - ratio
        surplus = count - model.expected_count + 0.5
        log_odds = count_gauge * surplus + 0.5 * mean_gauge * (1.0 - 2.0 * excess) - prior[c]
        log_odds -= 0.5 * x * x if x > 0.0 else 0.0
        log_odds += 0.5 * y * y if y > 0.0 else 0.0
        odds, ft_sd, mean_t = ratio / fn_sd, 0.0, 0.0
        if frictional:
            ft_sd = 1.0 / root_t
            mean_t = bt * ft_sd
            log_odds -= 0.5 * mean_t * mean_t
            odds *= root_t * tangential_sd
        bearing = False
        if log_odds < MAX_LOG_ODDS:
            odds *= scaled_cdf(y) / scaled_cdf(x) * math.exp(log_odds)
            bearing = rng.random() * (1.0 + odds) < 1.0
        fn = ft = 0.0
        if bearing:
            fn = fn_sd * (x + draw_above(rng, -x))
            if frictional:
                ft = ft_sd * (mean_t + rng.standard_normal())
            if abs(ft) > friction[c] * fn:  # rejected: the old state stays
                bearing, fn, ft = was_bearing, old_fn, old_ft
        if bearing:
            lower = -x
            if frictional:
                bound = friction[c] * fn * root_t
                ft = ft_sd * (mean_t + draw_between(rng, -bound - mean_t, bound - mean_t))
                lower += abs(ft) / (friction[c] * fn_sd)
            fn = fn_sd * (x + draw_above(rng, lower))
            excess += fn - 1.0
            count += 1.0
            open_gap[c] = 0.0
            observation[c, 1] = gap[c] - offset + kappa * fn
        else:
            gamma = gap_sd * (draw_above(rng, -y) + y)
            open_gap[c] = gamma
            observation[c, 1] = gap[c] - offset - gamma
        if bearing or was_bearing:
            dn, dt = fn - old_fn, ft - old_ft
            fx, fy = dn * nx - dt * ny, dn * ny + dt * nx
            body[i, FX] -= fx
            body[i, FY] -= fy
            body[i, TORQUE] -= li * dt
            normal_sum[i] += dn
            if j >= 0:
                normal_sum[j] += dn
                body[j, FX] += fx
                body[j, FY] += fy
                body[j, TORQUE] -= lj * dt
            if g >= 0:
                group_sum[g] += factor[c] * dn
        state_bearing[c], state_fn[c], state_ft[c] = bearing, fn, ft
    state.common[2], state.common[3] = excess, count
