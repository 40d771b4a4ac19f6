"""Localisation of strain, and the shear band that it forms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..bodies.grains import Array

INTENSE = 2.0  # local shear strain of a band over the mean of the packing, at least
LEAST_ELONGATION = 3.0  # length over thickness of a band
LEAST_FRACTION = 0.05  # of the grains


@dataclass(frozen=True, slots=True)
class ShearBand:
    """The greatest connected zone of intense shear; without one, no grain and NaN."""

    member: Bool[np.ndarray, " n"]
    angle: float  # [rad] of its long axis, counter-clockwise from x, in (−π/2, π/2]
    thickness: float  # [m]


def participation(value: Float[Array, " n"]) -> float:
    """Return the participation ratio of values that are not negative: 1 where all are equal, 1/n where one has all.

    Notes
    -----
    P = (Σ γ)² / (n Σ γ²), over the known values.
    """
    known = value[np.isfinite(value)]
    square = float(np.sum(known**2))
    return float(np.sum(known)) ** 2 / (len(known) * square) if square > 0.0 else float("nan")


def find_shear_band(
    position: Float[Array, "n 2"], shear: Float[Array, " n"], triangle: Int[np.ndarray, "t 3"]
) -> ShearBand:
    """Find a band: connected grains whose shear strain exceeds twice the mean, in an elongated zone.

    Parameters
    ----------
    position : (n, 2)
        Positions [m].
    shear : (n,)
        Local shear strain; NaN: unknown.
    triangle : (t, 3)
        Delaunay triangles, whose edges connect neighbours.

    Notes
    -----
    With λ₁ ≥ λ₂ the variances of the zone's centres along its principal axes, its length and thickness are √(12 λ):
    those of a rectangle of uniform density. It is a band if √(λ₁/λ₂) ≥ 3 and it has 5 % of the grains.
    """
    count = len(shear)
    none = ShearBand(np.zeros(count, np.bool_), float("nan"), float("nan"))
    known = np.isfinite(shear)
    if not known.any() or not len(triangle):
        return none
    intense = known & (np.nan_to_num(shear) > INTENSE * float(shear[known].mean()))
    i, j = triangle.ravel(), np.roll(triangle, 1, axis=1).ravel()
    edge = intense[i] & intense[j]
    graph = coo_array((np.ones(edge.sum()), (i[edge], j[edge])), shape=(count, count))
    label = connected_components(graph, directed=False)[1]
    size = np.bincount(label[intense], minlength=count)
    member = intense & (label == int(np.argmax(size)))
    if member.sum() < max(LEAST_FRACTION * known.sum(), 3):
        return none
    variance, axis = np.linalg.eigh(np.cov(position[member].T))
    if not variance[1] >= LEAST_ELONGATION**2 * max(variance[0], np.finfo(float).tiny):
        return none
    angle = float(np.arctan2(axis[1, 1], axis[0, 1]))
    angle = angle - np.pi if angle > 0.5 * np.pi else angle + np.pi if angle <= -0.5 * np.pi else angle
    return ShearBand(member, angle, float(np.sqrt(12.0 * variance[0])))
