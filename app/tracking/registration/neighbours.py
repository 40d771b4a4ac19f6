"""Local motion and local medians over a grain's neighbours, and overlapping pairs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ...solver.bodies.grains import Array

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
    distance, index = KDTree(known).query(query, k=available)
    distance, index = distance.reshape(m, available), index.reshape(m, available)
    if exclude_self:
        distance, index = distance[:, 1:], index[:, 1:]
    moved = displacement[index]  # (m, k, 2)
    median = np.median(moved, axis=1)
    deviation = np.linalg.norm(moved - median[:, None, :], axis=2)
    median_deviation = np.median(deviation, axis=1)
    if index.shape[1] < AFFINE_COUNT:
        return median, median_deviation

    farthest = np.maximum(distance[:, -1:], 1e-9)
    # The quarter of a pixel keeps all neighbours where the motion is perfectly uniform.
    agree = deviation < 4.0 * median_deviation[:, None] + 0.25
    weight = np.exp(-2.0 * (distance / farthest) ** 2) * agree
    design = np.concatenate(
        [np.ones((*index.shape, 1)), (known[index] - query[:, None, :]) / farthest[:, :, None]], axis=2
    )
    residual = moved - median[:, None, :]
    normal = np.einsum("mk,mki,mkj->mij", weight, design, design)
    # Neighbours on one line do not determine the gradient across it, which is regularised to zero.
    normal[:, 1, 1] += 1e-2
    normal[:, 2, 2] += 1e-2
    right = np.einsum("mk,mki,mkj->mij", weight, design, residual)
    normal[:, 0, 0] += 1e-9
    solution = np.linalg.solve(normal, right)
    misfit = np.linalg.norm(residual - np.einsum("mki,mij->mkj", design, solution), axis=2)
    return median + solution[:, 0, :], np.median(misfit, axis=1)


def nearby_median(known: Array, value: Array, query: Array, count: int = NEIGHBOUR_COUNT) -> Array:
    """Return the median of `value` (k,) over the nearest `known` (k, 2) [px] grains, at `query` (m, 2) [px]."""
    if len(known) == 0:
        return np.full(len(query), np.nan)
    count = min(count, len(known))
    _, index = KDTree(known).query(query, k=count)
    return np.median(value[index.reshape(len(query), count)], axis=1)


def overlaps(position: Array, radius: Array, allowed: float) -> NDArray[np.intp]:
    """Return the pairs (p, 2) of grains that overlap by more than the fraction `allowed` of the smaller radius."""
    if len(position) < 2:
        return np.empty((0, 2), np.intp)
    pairs = KDTree(position).query_pairs(2.0 * float(radius.max()), output_type="ndarray")
    i, j = pairs[:, 0], pairs[:, 1]
    distance = np.linalg.norm(position[i] - position[j], axis=1)
    smaller = np.minimum(radius[i], radius[j])
    return pairs[distance < radius[i] + radius[j] - allowed * smaller]
