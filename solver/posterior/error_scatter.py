"""Errors of centres and of radii told apart by how the gaps of one grain vary together.

A radius that is too small widens all gaps of its grain, an error of a centre widens those on one side and narrows those
on the other. Gaps of touching pairs that meet at a grain therefore have the covariance σ_r² + σ_c² n·n', with n, n'
their directions as the grain sees them; noise of photographs counts as an error of centres. Elastic overlap is common
to the gaps of a grain that is squeezed more than others and would look like a radius: its part follows from the mean
overlap.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.contacts.contacts import Contacts

PRESSURE_SCATTER = 0.5  # standard deviation over the mean of the normal forces' average on a grain


@dataclass(frozen=True, slots=True)
class ErrorScatter:
    """Variances of what every grain has for itself."""

    radius: float  # σ_r² [m²], of what all gaps of a grain share, overlap included
    centre: float  # σ_c² [m²], of a centre's coordinate
    products: float  # weight of pairs of gaps that it rests on

    def radius_deviation(self, overlap: float) -> float:
        """Standard deviation of the radii [m] where touching surfaces overlap by so much [m] on average."""
        return float(np.sqrt(max(self.radius - (PRESSURE_SCATTER * overlap) ** 2, 0.0)))


def scatter_of(frames: list[tuple[Contacts, Array, Array]]) -> ErrorScatter:
    """Tell the errors apart from frames of pairs of grains: contacts (c), what their gaps exceed the mean by (c,) [m],
    and weights P(touch) (c,).
    """
    normal_matrix, right = np.zeros((2, 2)), np.zeros(2)
    for contacts, rest, weight in frames:
        part, side = _products_of(contacts, rest, weight)
        normal_matrix += part
        right += side
    if not normal_matrix[0, 0] > 0.0:
        return ErrorScatter(0.0, 0.0, 0.0)
    radius, centre = np.linalg.lstsq(normal_matrix, right, rcond=1e-9)[0]
    return ErrorScatter(max(float(radius), 0.0), max(float(centre), 0.0), float(normal_matrix[0, 0]))


def _products_of(contacts: Contacts, rest: Array, weight: Array) -> tuple[Array, Array]:
    """Sums over all ordered pairs of different gaps of a grain: for least squares on 1 and n·n'."""
    n = contacts.grain_count
    grain = np.concatenate([contacts.i, contacts.j])
    x, y = np.concatenate([contacts.normal, -contacts.normal]).T
    w, e = np.tile(weight, 2), np.tile(weight * rest, 2)

    def pairs(value: NDArray[np.float64]) -> float:
        """Σ over different gaps of one grain of value · value'."""
        return float(np.sum(np.bincount(grain, value, minlength=n) ** 2) - np.sum(value**2))

    ones, cosine = pairs(w), pairs(w * x) + pairs(w * y)
    square = pairs(w * x * x) + pairs(w * y * y) + 2.0 * pairs(w * x * y)
    return np.array([[ones, cosine], [cosine, square]]), np.array([pairs(e), pairs(e * x) + pairs(e * y)])
