"""Poses of the grains in one photograph: the result of its registration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...solver.bodies.grains import Array
from ...tracks import TrackStatus
from ..correlation.patches import Patches
from .registration import Registration

# Margin around a patch that correlation needs [px]: the support of the splines.
SPLINE_SUPPORT = 3.0


@dataclass(frozen=True, slots=True)
class FramePoses:
    """The poses of n grains in one photograph. Grains without a pose have NaN."""

    x: Array  # (n,) [px] column
    y: Array  # (n,) [px] row, down
    rotation: Array  # (n,) [rad] from the first photograph, positive from x towards y, continuous
    sigma: Array  # (n,) [px] standard deviation of a component of the displacement from the first photograph
    zncc: Array  # (n,) correlation with the reference patch
    second_zncc: Array  # (n,) of the best other place where a search found the grain, 0: none; NaN: not searched
    status: NDArray[np.uint8]  # (n,) TrackStatus
    reference: NDArray[np.int32]  # (n,) photograph that the reference patch was cut from
    failed_reason: str = ""  # why no grain was tracked; empty where some were

    @property
    def has_pose(self) -> NDArray[np.bool_]:
        return np.isfinite(self.x)

    @property
    def is_reliable(self) -> NDArray[np.bool_]:
        return self.has_pose & (self.status != TrackStatus.SUSPECT)

    @property
    def pose(self) -> Array:
        """x, y, rotation (n, 3)."""
        return np.stack([self.x, self.y, self.rotation], axis=1)


def reference_poses(patches: Patches, noise: float, reference: NDArray[np.int32]) -> FramePoses:
    """Return the poses in the reference itself: zero displacement by definition.

    Grains whose patch leaves the photograph or has no texture cannot be tracked and have no pose.

    Parameters
    ----------
    patches : Patches
        The reference patches.
    noise : float
        Standard deviation of a pixel's noise [grey], which gives that of a position.
    reference : (n,) array
        Photograph of every grain's patch.
    """
    n, good = len(patches.centre), patches.usable
    x, y = patches.centre[:, 0], patches.centre[:, 1]
    cut = _leave_photograph(patches, patches.centre)
    status = np.where(good, TrackStatus.OK, np.where(cut, TrackStatus.OUT_OF_FRAME, TrackStatus.LOST))
    sigma = noise * patches.sigma_per_noise
    return FramePoses(
        np.where(good, x, np.nan), np.where(good, y, np.nan), np.where(good, np.zeros(n), np.nan),
        np.where(good, sigma, np.nan), np.where(good, 1.0, np.nan), np.full(n, np.nan), status.astype(np.uint8),
        reference,
    )  # fmt: skip


def found_poses(registration: Registration, first: FramePoses, reference: NDArray[np.int32]) -> FramePoses:
    """Return the poses found in a photograph.

    Parameters
    ----------
    registration : Registration
        The finished registration.
    first : FramePoses
        The poses in the reference: they give the status of grains that were never visible.
    reference : (n,) array
        Photograph of every grain's patch.
    """
    results, last, patches = registration.results, registration.last, registration.patches
    status = results.status.copy()
    missing = ~results.accepted
    predicted = np.where(np.isfinite(results.predicted), results.predicted, last)
    leaving = _leave_photograph(patches, predicted)
    status[missing] = np.where(leaving, TrackStatus.OUT_OF_FRAME, TrackStatus.LOST)[missing]
    never_visible = ~patches.usable & missing
    status[never_visible] = first.status[never_visible]
    pose = np.where(missing[:, None], np.nan, results.pose)
    before = np.nan_to_num(last[:, 2])  # a grain without a reference has no earlier rotation
    rotation = before + np.angle(np.exp(1j * (pose[:, 2] - before)))
    blank = np.where(missing, np.nan, 1.0)
    return FramePoses(
        pose[:, 0], pose[:, 1], rotation, results.sigma * blank, results.zncc * blank,
        results.second_zncc * blank, status, reference,
    )  # fmt: skip


def no_poses(reference: NDArray[np.int32], reason: str) -> FramePoses:
    """Return the poses of a failed photograph, all NaN, with the reason of the failure."""
    unknown = np.full(len(reference), np.nan)
    status = np.full(len(reference), TrackStatus.LOST, np.uint8)
    return FramePoses(unknown, unknown, unknown, unknown, unknown, unknown, status, reference, reason)


def _leave_photograph(patches: Patches, place: Array) -> NDArray[np.bool_]:
    """Which patches (n,) leave the photograph at places (n, 2+) [px]."""
    height, width = patches.reference.image.shape
    x, y, margin = place[:, 0], place[:, 1], patches.radius + SPLINE_SUPPORT
    return (x < margin) | (y < margin) | (x > width - 1 - margin) | (y > height - 1 - margin)
