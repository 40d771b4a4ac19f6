"""The Gibbs sampler's loops: contact by contact, then centre by centre, then what all share.

Lengths in mean diameters, forces in force units, torques over the mean radius. With ε the error of a centre and δ how
much a radius is too small, h = gap − offset − n·(ε_j − ε_i) − δ_i − δ_j is the height of a pair over contact. With w
of a grain 1/s², or zero where its balance is not known, minus the logarithm of the posterior is the sum of

    balance   Σ_i w_i/2 (|ΣF|² + (ΣM)²) + Σ_groups w/2 (Σ f_n − load)²
    bears     (h + κ f)²/(2 b²) + t²/(2 τ²) + λ f,  0 ≤ f,  |t| ≤ μ f
    open      (h − γ)²/(2 b²) + γ/ℓ,  0 ≤ γ
    gauge     K/(2 c) (Σ_bears (f − 1))² + K/(2 c) (Σ z − Σ P)²

with b² larger by the square of an error that a pair's gap has for itself.

A contact is drawn as a whole: bears or not, f and t from the law without Coulomb's bound, and the draw is refused
where it breaks the bound, which makes it exact. f and t are then drawn once more, each given the other.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.posterior.draws import LOG_ROOT_TWO_PI, draw_above, draw_between, log_normal_cdf

Rows = NDArray[np.int64]

SCALE_STEPS = 4  # of Metropolis, a sweep


class Pairs(NamedTuple):
    """Pairs within reach, as they were measured."""

    i: Rows  # (c,) row of a grain
    j: Rows  # (c,) row of a grain, −1: a wall
    normal: Array  # (c, 2) from i towards j
    gap: Array  # (c,)
    odds: Array  # (c,) ln P/(1 − P) before gap and balance are looked at
    friction: Array  # (c,)
    group: Rows  # (c,) group whose normal forces have a known sum, −1: none
    deviation: Array  # (c,) of an error that this gap has for itself; 0: none


class Centres(NamedTuple):
    """Grains, and the pairs that each of them has.

    m = k n rows: the n grains in one frame or, one frame after the other, in k frames that share the radii.
    """

    lever: Array  # (m,) radius over the mean radius
    load: Array  # (m, 2) weight
    balanced: Array  # (m,) 1.0, or 0.0 where forces on the grain are missing
    deviation: Array  # (m,) of the centre's error along each axis
    radius_deviation: Array  # (n,) of the radius' error
    start: Rows  # (m + 1,) of a grain's rows in `row`
    row: Rows  # (2c,) of pairs, a grain's own after one another
    group_load: Array  # (g,) known sums of normal forces


class Law(NamedTuple):
    """What holds in one sweep."""

    balance: float  # s
    width: float  # b
    shear: float  # τ
    open_gap: float  # ℓ
    gauge: float  # K of the mean force; 0: a load fixes it
    share: float  # K of the number that bear
    expected: float  # Σ P
    stiffness_mean: float  # of κ, before anything is known
    stiffness_sd: float
    offset_sd: float
    rarity: float  # λ of large forces


class State(NamedTuple):
    """One draw of everything unknown; changes in place."""

    bears: NDArray[np.bool_]  # (c,)
    fn: Array  # (c,)
    ft: Array  # (c,)
    open_gap: Array  # (c,) γ
    error: Array  # (m, 3) ε, δ
    resultant: Array  # (m, 3) ΣF, ΣM over the mean radius
    group_sum: Array  # (g,)
    common: Array  # (4,) κ, offset, Σ_bears (f − 1), Σ z


@njit(cache=True, nogil=True)
def sweep(rng, pairs, centres, law, state):  # type: ignore[no-untyped-def]
    """Draw everything once, in the order of the pairs, then of the grains."""
    _draw_contacts(rng, pairs, centres, law, state)
    _draw_errors(rng, pairs, centres, law, state)
    _draw_common(rng, pairs, law, state)
    _draw_scale(rng, pairs, centres, law, state)


@njit(cache=True, nogil=True)
def run(rng, pairs, centres, laws, state, kept, sums):  # type: ignore[no-untyped-def]
    """Sweep once for each row of `laws` (sweeps, 11), the last `kept` of which are added to the sums.

    sums: of bears, z f, z t, (z f)², (z t)² (c, 5), of ε, δ and δ² (m, 4), of κ, κ², offset, offset² (4,).
    """
    by_pair, by_grain, shared = sums
    burnt = len(laws) - kept
    for k in range(len(laws)):
        a = laws[k]
        law = Law(a[0], a[1], a[2], a[3], a[4], a[5], a[6], a[7], a[8], a[9], a[10])
        sweep(rng, pairs, centres, law, state)
        if k >= burnt:
            for c in range(len(pairs.i)):
                if state.bears[c]:
                    f, t = state.fn[c], state.ft[c]
                    by_pair[c, 0] += 1.0
                    by_pair[c, 1] += f
                    by_pair[c, 2] += t
                    by_pair[c, 3] += f * f
                    by_pair[c, 4] += t * t
            for g in range(len(by_grain)):
                for q in range(3):
                    by_grain[g, q] += state.error[g, q]
                by_grain[g, 3] += state.error[g, 2] ** 2
            for q in range(2):
                shared[2 * q] += state.common[q]
                shared[2 * q + 1] += state.common[q] ** 2


@njit(cache=True, nogil=True, inline="always")
def _height(c, i, j, normal, gap, error, offset):  # type: ignore[no-untyped-def]
    """Give h of pair c (i, j)."""
    h = gap[c] - offset + normal[c, 0] * error[i, 0] + normal[c, 1] * error[i, 1] - error[i, 2]
    if j >= 0:
        h -= normal[c, 0] * error[j, 0] + normal[c, 1] * error[j, 1] + error[j, 2]
    return h


@njit(cache=True, nogil=True, inline="always")
def _width(c, deviation, common):  # type: ignore[no-untyped-def]
    """Give b of pair c: that of all pairs, `common`, widened by its own error."""
    return common if deviation[c] == 0.0 else math.sqrt(common * common + deviation[c] * deviation[c])


@njit(cache=True, nogil=True)
def _draw_contacts(rng, pairs, centres, law, state):  # type: ignore[no-untyped-def]
    # Every field is taken out once: taken out within the loop, it would be counted as a reference each time.
    first, second, normal, gap = pairs.i, pairs.j, pairs.normal, pairs.gap
    prior, friction, group, deviation = pairs.odds, pairs.friction, pairs.group, pairs.deviation
    lever, balanced, group_load = centres.lever, centres.balanced, centres.group_load
    state_bears, state_fn, state_ft, open_gap = state.bears, state.fn, state.ft, state.open_gap
    error, resultant, group_sum = state.error, state.resultant, state.group_sum
    kappa, offset, excess, bearing = state.common
    w = 1.0 / law.balance**2
    pull, hold = law.gauge / len(gap), law.share / len(gap)
    for c in range(len(gap)):
        i, j, g, nx, ny = first[c], second[c], group[c], normal[c, 0], normal[c, 1]
        bore, old_fn, old_ft = state_bears[c], state_fn[c], state_ft[c]
        if bore:
            excess -= old_fn - 1.0
            bearing -= 1.0
        h = _height(c, i, j, normal, gap, error, offset)
        width = _width(c, deviation, law.width)
        tight, inner = 1.0 / width**2, width / law.open_gap
        # ΣF, ΣM without this contact. −½ A f² + B f is the logarithm of f's law, likewise for t.
        wi, li = w * balanced[i], lever[i]
        fx, fy = old_fn * nx - old_ft * ny, old_fn * ny + old_ft * nx
        rx, ry, rm = resultant[i, 0] + fx, resultant[i, 1] + fy, resultant[i, 2] + li * old_ft
        a = wi + kappa * kappa * tight + pull
        b = wi * (rx * nx + ry * ny) - kappa * h * tight - pull * (excess - 1.0) - law.rarity
        at = wi * (1.0 + li * li) + 1.0 / law.shear**2
        bt = wi * (ry * nx - rx * ny + li * rm)
        if j >= 0:
            wj, lj = w * balanced[j], lever[j]
            rx, ry, rm = resultant[j, 0] - fx, resultant[j, 1] - fy, resultant[j, 2] + lj * old_ft
            a += wj
            b -= wj * (rx * nx + ry * ny)
            at += wj * (1.0 + lj * lj)
            bt += wj * (lj * rm - ry * nx + rx * ny)
        if g >= 0:
            a += w
            b -= w * (group_sum[g] - old_fn - group_load[g])

        root, root_t, rough = math.sqrt(a), math.sqrt(at), friction[c] > 0.0
        odds = prior[c] + 0.5 * (b * b / a - h * h * tight) - 0.5 * pull * (1.0 - 2.0 * excess)
        odds += log_normal_cdf(b / root) + LOG_ROOT_TWO_PI - hold * (bearing - law.expected + 0.5)
        odds += h / law.open_gap - 0.5 * inner * inner - LOG_ROOT_TWO_PI - log_normal_cdf(h / width - inner)
        volume = root * inner
        if rough:
            odds += 0.5 * bt * bt / at
            volume *= root_t * law.shear
        odds -= math.log(volume)

        bears = odds > -40.0 and rng.random() * (1.0 + math.exp(-odds)) < 1.0
        fn = ft = 0.0
        if bears:
            fn = (b / root + draw_above(rng, -b / root)) / root
            if rough:
                ft = (bt / root_t + rng.standard_normal()) / root_t
            if abs(ft) > friction[c] * fn:  # refused: all stays as it was
                bears, fn, ft = bore, old_fn, old_ft
        if bears:
            least = 0.0
            if rough:
                bound = friction[c] * fn * root_t
                ft = (bt / root_t + draw_between(rng, -bound - bt / root_t, bound - bt / root_t)) / root_t
                least = abs(ft) / friction[c] * root
            fn = (b / root + draw_above(rng, least - b / root)) / root
            excess += fn - 1.0
            bearing += 1.0
            open_gap[c] = 0.0
        else:
            low = inner - h / width
            open_gap[c] = width * (draw_above(rng, low) - low)
        if bears or bore:
            dn, dt = fn - old_fn, ft - old_ft
            fx, fy = dn * nx - dt * ny, dn * ny + dt * nx
            resultant[i, 0] -= fx
            resultant[i, 1] -= fy
            resultant[i, 2] -= li * dt
            if j >= 0:
                resultant[j, 0] += fx
                resultant[j, 1] += fy
                resultant[j, 2] -= lever[j] * dt
            if g >= 0:
                group_sum[g] += dn
        state_bears[c], state_fn[c], state_ft[c] = bears, fn, ft
    state.common[2], state.common[3] = excess, bearing


@njit(cache=True, nogil=True)
def _draw_errors(rng, pairs, centres, law, state):  # type: ignore[no-untyped-def]
    """Draw the error of every radius together with those of its centre in all frames, from their Gaussian law."""
    first, second, normal, gap = pairs.i, pairs.j, pairs.normal, pairs.gap
    bears, fn, open_gap, error = state.bears, state.fn, state.open_gap, state.error
    start, row, deviation, radius_deviation = centres.start, centres.row, centres.deviation, centres.radius_deviation
    kappa, offset, own = state.common[0], state.common[1], pairs.deviation
    n, m = len(radius_deviation), len(deviation)
    factor = np.empty((m // n, 7))  # of every frame: Cholesky L of ε's precision, L⁻¹ of its pull and of its tie to δ
    for first_row in range(n):
        precision, pull = 1.0 / radius_deviation[first_row] ** 2, 0.0
        for k in range(m // n):
            g = first_row + k * n
            ex, ey, er = error[g, 0], error[g, 1], error[g, 2]
            xx = 1.0 / deviation[g] ** 2
            yy, xy, bx, by, xr, yr = xx, 0.0, 0.0, 0.0, 0.0, 0.0
            for q in range(start[g], start[g + 1]):
                c = row[q]
                tight = 1.0 / _width(c, own, law.width) ** 2
                side = -1.0 if first[c] == g else 1.0  # height falls as j's error goes along the normal
                nx, ny = side * normal[c, 0], side * normal[c, 1]
                rest = _height(c, first[c], second[c], normal, gap, error, offset) + nx * ex + ny * ey + er
                rest += kappa * fn[c] if bears[c] else -open_gap[c]
                xx += tight * nx * nx
                xy += tight * nx * ny
                yy += tight * ny * ny
                xr += tight * nx
                yr += tight * ny
                bx += tight * nx * rest
                by += tight * ny * rest
                precision += tight
                pull += tight * rest
            l11 = math.sqrt(xx)
            l21 = xy / l11
            l22 = math.sqrt(yy - l21 * l21)
            ux, tx = bx / l11, xr / l11
            uy, ty = (by - l21 * ux) / l22, (yr - l21 * tx) / l22
            precision -= tx * tx + ty * ty
            pull -= tx * ux + ty * uy
            factor[k, 0], factor[k, 1], factor[k, 2] = l11, l21, l22
            factor[k, 3], factor[k, 4], factor[k, 5], factor[k, 6] = ux, uy, tx, ty
        delta = pull / precision + rng.standard_normal() / math.sqrt(precision)
        for k in range(m // n):
            g = first_row + k * n
            u = factor[k, 3] - delta * factor[k, 5] + rng.standard_normal()
            v = factor[k, 4] - delta * factor[k, 6] + rng.standard_normal()
            error[g, 1] = v / factor[k, 2]
            error[g, 0] = (u - factor[k, 1] * error[g, 1]) / factor[k, 0]
            error[g, 2] = delta


@njit(cache=True, nogil=True)
def _draw_common(rng, pairs, law, state):  # type: ignore[no-untyped-def]
    """Draw κ, then the offset; recompute the sums, which would else gather rounding."""
    first, second, normal, gap = pairs.i, pairs.j, pairs.normal, pairs.gap
    bears, fn, open_gap, error, common = state.bears, state.fn, state.open_gap, state.error, state.common
    own, precision = pairs.deviation, 0.0
    a, b = 1.0 / law.stiffness_sd**2, law.stiffness_mean / law.stiffness_sd**2
    excess = bearing = 0.0
    for c in range(len(gap)):
        tight = 1.0 / _width(c, own, law.width) ** 2
        precision += tight
        if bears[c]:
            a += tight * fn[c] * fn[c]
            b -= tight * fn[c] * _height(c, first[c], second[c], normal, gap, error, common[1])
            excess += fn[c] - 1.0
            bearing += 1.0
    root = math.sqrt(a)
    common[0] = (b / root + draw_above(rng, -b / root)) / root
    common[2], common[3] = excess, bearing
    a, b = 1.0 / law.offset_sd**2 + precision, 0.0
    for c in range(len(gap)):
        rest = _height(c, first[c], second[c], normal, gap, error, 0.0)
        rest += common[0] * fn[c] if bears[c] else -open_gap[c]
        b += rest / _width(c, own, law.width) ** 2
    common[1] = b / a + rng.standard_normal() / math.sqrt(a)


@njit(cache=True, nogil=True)
def _draw_scale(rng, pairs, centres, law, state):  # type: ignore[no-untyped-def]
    """Multiply all forces and divide κ by one number: contact by contact this would take thousands of sweeps.

    What the number λ changes is known in closed form, a few steps of Metropolis draw its logarithm; forces and κ
    transform with the Jacobian λ^(their count).
    """
    bears, fn, ft, friction, common = state.bears, state.fn, state.ft, pairs.friction, state.common
    resultant, load, balanced = state.resultant, centres.load, centres.balanced
    group_sum, group_load = state.group_sum, centres.group_load
    w = 1.0 / law.balance**2
    square = cross = total = 0.0
    moved = -1.0
    for c in range(len(fn)):
        if bears[c]:
            total += fn[c]
            square += (ft[c] / law.shear) ** 2
            moved += 2.0 if friction[c] > 0.0 else 1.0
    for g in range(len(load)):
        fx, fy = resultant[g, 0] - load[g, 0], resultant[g, 1] - load[g, 1]
        square += w * balanced[g] * (fx * fx + fy * fy + resultant[g, 2] ** 2)
        cross += w * balanced[g] * (fx * load[g, 0] + fy * load[g, 1])
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
        resultant[g, 0] = load[g, 0] + scale * (resultant[g, 0] - load[g, 0])
        resultant[g, 1] = load[g, 1] + scale * (resultant[g, 1] - load[g, 1])
        resultant[g, 2] *= scale
    for g in range(len(group_sum)):
        group_sum[g] *= scale


def start_state(pairs: Pairs, centres: Centres, stiffness: float) -> State:
    """A start without errors of centres: as many bear, the nearest first, as are expected to; each the same force."""
    count, between = len(pairs.i), pairs.j >= 0
    share = 1.0 / (1.0 + np.exp(-pairs.odds))
    bears = np.zeros(count, np.bool_)
    bears[np.argsort(pairs.gap, kind="stable")[: round(float(share.sum()))]] = True
    fn = bears.astype(np.float64)
    force = fn[:, None] * pairs.normal
    resultant = np.column_stack([centres.load, np.zeros(len(centres.lever))])
    np.subtract.at(resultant[:, :2], pairs.i, force)
    np.add.at(resultant[:, :2], pairs.j[between], force[between])
    grouped = pairs.group >= 0
    return State(
        bears, fn, np.zeros(count), np.where(bears, 0.0, np.maximum(pairs.gap, 0.0)), np.zeros((len(centres.lever), 3)),
        resultant, np.bincount(pairs.group[grouped], fn[grouped], minlength=len(centres.group_load)).astype(np.float64),
        np.array([stiffness, 0.0, 0.0, float(bears.sum())]),
    )  # fmt: skip
