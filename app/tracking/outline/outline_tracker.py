"""Tracking of discs by their rims: plain discs, and photoelastic ones whose inside changes with their forces.

The rim gives x and y; the rotation stays unknown. A disc is searched for around its own extrapolated motion, then
around its neighbours' motion, then in a wide window among the rings of no other disc. The accuracy is that of the
circle through its edges. A photograph is not compared with any other, so errors do not accumulate.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...experiment.photographs import Image
from ...solver.bodies.grains import Array
from ...tracks import TrackStatus
from ..correlation.correlator import Rows
from ..correlation.noise import image_noise
from ..correlation.splines import spline_coefficients
from ..detection.detect import Detection
from ..registration.manual_poses import MANUAL_SIGMA, ManualPoses
from ..registration.neighbours import local_motion, overlaps
from ..registration.poses import FramePoses
from ..settings import TrackingSettings
from .rim_kernels import COLUMNS, QUALITY, SIGMA, VIEW, X, Y, find_rings, measure_rims

# Half width of the search for a ring around its prediction, as a fraction of the radius, and at least [px].
NEAR_FRACTION, NEAR_MIN = 0.35, 3.0
# Half widths of the search for edges [px]: the first around a ring, the second around the circle that was then fitted.
WINDOWS = (2.5, 1.3)
# Standard deviation of the apparent radius about that of the first photograph [px]: edges move with the light.
RADIUS_SD = 0.3
# Least fraction of the rim in view with an edge on the circle, and its least ratio to that of the first photograph.
MIN_QUALITY, MIN_QUALITY_RATIO = 0.3, 0.4
# Least fraction of a rim that must be in view.
MIN_VIEW = 0.55
MAX_SIGMA = 0.5  # [px] standard deviation of a centre above which it is suspect
PLACES = 6  # rings that are measured in a wide search
ROUNDS = 3  # of searches around the neighbours' predictions


class OutlineTracker:
    """Positions of the discs of one photograph in others, without state of the sequence."""

    def __init__(
        self, reference_image: Image, grains: Detection, settings: TrackingSettings | None = None, workers: int = 2
    ) -> None:
        self.settings = settings if settings is not None else TrackingSettings()
        self.reference = np.zeros(grains.count, dtype=np.int32)
        self._shape = reference_image.shape
        rough = np.asarray(grains.radius, np.float64)
        rim_image = _RimImage(reference_image)
        centre = np.stack([grains.x, grains.y], axis=1)
        # The definition of an edge differs from that of detection, by the same for all discs: radii are measured anew.
        measured = rim_image.measure(centre, rough, np.full(len(rough), np.inf))
        excess = measured[:, 2] - rough
        good = np.isfinite(measured[:, SIGMA]) & (np.abs(excess) < 0.1 * rough)
        self.radius = np.where(good, measured[:, 2], rough + (np.median(excess[good]) if good.any() else 0.0))
        found = rim_image.measure(centre, self.radius, np.full(len(rough), RADIUS_SD))
        self._quality = np.where(np.isfinite(found[:, SIGMA]), found[:, QUALITY], 0.0)
        good = np.isfinite(found[:, SIGMA]) & (found[:, VIEW] >= MIN_VIEW)
        position = np.where(good[:, None], found[:, :2], centre)
        sigma = np.where(good, found[:, SIGMA], np.where(np.isfinite(grains.sigma), grains.sigma, MANUAL_SIGMA))
        status = np.where(good, TrackStatus.OK, TrackStatus.SUSPECT).astype(np.uint8)
        self._first = self._poses(position, sigma, status)

    @property
    def grain_count(self) -> int:
        return len(self.radius)

    def first(self) -> FramePoses:
        """Return the positions in the first photograph."""
        return self._first

    def find_damaged(self, history: Sequence[FramePoses], first_frame: int, photograph: Callable[[int], Image]) -> Rows:
        """Return no grain: a rim is not compared with that of another photograph."""
        return np.empty(0, np.intp)

    def renew(self, rows: Rows, frame: int, photograph: Image, poses: FramePoses) -> None:
        """Do nothing: there is no reference to renew."""

    def follow(self, image: Image, history: Sequence[FramePoses], given: ManualPoses | None = None) -> FramePoses:
        """Find the discs in the next photograph; parameters as of `Tracker.follow`."""
        if image.shape != self._shape:
            raise ValueError(f"the photograph is {image.shape}, the first one {self._shape}")
        rim_image = _RimImage(image)
        last = self._last_known(history)
        n = self.grain_count
        position, sigma = np.full((n, 2), np.nan), np.full(n, np.nan)
        quality, status = np.zeros(n), np.full(n, TrackStatus.LOST, np.uint8)
        if given is not None:
            visible = np.isfinite(given.pose[:, 0])
            rows = given.row[visible]
            position[rows], sigma[rows], status[rows] = given.pose[visible, :2], MANUAL_SIGMA, TrackStatus.GIVEN
        lost = np.zeros(n, np.bool_)
        if given is not None:
            lost[given.lost] = True

        def accept(rows: Rows, guess: Array, window: Array, kind: TrackStatus) -> None:
            if len(rows) == 0:
                return
            found = rim_image.find(guess, self.radius[rows], window)
            good = self._convincing(rows, found)
            chosen = rows[good]
            position[chosen], sigma[chosen], quality[chosen] = found[good, :2], found[good, SIGMA], found[good, QUALITY]
            status[chosen] = kind

        near = np.maximum(NEAR_MIN, NEAR_FRACTION * self.radius)
        step = np.zeros((n, 2))
        if len(history) > 1:
            step = np.nan_to_num(history[-1].pose[:, :2] - history[-2].pose[:, :2])
        rows = np.flatnonzero((status == TrackStatus.LOST) & ~lost)
        accept(rows, last[rows] + step[rows], near[rows], TrackStatus.OK)
        self._resolve_duplicates(position, quality, status)
        for _ in range(ROUNDS):
            rows = np.flatnonzero((status == TrackStatus.LOST) & ~lost)
            known = np.flatnonzero(status != TrackStatus.LOST)
            if len(rows) == 0 or len(known) == 0:
                break
            moved, _ = local_motion(last[known], position[known] - last[known], last[rows], exclude_self=False)
            accept(rows, last[rows] + moved, near[rows], TrackStatus.OK)
            self._resolve_duplicates(position, quality, status)
        for row in np.flatnonzero((status == TrackStatus.LOST) & ~lost):
            self._search(rim_image, int(row), last[row], position, sigma, quality, status)
        self._flag_inconsistent(last, position, sigma, quality, status)
        leaving = self._leaves(last + step) | (history[-1].status == TrackStatus.OUT_OF_FRAME)
        status[(status == TrackStatus.LOST) & leaving & ~lost] = TrackStatus.OUT_OF_FRAME
        return self._poses(position, sigma, status)

    def _convincing(self, rows: Rows, found: Array) -> NDArray[np.bool_]:
        min_quality = np.maximum(MIN_QUALITY, MIN_QUALITY_RATIO * self._quality[rows])
        good = np.isfinite(found[:, SIGMA]) & (found[:, QUALITY] >= min_quality) & (found[:, VIEW] >= MIN_VIEW)
        return good & (found[:, SIGMA] < np.maximum(MAX_SIGMA, 0.05 * self.radius[rows]))

    def _resolve_duplicates(self, position: Array, quality: Array, status: NDArray[np.uint8]) -> None:
        """Of two discs on the same ring, reset the one of lower quality to lost."""
        rows = np.flatnonzero(status != TrackStatus.LOST)
        for i, j in rows[overlaps(position[rows], self.radius[rows], 0.5)]:
            worse = i if (quality[i] < quality[j] or status[j] == TrackStatus.GIVEN) else j
            if status[worse] != TrackStatus.GIVEN:
                position[worse], status[worse] = np.nan, TrackStatus.LOST

    def _search(
        self, rim_image: _RimImage, row: int, middle: Array, position: Array, sigma: Array, quality: Array,
        status: NDArray[np.uint8],
    ) -> None:  # fmt: skip
        """Search in the widest window for a ring of no other disc."""
        radius = self.radius[row]
        taken = np.flatnonzero(status != TrackStatus.LOST)
        for x, y, value in rim_image.find_strongest(middle, radius, self.settings.search_window, PLACES):
            apart = np.hypot(position[taken, 0] - x, position[taken, 1] - y)
            if value < 0.0 or (apart < 0.7 * (radius + self.radius[taken])).any():
                continue
            found = rim_image.measure(np.array([[x, y]]), np.array([radius]), np.array([RADIUS_SD]))
            if self._convincing(np.array([row]), found)[0]:
                position[row], sigma[row], quality[row] = found[0, :2], found[0, SIGMA], found[0, QUALITY]
                status[row] = TrackStatus.RESCUED
                return

    def _flag_inconsistent(
        self, last: Array, position: Array, sigma: Array, quality: Array, status: NDArray[np.uint8]
    ) -> None:
        """Mark discs as suspect that contradict their neighbours, overlap them, or have a large standard deviation."""
        rows = np.flatnonzero(status != TrackStatus.LOST)
        if len(rows) == 0:
            return
        moved = position[rows] - last[rows]
        predicted, radius_sd = local_motion(last[rows], moved, last[rows], exclude_self=True)
        inconsistent = np.linalg.norm(moved - predicted, axis=1) > 6.0 * radius_sd + 0.5 * self.radius[rows]
        pairs = overlaps(position[rows], self.radius[rows], self.settings.overlap_allowed)
        inconsistent[np.where(quality[rows[pairs[:, 0]]] < quality[rows[pairs[:, 1]]], pairs[:, 0], pairs[:, 1])] = True
        suspect = rows[inconsistent | (sigma[rows] > MAX_SIGMA)]
        status[suspect[status[suspect] != TrackStatus.GIVEN]] = TrackStatus.SUSPECT

    def _last_known(self, history: Sequence[FramePoses]) -> Array:
        """The most recent position of every disc (n, 2)."""
        last = self._first.pose[:, :2].copy()
        for frame in history:
            visible = frame.has_pose
            last[visible] = frame.pose[visible, :2]
        return last

    def _leaves(self, position: Array) -> NDArray[np.bool_]:
        height, width = self._shape
        x, y = position[:, 0], position[:, 1]
        return (x < self.radius) | (y < self.radius) | (x > width - 1 - self.radius) | (y > height - 1 - self.radius)

    def _poses(self, position: Array, sigma: Array, status: NDArray[np.uint8]) -> FramePoses:
        missing = (status == TrackStatus.LOST) | (status == TrackStatus.OUT_OF_FRAME)
        unknown = np.full(len(status), np.nan)
        return FramePoses(
            np.where(missing, np.nan, position[:, 0]), np.where(missing, np.nan, position[:, 1]), unknown,
            np.where(missing, np.nan, sigma), unknown, unknown, status, self.reference,
        )  # fmt: skip


class _RimImage:
    """One photograph with the gradients and coefficients that rims are measured with."""

    def __init__(self, image: Image) -> None:
        image = np.ascontiguousarray(image, np.float32)
        self._coefficients = spline_coefficients(image)
        self._noise = image_noise(image)
        smooth = cv2.GaussianBlur(image, (0, 0), 1.0)
        slope: dict[str, Any] = {"ddepth": cv2.CV_32F, "ksize": 3, "scale": 1.0 / 8.0}
        self._slope_x = np.asarray(cv2.Sobel(smooth, dx=1, dy=0, **slope), np.float32)
        self._slope_y = np.asarray(cv2.Sobel(smooth, dx=0, dy=1, **slope), np.float32)

    def measure(self, centre: Array, radius: Array, radius_sd: Array) -> Array:
        """Measure the circles (n, 6) through the edges around centre (n, 2) [px]; see `measure_rims`."""
        found = np.empty((len(radius), COLUMNS))
        x, y = np.array(centre[:, 0], np.float64), np.array(centre[:, 1], np.float64)
        for width in WINDOWS:
            window = np.minimum(width, 0.4 * radius)
            measure_rims(self._coefficients, x, y, radius, window, float(radius_sd[0]), self._noise, found)
            good = np.isfinite(found[:, SIGMA])
            x, y = np.where(good, found[:, X], x), np.where(good, found[:, Y], y)
        return found

    def find(self, guess: Array, radius: Array, window: Array) -> Array:
        """Measure the circle (m, 6) of the best ring around each guess (m, 2) [px]."""
        places = np.empty((len(radius), 1, 3))
        x, y = np.ascontiguousarray(guess[:, 0]), np.ascontiguousarray(guess[:, 1])
        find_rings(self._slope_x, self._slope_y, x, y, radius, window, 1.0, places)
        centre = np.where(places[:, 0, 2:] > 0.0, places[:, 0, :2], guess)
        radius_sd = np.full(len(radius), RADIUS_SD)
        found, at_guess = self.measure(centre, radius, radius_sd), self.measure(guess, radius, radius_sd)
        # Fringes may be stronger than the rim; the circle at the guess is then the better one.
        return np.where((at_guess[:, QUALITY] > found[:, QUALITY])[:, None], at_guess, found)

    def find_strongest(self, middle: Array, radius: float, window: float, count: int) -> Array:
        """Find the best rings (c, 3) in a wide window: x, y [px], mean radial slope."""
        places = np.empty((1, count, 3))
        x, y = middle[:1].astype(np.float64), middle[1:2].astype(np.float64)
        step = max(1.0, 0.08 * radius)
        find_rings(self._slope_x, self._slope_y, x, y, np.array([radius]), np.array([window]), step, places)
        return places[0]
