"""One-sided robust weights of measured gaps, and the standard deviation of touching gaps."""

from __future__ import annotations

import numpy as np

from ..bodies.grains import Array
from ..robust_scale import NORMAL_MEDIAN

FINAL_SCALE = 2.0  # final s over the noise of a gap: a smaller one would cut off contacts by their own noise
MAX_DEPTH = 2.0  # times s: a deeper overlap is a tracking error


def contact_width(gap: Array, overlap: float) -> float:
    """Estimate the standard deviation [m] of touching gaps from their overlapping side, which open gaps do not reach.

    Parameters
    ----------
    gap : array (m,)
        Gaps [m].
    overlap : float
        Typical elastic overlap ō [m].

    Notes
    -----
    The median of −(g + ō) over g < −ō, divided by 0.6745, the median of |N(0, 1)|; 0 without overlaps.
    """
    depth = -(gap + overlap)
    depth = depth[depth > 0.0]
    return float(np.median(depth)) / NORMAL_MEDIAN if len(depth) else 0.0


def weigh_gaps(excess: Array) -> Array:
    """Compute the weights (m,) of gaps that exceed contact by `excess` (m,) times s.

    Notes
    -----
    W(e) = (1 + e²)⁻² for open gaps, e ≥ 0; 1 for overlaps, −2 ≤ e < 0; (2/e)² for deeper ones, which no error of
    centres or noise explains.
    """
    opened = (1.0 + np.maximum(excess, 0.0) ** 2) ** -2.0
    return opened * np.minimum(1.0, MAX_DEPTH / np.maximum(-excess, MAX_DEPTH)) ** 2


def weighting_bias(s: Array, sigma: Array) -> Array:
    """Compute by how much the weighted mean of touching gaps lies below contact (m,) [m].

    Noise that opens a gap reduces its weight, noise that closes it does not. Without this term all contacts would be
    fitted as overlapping.

    Parameters
    ----------
    s : array (m,)
        Scale of the weights [m].
    sigma : array (m,)
        Standard deviation [m] of a gap by the noise of positions.

    Notes
    -----
    β = −∫ σ ξ W(σ ξ/s) φ(ξ) dξ / ∫ W(σ ξ/s) φ(ξ) dξ, φ the standard normal density, from a table in σ/s.
    """
    return -sigma * np.interp(sigma / s, *_BIAS)


def _tabulate_bias() -> tuple[Array, Array]:
    """Tabulate −β/σ over σ/s, which is never greater than at the final scale."""
    noise = np.linspace(-6.0, 6.0, 241)
    ratio = np.linspace(0.0, 1.0 / FINAL_SCALE, 41)
    weighted = weigh_gaps(ratio[:, None] * noise) * np.exp(-0.5 * noise**2)
    return ratio, weighted @ noise / weighted.sum(axis=1)


_BIAS = _tabulate_bias()
