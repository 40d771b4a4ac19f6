"""Tracking of every grain of the first photograph through the later ones.

Every photograph is compared with the same reference, the first one, so errors do not accumulate. Only a grain that is
damaged permanently is compared with a later photograph from then on, which is recorded. A grain is fitted from its own
extrapolated motion, else from its neighbours' motion, else it is searched for. Fits whose residual exceeds what noise
explains are repeated robustly. Poses that stay poor, are ambiguous or contradict their neighbours are suspect.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..experiment.pictures.image import Image
from ..solver.bodies.grains import Array
from .correlation.correlator import Correlator, Rows
from .correlation.noise import image_noise
from .correlation.patches import Patches
from .correlation.splines import Pyramid
from .detection.detect import Detection
from .registration.consistency import flag_inconsistent, refit_poor
from .registration.manual_poses import ManualPoses, apply_manual_poses
from .registration.poses import FramePoses, found_poses, reference_poses
from .registration.prediction import fit_from_own_motion, last_known
from .registration.registration import Registration
from .registration.renewal import find_damaged
from .registration.rescue import rescue
from .settings import TrackingSettings


class Tracker:
    """Poses of the grains of one reference photograph in other photographs.

    The tracker's only state of the sequence are the renewed references: `follow` takes the rest from the history it is
    given, and `renew` repeats a renewal from stored poses, so that a run can be resumed.

    Parameters
    ----------
    reference_image : (H, W) array
        The reference photograph [grey].
    grains : Detection or tuple of (n,) arrays
        The grains, or their x, y, radius [px].
    settings : TrackingSettings, optional
    workers : int
        Number of threads; results do not depend on it.
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
        self.patches = Patches.cut(reference, centre, self.settings.patch_fraction * self.radius)
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
        """Return the poses in the reference itself."""
        return self._first

    def follow(self, image: Image, history: Sequence[FramePoses], given: ManualPoses | None = None) -> FramePoses:
        """Find the grains in the next photograph.

        Parameters
        ----------
        image : (H, W) array
            The photograph [grey].
        history : sequence of FramePoses
            Earlier frames, most recent last, at least one. The last two predict the motion. Earlier ones are needed
            only for grains that were lost: without them such a grain's rotation counts from the first photograph, in
            (−π, π].
        given : ManualPoses, optional
            Poses of some grains in this photograph, given by hand.

        Raises
        ------
        ValueError
            If the history is empty or the photograph has another size than the reference.
        """
        registration = self.begin(image, history)
        if given is not None:
            apply_manual_poses(registration, given)
        fit_from_own_motion(registration, history)
        registration.flag_poor()
        rescue(registration)
        refit_poor(registration)
        flag_inconsistent(registration, self.radius)
        return found_poses(registration, self._first, self.reference)

    def find_damaged(self, history: Sequence[FramePoses], first_frame: int, photograph: Callable[[int], Image]) -> Rows:
        """Find the grains whose reference is permanently damaged at the end of the history, see `renewal`."""
        return find_damaged(self._correlator, history, first_frame, photograph)

    def renew(self, rows: Rows, frame: int, photograph: Image, poses: FramePoses) -> None:
        """Replace the references of `rows` (m,) by those in a later photograph, at the poses found in it."""
        self.patches = self.patches.renew(photograph, rows, poses.pose[rows], poses.sigma[rows])
        self._correlator = self._correlator.with_patches(self.patches)
        self.reference = self.reference.copy()
        self.reference[rows] = frame

    def begin(self, image: Image, history: Sequence[FramePoses]) -> Registration:
        """Prepare the registration of a photograph, without any fit; parameters and errors as of `follow`."""
        if not history:
            raise ValueError("the history must hold at least one frame, the tracker's own first()")
        if image.shape != self.patches.reference.image.shape:
            raise ValueError(f"the photograph is {image.shape}, the reference {self.patches.reference.image.shape}")
        photograph = Pyramid(np.ascontiguousarray(image, dtype=np.float32))
        noise = max(image_noise(photograph.image), self.noise)
        last = last_known(history, self._first)
        return Registration.begin(self._correlator, photograph, last, noise, self.settings)
