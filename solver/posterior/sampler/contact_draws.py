"""The loop over contacts: bears or not, with how much force, or how far apart.

A contact is drawn as a whole: bears or not, f and t from the law without Coulomb's bound, and the draw is refused
where it breaks the bound, which makes it exact. f and t are then drawn once more, each given the other.
"""

from __future__ import annotations

import math

from numba import njit

from solver.posterior.sampler.draws import draw_above, draw_between, scaled_cdf
from solver.posterior.sampler.records import CX, CY, DELTA, FX, FY, KNOWN, LEVER, TORQUE

HOPELESS = 100.0  # logarithm of the odds against bearing beyond which they need not be known


@njit(cache=True, nogil=True, error_model="numpy")
def weigh_contacts(pairs, centres, law, room):  # type: ignore[no-untyped-def]
    """What follows from the law alone: b and 1/b² of every pair, and how sharply balance holds its f and t."""
    sharp = room.sharp
    w, shear = 1.0 / law.balance**2, 1.0 / law.shear**2
    for c in range(len(sharp)):
        i, j, own = pairs.i[c], pairs.j[c], pairs.deviation[c]
        width = law.width if own == 0.0 else math.sqrt(law.width * law.width + own * own)
        wi, li = w * centres.balanced[i], centres.lever[i]
        a, at = wi + law.gauge / len(sharp), shear + wi * (1.0 + li * li)
        if j >= 0:
            wj, lj = w * centres.balanced[j], centres.lever[j]
            a += wj
            at += wj * (1.0 + lj * lj)
        if pairs.group[c] >= 0:
            a += w
        sharp[c, 0], sharp[c, 1], sharp[c, 2], sharp[c, 3] = width, 1.0 / (width * width), a, math.sqrt(at)
        room.told[c, 0] = sharp[c, 1]


@njit(cache=True, nogil=True, error_model="numpy")
def draw_contacts(rng, pairs, group_load, law, room, state):  # type: ignore[no-untyped-def]
    """Draw contact after contact; leaves in room.told what each says of the errors: gap − offset + κ f, or − γ."""
    # Every field is taken out once: taken out within the loop, it would be counted as a reference each time.
    first, second, normal, gap = pairs.i, pairs.j, pairs.normal, pairs.gap
    prior, friction, group = pairs.odds, pairs.friction, pairs.group
    state_bears, state_fn, state_ft, open_gap = state.bears, state.fn, state.ft, state.open_gap
    body, group_sum, sharp, told = state.body, state.group_sum, room.sharp, room.told
    kappa, offset, excess, bearing = state.common
    w, rare, shear = 1.0 / law.balance**2, 1.0 / law.open_gap, law.shear
    pull, hold = law.gauge / len(gap), law.share / len(gap)
    for c in range(len(gap)):
        i, j, g, nx, ny = first[c], second[c], group[c], normal[c, 0], normal[c, 1]
        width, tight, root_t = sharp[c, 0], sharp[c, 1], sharp[c, 3]
        bore, old_fn, old_ft = state_bears[c], state_fn[c], state_ft[c]
        if bore:
            excess -= old_fn - 1.0
            bearing -= 1.0
        # ΣF, ΣM without this contact. −½ A f² + B f is the logarithm of f's law, likewise for t.
        wi, li = w * body[i, KNOWN], body[i, LEVER]
        fx, fy = old_fn * nx - old_ft * ny, old_fn * ny + old_ft * nx
        rx, ry, rm = body[i, FX] + fx, body[i, FY] + fy, body[i, TORQUE] + li * old_ft
        h = gap[c] - offset + nx * body[i, CX] + ny * body[i, CY] - body[i, DELTA]
        b, bt = wi * (rx * nx + ry * ny), wi * (ry * nx - rx * ny + li * rm)
        lj = 0.0
        if j >= 0:
            wj, lj = w * body[j, KNOWN], body[j, LEVER]
            rx, ry, rm = body[j, FX] - fx, body[j, FY] - fy, body[j, TORQUE] + lj * old_ft
            h -= nx * body[j, CX] + ny * body[j, CY] + body[j, DELTA]
            b -= wj * (rx * nx + ry * ny)
            bt += wj * (lj * rm - ry * nx + rx * ny)
        b -= kappa * h * tight + pull * (excess - 1.0) + law.rarity
        if g >= 0:
            b -= w * (group_sum[g] - old_fn - group_load[g])

        flex, rough = 1.0 / math.sqrt(sharp[c, 2] + kappa * kappa * tight), friction[c] > 0.0
        inner = width * rare
        x, y = b * flex, h * width * tight - inner
        against = hold * (bearing - law.expected + 0.5) + 0.5 * pull * (1.0 - 2.0 * excess) - prior[c]
        against -= 0.5 * x * x if x > 0.0 else 0.0
        against += 0.5 * y * y if y > 0.0 else 0.0
        odds, flex_t, mean_t = inner / flex, 0.0, 0.0
        if rough:
            flex_t = 1.0 / root_t
            mean_t = bt * flex_t
            against -= 0.5 * mean_t * mean_t
            odds *= root_t * shear
        bears = False
        if against < HOPELESS:
            odds *= scaled_cdf(y) / scaled_cdf(x) * math.exp(against)
            bears = rng.random() * (1.0 + odds) < 1.0
        fn = ft = 0.0
        if bears:
            fn = flex * (x + draw_above(rng, -x))
            if rough:
                ft = flex_t * (mean_t + rng.standard_normal())
            if abs(ft) > friction[c] * fn:  # refused: all stays as it was
                bears, fn, ft = bore, old_fn, old_ft
        if bears:
            least = -x
            if rough:
                bound = friction[c] * fn * root_t
                ft = flex_t * (mean_t + draw_between(rng, -bound - mean_t, bound - mean_t))
                least += abs(ft) / (friction[c] * flex)
            fn = flex * (x + draw_above(rng, least))
            excess += fn - 1.0
            bearing += 1.0
            open_gap[c] = 0.0
            told[c, 1] = gap[c] - offset + kappa * fn
        else:
            away = width * (draw_above(rng, -y) + y)
            open_gap[c] = away
            told[c, 1] = gap[c] - offset - away
        if bears or bore:
            dn, dt = fn - old_fn, ft - old_ft
            fx, fy = dn * nx - dt * ny, dn * ny + dt * nx
            body[i, FX] -= fx
            body[i, FY] -= fy
            body[i, TORQUE] -= li * dt
            if j >= 0:
                body[j, FX] += fx
                body[j, FY] += fy
                body[j, TORQUE] -= lj * dt
            if g >= 0:
                group_sum[g] += dn
        state_bears[c], state_fn[c], state_ft[c] = bears, fn, ft
    state.common[2], state.common[3] = excess, bearing
