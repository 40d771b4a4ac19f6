"""Variances of centre and radius errors, from how the gaps of one grain vary together.

A radius that is too small widens all gaps of its grain; an error of a centre widens those on one side and narrows
those on the other. Noise of photographs counts as an error of centres. Elastic overlap is common to the gaps of a grain
under more pressure than others and looks like a radius error: its part follows from the mean overlap.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..bodies.grains import Array
from ..contacts.contacts import Contacts

GRAIN_PRESSURE_SD = 0.5  # standard deviation of the grains' mean normal forces, over their mean


@dataclass(frozen=True, slots=True)
class ErrorVariances:
    """Variances of the errors that belong to single grains."""

    radius: float  # σ_r² [m²], common to all gaps of a grain, overlap included
    centre: float  # σ_c² [m²], of a centre's coordinate

    def radius_sd(self, overlap: float) -> float:
        """Compute the standard deviation of the radii [m], given the mean overlap [m] of touching surfaces.

        Notes
        -----
        σ = √max(σ_r² − (0.5 overlap)², 0).
        """
        return float(np.sqrt(max(self.radius - (GRAIN_PRESSURE_SD * overlap) ** 2, 0.0)))


def estimate_error_variances(frames: list[tuple[Contacts, Array, Array]]) -> ErrorVariances:
    """Estimate the variances of radius and centre errors.

    Parameters
    ----------
    frames : list of (Contacts, array (c,), array (c,))
        For each frame: contacts between grains (c), their gaps less the mean gap of touching pairs (c,) [m], and the
        weights P(touch) (c,).

    Notes
    -----
    Residuals e, e' of two gaps of one grain, with normals n, n' from the grain's side, have the covariance

        E[e e'] = σ_r² + σ_c² n·n'.

    Both variances follow by linear least squares over all ordered pairs of different gaps of a grain, weighted by
    P(touch) P'(touch); negative estimates are set to zero.
    """
    normal_matrix, right = np.zeros((2, 2)), np.zeros(2)
    for contacts, rest, weight in frames:
        part, side = _sum_products(contacts, rest, weight)
        normal_matrix += part
        right += side
    if not normal_matrix[0, 0] > 0.0:
        return ErrorVariances(0.0, 0.0)
    radius, centre = np.linalg.lstsq(normal_matrix, right, rcond=1e-9)[0]
    return ErrorVariances(max(float(radius), 0.0), max(float(centre), 0.0))


def _sum_products(contacts: Contacts, rest: Array, weight: Array) -> tuple[Array, Array]:
    """Sum the normal equations of least squares on 1 and n·n' over all ordered pairs of different gaps of a grain."""
    n = contacts.grain_count
    grain = np.concatenate([contacts.i, contacts.j])
    x, y = np.concatenate([contacts.normal, -contacts.normal]).T
    w, e = np.tile(weight, 2), np.tile(weight * rest, 2)

    def pairs(value: NDArray[np.float64]) -> float:
        """Sum value · value' over different gaps of one grain."""
        return float(np.sum(np.bincount(grain, value, minlength=n) ** 2) - np.sum(value**2))

    ones, cosine = pairs(w), pairs(w * x) + pairs(w * y)
    square = pairs(w * x * x) + pairs(w * y * y) + 2.0 * pairs(w * x * y)
    return np.array([[ones, cosine], [cosine, square]]), np.array([pairs(e), pairs(e * x) + pairs(e * y)])
