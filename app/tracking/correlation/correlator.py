"""Patches of the reference photograph, and their correlation with another one, many grains at a time."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array

from . import kernels as kernels
from .patches import Patches
from .search import angle_steps, is_same_turn, search_patch
from .search_parts import search_parts
from .splines import HALFWAY_VARIANCE, Pyramid

Rows = NDArray[np.intp]

# Grains of one task. It is fixed, and no grain's result depends on another's within a task, so the number
# of workers cannot change anything.
CHUNK = 32

# A patch is sifted on the next coarser level first, if it has this radius there and a pixel of it is not coarser than
# paint.
SIFTED_REACH = 4.5
SIFTED_COARSEST = 4
# Half width of the look at such a place, in pixels of the finer level; and how many more places are looked at once one
# is beyond doubt, so that the second best is known, too.
LOOK = 2.0
RUNNERS_UP = 2


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

        def one(k: int) -> None:
            row = rows[k]
            kernels.fit_rigid(
                coefficients, patches.data[row],
                patches.hessian_inverse[row], patches.reach[row], leash[k],
                hopeless[k], self._tolerance, limit, pose[k], fit[k],
            )  # fmt: skip

        self._each(len(rows), one)
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
                coefficients, patches.data[row], patches.reach[row],
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
        factor = patches.search_factor[rows]
        sifted = self.sifts(rows) & (looks > 0)
        for level in np.unique(np.concatenate([factor, 2 * factor[sifted]])):  # made before the threads ask for them
            photograph.level(int(level))
            for source in {id(each): each for each in (patches.source(row) for row in rows)}.values():
                source.coefficients(int(level))

        beyond_doubt = np.minimum(patches.accidental_zncc[rows] + 0.2, 0.9)

        def one(k: int) -> None:
            level = _Level(photograph, patches, int(rows[k]), int(factor[k]))
            pose, window = within.middle[k], float(within.window[k])
            if sifted[k]:
                level.sift(pose, window, within.sweep, best[k], looks, float(beyond_doubt[k]))
            else:
                level.search(pose, window, within.sweep, best[k], parts=parts)

        self._each(len(rows), one)
        return best

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
        def chunk(first: int) -> None:
            for k in range(first, min(first + CHUNK, count)):
                one(k)

        if self._workers == 1 or count <= CHUNK:
            for first in range(0, count, CHUNK):
                chunk(first)
            return
        with ThreadPoolExecutor(self._workers) as pool:
            list(pool.map(chunk, range(0, count, CHUNK)))


@dataclass(frozen=True, slots=True)
class _Level:
    """One grain on one level of the pyramids. Poses are in pixels of the photograph."""

    photograph: Pyramid
    patches: Patches
    row: int
    factor: int  # by which the photographs are shrunk

    def search(
        self, pose: Array, window: float, sweep: float, best: Array, spacing: float = 3.0, *, parts: bool = False
    ) -> None:
        """Search about a pose (3,); best (c, 4) is written; spacing in pixels of the level."""
        patches, row, factor = self.patches, self.row, self.factor
        shift = 0.5 * (factor - 1)
        search = search_parts if parts else search_patch
        search(
            patches.source(row).coefficients(factor), self.photograph.level(factor),
            (patches.place[row, 0] - shift) / factor, (patches.place[row, 1] - shift) / factor,
            patches.reach[row] / factor, (pose[0] - shift) / factor, (pose[1] - shift) / factor,
            pose[2] - patches.turn[row], window / factor, sweep, spacing, best,
        )  # fmt: skip
        best[:, :2] = best[:, :2] * factor + shift
        best[:, 2] += patches.turn[row]

    def sift(self, pose: Array, window: float, sweep: float, best: Array, looks: int, beyond_doubt: float) -> None:
        """Search the next coarser level, and look at its `looks` best places on this one.

        beyond_doubt: ZNCC of a place after which few more are looked at.
        """
        coarse = replace(self, factor=2 * self.factor)
        places = np.empty((looks, 4))
        coarse.search(pose, window, sweep, places, spacing=2.0)
        # Half a step of the coarse angles to either side, and a pixel of the coarse level.
        half = 0.6 * sweep / angle_steps(float(self.patches.reach[self.row]) / coarse.factor, sweep)
        looked = np.full((looks, 1, 4), -1.0)
        last = looks
        for m in np.flatnonzero(places[:, 3] > 0.0):
            if m >= last:
                break
            self.search(places[m, :3], LOOK * self.factor, half, looked[m])
            if looked[m, 0, 3] > beyond_doubt:
                last = min(last, m + 1 + RUNNERS_UP)
        best[:] = _most_similar(looked[:, 0], len(best), 3.0 * self.factor)


def _most_similar(places: Array, count: int, spacing: float) -> Array:
    """The best `count` (count, 4) of places (m, 4), distinct by `spacing` [px] or in angle, else ZNCC −1."""
    best = np.full((count, 4), 0.0)
    best[:, 3] = -1.0
    found = 0
    for m in np.argsort(-places[:, 3], kind="stable"):
        if found == count or not places[m, 3] > 0.0:
            break
        away = np.hypot(best[:found, 0] - places[m, 0], best[:found, 1] - places[m, 1])
        turned = [is_same_turn(float(angle), float(places[m, 2])) for angle in best[:found, 2]]
        if not ((away < spacing) & np.array(turned, dtype=np.bool_)).any():
            best[found] = places[m]
            found += 1
    return best


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
