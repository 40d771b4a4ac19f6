"""Spatial correlation of a vector field on the grains."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.spatial import KDTree

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
    i, j = KDTree(place).query_pairs(float(DISTANCE_EDGES[-1]), output_type="ndarray").T
    distance = np.linalg.norm(place[i] - place[j], axis=1)
    number = np.clip(np.digitize(distance, DISTANCE_EDGES) - 1, 0, DISTANCE_BINS - 1)
    pairs = np.bincount(number, minlength=DISTANCE_BINS)
    total = np.bincount(number, np.einsum("pk,pk->p", field[i], field[j]), DISTANCE_BINS)
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
