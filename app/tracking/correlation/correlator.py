"""Fits and searches of patches of the reference photograph in another one, for many grains at a time."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...solver.bodies.grains import Array
from . import kernels as kernels
from .coarse_to_fine import search_all, search_coarse_to_fine, search_parts_all
from .patches import Patches
from .splines import HALFWAY_VARIANCE, Pyramid

Rows = NDArray[np.intp]

# Grains of one task. The number is fixed and no grain's result depends on another's within a task, so results do not
# depend on the number of workers.
CHUNK = 32

# A patch is first searched on the next coarser level if its radius there is at least this [px], and if that level's
# factor is at most the other: its pixels are then no coarser than paint.
COARSE_RADIUS_MIN = 4.5
COARSE_FACTOR_MAX = 4


@dataclass(frozen=True, slots=True)
class Fits:
    """Poses of m patches in one photograph and how well they fit."""

    pose: Array  # (m, 3) x [px], y [px], rotation [rad]
    zncc: Array  # (m,)
    residual: Array  # (m,) [grey²] variance of a pixel's residual
    gain: Array  # (m,) [grey] image = gain · f + offset, f: the reference of unit norm
    offset: Array  # (m,) [grey]
    kept: Array  # (m,) weighted fraction of the pixels that the fit uses
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
    """The ranges of positions and angles in which m grains are searched for."""

    middle: Array  # (m, 3) x [px], y [px], rotation [rad]
    window: Array  # (m,) [px] half width
    angle_window: float  # [rad] half width of the angles


class Correlator:
    """Fits patches to photographs in several threads. Results do not depend on their number."""

    def __init__(self, patches: Patches, *, workers: int, tolerance: float, limit: int) -> None:
        self.patches = patches
        self._workers = workers
        self._tolerance = tolerance
        self._limit = limit

    def with_patches(self, patches: Patches) -> Correlator:
        """Return a correlator with the same settings and other patches."""
        return Correlator(patches, workers=self._workers, tolerance=self._tolerance, limit=self._limit)

    def fit(
        self, photograph: Pyramid, rows: Rows, pose: Array, max_shift: Array, *, steps: int | None = None
    ) -> Fits:  # fmt: skip
        """Fit grains by Gauss-Newton; fits whose ZNCC is low after a few steps are stopped.

        Parameters
        ----------
        photograph : Pyramid
            The photograph that the grains are fitted in.
        rows : (m,) array
            The grains.
        pose : (m, 3) array
            Starts: x, y [px], rotation [rad].
        max_shift : (m,) array
            Greatest distance from the start [px].
        steps : int, optional
            Greatest number of steps, instead of the correlator's limit.
        """
        patches = self.patches
        coefficients = photograph.quintic_coefficients()
        pose = self._from_reference(rows, pose)
        fit = np.zeros((len(rows), kernels.FIT_COLUMNS))
        min_zncc = patches.accidental_zncc[rows]
        limit = self._limit if steps is None else steps

        rows, max_shift = np.ascontiguousarray(rows, np.intp), np.ascontiguousarray(max_shift, np.float64)

        def run_chunk(part: slice) -> None:
            kernels.fit_all(
                coefficients, patches.blocks, patches.start, patches.pixel_count, patches.coarse_inverse,
                patches.hessian_inverse, patches.radius, rows[part], max_shift[part], min_zncc[part], self._tolerance,
                limit, pose[part], fit[part],
            )  # fmt: skip

        self._run_in_chunks(len(rows), run_chunk)
        gain = fit[:, kernels.GAIN]
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = fit[:, kernels.RESIDUAL] / gain**2 * _interpolation_loss(pose, patches.radius[rows])
        return self._fits(rows, pose, fit, patches.hessian_inverse[rows] * scale[:, None, None])

    def fit_robust(
        self, photograph: Pyramid, rows: Rows, pose: Array, max_shift: Array, noise: float, gain: Array, offset: Array
    ) -> Fits:
        """Refit grains with Tukey's weights.

        Parameters
        ----------
        photograph, rows, pose, max_shift
            As of `fit`.
        noise : float
            Least scale of the residuals [grey].
        gain, offset : (m,) array
            Initial gain and offset of the light [grey].
        """
        patches = self.patches
        coefficients = photograph.quintic_coefficients()
        pose = self._from_reference(rows, pose)
        fit = np.zeros((len(rows), kernels.FIT_COLUMNS))
        covariance = np.full((len(rows), 3, 3), np.nan)

        def one(k: int) -> None:
            row = rows[k]
            kernels.fit_robust(
                coefficients, patches.pixels(row), patches.radius[row], max_shift[k], noise, gain[k], offset[k],
                2 * self._limit, pose[k], fit[k], covariance[k],
            )  # fmt: skip

        self._run_each(len(rows), one)
        loss = _interpolation_loss(pose, patches.radius[rows])
        return self._fits(rows, pose, fit, covariance * loss[:, None, None])

    def uses_coarse_level(self, rows: Rows) -> NDArray[np.bool_]:
        """Which grains (m,) are first searched for on a level coarser than their search level."""
        factor = self.patches.search_factor[rows]
        return (self.patches.radius[rows] >= COARSE_RADIUS_MIN * 2.0 * factor) & (2 * factor <= COARSE_FACTOR_MAX)

    def search(
        self, photograph: Pyramid, rows: Rows, within: SearchRange, count: int, *, coarse_count: int = 0,
        parts: bool = False,
    ) -> Array:  # fmt: skip
        """Search for the most similar places of every grain.

        Parameters
        ----------
        photograph : Pyramid
            The photograph that is searched.
        rows : (m,) array
            The grains.
        within : SearchRange
            Where each is searched for.
        count : int
            Number of places of each grain.
        coarse_count : int
            Number of places of the coarser level that are refined, where that level is used; 0: the level itself is
            searched, which takes ten times as long.
        parts : bool
            Halves of a patch are searched for as well.

        Returns
        -------
        (m, count, 4) array
            x, y [px], rotation [rad], ZNCC, best first; ZNCC −1 where fewer places exist.
        """
        patches = self.patches
        best = np.empty((len(rows), count, 4))
        factor, coarse_first = patches.search_factor[rows], self.uses_coarse_level(rows) & (coarse_count > 0)
        source = np.array([row if int(row) in patches.renewed else -1 for row in rows])
        # Grains that are searched for with the same images on the same level are one group.
        for key in sorted(set(zip(factor.tolist(), source.tolist(), coarse_first.tolist(), strict=True))):
            level, own, coarser = key
            group = np.flatnonzero((factor == level) & (source == own) & (coarse_first == coarser))
            self._search_group(
                photograph, rows[group], _subset(within, group), best, group, level, coarse_count * coarser, parts
            )
        return best

    def _search_group(
        self, photograph: Pyramid, rows: Rows, within: SearchRange, best: Array, at: Rows, factor: int,
        coarse_count: int, parts: bool,
    ) -> None:  # fmt: skip
        """Write best[at] (m, c, 4) of grains `rows` (m,) that have one reference image, on the level `factor`."""
        patches = self.patches
        source = patches.source(int(rows[0]))
        levels = (factor, 2 * factor) if coarse_count else (factor,)
        images = [each for level in levels for each in (source.coefficients(level), photograph.level(level))]
        pose = self._from_reference(rows, within.middle)
        window = np.ascontiguousarray(within.window, np.float64)
        place, radius = patches.source_centre[rows], patches.radius[rows]
        sufficient_zncc = np.minimum(patches.accidental_zncc[rows] + 0.2, 0.9)
        found = np.empty((len(rows), best.shape[1], 4))

        def run_chunk(part: slice) -> None:
            discs = place[part], radius[part], pose[part], window[part]
            if coarse_count:
                search_coarse_to_fine(
                    images[0], images[1], images[2], images[3], factor, *discs, within.angle_window, coarse_count,
                    sufficient_zncc[part], found[part],
                )  # fmt: skip
            elif parts:
                search_parts_all(images[0], images[1], factor, *discs, within.angle_window, found[part])
            else:
                search_all(images[0], images[1], factor, *discs, within.angle_window, found[part])

        self._run_in_chunks(len(rows), run_chunk)
        found[:, :, 2] += patches.source_rotation[rows, None]
        best[at] = found

    def _from_reference(self, rows: Rows, pose: Array) -> Array:
        """A copy of poses (m, 3) with rotations relative to the image that each patch was cut from."""
        pose = np.array(pose, dtype=np.float64, order="C")
        pose[:, 2] -= self.patches.source_rotation[rows]
        return pose

    def _fits(self, rows: Rows, pose: Array, fit: Array, covariance: Array) -> Fits:
        """Fits with rotation and covariance (m, 3, 3) relative to the first photograph."""
        pose[:, 2] += self.patches.source_rotation[rows]
        covariance[:, :2, :2] += self.patches.source_variance[rows, None, None] * np.eye(2)
        return Fits(
            pose, fit[:, kernels.ZNCC], fit[:, kernels.RESIDUAL], fit[:, kernels.GAIN], fit[:, kernels.OFFSET],
            fit[:, kernels.KEPT], fit[:, kernels.CODE].astype(np.uint8), covariance,
        )  # fmt: skip

    def _run_each(self, count: int, one: Callable[[int], None]) -> None:
        def run_chunk(part: slice) -> None:
            for k in range(part.start, part.stop):
                one(k)

        self._run_in_chunks(count, run_chunk)

    def _run_in_chunks(self, count: int, run_chunk: Callable[[slice], None]) -> None:
        parts = [slice(first, min(first + CHUNK, count)) for first in range(0, count, CHUNK)]
        if self._workers == 1 or count <= CHUNK:
            for part in parts:
                run_chunk(part)
            return
        with ThreadPoolExecutor(self._workers) as pool:
            list(pool.map(run_chunk, parts))


def _subset(within: SearchRange, rows: Rows) -> SearchRange:
    return SearchRange(within.middle[rows], within.window[rows], within.angle_window)


def _interpolation_loss(pose: Array, radius: Array) -> Array:
    """Factor (m,) by which the residual variance underestimates the noise variance that displaces the pose.

    Interpolation smooths the photograph's noise but not its component along the speckle's gradient. Half of the
    residual is the reference's noise, which is not interpolated.
    """
    depth = 1.0 - HALFWAY_VARIANCE
    # Once the grid is rotated by a pixel at the rim, every position between the pixels occurs in the patch.
    angle = np.abs(np.angle(np.exp(4j * pose[:, 2]))) / 4.0
    mixed = np.clip(angle * radius, 0.0, 1.0)
    phases = np.sin(np.pi * pose[:, :2]) ** 2
    variance = 1.0 - depth * (mixed[:, None] * 0.5 + (1.0 - mixed[:, None]) * phases)
    return 2.0 / (1.0 + variance[:, 0] * variance[:, 1])
