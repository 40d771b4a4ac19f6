"""The hidden Markov smoother's loop over candidate pairs, frames and states.

How far a gap moves in an interval follows Laplace's law, exp(−|g − g'| / scale): sums with it over all states are two
recursions along the states, one up and one down, instead of a product with a matrix.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from solver.bodies.grains import Array

# Rows of a transition, by state: what is left of Laplace's law from the state below to this one; probability that a
# contact opens to this state; that it closes from it; and that it does not, over the law's sum over all open states.
DECAY, OPENS, CLOSES, SPREADS = range(4)


@njit(cache=True, error_model="numpy")
def smooth_candidates(
    gap: Array,  # (f, c) [m] measured gap plus half an overlap; NaN: unknown
    sigma: Array,  # (f, c) [m] standard deviation of the gap
    lowest: float,  # [σ_g] a deeper overlap counts as this one
    state_gap: Array,  # (q,) [m] gap of each state, ascending; state 0 touches
    start: Array,  # (q,) probability of the states in the first frame
    transition: Array,  # (f − 1, 4, q), of `find_transition`
    extent: Array,  # (q,) [m] width of the interval of gaps that a state stands for
    stay: float,  # probability that a contact lasts one interval
    floor: float,  # least likelihood of a measurement, for outliers
    emission: Array,  # (f, q) scratch
    alpha: Array,  # (f, q) scratch
    beta: Array,  # (2, q) scratch
    moved: Array,  # (3, q) scratch
    touch: Array,  # (f, c) out: probability that the pair touches
    width: Array,  # (q,) [m²] variance of the true gap within a state
    error: Array,  # (f, c) [m²] variance of the measured gap about the true one
    mean: Array,  # (f, c) [m] out: of the true gap, all photographs considered
    variance: Array,  # (f, c) [m²] out: of the true gap
) -> None:
    frames, candidates = gap.shape
    states = len(state_gap)
    farthest = -2.0 * np.log(floor) + 1e-6
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
            for q in range(states):
                z = (measured - state_gap[q]) / s
                emission[f, q] = max(np.exp(-0.5 * z * z), floor) if z * z < farthest else floor

        total = 0.0
        for q in range(states):
            alpha[0, q] = start[q] * emission[0, q]
            total += alpha[0, q]
        for q in range(states):
            alpha[0, q] /= total
        for f in range(1, frames):
            step, before = transition[f - 1], alpha[f - 1]
            for r in range(1, states):
                value[r] = before[r] * step[SPREADS, r]
            closed = stay * before[0]
            for r in range(1, states):
                closed += before[r] * step[CLOSES, r]
            alpha[f, 0] = closed
            _blur(value, step[DECAY], up, down)
            for r in range(1, states):
                alpha[f, r] = (up[r] + down[r]) * extent[r] + before[0] * step[OPENS, r]
            total = 0.0
            for r in range(states):
                alpha[f, r] *= emission[f, r]
                total += alpha[f, r]
            for r in range(states):
                alpha[f, r] /= total

        # β is kept up to a factor, which cancels in the share of the touching state.
        for q in range(states):
            beta[0, q] = 1.0
        touch[frames - 1, c] = alpha[frames - 1, 0]
        mean[frames - 1, c], variance[frames - 1, c] = _moments(
            alpha[frames - 1], beta[0], gap[frames - 1, c], error[frames - 1, c], state_gap, width
        )
        for f in range(frames - 2, -1, -1):
            step = transition[f]
            touching = beta[0, 0] * emission[f + 1, 0]
            opened = 0.0
            for r in range(1, states):
                b = beta[0, r] * emission[f + 1, r]
                opened += b * step[OPENS, r]
                value[r] = b * extent[r]
            _blur(value, step[DECAY], up, down)
            for q in range(1, states):
                beta[1, q] = (up[q] + down[q]) * step[SPREADS, q] + touching * step[CLOSES, q]
            beta[1, 0] = stay * touching + opened
            total = 0.0
            share = 0.0
            for q in range(states):
                total += beta[1, q]
                share += alpha[f, q] * beta[1, q]
            for q in range(states):
                beta[0, q] = beta[1, q] / total
            touch[f, c] = alpha[f, 0] * beta[1, 0] / share
            mean[f, c], variance[f, c] = _moments(alpha[f], beta[0], gap[f, c], error[f, c], state_gap, width)


@njit(inline="always")
def _blur(value, decay, up, down):  # type: ignore[no-untyped-def]
    """Set up + down to Σ_q value_q exp(−|g − g_q| / scale) for every open state, the first one being 1.

    Both ways at once: each step of one waits for the step before it.
    """
    above, below, states = 0.0, 0.0, len(value)
    for k in range(1, states):
        above = above * decay[k] + value[k]
        up[k] = above
        down[states - k] = below
        below = (below + value[states - k]) * decay[states - k]


@njit(cache=True, error_model="numpy")
def _moments(
    alpha: Array, beta: Array, measured: float, error: float, state_gap: Array, width: Array
) -> tuple[float, float]:
    """Mean and variance of the true gap, a mixture of one normal law per state."""
    total, first, second = 0.0, 0.0, 0.0
    for q in range(len(state_gap)):
        share = alpha[q] * beta[q]
        gain = 0.0 if np.isnan(measured) else width[q] / (width[q] + error)
        middle = state_gap[q] if gain == 0.0 else state_gap[q] + gain * (measured - state_gap[q])
        total += share
        first += share * middle
        second += share * (middle * middle + width[q] * (1.0 - gain))
    first /= total
    return first, max(second / total - first * first, 0.0)
