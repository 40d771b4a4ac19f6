"""Spatial correlation of a vector field on the grains."""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float
from numba import njit

from ..bodies.grains import Array

DISTANCE_EDGES = np.linspace(0.0, 20.0, 41)  # of the bins of distances, in mean diameters
DISTANCE_BINS = len(DISTANCE_EDGES) - 1
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
    pairs, total = np.zeros(DISTANCE_BINS, np.int64), np.zeros(DISTANCE_BINS)
    order = np.argsort(place[:, 0], kind="stable")
    _add_pairs(place[order], field[order], float(DISTANCE_EDGES[-1]), pairs, total)
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
def _add_pairs(place, field, reach, pairs, total):  # type: ignore[no-untyped-def]
    """Count the pairs closer than `reach` in bins of equal width and add up their products; ascending place[:, 0]."""
    square, scale = reach * reach, len(pairs) / reach
    for a in range(len(place)):
        x, y, u, v = place[a, 0], place[a, 1], field[a, 0], field[a, 1]
        for b in range(a + 1, len(place)):
            dx = place[b, 0] - x
            if dx > reach:
                break
            dy = place[b, 1] - y
            distance = dx * dx + dy * dy
            if distance < square:
                k = min(int(scale * math.sqrt(distance)), len(pairs) - 1)  # the root may round up to the reach
                pairs[k] += 1
                total[k] += u * field[b, 0] + v * field[b, 1]
