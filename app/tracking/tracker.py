"""Follow every grain of the first photograph through the later ones.

Every photograph is compared with the same reference, the first one, so errors do not add up; only a grain that is
damaged for good is compared with a later one from then on, and that is recorded. A grain is fitted from where its own
motion leads, else from where its neighbours' leads, else it is searched for. What still fits worse than the noise
explains is refitted robustly, and what remains doubtful is compared with its neighbours. A pose that cannot be vouched
for is never handed out as a good one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from solver.bodies.grains import Array

from ..experiment.photographs import Image
from ..tracks import TrackStatus
from .corrections import Corrections, apply_corrections
from .correlation.correlator import Correlator, Rows
from .correlation.noise import image_noise
from .correlation.patches import Patches
from .correlation.splines import Pyramid
from .detection.grains import Detection
from .findings import Findings
from .neighbours import local_motion, overlaps
from .poses import FramePoses
from .renewal import find_damaged
from .rescue import leash, refit_hidden, rescue
from .settings import TrackingSettings


class Tracker:
    """Poses of the grains of one reference photograph in other photographs.

    grains: a Detection, or x, y, radius (n,) [px]. The tracker holds no state of the sequence but the references
    that were renewed: `follow` reads the rest from the history it is given, and `renew` repeats a renewal from stored
    poses, so that a run can be resumed.
    """

    def __init__(
        self,
        reference_image: Image,
        grains: Detection | tuple[Array, Array, Array],
        settings: TrackingSettings | None = None,
        workers: int = 2,
    ) -> None:
        x, y, radius = (grains.x, grains.y, grains.radius) if isinstance(grains, Detection) else grains
        self.settings = settings if settings is not None else TrackingSettings()
        self.radius = np.ascontiguousarray(radius, dtype=np.float64)  # (n,) [px]
        centre = np.stack([np.asarray(x, np.float64), np.asarray(y, np.float64)], axis=1)
        reference = Pyramid(np.ascontiguousarray(reference_image, dtype=np.float32))
        self.patches = Patches.cut(reference, centre, self.settings.patch_share * self.radius)
        self.noise = image_noise(reference.image)  # [grey]
        self._correlator = Correlator(
            self.patches, workers=workers, tolerance=self.settings.tolerance, limit=self.settings.step_limit
        )
        self.reference = np.zeros(len(self.radius), dtype=np.int32)  # (n,) photograph of every grain's patch
        self._first = self._begin()

    @property
    def grain_count(self) -> int:
        return len(self.radius)

    @property
    def accepted_zncc(self) -> Array:
        """ZNCC above which a place is the right one (n,): the smaller a patch, the more it takes."""
        return np.clip(self.patches.accidental_zncc + self.settings.margin, 0.5, 0.9)

    def first(self) -> FramePoses:
        """The poses in the reference itself.

        The displacement is zero by definition; sigma is what the noise of a single photograph amounts to.
        Grains whose patch leaves the photograph or has no texture cannot be followed and have no pose.
        """
        return self._first

    def find_damaged(self, history: Sequence[FramePoses], first_frame: int, photograph: Callable[[int], Image]) -> Rows:
        """The grains whose reference is damaged for good by the last frame of the history, see `renewal`."""
        return find_damaged(self._correlator, history, first_frame, photograph)

    def renew(self, rows: Rows, frame: int, photograph: Image, poses: FramePoses) -> None:
        """Compare `rows` (m,) from now on with a later photograph, in which they have the poses found in it."""
        self.patches = self.patches.renew(photograph, rows, poses.pose[rows], poses.sigma[rows])
        self._correlator = self._correlator.with_patches(self.patches)
        self.reference = self.reference.copy()
        self.reference[rows] = frame

    def _begin(self) -> FramePoses:
        n = self.grain_count
        patches = self.patches
        good = patches.usable
        height, width = patches.reference.image.shape
        x, y, r = patches.centre[:, 0], patches.centre[:, 1], patches.reach + 3.0
        cut = (x < r) | (y < r) | (x > width - 1 - r) | (y > height - 1 - r)
        status = np.where(good, TrackStatus.OK, np.where(cut, TrackStatus.OUT_OF_FRAME, TrackStatus.LOST))
        inverse = patches.hessian_inverse
        sigma = self.noise / patches.norm * np.sqrt(0.5 * (inverse[:, 0, 0] + inverse[:, 1, 1]))
        return FramePoses(
            np.where(good, x, np.nan), np.where(good, y, np.nan), np.where(good, np.zeros(n), np.nan),
            np.where(good, sigma, np.nan), np.where(good, 1.0, np.nan), np.full(n, np.nan), status.astype(np.uint8),
            self.reference,
        )  # fmt: skip

    def follow(self, image: Image, history: Sequence[FramePoses], corrections: Corrections | None = None) -> FramePoses:
        """Find the grains in the next photograph. history: earlier frames, most recent last, at least one.

        corrections: what a user tells of some of them in this photograph.

        The last two frames predict the motion. Frames further back are read only for grains that were lost
        meanwhile: without them such a grain's rotation counts from the first photograph, in (−π, π].
        """
        if not history:
            raise ValueError("the history must hold at least one frame, the tracker's own first()")
        if image.shape != self.patches.reference.image.shape:
            raise ValueError(f"the photograph is {image.shape}, the reference {self.patches.reference.image.shape}")
        photograph = Pyramid(np.ascontiguousarray(image, dtype=np.float32))
        last = _last_known(history, self.first())
        findings = Findings(self.patches, self.accepted_zncc, self.settings)
        noise = max(image_noise(photograph.image), self.noise)
        if corrections is not None:
            apply_corrections(self._correlator, photograph, findings, corrections, last, np.sqrt(2.0) * noise)
        _follow_predictions(self._correlator, photograph, findings, last, history)
        typical = findings.judge_residuals(noise)
        rescue(self._correlator, photograph, findings, last, self.settings, typical)
        typical = findings.judge_residuals(noise)
        poor = np.flatnonzero(findings.poor & (findings.status != TrackStatus.ROBUST))
        refit_hidden(self._correlator, photograph, findings, poor, findings.pose[poor], typical)
        findings.doubt(np.flatnonzero(findings.poor & (findings.status != TrackStatus.ROBUST)))
        self._judge(findings, last)
        return self._poses(findings, last, photograph)

    def _judge(self, findings: Findings, last: Array) -> None:
        """Mark what is not unique, and what contradicts its neighbours or overlaps them unless its ZNCC is high."""
        rows = np.flatnonzero(findings.accepted)
        if len(rows) == 0:
            return
        moved = findings.pose[rows, :2] - last[rows, :2]
        predicted, scatter = local_motion(last[rows, :2], moved, last[rows, :2], itself=True)
        # Grains do move against their neighbours, by a share of a radius between photographs.
        deviation = np.linalg.norm(moved - predicted, axis=1)
        odd = deviation > 6.0 * scatter + 0.25 * self.radius[rows]
        certain = findings.zncc[rows] > np.maximum(self.accepted_zncc[rows], 0.8)
        findings.doubt(rows[odd & ~certain])
        # A grain that another place resembles nearly as well may be there.
        findings.doubt(rows[findings.second_zncc[rows] > findings.zncc[rows] - self.settings.margin])
        pairs = rows[overlaps(findings.pose[rows, :2], self.radius[rows], self.settings.overlap_allowed)]
        trust = np.where(findings.status == TrackStatus.GIVEN, np.inf, findings.zncc)
        for i, j in pairs:
            findings.doubt(np.array([i if trust[i] < trust[j] else j]))

    def _poses(self, findings: Findings, last: Array, photograph: Pyramid) -> FramePoses:
        height, width = photograph.image.shape
        status = findings.status.copy()
        missing = ~findings.accepted
        expected = np.where(np.isfinite(findings.expected), findings.expected, last)
        reach = self.patches.reach + 3.0
        x, y = expected[:, 0], expected[:, 1]
        leaving = (x < reach) | (y < reach) | (x > width - 1 - reach) | (y > height - 1 - reach)
        never = self.first().status
        status[missing] = np.where(leaving, TrackStatus.OUT_OF_FRAME, TrackStatus.LOST)[missing]
        unseen = ~self.patches.usable & missing
        status[unseen] = never[unseen]
        pose = np.where(missing[:, None], np.nan, findings.pose)
        rotation = last[:, 2] + np.angle(np.exp(1j * (pose[:, 2] - last[:, 2])))
        blank = np.where(missing, np.nan, 1.0)
        return FramePoses(
            pose[:, 0], pose[:, 1], rotation, findings.sigma * blank, findings.zncc * blank,
            findings.second_zncc * blank, status, self.reference,
        )  # fmt: skip


def _last_known(history: Sequence[FramePoses], first: FramePoses) -> Array:
    """The most recent pose of every grain (n, 3)."""
    last = history[-1].pose
    for frame in reversed([first, *history[:-1]]):
        gone = ~np.isfinite(last[:, 0])
        if not gone.any():
            break
        last[gone] = frame.pose[gone]
    return last


def _follow_predictions(
    correlator: Correlator, photograph: Pyramid, findings: Findings, last: Array, history: Sequence[FramePoses]
) -> None:
    """Fit every grain from its own motion, and from rest where that leads nowhere."""
    seen = np.isfinite(history[-1].x)
    guess = history[-1].pose
    if len(history) > 1:
        step = history[-1].pose - history[-2].pose
        guess = np.where(np.isfinite(step), guess + step, guess)
    rows = np.flatnonzero(seen & findings.open)
    findings.take(rows, correlator.fit(photograph, rows, guess[rows], leash(correlator, rows)), TrackStatus.OK)
    rows = np.flatnonzero(seen & findings.open)
    if len(history) > 1 and len(rows):
        fits = correlator.fit(photograph, rows, last[rows], leash(correlator, rows))
        findings.take(rows, fits, TrackStatus.OK)
