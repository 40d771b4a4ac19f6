"""Patches of the reference photograph, and their correlation with another one, many grains at a time."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.frames import Image
from app.tracking import correlation_kernels as kernels
from app.tracking.search import angle_steps, search_patch
from app.tracking.splines import HALFWAY_VARIANCE, Pyramid
from solver.grains import Array

Rows = NDArray[np.intp]

# Grains of one task. It is fixed, and no grain's result depends on another's within a task, so the number
# of workers cannot change anything.
CHUNK = 32

# The greatest of the thousands of accidental correlations that a search meets, in their standard deviations.
ACCIDENTAL_DEVIATIONS = 4.5

# Radius [px] below which a patch is not shrunk any further for the search.
COARSE_REACH = 8.0


# A window wider than this, in pixels of the level that is searched, is sifted on the next coarser level first, if a
# patch has this radius there and a pixel of it is not coarser than paint. The true place has been among the first few.
WIDE = 8.0
SIFTED_REACH = 4.5
SIFTED_COARSEST = 4
SIFTED_PLACES = 24


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
class Patches:
    """The fixed reference: one textured disc per grain."""

    centre: Array  # (n, 2) [px] in the reference photograph
    reach: Array  # (n,) [px], radius of the disc
    usable: NDArray[np.bool_]  # (n,) the disc lies within the photograph and has a texture
    norm: Array  # (n,) [grey] norm of the disc about its mean
    mean: Array  # (n,) [grey]
    correlation_length: Array  # (n,) [px], of the speckle
    start: NDArray[np.int64]  # (n + 1,) first row of data of every grain
    data: Image  # (start[-1], 6), see correlation_kernels
    hessian_inverse: Array  # (n, 3, 3) [px², px, 1] for a reference of unit norm
    reference: Pyramid

    @classmethod
    def cut(cls, photograph: Pyramid, centre: Array, reach: Array) -> Patches:
        """Cut the discs out of a photograph: centre (n, 2) [px], reach (n,) [px]."""
        n = len(centre)
        height, width = photograph.image.shape
        usable = np.array(
            [kernels.inside(height, width, centre[k, 0], centre[k, 1], reach[k]) for k in range(n)], dtype=np.bool_
        ).reshape(n)
        count = [kernels.count_pixels(centre[k, 0], centre[k, 1], reach[k]) if usable[k] else 0 for k in range(n)]
        start = np.concatenate([[0], np.cumsum(count)]).astype(np.int64)
        data = np.empty((start[-1], 6), np.float32)
        inverse = np.full((n, 3, 3), np.nan)
        facts = np.full((n, 3), np.nan)
        coefficients = photograph.coefficients()
        for k in np.flatnonzero(usable):
            usable[k] = kernels.fill_patch(
                photograph.image, coefficients, centre[k, 0], centre[k, 1], reach[k],
                data[start[k] : start[k + 1]], inverse[k], facts[k],
            )  # fmt: skip
        length = np.sqrt(facts[:, 2])
        return cls(centre, reach, usable, facts[:, 0], facts[:, 1], length, start, data, inverse, photograph)

    @property
    def pixel_count(self) -> NDArray[np.int64]:
        return np.diff(self.start)

    @property
    def accidental_zncc(self) -> Array:
        """Greatest correlation that a wrong place reaches by accident (n,).

        Two independent speckles with Gaussian autocorrelation of length ℓ correlate with standard
        deviation ℓ/r over a disc of radius r.
        """
        return np.minimum(ACCIDENTAL_DEVIATIONS * self.correlation_length / self.reach, 0.85)

    @property
    def search_factor(self) -> NDArray[np.int64]:
        """By how much the photographs are shrunk when a grain is searched for (n,)."""
        return 2 ** np.clip(np.floor(np.log2(self.reach / COARSE_REACH)), 0, 3).astype(np.int64)


class Correlator:
    """Fits patches to photographs with some threads. Results do not depend on their number."""

    def __init__(self, patches: Patches, *, workers: int, tolerance: float, limit: int) -> None:
        self.patches = patches
        self._workers = workers
        self._tolerance = tolerance
        self._limit = limit

    def fit(self, photograph: Pyramid, rows: Rows, pose: Array, leash: Array) -> Fits:
        """Gauss-Newton from `pose` (m, 3) for the grains `rows` (m,), no farther than `leash` (m,) [px]."""
        patches = self.patches
        coefficients = photograph.coefficients()
        pose = np.array(pose, dtype=np.float64, order="C")
        fit = np.zeros((len(rows), kernels.FIT_COLUMNS))

        def one(k: int) -> None:
            row = rows[k]
            kernels.fit_rigid(
                coefficients, patches.data[patches.start[row] : patches.start[row + 1]],
                patches.hessian_inverse[row], patches.reach[row], leash[k],
                self._tolerance, self._limit, pose[k], fit[k],
            )  # fmt: skip

        self._each(len(rows), one)
        gain = fit[:, kernels.GAIN]
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = fit[:, kernels.RESIDUAL] / gain**2 * _interpolation_loss(pose, patches.reach[rows])
        return _fits(pose, fit, patches.hessian_inverse[rows] * scale[:, None, None])

    def fit_robust(
        self, photograph: Pyramid, rows: Rows, pose: Array, leash: Array, noise: float, gain: Array, offset: Array
    ) -> Fits:
        """Tukey-weighted refit; gain, offset (m,): the light to begin with; noise [grey]: least residual."""
        patches = self.patches
        coefficients = photograph.coefficients()
        pose = np.array(pose, dtype=np.float64, order="C")
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
        return _fits(pose, fit, covariance * loss[:, None, None])

    def sifts(self, rows: Rows, window: Array) -> NDArray[np.bool_]:
        """Which searches (m,) look for places worth trying on a level coarser still than a patch is searched on."""
        factor = self.patches.search_factor[rows]
        wide = window > WIDE * factor
        return wide & (self.patches.reach[rows] >= SIFTED_REACH * 2.0 * factor) & (2 * factor <= SIFTED_COARSEST)

    def search(
        self, photograph: Pyramid, rows: Rows, pose: Array, window: Array, sweep: float, count: int,
        *, thorough: bool = False,
    ) -> Array:  # fmt: skip
        """The `count` most similar places of every grain (m, count, 4): x, y [px], rotation [rad], ZNCC.

        pose (m, 3): middle; window (m,) [px] and sweep [rad]: half widths. Places that are not there have ZNCC −1.
        thorough: nothing is sifted; it takes ten times as long.
        """
        patches = self.patches
        best = np.empty((len(rows), count, 4))
        factor = patches.search_factor[rows]
        sifted = self.sifts(rows, window) & (not thorough)
        for level in np.unique(np.concatenate([factor, 2 * factor[sifted]])):  # made before the threads ask for them
            patches.reference.coefficients(int(level))
            photograph.level(int(level))

        def one(k: int) -> None:
            if not sifted[k]:
                self._search_level(photograph, rows[k], int(factor[k]), pose[k], float(window[k]), sweep, best[k])
                return
            level = int(factor[k])
            places = np.empty((SIFTED_PLACES, 4))
            self._search_level(photograph, rows[k], 2 * level, pose[k], float(window[k]), sweep, places, spacing=2.0)
            # Half a step of the coarse angles to either side, and a pixel and a half of the coarse level.
            half = 0.6 * sweep / angle_steps(float(patches.reach[rows[k]]) / (2 * level), sweep)
            looked = np.full((SIFTED_PLACES, 1, 4), -1.0)
            beyond_doubt = min(float(patches.accidental_zncc[rows[k]]) + 0.2, 0.9)
            for m in np.flatnonzero(places[:, 3] > 0.0):
                self._search_level(photograph, rows[k], level, places[m, :3], 3.0 * level, half, looked[m])
                if looked[m, 0, 3] > beyond_doubt:
                    break
            best[k] = _most_similar(looked[:, 0], count, 3.0 * level)

        self._each(len(rows), one)
        return best

    def _search_level(
        self, photograph: Pyramid, row: int, level: int, pose: Array, window: float, sweep: float, best: Array,
        spacing: float = 3.0,
    ) -> None:  # fmt: skip
        """Search one grain on one level; best (c, 4) in pixels of the photograph, spacing in those of the level."""
        patches = self.patches
        shift = 0.5 * (level - 1)
        side = int(np.ceil(2.0 * window / level)) + 4
        buffers = np.empty((3, side, side), np.float32)
        search_patch(
            patches.reference.coefficients(level), photograph.level(level),
            (patches.centre[row, 0] - shift) / level, (patches.centre[row, 1] - shift) / level,
            patches.reach[row] / level, (pose[0] - shift) / level, (pose[1] - shift) / level,
            pose[2], window / level, sweep, spacing, best, buffers[0], buffers[1], buffers[2],
        )  # fmt: skip
        best[:, :2] = best[:, :2] * level + shift

    def _each(self, count: int, one: Callable[[int], None]) -> None:
        def chunk(first: int) -> None:
            for k in range(first, min(first + CHUNK, count)):
                one(k)

        if self._workers == 1 or count <= CHUNK:
            for first in range(0, count, CHUNK):
                chunk(first)
            return
        with ThreadPoolExecutor(self._workers) as pool:
            list(pool.map(chunk, range(0, count, CHUNK)))


def _most_similar(places: Array, count: int, spacing: float) -> Array:
    """The best `count` (count, 4) of places (m, 4), no two nearer than `spacing` [px]; ZNCC −1 where there is none."""
    best = np.full((count, 4), 0.0)
    best[:, 3] = -1.0
    found = 0
    for m in np.argsort(-places[:, 3], kind="stable"):
        if found == count or not places[m, 3] > 0.0:
            break
        away = np.hypot(best[:found, 0] - places[m, 0], best[:found, 1] - places[m, 1])
        if (away >= spacing).all():
            best[found] = places[m]
            found += 1
    return best


def _fits(pose: Array, fit: Array, covariance: Array) -> Fits:
    return Fits(
        pose, fit[:, kernels.ZNCC], fit[:, kernels.RESIDUAL], fit[:, kernels.GAIN], fit[:, kernels.OFFSET],
        fit[:, kernels.KEPT], fit[:, kernels.CODE].astype(np.uint8), covariance,
    )  # fmt: skip


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
