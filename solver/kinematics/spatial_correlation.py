"""Spatial correlation of a vector field on the grains."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numba import njit

from ..bodies.grains import Array

DISTANCE_EDGES = np.linspace(0.0, 20.0, 41)  # of the bins of distances, in mean diameters
DISTANCE_BINS = len(DISTANCE_EDGES) - 1
# Bin by the whole part of the squared distance, in widths of a bin, as floor √x = floor √(floor x); the last: beyond.
_BIN_OF_SQUARE = np.append(np.sqrt(np.arange(DISTANCE_BINS**2)), DISTANCE_BINS).astype(np.int32)
FEWEST_PAIRS = 20  # in a bin


def correlate_in_space(position: Float[Array, "n 2"], vector: Float[Array, "n 2"], diameter: float) -> Array:
    """Return C(r) in the bins of DISTANCE_EDGES (DISTANCE_BINS,), NaN in bins of fewer than FEWEST_PAIRS pairs.

    Parameters
    ----------
    position : (n, 2)
        Positions [m]; NaN: not seen.
    vector : (n, 2)
        A field of zero mean; NaN: unknown.
    diameter : float
        Mean diameter [m], the unit of r.

    Notes
    -----
    C(r) = ⟨u_i · u_j⟩ / ⟨|u|²⟩ over the pairs at the distance r.
    """
    known = np.flatnonzero(np.isfinite(np.hstack([position, vector])).all(axis=1))
    result = np.full(DISTANCE_BINS, np.nan)
    if len(known) < 2:
        return result
    place, field = position[known] / diameter, vector[known]
    square = float(np.mean(np.sum(field**2, axis=1)))
    if not square > 0.0:
        return result
    pairs, total = np.zeros(DISTANCE_BINS + 1, np.int64), np.zeros(DISTANCE_BINS + 1)
    order = np.argsort(place[:, 0], kind="stable")
    sorted_place, sorted_field = np.ascontiguousarray(place[order].T), np.ascontiguousarray(field[order].T)
    _add_pairs(sorted_place, sorted_field, float(DISTANCE_EDGES[-1]), _BIN_OF_SQUARE, pairs, total)
    pairs, total = pairs[:-1], total[:-1]
    enough = pairs >= FEWEST_PAIRS
    result[enough] = total[enough] / (pairs[enough] * square)
    return result


def correlation_length(correlation: Array) -> float:
    """Return the distance [mean diameters] at which C(r) first falls below 1/e; NaN where it never does."""
    middle = 0.5 * (DISTANCE_EDGES[1:] + DISTANCE_EDGES[:-1])
    known = np.isfinite(correlation)
    r, c = np.append(0.0, middle[known]), np.append(1.0, correlation[known])
    below = np.flatnonzero(c < np.exp(-1.0))
    if not len(below):
        return float("nan")
    k = int(below[0])
    return float(r[k - 1] + (r[k] - r[k - 1]) * (c[k - 1] - np.exp(-1.0)) / (c[k - 1] - c[k]))


@njit(cache=True, nogil=True, error_model="numpy")
def _add_pairs(place, field, reach, bin_of_square, pairs, total):  # type: ignore[no-untyped-def]
    """Count the pairs in bins of equal width up to `reach`, then one beyond, and add up their products.

    place, field (2, n), with ascending place[0].
    """
    scale, last, end = ((len(pairs) - 1) / reach) ** 2, len(bin_of_square) - 1.0, 0
    for a in range(place.shape[1]):
        x, y, u, v = place[0, a], place[1, a], field[0, a], field[1, a]
        while end < place.shape[1] and not place[0, end] - x > reach:
            end += 1
        for b in range(a + 1, end):
            dx, dy = place[0, b] - x, place[1, b] - y
            k = bin_of_square[int(min(scale * (dx * dx + dy * dy), last))]
            pairs[k] += 1
            total[k] += u * field[0, b] + v * field[1, b]
