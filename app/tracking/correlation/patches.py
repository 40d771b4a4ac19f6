"""Patches of a reference photograph: what every grain looks like, and how exactly that tells where it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array

from ...experiment.photographs import Image
from . import kernels as kernels
from .splines import Pyramid

# The greatest of the thousands of accidental correlations that a search meets, in their standard deviations.
ACCIDENTAL_DEVIATIONS = 4.5

# Radius [px] below which a patch is not shrunk any further for the search.
COARSE_REACH = 8.0

# What is kept around a patch that is cut out of a later photograph [px]: splines reach that far.
SURROUNDINGS = 24


@dataclass(frozen=True, slots=True)
class Patches:
    """The fixed reference: one textured disc per grain, of the first photograph unless it had to be renewed."""

    centre: Array  # (n, 2) [px] in the first photograph
    reach: Array  # (n,) [px], radius of the disc
    usable: NDArray[np.bool_]  # (n,) the disc lies within the photograph and has a texture
    norm: Array  # (n,) [grey] norm of the disc about its mean
    mean: Array  # (n,) [grey]
    correlation_length: Array  # (n,) [px], of the speckle
    data: Image  # (p, 6) the pixels of one patch after the other, see kernels
    start: NDArray[np.intp]  # (n + 1,) where each patch begins in them
    hessian_inverse: Array  # (n, 3, 3) [px², px, 1] for a reference of unit norm
    coarse_inverse: Array  # (n, 5, 5) the same with the light, for the pixels that lead a fit
    reference: Pyramid
    place: Array  # (n, 2) [px] of the centre in the picture that the disc was cut out of
    turn: Array  # (n,) [rad] of the grain there
    variance: Array  # (n,) [px²] of a component of its displacement there from the first photograph
    renewed: Mapping[int, Pyramid]  # pictures of the grains that are not compared with the first photograph

    @classmethod
    def cut(cls, photograph: Pyramid, centre: Array, reach: Array) -> Patches:
        """Cut the discs out of a photograph: centre (n, 2) [px], reach (n,) [px]."""
        n = len(centre)
        usable = np.zeros(n, dtype=np.bool_)
        inverse, facts, data = np.full((n, 3, 3), np.nan), np.full((n, 3), np.nan), []
        coarse = np.full((n, 5, 5), np.nan)
        for k in range(n):
            patch, usable[k] = _cut_one(photograph, centre[k], float(reach[k]), inverse[k], coarse[k], facts[k])
            data.append(patch)
        return cls(
            centre, reach, usable, facts[:, 0], facts[:, 1], np.sqrt(facts[:, 2]), *_one_after_the_other(data), inverse,
            coarse, photograph, centre, np.zeros(n), np.zeros(n), {},
        )  # fmt: skip

    def renew(self, photograph: Image, rows: NDArray[np.intp], pose: Array, sigma: Array) -> Patches:
        """Cut the discs of `rows` (m,) anew where they are in a later photograph, pose (m, 3), sigma (m,) [px].

        What is found with them has the variance of that pose added to its own. A grain whose disc does not lie
        within that photograph keeps the patch that it has.
        """
        fact, inverse = (
            np.stack([self.norm, self.mean, self.correlation_length**2], axis=1),
            self.hessian_inverse.copy(),
        )
        coarse = self.coarse_inverse.copy()
        place, turn, variance = self.place.copy(), self.turn.copy(), self.variance.copy()
        data, renewed = np.split(self.data, self.start[1:-1]), dict(self.renewed)
        height, width = photograph.shape
        for k, row in enumerate(rows):
            side = self.reach[row] + SURROUNDINGS
            left, top = (max(int(pose[k, axis] - side), 0) for axis in (0, 1))
            right, bottom = min(int(pose[k, 0] + side) + 1, width), min(int(pose[k, 1] + side) + 1, height)
            picture = Pyramid(np.ascontiguousarray(photograph[top:bottom, left:right], dtype=np.float32))
            centre = pose[k, :2] - (left, top)
            found, leading, told = np.full((3, 3), np.nan), np.full((5, 5), np.nan), np.full(3, np.nan)
            patch, good = _cut_one(picture, centre, float(self.reach[row]), found, leading, told)
            if good:
                data[row], inverse[row], coarse[row], fact[row] = patch, found, leading, told
                renewed[int(row)] = picture
                place[row], turn[row], variance[row] = centre, pose[k, 2], sigma[k] ** 2
        packed, start = _one_after_the_other(data)
        return replace(
            self, norm=fact[:, 0], mean=fact[:, 1], correlation_length=np.sqrt(fact[:, 2]), data=packed, start=start,
            hessian_inverse=inverse, coarse_inverse=coarse, place=place, turn=turn, variance=variance, renewed=renewed,
        )  # fmt: skip

    def source(self, row: int) -> Pyramid:
        """The picture that a grain's disc was cut out of."""
        return self.renewed.get(int(row), self.reference)

    @property
    def pixel_count(self) -> NDArray[np.int64]:
        return np.diff(self.start)

    @property
    def sigma_per_noise(self) -> Array:
        """Standard deviation of a component of a disc's place [px] for each grey level of a pixel's noise (n,)."""
        return np.sqrt(0.5 * (self.hessian_inverse[:, 0, 0] + self.hessian_inverse[:, 1, 1])) / self.norm

    @property
    def accidental_zncc(self) -> Array:
        """Greatest correlation that a wrong place reaches by accident (n,).

        Two independent speckles with Gaussian autocorrelation of length ℓ correlate with standard
        deviation ℓ/r over a disc of radius r.
        """
        return np.minimum(ACCIDENTAL_DEVIATIONS * self.correlation_length / self.reach, 0.85)

    @property
    def accidental_coarse_zncc(self) -> Array:
        """The same on the level that is searched (n,): averaging over f pixels adds (f² − 1)/6 to ℓ²."""
        added = (self.search_factor**2 - 1) / 6.0
        return np.minimum(self.accidental_zncc * np.sqrt(1.0 + added / self.correlation_length**2), 0.85)

    @property
    def search_factor(self) -> NDArray[np.int64]:
        """By how much the photographs are shrunk when a grain is searched for (n,)."""
        return 2 ** np.clip(np.floor(np.log2(self.reach / COARSE_REACH)), 0, 3).astype(np.int64)


def _cut_one(
    photograph: Pyramid, centre: Array, reach: float, inverse: Array, coarse: Array, facts: Array
) -> tuple[Image, bool]:
    """One disc's rows of data, and whether it is usable; its inverse matrices and facts are written."""
    height, width = photograph.image.shape
    if not kernels.inside(height, width, centre[0], centre[1], reach):
        return np.empty((0, 6), np.float32), False
    data = np.empty((kernels.count_pixels(centre[0], centre[1], reach), 6), np.float32)
    good = kernels.fill_patch(
        photograph.image, photograph.coefficients(), centre[0], centre[1], reach, data, inverse, facts
    )  # fmt: skip
    if good:
        kernels.fill_coarse(data, coarse)
    return data, bool(good)


def _one_after_the_other(data: list[Image]) -> tuple[Image, NDArray[np.intp]]:
    start = np.cumsum([0, *(len(patch) for patch in data)], dtype=np.intp)
    return np.concatenate([np.empty((0, 6), np.float32), *data]), start
