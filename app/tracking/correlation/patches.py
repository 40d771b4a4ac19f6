"""Patches of a reference photograph: the texture of every grain, and the accuracy of a position found with it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...experiment.pictures.image import Image
from ...solver.bodies.grains import Array
from . import kernels as kernels
from .splines import Pyramid

# Greatest of the thousands of accidental correlations in a search, in standard deviations of them.
ACCIDENTAL_DEVIATIONS = 4.5

# Radius [px] below which a patch is not shrunk any further for the search.
COARSE_REACH = 8.0

# Margin around a patch that is cut out of a later photograph [px]: the support of the splines.
SURROUNDINGS = 24


@dataclass(frozen=True, slots=True)
class Patches:
    """The fixed reference: one textured disc per grain, from the first photograph unless it was renewed."""

    centre: Array  # (n, 2) [px] in the first photograph
    radius: Array  # (n,) [px] of the disc
    usable: NDArray[np.bool_]  # (n,) the disc lies within the photograph and has a texture
    norm: Array  # (n,) [grey] norm of the disc about its mean
    mean: Array  # (n,) [grey]
    correlation_length: Array  # (n,) [px], of the speckle
    pixel_count: NDArray[np.intp]  # (n,)
    blocks: Image  # (b, 6, 8) pixels of all patches, eight in a block, concatenated; columns see kernels
    start: NDArray[np.intp]  # (n + 1,) first block of each patch
    hessian_inverse: Array  # (n, 3, 3) [px², px, 1] for a reference of unit norm
    coarse_inverse: Array  # (n, 5, 5) the same with gain and offset, for the pixels of the coarse steps
    reference: Pyramid
    source_centre: Array  # (n, 2) [px] centre in the image that the disc was cut from
    source_rotation: Array  # (n,) [rad] of the grain in that image
    source_variance: Array  # (n,) [px²] of a component of the displacement between that image and the first photograph
    renewed: Mapping[int, Pyramid]  # images of the grains whose reference is not the first photograph

    @classmethod
    def cut(cls, photograph: Pyramid, centre: Array, radius: Array) -> Patches:
        """Cut the discs out of a photograph: centre (n, 2) [px], radius (n,) [px]."""
        n = len(centre)
        usable = np.zeros(n, dtype=np.bool_)
        inverse, statistics, blocks = np.full((n, 3, 3), np.nan), np.full((n, 3), np.nan), []
        count = np.zeros(n, np.intp)
        coarse = np.full((n, 5, 5), np.nan)
        for k in range(n):
            patch, usable[k] = _cut_patch(photograph, centre[k], float(radius[k]), inverse[k], coarse[k], statistics[k])
            blocks.append(_pack(patch))
            count[k] = len(patch)
        return cls(
            centre, radius, usable, statistics[:, 0], statistics[:, 1], np.sqrt(statistics[:, 2]),
            count, *_concatenate(blocks), inverse, coarse, photograph, centre, np.zeros(n), np.zeros(n), {},
        )  # fmt: skip

    def renew(self, photograph: Image, rows: NDArray[np.intp], pose: Array, sigma: Array) -> Patches:
        """Replace the discs of some grains by those of a later photograph.

        Parameters
        ----------
        photograph : (H, W) array
            The later photograph [grey].
        rows : (m,) array
            The grains.
        pose : (m, 3) array
            Their poses in that photograph: x, y [px], rotation [rad].
        sigma : (m,) array
            Standard deviation of a component of their positions there [px].

        Returns
        -------
        Patches
            The variance of the pose is added to that of every later one. A grain whose disc leaves the photograph
            keeps its patch.
        """
        statistics = np.stack([self.norm, self.mean, self.correlation_length**2], axis=1)
        inverse, coarse = self.hessian_inverse.copy(), self.coarse_inverse.copy()
        source_centre, source_rotation = self.source_centre.copy(), self.source_rotation.copy()
        source_variance = self.source_variance.copy()
        blocks, renewed = np.split(self.blocks, self.start[1:-1]), dict(self.renewed)
        count = self.pixel_count.copy()
        height, width = photograph.shape
        for k, row in enumerate(rows):
            side = self.radius[row] + SURROUNDINGS
            left, top = (max(int(pose[k, axis] - side), 0) for axis in (0, 1))
            right, bottom = min(int(pose[k, 0] + side) + 1, width), min(int(pose[k, 1] + side) + 1, height)
            crop = Pyramid(np.ascontiguousarray(photograph[top:bottom, left:right], dtype=np.float32))
            centre = pose[k, :2] - (left, top)
            new_inverse, new_coarse = np.full((3, 3), np.nan), np.full((5, 5), np.nan)
            new_statistics = np.full(3, np.nan)
            patch, good = _cut_patch(crop, centre, float(self.radius[row]), new_inverse, new_coarse, new_statistics)
            if good:
                blocks[row], count[row], statistics[row] = _pack(patch), len(patch), new_statistics
                inverse[row], coarse[row] = new_inverse, new_coarse
                renewed[int(row)] = crop
                source_centre[row], source_rotation[row], source_variance[row] = centre, pose[k, 2], sigma[k] ** 2
        packed, start = _concatenate(blocks)
        return replace(
            self, norm=statistics[:, 0], mean=statistics[:, 1], correlation_length=np.sqrt(statistics[:, 2]),
            pixel_count=count, blocks=packed, start=start, hessian_inverse=inverse, coarse_inverse=coarse,
            source_centre=source_centre, source_rotation=source_rotation, source_variance=source_variance,
            renewed=renewed,
        )  # fmt: skip

    def source(self, row: int) -> Pyramid:
        """The image that a grain's disc was cut from."""
        return self.renewed.get(int(row), self.reference)

    def pixels(self, row: int) -> Image:
        """Return the pixels (p, 6) of one patch; columns see `kernels`."""
        blocks = self.blocks[self.start[row] : self.start[row + 1]]
        return np.ascontiguousarray(blocks.transpose(0, 2, 1).reshape(-1, kernels.COLUMNS)[: self.pixel_count[row]])

    @property
    def sigma_per_noise(self) -> Array:
        """Standard deviation of a position component (n,) [px] per grey level of a pixel's noise."""
        return np.sqrt(0.5 * (self.hessian_inverse[:, 0, 0] + self.hessian_inverse[:, 1, 1])) / self.norm

    @property
    def accidental_zncc(self) -> Array:
        """Greatest correlation that a wrong place reaches by accident (n,).

        Notes
        -----
        Two independent speckles with Gaussian autocorrelation of length ℓ correlate with standard deviation ℓ/r over a
        disc of radius r: ZNCC = min(4.5 ℓ/r, 0.85).
        """
        return np.minimum(ACCIDENTAL_DEVIATIONS * self.correlation_length / self.radius, 0.85)

    @property
    def accidental_coarse_zncc(self) -> Array:
        """`accidental_zncc` on the level that is searched (n,): averaging over f pixels adds (f² − 1)/6 to ℓ²."""
        added = (self.search_factor**2 - 1) / 6.0
        return np.minimum(self.accidental_zncc * np.sqrt(1.0 + added / self.correlation_length**2), 0.85)

    @property
    def search_factor(self) -> NDArray[np.int64]:
        """Factor (n,) by which the photographs are shrunk for the search of a grain."""
        return 2 ** np.clip(np.floor(np.log2(self.radius / COARSE_REACH)), 0, 3).astype(np.int64)


def _cut_patch(
    photograph: Pyramid, centre: Array, radius: float, inverse: Array, coarse: Array, statistics: Array
) -> tuple[Image, bool]:
    """One disc's rows of data, and whether it is usable; writes its inverse matrices and statistics."""
    height, width = photograph.image.shape
    if not kernels.inside(height, width, centre[0], centre[1], radius):
        return np.empty((0, 6), np.float32), False
    data = np.empty((kernels.count_pixels(centre[0], centre[1], radius), 6), np.float32)
    good = kernels.fill_patch(
        photograph.image, photograph.coefficients(), centre[0], centre[1], radius, data, inverse, statistics
    )  # fmt: skip
    if good:
        kernels.fill_coarse(data, coarse)
    return data, bool(good)


def _pack(patch: Image) -> Image:
    """The pixels (p, 6) of a patch in blocks."""
    blocks = np.empty((-(-len(patch) // kernels.LANES), kernels.COLUMNS, kernels.LANES), np.float32)
    kernels.pack_blocks(patch, blocks)
    return blocks


def _concatenate(blocks: list[Image]) -> tuple[Image, NDArray[np.intp]]:
    start = np.cumsum([0, *(len(patch) for patch in blocks)], dtype=np.intp)
    return np.concatenate([np.empty((0, kernels.COLUMNS, kernels.LANES), np.float32), *blocks]), start
