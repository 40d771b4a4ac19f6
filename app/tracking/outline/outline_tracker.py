"""Follow discs by their rims: plain ones, and those whose inside changes with the forces that are looked for.

The rim tells x and y, and nothing of a rotation, which stays unknown. A disc is looked for about where its own motion
leads, then about where its neighbours' leads, then in a wide window among the rings that no other disc has. What is
found is as exact as the circle through its edges; a photograph is not compared with any other, so errors do not add up.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array

from ...experiment.photographs import Image
from ...tracks import TrackStatus
from ..correlation.correlator import Rows
from ..correlation.noise import image_noise
from ..correlation.splines import spline_coefficients
from ..detection.detect import Detection
from ..registration.manual_poses import HAND_SIGMA, ManualPoses
from ..registration.neighbours import local_motion, overlaps
from ..registration.poses import FramePoses
from ..settings import TrackingSettings
from .rim_kernels import COLUMNS, QUALITY, SIGMA, VIEW, X, Y, find_rings, measure_rims

# Where a ring is looked for about its prediction, as a share of the radius, and at least [px].
NEAR_SHARE, NEAR_LEAST = 0.35, 3.0
# Edges are looked for within the first width of a ring that was found, then within the second [px].
WINDOWS = (2.5, 1.3)
# By how much the radius may seem to differ from that of the first photograph [px]: edges move with the light.
RADIUS_SCATTER = 0.3
# Share of the rim in view that must be seen on the circle, itself and as a part of that in the first photograph.
QUALITY_LEAST, QUALITY_SHARE = 0.3, 0.4
# Less of a rim in view does not make a disc.
VIEW_LEAST = 0.55
SIGMA_MOST = 0.5  # [px] beyond which a centre is not to be relied on
PLACES = 6  # rings that are looked at in a wide search
ROUNDS = 3  # of looking where neighbours lead


class OutlineTracker:
    """Places of the discs of one photograph in others. It holds no state of the sequence."""

    def __init__(
        self, reference_image: Image, grains: Detection, settings: TrackingSettings | None = None, workers: int = 2
    ) -> None:
        self.settings = settings if settings is not None else TrackingSettings()
        self.reference = np.zeros(grains.count, dtype=np.int32)
        self._shape = reference_image.shape
        rough = np.asarray(grains.radius, np.float64)
        look = _Look(reference_image)
        centre = np.stack([grains.x, grains.y], axis=1)
        # What an edge is differs from that of detection by the same for all: radii are measured once as they will be.
        seen = look.measure(centre, rough, np.full(len(rough), np.inf))
        good = np.isfinite(seen[:, SIGMA]) & (np.abs(seen[:, 2] - rough) < 0.1 * rough)
        self.radius = np.where(good, seen[:, 2], rough + (np.median((seen[:, 2] - rough)[good]) if good.any() else 0.0))
        found = look.measure(centre, self.radius, np.full(len(rough), RADIUS_SCATTER))
        self._quality = np.where(np.isfinite(found[:, SIGMA]), found[:, QUALITY], 0.0)
        good = np.isfinite(found[:, SIGMA]) & (found[:, VIEW] >= VIEW_LEAST)
        place = np.where(good[:, None], found[:, :2], centre)
        sigma = np.where(good, found[:, SIGMA], np.where(np.isfinite(grains.sigma), grains.sigma, HAND_SIGMA))
        status = np.where(good, TrackStatus.OK, TrackStatus.SUSPECT).astype(np.uint8)
        self._first = self._poses(place, sigma, status)

    @property
    def grain_count(self) -> int:
        return len(self.radius)

    def first(self) -> FramePoses:
        """The places in the first photograph."""
        return self._first

    def find_damaged(self, history: Sequence[FramePoses], first_frame: int, photograph: Callable[[int], Image]) -> Rows:
        """None: a rim is not compared with that of another photograph."""
        return np.empty(0, np.intp)

    def renew(self, rows: Rows, frame: int, photograph: Image, poses: FramePoses) -> None:
        """Nothing is to be renewed."""

    def follow(self, image: Image, history: Sequence[FramePoses], told: ManualPoses | None = None) -> FramePoses:
        """Find the discs in the next photograph. history: earlier frames, most recent last, at least one."""
        if image.shape != self._shape:
            raise ValueError(f"the photograph is {image.shape}, the first one {self._shape}")
        look = _Look(image)
        last = self._last_known(history)
        n = self.grain_count
        place, sigma = np.full((n, 2), np.nan), np.full(n, np.nan)
        quality, status = np.zeros(n), np.full(n, TrackStatus.LOST, np.uint8)
        if told is not None:
            seen = np.isfinite(told.pose[:, 0])
            rows = told.row[seen]
            place[rows], sigma[rows], status[rows] = told.pose[seen, :2], HAND_SIGMA, TrackStatus.GIVEN
        lost = np.zeros(n, np.bool_)
        if told is not None:
            lost[told.lost] = True

        def take(rows: Rows, guess: Array, window: Array, kind: TrackStatus) -> None:
            if len(rows) == 0:
                return
            found = look.find(guess, self.radius[rows], window)
            good = self._convincing(rows, found)
            chosen = rows[good]
            place[chosen], sigma[chosen], quality[chosen] = found[good, :2], found[good, SIGMA], found[good, QUALITY]
            status[chosen] = kind

        near = np.maximum(NEAR_LEAST, NEAR_SHARE * self.radius)
        step = np.zeros((n, 2))
        if len(history) > 1:
            step = np.nan_to_num(history[-1].pose[:, :2] - history[-2].pose[:, :2])
        rows = np.flatnonzero((status == TrackStatus.LOST) & ~lost)
        take(rows, last[rows] + step[rows], near[rows], TrackStatus.OK)
        self._part_rivals(place, quality, status)
        for _ in range(ROUNDS):
            rows = np.flatnonzero((status == TrackStatus.LOST) & ~lost)
            known = np.flatnonzero(status != TrackStatus.LOST)
            if len(rows) == 0 or len(known) == 0:
                break
            moved, _ = local_motion(last[known], place[known] - last[known], last[rows], itself=False)
            take(rows, last[rows] + moved, near[rows], TrackStatus.OK)
            self._part_rivals(place, quality, status)
        for row in np.flatnonzero((status == TrackStatus.LOST) & ~lost):
            self._search(look, int(row), last[row], place, sigma, quality, status)
        self._doubt(last, place, sigma, quality, status)
        leaving = self._leaves(last + step) | (history[-1].status == TrackStatus.OUT_OF_FRAME)
        status[(status == TrackStatus.LOST) & leaving & ~lost] = TrackStatus.OUT_OF_FRAME
        return self._poses(place, sigma, status)

    def _convincing(self, rows: Rows, found: Array) -> NDArray[np.bool_]:
        least = np.maximum(QUALITY_LEAST, QUALITY_SHARE * self._quality[rows])
        good = np.isfinite(found[:, SIGMA]) & (found[:, QUALITY] >= least) & (found[:, VIEW] >= VIEW_LEAST)
        return good & (found[:, SIGMA] < np.maximum(SIGMA_MOST, 0.05 * self.radius[rows]))

    def _part_rivals(self, place: Array, quality: Array, status: NDArray[np.uint8]) -> None:
        """Of two that took one and the same ring, the one that it fits worse is still to be found."""
        rows = np.flatnonzero(status != TrackStatus.LOST)
        for i, j in rows[overlaps(place[rows], self.radius[rows], 0.5)]:
            worse = i if (quality[i] < quality[j] or status[j] == TrackStatus.GIVEN) else j
            if status[worse] != TrackStatus.GIVEN:
                place[worse], status[worse] = np.nan, TrackStatus.LOST

    def _search(
        self, look: _Look, row: int, middle: Array, place: Array, sigma: Array, quality: Array,
        status: NDArray[np.uint8],
    ) -> None:  # fmt: skip
        """Look in the widest window for a ring that no other disc has taken."""
        radius = self.radius[row]
        taken = np.flatnonzero(status != TrackStatus.LOST)
        for x, y, value in look.rings(middle, radius, self.settings.search_window, PLACES):
            apart = np.hypot(place[taken, 0] - x, place[taken, 1] - y)
            if value < 0.0 or (apart < 0.7 * (radius + self.radius[taken])).any():
                continue
            found = look.measure(np.array([[x, y]]), np.array([radius]), np.array([RADIUS_SCATTER]))
            if self._convincing(np.array([row]), found)[0]:
                place[row], sigma[row], quality[row] = found[0, :2], found[0, SIGMA], found[0, QUALITY]
                status[row] = TrackStatus.RESCUED
                return

    def _doubt(self, last: Array, place: Array, sigma: Array, quality: Array, status: NDArray[np.uint8]) -> None:
        """Mark what contradicts its neighbours, overlaps them, or is seen badly."""
        rows = np.flatnonzero(status != TrackStatus.LOST)
        if len(rows) == 0:
            return
        moved = place[rows] - last[rows]
        predicted, scatter = local_motion(last[rows], moved, last[rows], itself=True)
        odd = np.linalg.norm(moved - predicted, axis=1) > 6.0 * scatter + 0.5 * self.radius[rows]
        pairs = overlaps(place[rows], self.radius[rows], self.settings.overlap_allowed)
        odd[np.where(quality[rows[pairs[:, 0]]] < quality[rows[pairs[:, 1]]], pairs[:, 0], pairs[:, 1])] = True
        doubtful = rows[odd | (sigma[rows] > SIGMA_MOST)]
        status[doubtful[status[doubtful] != TrackStatus.GIVEN]] = TrackStatus.SUSPECT

    def _last_known(self, history: Sequence[FramePoses]) -> Array:
        """The most recent place of every disc (n, 2)."""
        last = self._first.pose[:, :2].copy()
        for frame in history:
            seen = frame.has_pose
            last[seen] = frame.pose[seen, :2]
        return last

    def _leaves(self, place: Array) -> NDArray[np.bool_]:
        height, width = self._shape
        x, y = place[:, 0], place[:, 1]
        return (x < self.radius) | (y < self.radius) | (x > width - 1 - self.radius) | (y > height - 1 - self.radius)

    def _poses(self, place: Array, sigma: Array, status: NDArray[np.uint8]) -> FramePoses:
        missing = (status == TrackStatus.LOST) | (status == TrackStatus.OUT_OF_FRAME)
        unknown = np.full(len(status), np.nan)
        return FramePoses(
            np.where(missing, np.nan, place[:, 0]), np.where(missing, np.nan, place[:, 1]), unknown,
            np.where(missing, np.nan, sigma), unknown, unknown, status, self.reference,
        )  # fmt: skip


class _Look:
    """One photograph, as rims are looked for in it."""

    def __init__(self, image: Image) -> None:
        image = np.ascontiguousarray(image, np.float32)
        self._coefficients = spline_coefficients(image)
        self._noise = image_noise(image)
        smooth = cv2.GaussianBlur(image, (0, 0), 1.0)
        slope: dict[str, Any] = {"ddepth": cv2.CV_32F, "ksize": 3, "scale": 1.0 / 8.0}
        self._slope_x = np.asarray(cv2.Sobel(smooth, dx=1, dy=0, **slope), np.float32)
        self._slope_y = np.asarray(cv2.Sobel(smooth, dx=0, dy=1, **slope), np.float32)

    def measure(self, centre: Array, radius: Array, scatter: Array) -> Array:
        """Circles (n, 6) through the edges about centre (n, 2) [px]; see `measure_rims`."""
        found = np.empty((len(radius), COLUMNS))
        x, y = np.array(centre[:, 0], np.float64), np.array(centre[:, 1], np.float64)
        for width in WINDOWS:
            window = np.minimum(width, 0.4 * radius)
            measure_rims(self._coefficients, x, y, radius, window, float(scatter[0]), self._noise, found)
            good = np.isfinite(found[:, SIGMA])
            x, y = np.where(good, found[:, X], x), np.where(good, found[:, Y], y)
        return found

    def find(self, guess: Array, radius: Array, window: Array) -> Array:
        """The best ring's circle (m, 6) about each guess (m, 2) [px]."""
        places = np.empty((len(radius), 1, 3))
        x, y = np.ascontiguousarray(guess[:, 0]), np.ascontiguousarray(guess[:, 1])
        find_rings(self._slope_x, self._slope_y, x, y, radius, window, 1.0, places)
        centre = np.where(places[:, 0, 2:] > 0.0, places[:, 0, :2], guess)
        scatter = np.full(len(radius), RADIUS_SCATTER)
        found, still = self.measure(centre, radius, scatter), self.measure(guess, radius, scatter)
        # Fringes may outshine the rim: then it is where it was expected.
        return np.where((still[:, QUALITY] > found[:, QUALITY])[:, None], still, found)

    def rings(self, middle: Array, radius: float, window: float, count: int) -> Array:
        """The best rings (c, 3) in a wide window: x, y [px], their strength."""
        places = np.empty((1, count, 3))
        x, y = middle[:1].astype(np.float64), middle[1:2].astype(np.float64)
        step = max(1.0, 0.08 * radius)
        find_rings(self._slope_x, self._slope_y, x, y, np.array([radius]), np.array([window]), step, places)
        return places[0]
