"""The poses of the grains in one photograph, as they are handed out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array

from ...tracks import TrackStatus
from ..correlation.patches import Patches
from .registration import Registration

# What a patch needs about it to be correlated [px]: splines reach that far.
SPLINE_REACH = 3.0


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
    reference: NDArray[np.int32]  # (n,) photograph that the reference patch was cut out of
    failed_reason: str = ""  # why the photograph shows nothing; empty where it does

    @property
    def has_pose(self) -> NDArray[np.bool_]:
        return np.isfinite(self.x)

    @property
    def pose(self) -> Array:
        """x, y, rotation (n, 3)."""
        return np.stack([self.x, self.y, self.rotation], axis=1)


def reference_poses(patches: Patches, noise: float, reference: NDArray[np.int32]) -> FramePoses:
    """The poses in the reference itself: no displacement by definition, known as its noise [grey] allows.

    Grains whose patch leaves the photograph or has no texture cannot be followed and have no pose.
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
    """The poses that a photograph has shown; first: those in the reference, which tell what was never to be seen."""
    findings, last, patches = registration.findings, registration.last, registration.patches
    status = findings.status.copy()
    missing = ~findings.accepted
    expected = np.where(np.isfinite(findings.expected), findings.expected, last)
    leaving = _leave_photograph(patches, expected)
    status[missing] = np.where(leaving, TrackStatus.OUT_OF_FRAME, TrackStatus.LOST)[missing]
    unseen = ~patches.usable & missing
    status[unseen] = first.status[unseen]
    pose = np.where(missing[:, None], np.nan, findings.pose)
    rotation = last[:, 2] + np.angle(np.exp(1j * (pose[:, 2] - last[:, 2])))
    blank = np.where(missing, np.nan, 1.0)
    return FramePoses(
        pose[:, 0], pose[:, 1], rotation, findings.sigma * blank, findings.zncc * blank,
        findings.second_zncc * blank, status, reference,
    )  # fmt: skip


def no_poses(reference: NDArray[np.int32], reason: str) -> FramePoses:
    """The poses in a photograph that shows nothing, and why it does not."""
    nothing = np.full(len(reference), np.nan)
    status = np.full(len(reference), TrackStatus.LOST, np.uint8)
    return FramePoses(nothing, nothing, nothing, nothing, nothing, nothing, status, reference, reason)


def _leave_photograph(patches: Patches, place: Array) -> NDArray[np.bool_]:
    """Which grains (n,) show less than their whole patch at places (n, 2+) [px]."""
    height, width = patches.reference.image.shape
    x, y, reach = place[:, 0], place[:, 1], patches.reach + SPLINE_REACH
    return (x < reach) | (y < reach) | (x > width - 1 - reach) | (y > height - 1 - reach)
