"""Follow the frame's bars: patches along each of them, correlated as grains are, and the rigid motion they share.

A bar is known by its inner face on the first photograph, a segment with the packing on its left; its body lies on the
right. Patches are cut out of the body, so that neither the grains before it nor the backing behind it take part. What
lies over a bar or leaves the picture in a later photograph contradicts the rest and is left out. Bars keep their
length: a frame's segment is the first one, moved and turned.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array

from ...experiment.photographs import Image
from ...experiment.units import Scale
from ..correlation.correlator import Correlator, Fits, Rows, SearchRange
from ..correlation.patches import Patches
from ..correlation.splines import Pyramid
from .rigid_motion import share_motion, turn


@dataclass(frozen=True, slots=True)
class WallSettings:
    """How bars are followed. Lengths in pixels."""

    reach: tuple[float, float] = (5.0, 24.0)  # [px] least and greatest radius of a patch
    margin: float = 2.0  # [px] kept from the edges of the body, where it is blurred
    tolerance: float = 1e-2  # [px] a step below which a fit has converged
    step_limit: int = 30  # Gauss-Newton steps
    search_window: float = 60.0  # [px] half width of the search when a bar has jumped
    search_sweep: float = 0.15  # [rad] half width of the angles searched
    margin_zncc: float = 0.1  # by which a ZNCC must exceed the greatest accidental one
    model_error: float = 0.01  # [px] by which a patch may miss the rigid motion although its fit is perfect
    outlier: float = 5.0  # standard deviations beyond which a patch does not count
    least_patches: int = 4  # that must agree
    least_share: float = 0.25  # of the usable patches that must agree

    def __post_init__(self) -> None:
        if not 3.0 < self.reach[0] <= self.reach[1]:
            raise ValueError(f"reach must ascend and exceed 3 px, not {self.reach}")


@dataclass(frozen=True, slots=True)
class WallPoses:
    """w walls in one photograph. Walls that were not found have NaN."""

    endpoints: Array  # (w, 2, 2) [m]
    sigma: Array  # (w, 2) [m] of each endpoint along the wall's normal, against the first photograph
    zncc: Array  # (w,) median over the patches that agree
    patches: NDArray[np.int64]  # (w,) how many agree


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
        """endpoints (w, 2, 2) [m] on the reference; depth (w,) [m]: how much of each body is seen."""
        self.settings = settings if settings is not None else WallSettings()
        self.scale = scale
        self.endpoints = np.array(endpoints, dtype=np.float64)
        centre, reach, wall = self._place(np.asarray(depth, dtype=np.float64))
        self.wall: NDArray[np.int64] = wall  # (p,) of every patch
        self.patches = Patches.cut(Pyramid(np.ascontiguousarray(reference_image, np.float32)), centre, reach)
        self.place = scale.to_world(centre)  # (p, 2) [m] of every patch on the reference
        self._correlator = Correlator(
            self.patches, workers=workers, tolerance=self.settings.tolerance, limit=self.settings.step_limit
        )

    @property
    def wall_count(self) -> int:
        return len(self.endpoints)

    @property
    def patch_count(self) -> NDArray[np.int64]:
        """Usable patches of every wall (w,)."""
        return np.bincount(self.wall[self.patches.usable], minlength=self.wall_count)

    def first(self) -> WallPoses:
        """The walls on the reference itself."""
        w = self.wall_count
        return WallPoses(self.endpoints.copy(), np.zeros((w, 2)), np.ones(w), self.patch_count.astype(np.int64))

    def follow(self, image: Image, history: Sequence[WallPoses]) -> WallPoses:
        """Find the walls in the next photograph. history: earlier frames, the most recent last, at least one."""
        photograph = Pyramid(np.ascontiguousarray(image, dtype=np.float32))
        w = self.wall_count
        endpoints, sigma = np.full((w, 2, 2), np.nan), np.full((w, 2), np.nan)
        zncc, count = np.full(w, np.nan), np.zeros(w, dtype=np.int64)
        for k in range(w):
            for guess in self._guesses(photograph, k, history):
                found = self._fit(photograph, k, guess)
                if found is not None:
                    endpoints[k], sigma[k], zncc[k], count[k] = found
                    break
        return WallPoses(endpoints, sigma, zncc, count)

    def _place(self, depth: Array) -> tuple[Array, Array, NDArray[np.int64]]:
        """Centres (p, 2) [px], radii (p,) [px] and walls (p,) of patches laid side by side along the bodies."""
        settings, pixel = self.settings, self.scale.mean_size
        centres, reaches, walls = [np.empty((0, 2))], [], []
        for k, (start, end) in enumerate(self.endpoints):
            along = end - start
            length = float(np.linalg.norm(along))
            along = along / length
            outward = np.array([along[1], -along[0]])
            room = depth[k] / pixel - 2.0 * settings.margin
            reach = float(np.clip(0.5 * room, *settings.reach))
            rows = max(int(room / (2.0 * reach)), 1)
            count = int((length / pixel - 2.0 * settings.margin) / (2.0 * reach))
            if count < 1:
                continue
            step = (np.arange(count) + 0.5) * length / count
            for row in range(rows):
                inside = (settings.margin + (2 * row + 1) * reach) * pixel
                centres.append(self.scale.to_pixels(start + np.outer(step, along) + inside * outward))
                reaches += [reach] * count
                walls += [k] * count
        return np.concatenate(centres), np.array(reaches, dtype=np.float64), np.array(walls, dtype=np.int64)

    def _guesses(self, photograph: Pyramid, k: int, history: Sequence[WallPoses]) -> Iterator[Array]:
        """Rigid motions (dx, dy, angle) of wall k to begin from: its own trend, rest, then what a search finds."""
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
        if len(rows) < self.settings.least_patches:
            return None
        pose = self._poses_at(rows, k, motion)
        leash = np.maximum(4.0, 0.5 * self.patches.reach[rows])
        inside = np.isfinite(pose).all(axis=1)
        rows, pose, leash = rows[inside], pose[inside], leash[inside]
        fits = self._correlator.fit(photograph, rows, pose, leash)
        needed = np.clip(self.patches.accidental_zncc[rows] + self.settings.margin_zncc, 0.5, 0.9)
        good = fits.converged & (fits.zncc > needed)
        if good.sum() < self._needed(k):
            return None
        chosen = rows[good]
        moved = self.scale.to_world(fits.pose[good, :2])
        size = self.scale.size_at(fits.pose[good, :2])
        motion, covariance, agree = share_motion(
            self.place[chosen], moved, self._covariances(fits, good, size), middle=self._middle(k),
            outlier=self.settings.outlier, tolerance=1e-4 * self.scale.mean_size,
        )  # fmt: skip
        if agree.sum() < self._needed(k):
            return None
        endpoints = self._move(k, motion, self.endpoints[k])
        zncc = float(np.median(fits.zncc[good][agree]))
        return endpoints, self._sigma(k, endpoints, covariance), zncc, int(agree.sum())

    def _covariances(self, fits: Fits, good: NDArray[np.bool_], size: Array) -> Array:
        """Of the displacement of every patch (m, 2, 2) [m²], with what the rigid motion leaves out."""
        covariance = fits.covariance[good][:, :2, :2].copy()
        covariance[:, 0, 1] *= -1.0  # the world's y points up
        covariance[:, 1, 0] *= -1.0
        covariance += self.settings.model_error**2 * np.eye(2)
        return covariance * size[:, None, None] ** 2

    def _search(self, photograph: Pyramid, k: int, motion: Array) -> list[Array]:
        """Motions that single patches propose when searched for, most similar first."""
        rows = self._rows(k)
        rows = rows[:: max(len(rows) // 8, 1)]
        pose = self._poses_at(rows, k, motion)
        inside = np.isfinite(pose).all(axis=1)
        rows, pose = rows[inside], pose[inside]
        if len(rows) == 0:
            return []
        window = np.full(len(rows), self.settings.search_window)
        within = SearchRange(pose, window, self.settings.search_sweep)
        places = self._correlator.search(photograph, rows, within, 1)[:, 0]
        order = np.argsort(-places[:, 3])[:4]
        proposals = []
        for m in order:
            angle = float(self.scale.angle_to_world(places[m, 2]))
            moved = self.scale.to_world(places[m, :2])
            arm = self.place[rows[m]] - self._middle(k)
            shift = moved - self._middle(k) - turn(angle, arm[None, :])[0]
            proposals.append(np.array([shift[0], shift[1], angle]))
        return proposals

    def _poses_at(self, rows: Rows, k: int, motion: Array) -> Array:
        """Where patches would be (m, 3): x, y [px], rotation [rad] of the picture."""
        point = self.scale.to_pixels(self._move(k, motion, self.place[rows]))
        angle = np.full((len(rows), 1), float(self.scale.angle_to_world(motion[2])))
        return np.concatenate([point, angle], axis=1)

    def _move(self, k: int, motion: Array, points: Array) -> Array:
        middle = self._middle(k)
        return middle + motion[:2] + turn(motion[2], points - middle)

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

    def _needed(self, k: int) -> float:
        return max(self.settings.least_patches, self.settings.least_share * len(self._rows(k)))
