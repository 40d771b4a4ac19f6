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
from .correlation.correlator import Correlator, Rows
from .correlation.noise import image_noise
from .correlation.patches import Patches
from .correlation.splines import Pyramid
from .detection.detect import Detection
from .registration.consistency import doubt_inconsistent, refit_poor
from .registration.manual_poses import ManualPoses, settle_manual_poses
from .registration.poses import FramePoses, found_poses, reference_poses
from .registration.prediction import follow_own_motion, last_known
from .registration.registration import Registration
from .registration.renewal import find_damaged
from .registration.rescue import rescue
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
        self._first = reference_poses(self.patches, self.noise, self.reference)

    @property
    def grain_count(self) -> int:
        return len(self.radius)

    def first(self) -> FramePoses:
        """The poses in the reference itself."""
        return self._first

    def follow(self, image: Image, history: Sequence[FramePoses], told: ManualPoses | None = None) -> FramePoses:
        """Find the grains in the next photograph. history: earlier frames, most recent last, at least one.

        told: what a user tells of some of them in this photograph.

        The last two frames predict the motion. Frames further back are read only for grains that were lost
        meanwhile: without them such a grain's rotation counts from the first photograph, in (−π, π].
        """
        registration = self.begin(image, history)
        if told is not None:
            settle_manual_poses(registration, told)
        follow_own_motion(registration, history)
        registration.judge_residuals()
        rescue(registration)
        refit_poor(registration)
        doubt_inconsistent(registration, self.radius)
        return found_poses(registration, self._first, self.reference)

    def find_damaged(self, history: Sequence[FramePoses], first_frame: int, photograph: Callable[[int], Image]) -> Rows:
        """The grains whose reference is damaged for good by the last frame of the history, see `renewal`."""
        return find_damaged(self._correlator, history, first_frame, photograph)

    def renew(self, rows: Rows, frame: int, photograph: Image, poses: FramePoses) -> None:
        """Compare `rows` (m,) from now on with a later photograph, in which they have the poses found in it."""
        self.patches = self.patches.renew(photograph, rows, poses.pose[rows], poses.sigma[rows])
        self._correlator = self._correlator.with_patches(self.patches)
        self.reference = self.reference.copy()
        self.reference[rows] = frame

    def begin(self, image: Image, history: Sequence[FramePoses]) -> Registration:
        """Make a photograph ready to be registered; nothing is looked for yet. history: as of `follow`."""
        if not history:
            raise ValueError("the history must hold at least one frame, the tracker's own first()")
        if image.shape != self.patches.reference.image.shape:
            raise ValueError(f"the photograph is {image.shape}, the reference {self.patches.reference.image.shape}")
        photograph = Pyramid(np.ascontiguousarray(image, dtype=np.float32))
        noise = max(image_noise(photograph.image), self.noise)
        last = last_known(history, self._first)
        return Registration.begin(self._correlator, photograph, last, noise, self.settings)
