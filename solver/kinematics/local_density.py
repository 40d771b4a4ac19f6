"""Local solid fraction around every grain, from the Delaunay triangles between centres."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import Delaunay, QhullError

from ..bodies.grains import Array

LARGEST_CIRCLE = 1.5  # radius around the corners of a triangle in the packing, in largest diameters; slivers exceed it


def triangulate(position: Float[Array, "n 2"], radius: Float[Array, " n"]) -> Int[np.ndarray, "t 3"]:
    """Return the Delaunay triangles (t, 3) of grains that are seen; without those that span its outside.

    Parameters
    ----------
    position : (n, 2)
        Positions [m]; NaN: not seen.
    radius : (n,)
        Radii [m].
    """
    seen = np.flatnonzero(np.isfinite(position).all(axis=1))
    none = np.empty((0, 3), np.int64)
    if len(seen) < 3:
        return none
    try:
        triangle = seen[Delaunay(position[seen]).simplices]
    except QhullError:  # all centres on a line
        return none
    corner = position[triangle]
    edge = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2)
    area = 0.5 * np.abs(_cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]))
    largest = LARGEST_CIRCLE * 2.0 * float(radius.max())  # radius: product of the edges over four times the area
    return triangle[edge.prod(axis=1) < largest * 4.0 * area]


def local_solid_fraction(
    position: Float[Array, "n 2"], radius: Float[Array, " n"], triangle: Int[np.ndarray, "t 3"]
) -> Float[Array, " n"]:
    """Return the solid fraction (n,) of the triangles around every grain; NaN where they do not surround it.

    Notes
    -----
    φ_i = Σ_t Σ_k ½ α_tk R_k² / Σ_t A_t over the triangles t that have the grain i as a corner, with α_tk the angle of t
    at its corner k: the sectors of its three grains over its area. Triangles as in K. Bagi, Mech. Mater. 22, 165,
    1996.
    """
    corner = position[triangle]
    following, preceding = np.roll(corner, -1, axis=1) - corner, np.roll(corner, 1, axis=1) - corner
    cross = np.abs(_cross(following, preceding))
    angle = np.arctan2(cross, np.sum(following * preceding, axis=-1))
    solid = np.sum(0.5 * angle * radius[triangle] ** 2, axis=1)
    area = 0.5 * cross[:, 0]
    count = len(radius)
    filled = np.bincount(triangle.ravel(), np.repeat(solid, 3), count)
    whole = np.bincount(triangle.ravel(), np.repeat(area, 3), count)
    inside = (whole > 0.0) & ~_on_outside(triangle, count)
    return np.where(inside, filled / np.maximum(whole, np.finfo(float).tiny), np.nan)


def _on_outside(triangle: Int[np.ndarray, "t 3"], count: int) -> Bool[np.ndarray, " n"]:
    """Return which grains (n,) are ends of an edge that only one triangle has."""
    one, other = triangle.ravel().astype(np.int64), np.roll(triangle, 1, axis=1).ravel()
    edge, times = np.unique(np.minimum(one, other) * count + np.maximum(one, other), return_counts=True)
    outside = np.zeros(count, np.bool_)
    once = edge[times == 1]
    outside[once // count] = outside[once % count] = True
    return outside


def _cross(a: Array, b: Array) -> Array:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
