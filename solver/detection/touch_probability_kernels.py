"""Kernel of the hidden Markov smoother: loop over candidate pairs, frames and states.

The change of a gap in an interval follows the Laplace law exp(−|g − g'| / scale). Sums over all states with this law
are two recursions along the states, upwards and downwards, instead of a product with a matrix.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..bodies.grains import Array

# Rows of a transition, by state: decay of the Laplace law from the state below to this one; probability that a contact
# opens to this state; that it closes from it; and that it stays open, over the sum of the law over all open states.
DECAY, OPENS, CLOSES, STAYS_OPEN = range(4)
E2, E3, E4, E5, E6, E7, E8 = (
    1 / 2,
    1 / 6,
    1 / 24,
    1 / 120,
    1 / 720,
    1 / 5040,
    1 / 40320,
)  # exponential series


@njit(cache=True, error_model="numpy")
def smooth_candidates(
    gap: Array,  # (f, c) [m] measured gap plus half an overlap; NaN: unknown
    sigma: Array,  # (f, c) [m] standard deviation of the gap
    lowest: float,  # [σ_g] a deeper overlap counts as this one
    state_gap: Array,  # (q,) [m] gap of each state, ascending; state 0 touches
    start: Array,  # (q,) probability of the states in the first frame
    transition: Array,  # (f − 1, 4, q), of `find_transition`
    interval_width: Array,  # (q,) [m] width of the interval of gaps that a state stands for
    stay: float,  # probability that a contact lasts one interval
    floor: float,  # least likelihood of a measurement, for outliers
    emission: Array,  # (f, q) scratch
    alpha: Array,  # (f, q) scratch
    beta: Array,  # (2, q) scratch
    moved: Array,  # (3, q) scratch
    touch: Array,  # (f, c) out: probability that the pair touches
    state_variance: Array,  # (q,) [m²] variance of the true gap within a state
    error: Array,  # (f, c) [m²] variance of the measured gap about the true one
    mean: Array,  # (f, c) [m] out: of the true gap, all photographs considered
    variance: Array,  # (f, c) [m²] out: of the true gap
) -> None:
    """Smooth the gaps of every candidate over the frames, by the forward and backward recursions over the states.

    Sets `touch`, `mean` and `variance`.
    """
    frames, candidates = gap.shape
    states = len(state_gap)
    farthest = -np.log(floor) + 1e-6
    value, up, down = moved[0], moved[1], moved[2]
    for c in range(candidates):
        for f in range(frames):
            measured = gap[f, c]
            if np.isnan(measured):
                for q in range(states):
                    emission[f, q] = 1.0
                continue
            s = sigma[f, c]
            measured = min(max(measured, lowest * s), state_gap[states - 1])
            _gaussian(state_gap, measured, 1.0 / s, farthest, floor, emission[f])

        total = 0.0
        for q in range(states):
            alpha[0, q] = start[q] * emission[0, q]
            total += alpha[0, q]
        for q in range(states):
            alpha[0, q] /= total
        for f in range(1, frames):
            step, before = transition[f - 1], alpha[f - 1]
            for r in range(1, states):
                value[r] = before[r] * step[STAYS_OPEN, r]
            closed = stay * before[0]
            for r in range(1, states):
                closed += before[r] * step[CLOSES, r]
            alpha[f, 0] = closed
            _laplace_sums(value, step[DECAY], up, down)
            for r in range(1, states):
                alpha[f, r] = (up[r] + down[r]) * interval_width[r] + before[0] * step[OPENS, r]
            total = 0.0
            for r in range(states):
                alpha[f, r] *= emission[f, r]
                total += alpha[f, r]
            for r in range(states):
                alpha[f, r] /= total

        # β is known up to a factor, which cancels in the probability of the touching state.
        for q in range(states):
            beta[0, q] = 1.0
        touch[frames - 1, c] = alpha[frames - 1, 0]
        mean[frames - 1, c], variance[frames - 1, c] = _moments(
            alpha[frames - 1], beta[0], gap[frames - 1, c], error[frames - 1, c], state_gap, state_variance
        )
        for f in range(frames - 2, -1, -1):
            step = transition[f]
            touching = beta[0, 0] * emission[f + 1, 0]
            opened = 0.0
            for r in range(1, states):
                b = beta[0, r] * emission[f + 1, r]
                opened += b * step[OPENS, r]
                value[r] = b * interval_width[r]
            _laplace_sums(value, step[DECAY], up, down)
            for q in range(1, states):
                beta[1, q] = (up[q] + down[q]) * step[STAYS_OPEN, q] + touching * step[CLOSES, q]
            beta[1, 0] = stay * touching + opened
            total = 0.0
            evidence = 0.0
            for q in range(states):
                total += beta[1, q]
                evidence += alpha[f, q] * beta[1, q]
            for q in range(states):
                beta[0, q] = beta[1, q] / total
            touch[f, c] = alpha[f, 0] * beta[1, 0] / evidence
            mean[f, c], variance[f, c] = _moments(alpha[f], beta[0], gap[f, c], error[f, c], state_gap, state_variance)


@njit(cache=True, error_model="numpy")
def _gaussian(state_gap, measured, sharp, farthest, floor, out):  # type: ignore[no-untyped-def]
    """Set `out` to max(exp(−z²/2), floor) of every state, with z = (measured − gap of the state) · sharp.

    The exponential of a 128th of the argument, by its series, is squared seven times: exact to 1e-9, and vectorised by
    the compiler.
    """
    for q in range(len(out)):
        z = (measured - state_gap[q]) * sharp
        x = -min(0.5 * z * z, farthest) / 128.0
        low = 1.0 + x * (1.0 + x * (E2 + x * E3))
        e = low + x**4 * (E4 + x * (E5 + x * (E6 + x * (E7 + x * E8))))
        e *= e
        e *= e
        e *= e
        e *= e
        e *= e
        e *= e
        e *= e
        out[q] = max(e, floor)


@njit(inline="always")
def _laplace_sums(value, decay, up, down):  # type: ignore[no-untyped-def]
    """Set up + down to Σ_q value_q exp(−|g − g_q| / scale) for every open state; the first open state is 1.

    Both recursions run at once and in blocks of four: the terms of a block are computed before the carry from the block
    before, which shortens the chain of dependent operations.
    """
    above, below, states = 0.0, 0.0, len(value)
    fours = (states - 1) // 4
    for n in range(fours):
        k = 4 * n + 1
        d1, d2, d3, d4 = decay[k], decay[k + 1], decay[k + 2], decay[k + 3]
        s1 = value[k]
        s2 = s1 * d2 + value[k + 1]
        s3 = s2 * d3 + value[k + 2]
        s4 = s3 * d4 + value[k + 3]
        d2 *= d1
        d3 *= d2
        d4 *= d3
        up[k], up[k + 1], up[k + 2] = above * d1 + s1, above * d2 + s2, above * d3 + s3
        above = above * d4 + s4
        up[k + 3] = above

        k = states - 1 - 4 * n
        d1, d2, d3, d4 = decay[k], decay[k - 1], decay[k - 2], decay[k - 3]
        s1 = value[k] * d1
        s2 = (s1 + value[k - 1]) * d2
        s3 = (s2 + value[k - 2]) * d3
        s4 = (s3 + value[k - 3]) * d4
        d2 *= d1
        d3 *= d2
        d4 *= d3
        down[k], down[k - 1], down[k - 2], down[k - 3] = below, below * d1 + s1, below * d2 + s2, below * d3 + s3
        below = below * d4 + s4
    for k in range(4 * fours + 1, states):
        above = above * decay[k] + value[k]
        up[k] = above
        down[states - k] = below
        below = (below + value[states - k]) * decay[states - k]


@njit(cache=True, error_model="numpy")
def _moments(
    alpha: Array, beta: Array, measured: float, error: float, state_gap: Array, state_variance: Array
) -> tuple[float, float]:
    """Return mean and variance of the true gap, a mixture of one normal distribution per state."""
    total, first, second = 0.0, 0.0, 0.0
    for q in range(len(state_gap)):
        weight = alpha[q] * beta[q]
        gain = 0.0 if np.isnan(measured) else state_variance[q] / (state_variance[q] + error)
        middle = state_gap[q] if gain == 0.0 else state_gap[q] + gain * (measured - state_gap[q])
        total += weight
        first += weight * middle
        second += weight * (middle * middle + state_variance[q] * (1.0 - gain))
    first /= total
    return first, max(second / total - first * first, 0.0)
