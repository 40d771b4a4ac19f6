"""One photograph being registered: its grains are found in it, one kind of guess after the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array

from ...tracks import TrackStatus
from ..correlation.correlator import Correlator, Fits, Rows
from ..correlation.patches import Patches
from ..correlation.splines import Pyramid
from ..settings import TrackingSettings
from .findings import Findings


@dataclass(slots=True)
class Registration:
    """What is compared with what, and what that has shown so far."""

    correlator: Correlator  # holds the patches of the reference
    photograph: Pyramid
    findings: Findings
    last: Array  # (n, 3) most recent pose of every grain: x, y [px], rotation [rad]
    noise: float  # [grey] of a pixel, of the noisier one of photograph and reference
    clean_residual: float  # [grey] deviation of what a right fit leaves, of noise alone until the fits tell

    @classmethod
    def begin(
        cls, correlator: Correlator, photograph: Pyramid, last: Array, noise: float, settings: TrackingSettings
    ) -> Registration:
        """Nothing is found yet."""
        findings = Findings(correlator.patches, settings)
        return cls(correlator, photograph, findings, last, noise, np.sqrt(2.0) * noise)

    @property
    def patches(self) -> Patches:
        return self.correlator.patches

    @property
    def settings(self) -> TrackingSettings:
        return self.findings.settings

    def fit(self, rows: Rows, pose: Array, *, steps: int | None = None) -> Fits:
        """Fit the grains `rows` (m,) from `pose` (m, 3); steps: at most, instead of the correlator's limit."""
        return self.correlator.fit(self.photograph, rows, pose, self._leash(rows), steps=steps)

    def take_fits(self, rows: Rows, pose: Array, status: TrackStatus) -> Fits:
        """Fit the grains `rows` (m,) from `pose` (m, 3) and keep what convinces."""
        fits = self.fit(rows, pose)
        self.findings.take(rows, fits, status)
        return fits

    def refit_hidden(self, rows: Rows, pose: Array) -> None:
        """Fit with Tukey's weights from `pose` (m, 3): what covers a part of a grain then does not count."""
        if len(rows) == 0:
            return
        gain, offset = self.findings.light_at(self.patches, rows, pose)
        fits = self.correlator.fit_robust(
            self.photograph, rows, pose, self._leash(rows), self.clean_residual, gain, offset
        )
        self.findings.take_robust(self.patches, rows, fits, self.clean_residual)

    def judge_residuals(self) -> None:
        """Mark the grains that fit worse than noise explains, by what is typical of this photograph."""
        self.clean_residual = self.findings.judge_residuals(self.noise)

    def _leash(self, rows: Rows | NDArray[np.bool_]) -> Array:
        """How far a fit may run [px]: a small part of the patch, for its basin is a speckle's size."""
        return np.maximum(4.0, 0.35 * self.patches.reach[rows])
