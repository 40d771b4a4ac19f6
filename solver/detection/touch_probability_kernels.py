"""The hidden Markov smoother's loop over candidate pairs, frames and states."""

from __future__ import annotations

import numpy as np
from numba import njit

from solver.bodies.grains import Array


@njit(cache=True)
def smooth_candidates(
    gap: Array,  # (f, c) [m] measured gap plus half an overlap; NaN: unknown
    sigma: Array,  # (f, c) [m] standard deviation of the gap
    lowest: float,  # [σ_g] a deeper overlap counts as this one
    state_gap: Array,  # (q,) [m] gap of each state, ascending; state 0 touches
    start: Array,  # (q,) probability of the states in the first frame
    forward: Array,  # (f − 1, q, q) transition from row to column
    backward: Array,  # (f − 1, q, q) its transpose
    floor: float,  # least likelihood of a measurement, for outliers
    emission: Array,  # (f, q) scratch
    alpha: Array,  # (f, q) scratch
    beta: Array,  # (2, q) scratch
    touch: Array,  # (f, c) out: probability that the pair touches
    width: Array,  # (q,) [m²] variance of the true gap within a state
    error: Array,  # (f, c) [m²] variance of the measured gap about the true one
    mean: Array,  # (f, c) [m] out: of the true gap, all photographs considered
    variance: Array,  # (f, c) [m²] out: of the true gap
) -> None:
    frames, candidates = gap.shape
    states = len(state_gap)
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
                emission[f, q] = max(np.exp(-0.5 * z * z), floor)

        total = 0.0
        for q in range(states):
            alpha[0, q] = start[q] * emission[0, q]
            total += alpha[0, q]
        for q in range(states):
            alpha[0, q] /= total
        for f in range(1, frames):
            for r in range(states):
                alpha[f, r] = 0.0
            for q in range(states):
                a = alpha[f - 1, q]
                for r in range(states):
                    alpha[f, r] += a * forward[f - 1, q, r]
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
            for q in range(states):
                beta[1, q] = 0.0
            for r in range(states):
                b = beta[0, r] * emission[f + 1, r]
                for q in range(states):
                    beta[1, q] += b * backward[f, r, q]
            total = 0.0
            share = 0.0
            for q in range(states):
                total += beta[1, q]
                share += alpha[f, q] * beta[1, q]
            for q in range(states):
                beta[0, q] = beta[1, q] / total
            touch[f, c] = alpha[f, 0] * beta[1, 0] / share
            mean[f, c], variance[f, c] = _moments(alpha[f], beta[0], gap[f, c], error[f, c], state_gap, width)


@njit(cache=True)
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
