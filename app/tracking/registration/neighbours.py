"""What a grain's neighbours say about where it should be."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from solver.bodies.grains import Array

NEIGHBOUR_COUNT = 12

# Fewer neighbours than this give a median, not a gradient.
AFFINE_COUNT = 6


def local_motion(known: Array, displacement: Array, query: Array, *, itself: bool) -> tuple[Array, Array]:
    """Predict displacements at `query` (m, 2) [px] from those of `known` (k, 2) [px] grains.

    A robust local affine motion of the twelve nearest: the median displacement first, then a weighted
    affine fit of those that agree with it. `itself`: every query is one of the known grains, the one at
    distance zero, and must not vouch for itself. Returns the prediction (m, 2) [px] and the
    neighbours' scatter about it (m,) [px]; NaN where there are no neighbours.
    """
    m = len(query)
    wanted = NEIGHBOUR_COUNT + int(itself)
    available = min(wanted, len(known))
    if m == 0 or available <= int(itself):
        return np.full((m, 2), np.nan), np.full(m, np.nan)
    distance, index = KDTree(known).query(query, k=available)
    distance, index = distance.reshape(m, available), index.reshape(m, available)
    if itself:
        distance, index = distance[:, 1:], index[:, 1:]
    moved = displacement[index]  # (m, k, 2)
    middle = np.median(moved, axis=1)
    deviation = np.linalg.norm(moved - middle[:, None, :], axis=2)
    scatter = np.median(deviation, axis=1)
    if index.shape[1] < AFFINE_COUNT:
        return middle, scatter

    reach = np.maximum(distance[:, -1:], 1e-9)
    # A quarter of a pixel keeps a perfectly uniform motion from excluding everybody.
    agree = deviation < 4.0 * scatter[:, None] + 0.25
    weight = np.exp(-2.0 * (distance / reach) ** 2) * agree
    design = np.concatenate(
        [np.ones((*index.shape, 1)), (known[index] - query[:, None, :]) / reach[:, :, None]], axis=2
    )
    residual = moved - middle[:, None, :]
    normal = np.einsum("mk,mki,mkj->mij", weight, design, design)
    # Neighbours on one line leave a direction open: its gradient is drawn to zero.
    normal[:, 1, 1] += 1e-2
    normal[:, 2, 2] += 1e-2
    right = np.einsum("mk,mki,mkj->mij", weight, design, residual)
    normal[:, 0, 0] += 1e-9
    solution = np.linalg.solve(normal, right)
    misfit = np.linalg.norm(residual - np.einsum("mki,mij->mkj", design, solution), axis=2)
    return middle + solution[:, 0, :], np.median(misfit, axis=1)


def nearby_median(known: Array, value: Array, query: Array, count: int = NEIGHBOUR_COUNT) -> Array:
    """Median of `value` (k,) over the nearest of the `known` (k, 2) [px] grains, at `query` (m, 2) [px]."""
    if len(known) == 0:
        return np.full(len(query), np.nan)
    count = min(count, len(known))
    _, index = KDTree(known).query(query, k=count)
    return np.median(value[index.reshape(len(query), count)], axis=1)


def overlaps(position: Array, radius: Array, allowed: float) -> NDArray[np.intp]:
    """Pairs (p, 2) of grains that overlap by more than the share `allowed` of the smaller radius."""
    if len(position) < 2:
        return np.empty((0, 2), np.intp)
    pairs = KDTree(position).query_pairs(2.0 * float(radius.max()), output_type="ndarray")
    i, j = pairs[:, 0], pairs[:, 1]
    distance = np.linalg.norm(position[i] - position[j], axis=1)
    smaller = np.minimum(radius[i], radius[j])
    return pairs[distance < radius[i] + radius[j] - allowed * smaller]
