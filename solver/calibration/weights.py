"""One-sided robust weights: which measured gaps speak of a contact, and how wide the gaps of contacts are."""

from __future__ import annotations

import numpy as np

from solver.bodies.grains import Array

FINAL_SCALE = 2.0  # final s over the noise of a gap: with less, gaps of contacts are cut off by their own noise
DEEPEST = 2.0  # times s: a deeper overlap is the error of a track
NORMAL_MEDIAN = 0.6745  # median of |N(0, 1)|


def contact_width(gap: Array, overlap: float) -> float:
    """Estimate the standard deviation of the gaps of touching pairs, from their overlapping side alone [m].

    Open gaps lie on the other side and do not count. gap (m,) [m]; overlap [m] is the typical elastic one.
    """
    depth = -(gap + overlap)
    depth = depth[depth > 0.0]
    return float(np.median(depth)) / NORMAL_MEDIAN if len(depth) else 0.0


def weigh_gaps(excess: Array) -> Array:
    """Weight (m,) of gaps that exceed contact by `excess` (m,) times s.

    An open gap counts less the wider it is. An overlap counts in full, however it fits, until it is deeper
    than any error of centres or noise makes it.
    """
    opened = (1.0 + np.maximum(excess, 0.0) ** 2) ** -2.0
    return opened * np.minimum(1.0, DEEPEST / np.maximum(-excess, DEEPEST)) ** 2


def weighting_bias(s: Array, sigma: Array) -> Array:
    """How far below contact the weighted mean of the gaps of touching pairs lies (m,) [m].

    s (m,) [m] is the scale of the weights, sigma (m,) [m] the noise that positions bring to a gap. Noise that
    opens a gap is down-weighted, noise that closes it is not: unless this is made good, all contacts are
    drawn apart.
    """
    noise = np.linspace(-6.0, 6.0, 241)
    ratio = np.linspace(0.0, 1.0 / FINAL_SCALE, 41)  # sigma / s is never greater
    weighted = weigh_gaps(ratio[:, None] * noise) * np.exp(-0.5 * noise**2)
    mean = weighted @ noise / weighted.sum(axis=1)
    return -sigma * np.interp(sigma / s, ratio, mean)
