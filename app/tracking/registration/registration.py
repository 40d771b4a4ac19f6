"""One photograph during its registration: the references, the photograph and the results so far."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...solver.bodies.grains import Array
from ...tracks import TrackStatus
from ..correlation.correlator import Correlator, Fits, Rows
from ..correlation.patches import Patches
from ..correlation.splines import Pyramid
from ..settings import TrackingSettings
from .registration_results import RegistrationResults


@dataclass(slots=True)
class Registration:
    """One photograph, the references that it is compared with, and the results so far."""

    correlator: Correlator  # holds the patches of the reference
    photograph: Pyramid
    results: RegistrationResults
    last: Array  # (n, 3) most recent pose of every grain: x, y [px], rotation [rad]
    noise: float  # [grey] of a pixel, the greater of photograph and reference
    clean_residual: float  # [grey] standard deviation of a clean residual; of noise alone before the first fits

    @classmethod
    def begin(
        cls, correlator: Correlator, photograph: Pyramid, last: Array, noise: float, settings: TrackingSettings
    ) -> Registration:
        """Begin without any results."""
        results = RegistrationResults(correlator.patches, settings)
        return cls(correlator, photograph, results, last, noise, np.sqrt(2.0) * noise)

    @property
    def patches(self) -> Patches:
        return self.correlator.patches

    @property
    def settings(self) -> TrackingSettings:
        return self.results.settings

    def fit(self, rows: Rows, pose: Array, *, steps: int | None = None) -> Fits:
        """Fit the grains `rows` (m,) from `pose` (m, 3); steps: greatest number, instead of the correlator's limit."""
        return self.correlator.fit(self.photograph, rows, pose, self._max_shift(rows), steps=steps)

    def fit_and_accept(self, rows: Rows, pose: Array, status: TrackStatus) -> Fits:
        """Fit the grains `rows` (m,) from `pose` (m, 3) and store the acceptable fits."""
        fits = self.fit(rows, pose)
        self.results.accept(rows, fits, status)
        return fits

    def refit_occluded(self, rows: Rows, pose: Array) -> None:
        """Fit with Tukey's weights from `pose` (m, 3), which exclude the covered part of a grain."""
        if len(rows) == 0:
            return
        gain, offset = self.results.local_light(self.patches, rows, pose)
        fits = self.correlator.fit_robust(
            self.photograph, rows, pose, self._max_shift(rows), self.clean_residual, gain, offset
        )
        self.results.accept_robust(self.patches, rows, fits, self.clean_residual)

    def flag_poor(self) -> None:
        """Flag the grains whose residual exceeds what noise and this photograph's typical residual explain."""
        self.clean_residual = self.results.flag_poor(self.noise)

    def _max_shift(self, rows: Rows | NDArray[np.bool_]) -> Array:
        """Greatest distance of a fit from its start [px]: a small part of the patch, its basin being a speckle wide."""
        return np.maximum(4.0, 0.35 * self.patches.radius[rows])
