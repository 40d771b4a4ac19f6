"""Variances of centre and radius errors, from how the gaps of one grain vary together.

A radius that is too small widens all gaps of its grain; an error of a centre widens those on one side and narrows
those on the other. Noise of photographs counts as an error of centres. Elastic overlap is common to the gaps of a grain
under more pressure than others and looks like a radius error: its part follows from the mean overlap. Errors of radii
last over all photographs, most pressures do not; where forces follow from overlaps only what lasts is an error, without
the few grains that were found at a wrong place or measured as another size, which would double the variance.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..bodies.grains import Array
from ..contacts.contacts import Contacts
from ..statistics.weighted import weighted_median

# Standard deviation of the grains' mean normal forces, over their mean: in one frame, and of what lasts over many. On
# eight simulated soft packings and two sets of photoelastic discs it is .18 to .41 in a frame (.77 in an annulus where
# few discs bear force, of which most changes).
GRAIN_PRESSURE_SD, LASTING_PRESSURE_SD = 0.5, 0.25
OUTLYING = 4.45  # median absolute deviations, 3 standard deviations of normal gaps: further ones are misread grains


@dataclass(frozen=True, slots=True)
class ErrorVariances:
    """Variances of the errors that belong to single grains."""

    radius: float  # σ_r² [m²], common to all gaps of a grain, overlap included
    centre: float  # σ_c² [m²], of a centre's coordinate
    lasting: bool = False  # whether σ_r² is common to the gaps of all frames, not of one

    def radius_sd(self, overlap: float) -> float:
        """Compute the standard deviation of the radii [m], given the mean overlap [m] of touching surfaces.

        Notes
        -----
        σ = √max(σ_r² − (p overlap)², 0), p = 0.25 where σ_r² is common to the gaps of all frames, else 0.5.
        """
        pressure_sd = LASTING_PRESSURE_SD if self.lasting else GRAIN_PRESSURE_SD
        return float(np.sqrt(max(self.radius - (pressure_sd * overlap) ** 2, 0.0)))


def estimate_error_variances(frames: list[tuple[Contacts, Array, Array]], *, lasting: bool = False) -> ErrorVariances:
    """Estimate the variances of radius and centre errors.

    Parameters
    ----------
    frames : list of (Contacts, array (c,), array (c,))
        For each frame: contacts between grains (c), their gaps less the mean gap of touching pairs (c,) [m], and the
        weights P(touch) (c,).
    lasting : bool
        Whether σ_r² is that of errors which last over the frames.

    Notes
    -----
    Residuals e, e' of two gaps of one grain, with normals n, n' from the grain's side, have the covariance

        E[e e'] = σ_r² + σ_c² n·n'.

    Both variances follow by linear least squares over ordered pairs of gaps of a grain, weighted by P(touch) P'(touch);
    negative estimates are set to zero. Both are those of different gaps in the same frame; a lasting σ_r² is that of
    different gaps in different frames, which neither noise nor a passing pressure enters, without gaps beyond three
    robust standard deviations.
    """
    sides = _Sides.of(frames)
    if not sides.weight.any():  # or no gap at all
        return ErrorVariances(0.0, 0.0)
    radius, centre = sides.solve(across=False)
    lasting = lasting and len(frames) > 1
    if lasting:
        radius, _ = sides.without_outliers().solve(across=True)
    return ErrorVariances(max(radius, 0.0), max(centre, 0.0), lasting)


@dataclass(frozen=True, slots=True)
class _Sides:
    """Gaps (m,) of all frames, each from the side of either of its grains."""

    grain: NDArray[np.int64]
    frame: NDArray[np.int64]  # group of the gaps of a grain in a frame
    contact: NDArray[np.int64]  # group of the gaps of a grain to the same other grain
    normal: Array  # (m, 2) from the grain's side
    rest: Array  # [m] gap less the mean gap of touching pairs
    weight: Array

    @staticmethod
    def of(frames: list[tuple[Contacts, Array, Array]]) -> _Sides:
        """Collect the gaps of some frames."""
        grain, number, key, normal, rest, weight = [], [], [], [], [], []
        for k, (contacts, gap, touch) in enumerate(frames):
            grain += [contacts.i, contacts.j]
            number.append(np.full(2 * contacts.count, k))
            key += [contacts.key, contacts.key]
            normal += [contacts.normal, -contacts.normal]
            rest += [gap, gap]
            weight += [touch, touch]
        grains = np.concatenate(grain)
        if not len(grains):
            return _Sides(grains, grains, grains, np.empty((0, 2)), np.empty(0), np.empty(0))
        return _Sides(
            grains, _group(grains, np.concatenate(number)), _group(grains, np.concatenate(key)),
            np.concatenate(normal), np.concatenate(rest), np.concatenate(weight),
        )  # fmt: skip

    def without_outliers(self) -> _Sides:
        """Return the same without weight where a gap is beyond three robust standard deviations."""
        distance = np.abs(self.rest - weighted_median(self.rest, self.weight))
        limit = OUTLYING * weighted_median(distance, self.weight)
        return replace(self, weight=np.where(distance <= limit, self.weight, 0.0))

    def solve(self, *, across: bool) -> tuple[float, float]:
        """Fit σ_r² and σ_c² [m²] to the products of different gaps of a grain, in the same frame or across frames."""
        pairs = self._sum_across if across else self._sum_within
        (x, y), w = self.normal.T, self.weight
        e = w * self.rest
        ones, cosine = pairs(w), pairs(w * x) + pairs(w * y)
        square = pairs(w * x * x) + pairs(w * y * y) + 2.0 * pairs(w * x * y)
        if not ones > 0.0:
            return 0.0, 0.0
        matrix, right = np.array([[ones, cosine], [cosine, square]]), np.array([pairs(e), pairs(e * x) + pairs(e * y)])
        radius, centre = np.linalg.lstsq(matrix, right, rcond=1e-9)[0]
        return float(radius), float(centre)

    def _sum_within(self, value: Array) -> float:
        """Sum value · value' over different gaps of one grain in the same frame."""
        return _square_of_sums(self.frame, value) - float(np.sum(value**2))

    def _sum_across(self, value: Array) -> float:
        """Sum value · value' over different gaps of one grain in different frames."""
        return _square_of_sums(self.grain, value) - _square_of_sums(self.contact, value) - self._sum_within(value)


def _group(one: NDArray[np.integer], two: NDArray[np.integer]) -> NDArray[np.int64]:
    """Number the different pairs of values (m,) from 0."""
    return np.unique(one.astype(np.int64) * (int(two.max()) + 1) + two, return_inverse=True)[1]


def _square_of_sums(group: NDArray[np.int64], value: Array) -> float:
    return float(np.sum(np.bincount(group, value) ** 2))
