"""Tracking of discs by their rims: plain discs, and photoelastic ones whose inside changes with their forces.

The rim gives x and y; the rotation stays unknown. A disc is searched for around its own extrapolated motion, then
around its neighbours' motion. A ring whose radial slopes are much weaker than the disc's in the first photograph is not
its rim. Lost discs are then assigned to the rings of no other disc in a wide window, so that their total motion is
least. The accuracy is that of the circle through its edges. A photograph is not compared with any other, so errors do
not accumulate.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from ...experiment.pictures.image import Image
from ...solver.bodies.grains import Array
from ...tracks import TrackStatus
from ..correlation.correlator import Rows
from ..detection.detect import Detection
from ..detection.rings import without_overlap
from ..registration.manual_poses import MANUAL_SIGMA, ManualPoses
from ..registration.neighbours import local_motion, overlaps
from ..registration.poses import FramePoses
from ..settings import TrackingSettings
from .rim_image import RADIUS_SD, RimImage
from .rim_kernels import QUALITY, SIGMA, VIEW

# Half width of the search for a ring around its prediction, as a fraction of the radius, and at least [px].
NEAR_FRACTION, NEAR_MIN = 0.35, 3.0
# Least fraction of the rim in view with an edge on the circle, and its least ratio to that of the first photograph.
MIN_QUALITY, MIN_QUALITY_RATIO = 0.3, 0.4
# Least fraction of a rim that must be in view.
MIN_VIEW = 0.55
# Standard deviation of a centre above which it is suspect [px], and as a fraction of the radius where that is more.
MAX_SIGMA, MAX_RELATIVE_SIGMA = 0.5, 0.02
# Strength of a ring over that of the disc's rim in the first photograph, and over the median of all discs: below the
# first it is not its rim, below the second it is suspect. Of 65 photoelastic discs in motion, the rims under fringes
# have 0.85 and more, wrong places at most 0.3.
LEAST_STRENGTH, WEAK_STRENGTH = 0.6, 0.75
OWN_WINDOW = 2.0  # [px] within which the strength of a disc's rim is read
# Radii: least half width of the search for lost discs; its growth by every photograph without the disc, and its limit.
WIDE, GROWTH, WIDEST = 2.0, 0.5, 3.0
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
        rim_image = RimImage(reference_image)
        centre = np.stack([grains.x, grains.y], axis=1)
        # The definition of an edge differs from that of detection, by the same for all discs: radii are measured anew.
        measured = rim_image.measure(centre, rough, np.full(len(rough), np.inf))
        excess = measured[:, 2] - rough
        good = np.isfinite(measured[:, SIGMA]) & (np.abs(excess) < 0.1 * rough)
        self.radius = np.where(good, measured[:, 2], rough + (np.median(excess[good]) if good.any() else 0.0))
        found = rim_image.measure(centre, self.radius, np.full(len(rough), RADIUS_SD))
        self._quality = np.where(np.isfinite(found[:, SIGMA]), found[:, QUALITY], 0.0)
        good = np.isfinite(found[:, SIGMA]) & (found[:, VIEW] >= MIN_VIEW)
        self._strength = self._rim_strength(rim_image, np.where(good[:, None], found[:, :2], centre), self.radius)
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
        rim_image = RimImage(image)
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
        strength = self._relative_strength(rim_image, position, status)
        wrong = (strength < LEAST_STRENGTH) & (status != TrackStatus.GIVEN)
        position[wrong], status[wrong] = np.nan, TrackStatus.LOST
        rows = np.flatnonzero((status == TrackStatus.LOST) & ~lost)
        if len(rows):
            self._find_again(
                rim_image, rows, last[rows], self._windows(rows, history), (position, sigma, quality, status)
            )
            strength = self._relative_strength(rim_image, position, status)
        self._flag_inconsistent(last, position, sigma, quality, status, strength)
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

    def _rim_strength(self, rim_image: RimImage, position: Array, radius: Array) -> Array:
        """Return the strength of the best ring (m,) within two pixels of each position (m, 2)."""
        x, y = np.ascontiguousarray(position[:, 0]), np.ascontiguousarray(position[:, 1])
        return rim_image.ring_strength(x, y, radius, np.full(len(x), OWN_WINDOW), 1.0, 1)[:, 0, 2]

    def _relative_strength(self, rim_image: RimImage, position: Array, status: NDArray[np.uint8]) -> Array:
        """Return the strength of every rim (n,) over that in the first photograph, over the median; NaN where lost."""
        strength = np.full(self.grain_count, np.nan)
        rows = np.flatnonzero(status != TrackStatus.LOST)
        if len(rows) == 0:
            return strength
        known = self._rim_strength(rim_image, position[rows], self.radius[rows])
        strength[rows] = known / np.maximum(self._strength[rows], 1e-6)
        return strength / max(float(np.median(strength[rows])), 1e-6)

    def _windows(self, rows: Rows, history: Sequence[FramePoses]) -> Array:
        """Return the half widths (m,) [px] of the search for lost discs, wider the longer they are lost."""
        seen = np.array([frame.has_pose[rows] for frame in reversed(history)])
        gone = np.where(seen.any(axis=0), np.argmax(seen, axis=0), len(seen))
        wide = np.maximum(self.settings.search_window, WIDE * self.radius[rows])
        return wide * np.minimum(1.0 + GROWTH * gone, WIDEST)

    def _find_again(
        self, rim_image: RimImage, rows: Rows, last: Array, windows: Array,
        found_discs: tuple[Array, Array, Array, NDArray[np.uint8]],
    ) -> None:  # fmt: skip
        """Assign lost discs to the rings of no other disc so that the sum of their squared motions is least."""
        position, sigma, quality, status = found_discs
        taken = np.flatnonzero(status != TrackStatus.LOST)
        own = self._rim_strength(rim_image, position[taken], self.radius[taken])
        light = float(np.median(own / np.maximum(self._strength[taken], 1e-6))) if len(taken) else 1.0
        rings: list[tuple[float, float, float]] = []  # x, y [px] and relative strength
        for row, middle, window in zip(rows, last, windows.tolist(), strict=True):
            radius = float(self.radius[row])
            for x, y, value in rim_image.find_strongest(middle, radius, window, PLACES):
                apart = np.hypot(position[taken, 0] - x, position[taken, 1] - y)
                strength = value / max(light * float(self._strength[row]), 1e-6)
                if strength > LEAST_STRENGTH and not (apart < 0.7 * (radius + self.radius[taken])).any():
                    rings.append((x, y, strength))
        if not rings:
            return
        ring = np.array(sorted(rings, key=lambda each: -each[2]))
        size = float(np.median(self.radius[rows]))
        ring = ring[without_overlap(ring[:, 0], ring[:, 1], np.full(len(ring), size), allowed=0.6)]
        away = np.linalg.norm(ring[None, :, :2] - last[:, None], axis=2)
        reach = windows[:, None] * np.sqrt(2.0)
        for k, chosen in zip(*linear_sum_assignment(np.where(away < reach, away**2, 1e6 * reach**2)), strict=True):
            row = int(rows[k])
            found = rim_image.find(ring[chosen : chosen + 1, :2], self.radius[row : row + 1], np.full(1, OWN_WINDOW))[0]
            if away[k, chosen] < reach[k, 0] and np.isfinite(found[SIGMA]):
                position[row], sigma[row], quality[row] = found[:2], found[SIGMA], found[QUALITY]
                status[row] = TrackStatus.RESCUED

    def _flag_inconsistent(
        self, last: Array, position: Array, sigma: Array, quality: Array, status: NDArray[np.uint8], strength: Array
    ) -> None:
        """Mark discs as suspect that contradict their neighbours, overlap them, or have a weak or uncertain rim."""
        rows = np.flatnonzero(status != TrackStatus.LOST)
        if len(rows) == 0:
            return
        moved = position[rows] - last[rows]
        predicted, radius_sd = local_motion(last[rows], moved, last[rows], exclude_self=True)
        inconsistent = np.linalg.norm(moved - predicted, axis=1) > 6.0 * radius_sd + 0.5 * self.radius[rows]
        pairs = overlaps(position[rows], self.radius[rows], self.settings.overlap_allowed)
        inconsistent[np.where(quality[rows[pairs[:, 0]]] < quality[rows[pairs[:, 1]]], pairs[:, 0], pairs[:, 1])] = True
        uncertain = sigma[rows] > np.maximum(MAX_SIGMA, MAX_RELATIVE_SIGMA * self.radius[rows])
        suspect = rows[inconsistent | uncertain | (strength[rows] < WEAK_STRENGTH)]
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
