"""The mixture of touching and open gaps, looked at gap by gap: what each says of its pair, and sums of that."""

from __future__ import annotations

import math

from numba import njit

from solver.posterior.sampler.draws import ROOT_TWO_PI, mills_ratio

NO_DENSITY = 1e-300
FAR = 8.0  # standard deviations beyond which the normal CDF is 0 or 1 for what is told here


@njit(inline="always")
def _densities(z, room):  # type: ignore[no-untyped-def]
    """φ(z) of a touching gap and Φ(z) − Φ(z − room) of an open one, z ≤ room, all in standard deviations."""
    bell = math.exp(-0.5 * z * z) / ROOT_TWO_PI
    if z > FAR:
        opened = 1.0
    elif z > 0.0:
        opened = 1.0 - bell * mills_ratio(z)
    else:
        opened = bell * mills_ratio(-z)
    z -= room
    if z > -FAR:
        opened -= mills_ratio(-z) * math.exp(-0.5 * z * z) / ROOT_TWO_PI
    return bell, max(opened, 0.0)


@njit(cache=True, nogil=True, error_model="numpy")
def add_gaps(gap, mean, room, s, share, by_pair, by_frame):  # type: ignore[no-untyped-def]
    """Logarithm of the likelihood of gaps (f, c) [m], NaN where unknown; and set the sums of what they say.

    mean, room (c,) [m]: of touching gaps, and from there to the reach; s [m]; share (f,). by_pair (3, c) out: Σ w,
    Σ w r and Σ w r² over the frames, w = P(touch) and r [m] what the gap exceeds the mean by; by_frame (f,) out: Σ w.
    """
    frames, pairs = gap.shape
    for c in range(pairs):
        by_pair[0, c] = by_pair[1, c] = by_pair[2, c] = 0.0
    likelihood = 0.0
    for f in range(frames):
        part = touched = 0.0  # frame by frame, lest rounding of a long sum hide that nothing changes
        for c in range(pairs):
            if math.isnan(gap[f, c]):
                continue
            rest = gap[f, c] - mean[c]
            bell, opened = _densities(rest / s, room[c] / s)
            touching = share[f] * bell / s
            density = max(touching + (1.0 - share[f]) * opened / max(room[c], s), NO_DENSITY)
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
def weigh_gaps(gap, mean, room, s, share, touch):  # type: ignore[no-untyped-def]
    """P(touch) (f, c), out, of gaps (f, c) [m]; 0 where they are unknown or beyond their room. The rest as above."""
    for f in range(len(gap)):
        for c in range(len(mean)):
            rest = gap[f, c] - mean[c]
            touch[f, c] = 0.0
            if rest < room[c]:
                bell, opened = _densities(rest / s, room[c] / s)
                touching = share[f] * bell / s
                touch[f, c] = touching / max(touching + (1.0 - share[f]) * opened / max(room[c], s), NO_DENSITY)
