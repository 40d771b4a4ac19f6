"""Tracking of the frame's bars: patches along each bar are correlated, and their common rigid motion is fitted.

A bar is given by its inner face on the first photograph, a segment with the packing on its left and the body on its
right. Patches are cut out of the body, without the grains before it and the background behind it. Patches that are
covered or leave a later photograph contradict the others and get no weight. Bars keep their length: the segment of a
frame is the first one, displaced and rotated.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...experiment.pictures.image import Image
from ...experiment.units import Scale
from ...solver.bodies.grains import Array
from ..correlation.correlator import Correlator, Fits, Rows, SearchRange
from ..correlation.patches import Patches
from ..correlation.splines import Pyramid
from .rigid_motion import fit_common_motion, rotate

MOST_LINED = 10.0  # variance of a patch's place along its bar, over that across it; of dots it is about 1


@dataclass(frozen=True, slots=True)
class WallSettings:
    """Settings of the wall tracker. Lengths in pixels."""

    patch_radius: tuple[float, float] = (5.0, 24.0)  # [px] least and greatest radius of a patch
    margin: float = 2.0  # [px] distance from the edges of the body, which are blurred
    tolerance: float = 1e-2  # [px] step below which a fit has converged
    step_limit: int = 30  # Gauss-Newton steps
    search_window: float = 60.0  # [px] half width of the search for a bar that has jumped
    search_angle: float = 0.15  # [rad] half width of the angles searched
    zncc_margin: float = 0.1  # by which a ZNCC must exceed the greatest accidental one
    model_error: float = 0.01  # [px] deviation of a patch from the rigid motion besides the error of its fit
    outlier: float = 5.0  # standard deviations beyond which a patch has no weight
    min_patches: int = 4  # number that must agree
    min_fraction: float = 0.25  # fraction of the usable patches that must agree

    def __post_init__(self) -> None:
        if not 3.0 < self.patch_radius[0] <= self.patch_radius[1]:
            raise ValueError(f"patch_radius must ascend and exceed 3 px, not {self.patch_radius}")


@dataclass(frozen=True, slots=True)
class WallPoses:
    """w walls in one photograph. Walls that were not found have NaN."""

    endpoints: Array  # (w, 2, 2) [m]
    sigma: Array  # (w, 2) [m] of each endpoint along the wall's normal, against the first photograph
    zncc: Array  # (w,) median over the patches that agree
    patches: NDArray[np.int64]  # (w,) number that agree


class WallTracker:
    """The bars of one reference photograph in other photographs."""

    def __init__(
        self,
        reference_image: Image,
        endpoints: Array,
        scale: Scale,
        depth: Array,
        settings: WallSettings | None = None,
        workers: int = 2,
    ) -> None:
        """Cut the patches of the bars.

        Parameters
        ----------
        reference_image : (H, W) array
            The first photograph [grey].
        endpoints : (w, 2, 2) array
            The bars' faces on it [m].
        scale : Scale
        depth : (w,) array
            Visible depths of the bodies [m].
        settings : WallSettings, optional
        workers : int
            Number of threads; results do not depend on it.
        """
        self.settings = settings if settings is not None else WallSettings()
        self.scale = scale
        self.endpoints = np.array(endpoints, dtype=np.float64)
        centre, patch_radius, wall = self._lay_patches(np.asarray(depth, dtype=np.float64))
        self.wall: NDArray[np.int64] = wall  # (p,) of every patch
        self.patches = Patches.cut(Pyramid(np.ascontiguousarray(reference_image, np.float32)), centre, patch_radius)
        self.position = scale.to_world(centre)  # (p, 2) [m] of every patch on the reference
        self._correlator = Correlator(
            self.patches, workers=workers, tolerance=self.settings.tolerance, limit=self.settings.step_limit
        )

    @property
    def wall_count(self) -> int:
        return len(self.endpoints)

    @property
    def patch_count(self) -> NDArray[np.int64]:
        """Number of usable patches of every wall (w,)."""
        return np.bincount(self.wall[self.patches.usable], minlength=self.wall_count)

    @property
    def lined(self) -> NDArray[np.bool_]:
        """Which walls (w,) show lines along them only: the edge of a thin bar, or traces of its brushing."""
        inverse = np.nan_to_num(self.patches.hessian_inverse[:, :2, :2])
        ends = self.scale.to_pixels(self.endpoints)
        along = (ends[:, 1] - ends[:, 0])[self.wall]
        across = np.stack([along[:, 1], -along[:, 0]], axis=1)
        variance, least = (np.einsum("pi,pij,pj->p", each, inverse, each) for each in (along, across))
        textured = self.patches.usable & (variance < MOST_LINED * least)
        count = np.bincount(self.wall[textured], minlength=self.wall_count)
        return np.asarray((count < self.settings.min_patches) & (self.patch_count >= self.settings.min_patches))

    def first(self) -> WallPoses:
        """Return the walls on the reference itself."""
        w = self.wall_count
        return WallPoses(self.endpoints.copy(), np.zeros((w, 2)), np.ones(w), self.patch_count.astype(np.int64))

    def follow(self, image: Image, history: Sequence[WallPoses]) -> WallPoses:
        """Find the walls in the next photograph. history: earlier frames, the most recent last, at least one."""
        photograph = Pyramid(np.ascontiguousarray(image, dtype=np.float32))
        w = self.wall_count
        endpoints, sigma = np.full((w, 2, 2), np.nan), np.full((w, 2), np.nan)
        zncc, count = np.full(w, np.nan), np.zeros(w, dtype=np.int64)
        for k in range(w):
            for motion in self._initial_motions(photograph, k, history):
                found = self._fit(photograph, k, motion)
                if found is not None:
                    endpoints[k], sigma[k], zncc[k], count[k] = found
                    break
        return WallPoses(endpoints, sigma, zncc, count)

    def _lay_patches(self, depth: Array) -> tuple[Array, Array, NDArray[np.int64]]:
        """Centres (p, 2) [px], radii (p,) [px] and walls (p,) of patches laid side by side along the bodies."""
        settings, pixel = self.settings, self.scale.mean_size
        centres, radii, walls = [np.empty((0, 2))], [], []
        for k, (start, end) in enumerate(self.endpoints):
            along = end - start
            length = float(np.linalg.norm(along))
            along = along / length
            outward = np.array([along[1], -along[0]])
            usable_depth = depth[k] / pixel - 2.0 * settings.margin
            patch_radius = float(np.clip(0.5 * usable_depth, *settings.patch_radius))
            rows = max(int(usable_depth / (2.0 * patch_radius)), 1)
            count = int((length / pixel - 2.0 * settings.margin) / (2.0 * patch_radius))
            if count < 1:
                continue
            step = (np.arange(count) + 0.5) * length / count
            for row in range(rows):
                offset = (settings.margin + (2 * row + 1) * patch_radius) * pixel
                centres.append(self.scale.to_pixels(start + np.outer(step, along) + offset * outward))
                radii += [patch_radius] * count
                walls += [k] * count
        return np.concatenate(centres), np.array(radii, dtype=np.float64), np.array(walls, dtype=np.int64)

    def _initial_motions(self, photograph: Pyramid, k: int, history: Sequence[WallPoses]) -> Iterator[Array]:
        """Starts (dx, dy, angle) of the fit of wall k: its extrapolated motion, its last position, then a search."""
        known = [pose.endpoints[k] for pose in history if np.isfinite(pose.endpoints[k]).all()]
        last = known[-1] if known else self.endpoints[k]
        if len(known) > 1:
            yield self._motion_to(k, last + (last - known[-2]))
        yield self._motion_to(k, last)
        yield from self._search(photograph, k, self._motion_to(k, last))

    def _fit(
        self, photograph: Pyramid, k: int, motion: Array
    ) -> tuple[Array, Array, float, int] | None:  # endpoints, sigma, zncc, patches
        rows = self._rows(k)
        if len(rows) < self.settings.min_patches:
            return None
        pose = self._poses_at(rows, k, motion)
        max_shift = np.maximum(4.0, 0.5 * self.patches.radius[rows])
        inside = np.isfinite(pose).all(axis=1)
        rows, pose, max_shift = rows[inside], pose[inside], max_shift[inside]
        fits = self._correlator.fit(photograph, rows, pose, max_shift)
        min_zncc = np.clip(self.patches.accidental_zncc[rows] + self.settings.zncc_margin, 0.5, 0.9)
        good = fits.converged & (fits.zncc > min_zncc)
        if good.sum() < self._min_count(k):
            return None
        chosen = rows[good]
        moved = self.scale.to_world(fits.pose[good, :2])
        size = self.scale.size_at(fits.pose[good, :2])
        motion, covariance, agree = fit_common_motion(
            self.position[chosen], moved, self._covariances(fits, good, size), middle=self._middle(k),
            outlier=self.settings.outlier, tolerance=1e-4 * self.scale.mean_size,
        )  # fmt: skip
        if agree.sum() < self._min_count(k):
            return None
        endpoints = self._move(k, motion, self.endpoints[k])
        zncc = float(np.median(fits.zncc[good][agree]))
        return endpoints, self._sigma(k, endpoints, covariance), zncc, int(agree.sum())

    def _covariances(self, fits: Fits, good: NDArray[np.bool_], size: Array) -> Array:
        """Covariances of the patches' displacements (m, 2, 2) [m²], the error of the rigid model included."""
        covariance = fits.covariance[good][:, :2, :2].copy()
        covariance[:, 0, 1] *= -1.0  # the world's y points up
        covariance[:, 1, 0] *= -1.0
        covariance += self.settings.model_error**2 * np.eye(2)
        return covariance * size[:, None, None] ** 2

    def _search(self, photograph: Pyramid, k: int, motion: Array) -> list[Array]:
        """Motions that the search for single patches gives, most similar first."""
        rows = self._rows(k)
        rows = rows[:: max(len(rows) // 8, 1)]
        pose = self._poses_at(rows, k, motion)
        inside = np.isfinite(pose).all(axis=1)
        rows, pose = rows[inside], pose[inside]
        if len(rows) == 0:
            return []
        window = np.full(len(rows), self.settings.search_window)
        within = SearchRange(pose, window, self.settings.search_angle)
        places = self._correlator.search(photograph, rows, within, 1)[:, 0]
        order = np.argsort(-places[:, 3])[:4]
        proposals = []
        for m in order:
            angle = float(self.scale.angle_to_world(places[m, 2]))
            moved = self.scale.to_world(places[m, :2])
            arm = self.position[rows[m]] - self._middle(k)
            shift = moved - self._middle(k) - rotate(angle, arm[None, :])[0]
            proposals.append(np.array([shift[0], shift[1], angle]))
        return proposals

    def _poses_at(self, rows: Rows, k: int, motion: Array) -> Array:
        """Poses of patches under a motion (m, 3): x, y [px], rotation [rad] of the picture."""
        point = self.scale.to_pixels(self._move(k, motion, self.position[rows]))
        angle = np.full((len(rows), 1), float(self.scale.angle_to_world(motion[2])))
        return np.concatenate([point, angle], axis=1)

    def _move(self, k: int, motion: Array, points: Array) -> Array:
        middle = self._middle(k)
        return middle + motion[:2] + rotate(motion[2], points - middle)

    def _motion_to(self, k: int, endpoints: Array) -> Array:
        """The rigid motion that takes the wall from the reference to `endpoints` (2, 2) [m]."""
        before, after = self.endpoints[k, 1] - self.endpoints[k, 0], endpoints[1] - endpoints[0]
        angle = np.arctan2(before[0] * after[1] - before[1] * after[0], before @ after)
        return np.array([*(endpoints.mean(axis=0) - self._middle(k)), angle])

    def _sigma(self, k: int, endpoints: Array, covariance: Array) -> Array:
        along = endpoints[1] - endpoints[0]
        normal = np.array([along[1], -along[0]]) / np.linalg.norm(along)
        arm = endpoints - endpoints.mean(axis=0)
        lever = -normal[0] * arm[:, 1] + normal[1] * arm[:, 0]
        design = np.column_stack([np.tile(normal, (2, 1)), lever])
        return np.sqrt(np.einsum("ea,ab,eb->e", design, covariance, design))

    def _middle(self, k: int) -> Array:
        return self.endpoints[k].mean(axis=0)

    def _rows(self, k: int) -> Rows:
        return np.flatnonzero((self.wall == k) & self.patches.usable)

    def _min_count(self, k: int) -> float:
        return max(self.settings.min_patches, self.settings.min_fraction * len(self._rows(k)))
