"""Patches of the reference photograph, and their correlation with another one, many grains at a time."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array

from . import kernels as kernels
from .patches import Patches
from .sifting import search_all, search_parts_all, sift_all
from .splines import HALFWAY_VARIANCE, Pyramid

Rows = NDArray[np.intp]

# Grains of one task. It is fixed, and no grain's result depends on another's within a task, so the number
# of workers cannot change anything.
CHUNK = 32

# A patch is sifted on the next coarser level first, if it has this radius there and a pixel of it is not coarser than
# paint.
SIFTED_REACH = 4.5
SIFTED_COARSEST = 4


@dataclass(frozen=True, slots=True)
class Fits:
    """Poses of m patches in one photograph and how well they fit."""

    pose: Array  # (m, 3) x [px], y [px], rotation [rad]
    zncc: Array  # (m,)
    residual: Array  # (m,) [grey²] variance of a pixel's residual
    gain: Array  # (m,) [grey] image = gain · f + offset, f the reference of unit norm
    offset: Array  # (m,) [grey]
    kept: Array  # (m,) share of the pixels that the fit rests on
    code: NDArray[np.uint8]  # (m,) CONVERGED, LEFT_IMAGE, WANDERED, UNFINISHED
    covariance: Array  # (m, 3, 3) of the pose, from the residual and the Hessian

    @property
    def converged(self) -> NDArray[np.bool_]:
        return self.code == kernels.CONVERGED

    @property
    def sigma(self) -> Array:
        """Standard deviation of a position component (m,) [px]."""
        return np.sqrt(0.5 * (self.covariance[:, 0, 0] + self.covariance[:, 1, 1]))


@dataclass(frozen=True, slots=True)
class SearchRange:
    """Where m grains are searched for."""

    middle: Array  # (m, 3) x [px], y [px], rotation [rad]
    window: Array  # (m,) [px] half width
    sweep: float  # [rad] half width of the angles


class Correlator:
    """Fits patches to photographs with some threads. Results do not depend on their number."""

    def __init__(self, patches: Patches, *, workers: int, tolerance: float, limit: int) -> None:
        self.patches = patches
        self._workers = workers
        self._tolerance = tolerance
        self._limit = limit

    def with_patches(self, patches: Patches) -> Correlator:
        """The same with other patches."""
        return Correlator(patches, workers=self._workers, tolerance=self._tolerance, limit=self._limit)

    def fit(
        self, photograph: Pyramid, rows: Rows, pose: Array, leash: Array, *, steps: int | None = None
    ) -> Fits:  # fmt: skip
        """Gauss-Newton from `pose` (m, 3) for the grains `rows` (m,), no farther than `leash` (m,) [px].

        What is not promising after a few steps is given up. steps: at most, instead of the limit.
        """
        patches = self.patches
        coefficients = photograph.fine_coefficients()
        pose = self._from_reference(rows, pose)
        fit = np.zeros((len(rows), kernels.FIT_COLUMNS))
        hopeless = patches.accidental_zncc[rows]
        limit = self._limit if steps is None else steps

        rows, leash = np.ascontiguousarray(rows, np.intp), np.ascontiguousarray(leash, np.float64)

        def some(part: slice) -> None:
            kernels.fit_all(
                coefficients, patches.data, patches.start, patches.coarse_inverse, patches.hessian_inverse,
                patches.reach, rows[part], leash[part], hopeless[part], self._tolerance, limit, pose[part], fit[part],
            )  # fmt: skip

        self._in_parts(len(rows), some)
        gain = fit[:, kernels.GAIN]
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = fit[:, kernels.RESIDUAL] / gain**2 * _interpolation_loss(pose, patches.reach[rows])
        return self._fits(rows, pose, fit, patches.hessian_inverse[rows] * scale[:, None, None])

    def fit_robust(
        self, photograph: Pyramid, rows: Rows, pose: Array, leash: Array, noise: float, gain: Array, offset: Array
    ) -> Fits:
        """Tukey-weighted refit; gain, offset (m,): the light to begin with; noise [grey]: least residual."""
        patches = self.patches
        coefficients = photograph.fine_coefficients()
        pose = self._from_reference(rows, pose)
        fit = np.zeros((len(rows), kernels.FIT_COLUMNS))
        covariance = np.full((len(rows), 3, 3), np.nan)

        def one(k: int) -> None:
            row = rows[k]
            kernels.fit_robust(
                coefficients, patches.data[patches.start[row] : patches.start[row + 1]], patches.reach[row],
                leash[k], noise, gain[k], offset[k], 2 * self._limit, pose[k], fit[k], covariance[k],
            )  # fmt: skip

        self._each(len(rows), one)
        loss = _interpolation_loss(pose, patches.reach[rows])
        return self._fits(rows, pose, fit, covariance * loss[:, None, None])

    def sifts(self, rows: Rows) -> NDArray[np.bool_]:
        """Which grains (m,) are first looked for on a level coarser still than their patch is searched on."""
        factor = self.patches.search_factor[rows]
        return (self.patches.reach[rows] >= SIFTED_REACH * 2.0 * factor) & (2 * factor <= SIFTED_COARSEST)

    def search(
        self, photograph: Pyramid, rows: Rows, within: SearchRange, count: int, *, looks: int = 0, parts: bool = False
    ) -> Array:
        """The `count` most similar places of every grain (m, count, 4): x, y [px], rotation [rad], ZNCC.

        Places that are not there have ZNCC −1.
        looks: the places of a coarser level, where there is one to be sifted, that are looked at more closely; 0: the
        level itself is searched, which takes ten times as long. parts: halves of a patch are searched for, too.
        """
        patches = self.patches
        best = np.empty((len(rows), count, 4))
        factor, sifted = patches.search_factor[rows], self.sifts(rows) & (looks > 0)
        source = np.array([row if int(row) in patches.renewed else -1 for row in rows])
        # What is looked for with the same pictures on the same level is one task of many grains.
        for level, own, coarser in sorted(set(zip(factor.tolist(), source.tolist(), sifted.tolist(), strict=True))):
            these = np.flatnonzero((factor == level) & (source == own) & (sifted == coarser))
            self._search_alike(
                photograph, rows[these], _some(within, these), best, these, level, looks * coarser, parts
            )
        return best

    def _search_alike(
        self, photograph: Pyramid, rows: Rows, within: SearchRange, best: Array, at: Rows, factor: int, looks: int,
        parts: bool,
    ) -> None:  # fmt: skip
        """Write best[at] (m, c, 4) of grains `rows` (m,) whose reference is one picture, on the level `factor`."""
        patches = self.patches
        picture = patches.source(int(rows[0]))
        levels = (factor, 2 * factor) if looks else (factor,)
        pictures = [each for level in levels for each in (picture.coefficients(level), photograph.level(level))]
        pose = self._from_reference(rows, within.middle)
        window = np.ascontiguousarray(within.window, np.float64)
        place, reach = patches.place[rows], patches.reach[rows]
        beyond_doubt = np.minimum(patches.accidental_zncc[rows] + 0.2, 0.9)
        found = np.empty((len(rows), best.shape[1], 4))

        def some(part: slice) -> None:
            told = place[part], reach[part], pose[part], window[part]
            if looks:
                sift_all(
                    pictures[0], pictures[1], pictures[2], pictures[3], factor, *told, within.sweep, looks,
                    beyond_doubt[part], found[part],
                )  # fmt: skip
            elif parts:
                search_parts_all(pictures[0], pictures[1], factor, *told, within.sweep, found[part])
            else:
                search_all(pictures[0], pictures[1], factor, *told, within.sweep, found[part])

        self._in_parts(len(rows), some)
        found[:, :, 2] += patches.turn[rows, None]
        best[at] = found

    def _from_reference(self, rows: Rows, pose: Array) -> Array:
        """Poses (m, 3) whose rotation counts from where each patch was cut, as a new array."""
        pose = np.array(pose, dtype=np.float64, order="C")
        pose[:, 2] -= self.patches.turn[rows]
        return pose

    def _fits(self, rows: Rows, pose: Array, fit: Array, covariance: Array) -> Fits:
        """Fits whose rotation and covariance (m, 3, 3) count from the first photograph."""
        pose[:, 2] += self.patches.turn[rows]
        covariance[:, :2, :2] += self.patches.variance[rows, None, None] * np.eye(2)
        return Fits(
            pose, fit[:, kernels.ZNCC], fit[:, kernels.RESIDUAL], fit[:, kernels.GAIN], fit[:, kernels.OFFSET],
            fit[:, kernels.KEPT], fit[:, kernels.CODE].astype(np.uint8), covariance,
        )  # fmt: skip

    def _each(self, count: int, one: Callable[[int], None]) -> None:
        def some(part: slice) -> None:
            for k in range(part.start, part.stop):
                one(k)

        self._in_parts(count, some)

    def _in_parts(self, count: int, some: Callable[[slice], None]) -> None:
        parts = [slice(first, min(first + CHUNK, count)) for first in range(0, count, CHUNK)]
        if self._workers == 1 or count <= CHUNK:
            for part in parts:
                some(part)
            return
        with ThreadPoolExecutor(self._workers) as pool:
            list(pool.map(some, parts))


def _some(within: SearchRange, rows: Rows) -> SearchRange:
    return SearchRange(within.middle[rows], within.window[rows], within.sweep)


def _interpolation_loss(pose: Array, reach: Array) -> Array:
    """By how much the residual understates the noise that moves the pose (m,).

    Interpolation smooths the photograph's noise but not the part of it that looks like the speckle's slope.
    Half of the residual is the reference's noise, which is not interpolated.
    """
    depth = 1.0 - HALFWAY_VARIANCE
    # Once the grid is turned by a pixel at the rim, every position between the pixels occurs in the patch.
    turn = np.abs(np.angle(np.exp(4j * pose[:, 2]))) / 4.0
    mixed = np.clip(turn * reach, 0.0, 1.0)
    phases = np.sin(np.pi * pose[:, :2]) ** 2
    share = 1.0 - depth * (mixed[:, None] * 0.5 + (1.0 - mixed[:, None]) * phases)
    return 2.0 / (1.0 + share[:, 0] * share[:, 1])
