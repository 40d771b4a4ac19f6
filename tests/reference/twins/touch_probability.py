"""The hidden Markov smoother of the gaps, one pair at a time, with dense matrices and constants written out."""

from __future__ import annotations

import math

import numpy as np
from rodsight.solver.bodies.grains import Array


def plain_smooth(gap: Array, sigma: Array, scale: Array, overlap: float) -> tuple[Array, Array, Array]:
    """P(touch), mean [m] and variance [m²] of the true gap, each (f, c); arguments as of `smooth_gaps`."""
    frames, pairs = gap.shape
    widest = max(6.0 * max(scale, default=0.0), 12.0 * float(np.median(sigma[np.isfinite(gap)])))
    edges = [widest * (q / 48) ** 2 for q in range(49)]
    states = [0.0] + [widest * ((q + 0.5) / 48) ** 2 for q in range(48)]
    width = [0.0] + [edges[q + 1] - edges[q] for q in range(48)]
    start = np.array([0.5] + [0.5 * w / sum(width) for w in width[1:]])
    steps = [_transition(states, width, s) for s in scale]
    touch, mean, variance = np.empty((3, frames, pairs))
    for c in range(pairs):
        likelihood = [_likelihood(gap[f, c] + 0.5 * overlap, sigma[f, c], states) for f in range(frames)]
        for f in range(frames):
            before = start
            for e in range(f):
                before = (before * likelihood[e]) @ steps[e]
                before = before / before.sum()
            after = np.ones(49)
            for e in range(frames - 1, f, -1):
                after = steps[e - 1] @ (likelihood[e] * after)
                after = after / after.sum()
            share = before * likelihood[f] * after
            share = share / share.sum()
            touch[f, c] = share[0]
            mean[f, c], variance[f, c] = _true_gap(share, states, width, gap[f, c], sigma[f, c], overlap)
    return touch, mean, variance


def _transition(states: list[float], width: list[float], scale: float) -> Array:
    """Row: state before; column: state after."""
    matrix = np.zeros((49, 49))
    opened = [0.0] + [math.exp(-(g - states[1]) / scale) * w for g, w in zip(states[1:], width[1:], strict=True)]
    for q in range(1, 49):
        matrix[0, q] = 0.05 * opened[q] / sum(opened)
        closes = 0.5 * math.exp(-states[q] / scale)
        moved = [math.exp(-abs(states[q] - states[r]) / scale) * width[r] for r in range(49)]
        for r in range(1, 49):
            matrix[q, r] = (1.0 - closes) * moved[r] / sum(moved)
        matrix[q, 0] = closes
    matrix[0, 0] = 0.95
    return matrix


def _likelihood(measured: float, sigma: float, states: list[float]) -> Array:
    """Likelihood of a measured gap in every state; outliers are clipped to the range of the states."""
    if math.isnan(measured):
        return np.ones(49)
    measured = min(max(measured, -5.0 * sigma), states[-1])
    return np.array([max(math.exp(-0.5 * ((measured - g) / sigma) ** 2), 1e-12) for g in states])


def _true_gap(
    share: Array, states: list[float], width: list[float], measured: float, sigma: float, overlap: float
) -> tuple[float, float]:
    """Combine each state, a normal distribution with its own width and that of the overlaps, with the measurement."""
    laws = []
    for g, w in zip(states, width, strict=True):
        spread = overlap**2 + w**2 / 12.0
        if math.isnan(measured) or spread == 0.0:
            laws.append((g, spread))
            continue
        error = max(sigma**2 - overlap**2, (1e-3 * sigma) ** 2)
        precision = 1.0 / spread + 1.0 / error
        laws.append(((g / spread + (measured + 0.5 * overlap) / error) / precision, 1.0 / precision))
    mean = sum(p * m for p, (m, _) in zip(share, laws, strict=True))
    variance = sum(p * (v + (m - mean) ** 2) for p, (m, v) in zip(share, laws, strict=True))
    return mean - 0.5 * overlap, variance
