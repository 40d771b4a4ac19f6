"""Compiled sums over gaps for the mixture of touching and open gaps: likelihood, P(touch) and its moments."""

from __future__ import annotations

import math

from numba import njit

from .sampler.truncated_normal import ROOT_TWO_PI, mills_ratio

MIN_DENSITY = 1e-300
FAR = 8.0  # standard deviations beyond which the normal CDF counts as 0 or 1


@njit(inline="always")
def _densities(z, reach):  # type: ignore[no-untyped-def]
    """φ(z) of a touching gap and Φ(z) − Φ(z − reach) of an open one, z ≤ reach, all in standard deviations."""
    bell = math.exp(-0.5 * z * z) / ROOT_TWO_PI
    if z > FAR:
        opened = 1.0
    elif z > 0.0:
        opened = 1.0 - bell * mills_ratio(z)
    else:
        opened = bell * mills_ratio(-z)
    z -= reach
    if z > -FAR:
        opened -= mills_ratio(-z) * math.exp(-0.5 * z * z) / ROOT_TWO_PI
    return bell, max(opened, 0.0)


@njit(cache=True, nogil=True, error_model="numpy")
def accumulate_gaps(gap, mean, reach, s, fraction, by_pair, by_frame):  # type: ignore[no-untyped-def]
    """Compute the log likelihood of gaps and the sums that expectation maximisation needs.

    gap (f, c) [m], NaN where unknown; mean (c,) [m] of touching gaps; reach (c,) [m] beyond it; s [m]; fraction (f,)
    that touches. Out: by_pair (3, c), Σ w, Σ w r and Σ w r² over the frames, w = P(touch), r = gap − mean [m];
    by_frame (f,), Σ w over the pairs.
    """
    frames, pairs = gap.shape
    for c in range(pairs):
        by_pair[0, c] = by_pair[1, c] = by_pair[2, c] = 0.0
    likelihood = 0.0
    for f in range(frames):
        part = touched = 0.0  # per frame: rounding of one long sum would hide convergence
        for c in range(pairs):
            if math.isnan(gap[f, c]):
                continue
            rest = gap[f, c] - mean[c]
            bell, opened = _densities(rest / s, reach[c] / s)
            touching = fraction[f] * bell / s
            density = max(touching + (1.0 - fraction[f]) * opened / max(reach[c], s), MIN_DENSITY)
            part += math.log(density)
            w = touching / density
            touched += w
            by_pair[0, c] += w
            by_pair[1, c] += w * rest
            by_pair[2, c] += w * rest * rest
        likelihood += part
        by_frame[f] = touched
    return likelihood


@njit(cache=True, nogil=True, error_model="numpy")
def compute_touch_probabilities(gap, mean, reach, s, fraction, touch):  # type: ignore[no-untyped-def]
    """Set P(touch) (f, c) of gaps (f, c) [m]; 0 where they are unknown or beyond reach. Arguments as above."""
    for f in range(len(gap)):
        for c in range(len(mean)):
            rest = gap[f, c] - mean[c]
            touch[f, c] = 0.0
            if rest < reach[c]:
                bell, opened = _densities(rest / s, reach[c] / s)
                touching = fraction[f] * bell / s
                touch[f, c] = touching / max(touching + (1.0 - fraction[f]) * opened / max(reach[c], s), MIN_DENSITY)
