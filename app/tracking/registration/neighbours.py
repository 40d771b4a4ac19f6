"""Local motion and local medians over a grain's neighbours, and overlapping pairs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ...solver.bodies.grains import Array
from .neighbour_kernels import find_nearest, fit_motion

NEIGHBOUR_COUNT = 12

# With fewer neighbours the prediction is their median, without a gradient.
AFFINE_COUNT = 6


def local_motion(known: Array, displacement: Array, query: Array, *, exclude_self: bool) -> tuple[Array, Array]:
    """Predict displacements from those of the nearest known grains.

    Parameters
    ----------
    known : (k, 2) array
        Positions of the known grains [px].
    displacement : (k, 2) array
        Their displacements [px].
    query : (m, 2) array
        Positions of the predictions [px].
    exclude_self : bool
        Every query is one of the known grains, the one at distance zero, which is then left out of its own prediction.

    Returns
    -------
    prediction : (m, 2) array
        Predicted displacements [px]; NaN without neighbours.
    median_deviation : (m,) array
        Median distance of the neighbours' displacements from the fit [px]; NaN without neighbours.

    Notes
    -----
    The prediction is the constant term of a local affine fit u(x) = ū + a + B (x − x_q) / h to the twelve nearest
    grains, ū: their median displacement, h: the distance of the farthest. Weights are exp(−2 (r/h)²), zero where a
    displacement deviates from ū by more than 4 median deviations and 0.25 px.
    """
    m = len(query)
    wanted = NEIGHBOUR_COUNT + int(exclude_self)
    available = min(wanted, len(known))
    if m == 0 or available <= int(exclude_self):
        return np.full((m, 2), np.nan), np.full(m, np.nan)
    index = _nearest(known, query, available)[:, int(exclude_self) :]
    prediction, median_deviation = np.empty((m, 2)), np.empty(m)
    fit_motion(
        np.ascontiguousarray(known, np.float64), np.ascontiguousarray(displacement, np.float64),
        np.ascontiguousarray(query, np.float64), np.ascontiguousarray(index), AFFINE_COUNT, prediction,
        median_deviation,
    )  # fmt: skip
    return prediction, median_deviation


def _nearest(known: Array, query: Array, count: int) -> NDArray[np.intp]:
    """Rows (m, count) of the known grains nearest to each place, nearest first."""
    if not (np.isfinite(known).all() and np.isfinite(query).all()):
        raise ValueError("neighbours are sought of finite positions")
    index = np.empty((len(query), count), np.intp)
    find_nearest(
        np.ascontiguousarray(known, np.float64), np.ascontiguousarray(query, np.float64), index,
        np.empty((len(query), count)),
    )  # fmt: skip
    return index


def nearby_median(known: Array, value: Array, query: Array, count: int = NEIGHBOUR_COUNT) -> Array:
    """Return the median of `value` (k,) over the nearest `known` (k, 2) [px] grains, at `query` (m, 2) [px]."""
    if len(known) == 0:
        return np.full(len(query), np.nan)
    count = min(count, len(known))
    return np.median(value[_nearest(known, query, count)], axis=1)


def overlaps(position: Array, radius: Array, allowed: float) -> NDArray[np.intp]:
    """Return the pairs (p, 2) of grains that overlap by more than the fraction `allowed` of the smaller radius."""
    if len(position) < 2:
        return np.empty((0, 2), np.intp)
    pairs = KDTree(position).query_pairs(2.0 * float(radius.max()), output_type="ndarray")
    i, j = pairs[:, 0], pairs[:, 1]
    distance = np.linalg.norm(position[i] - position[j], axis=1)
    smaller = np.minimum(radius[i], radius[j])
    return pairs[distance < radius[i] + radius[j] - allowed * smaller]
