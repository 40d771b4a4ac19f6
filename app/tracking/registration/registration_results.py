"""The best fit of every grain in the photograph that is being registered."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...solver.bodies.grains import Array
from ...tracks import TrackStatus
from ..correlation.correlator import Fits, Rows
from ..correlation.patches import Patches
from ..settings import TrackingSettings
from .neighbours import local_motion, nearby_median


class RegistrationResults:
    """The best fit of every grain so far; a better one replaces it."""

    def __init__(self, patches: Patches, settings: TrackingSettings) -> None:
        n = len(patches.centre)
        self.settings = settings
        self._contrast = patches.norm / np.sqrt(np.maximum(patches.pixel_count, 1))  # (n,) [grey]
        self._common, self._floor = np.inf, 0.0  # [grey²] typical residual variance of the frame, and that of noise
        # ZNCC above which a place is the right one (n,): greater for smaller patches.
        self.accepted_zncc = np.clip(patches.accidental_zncc + settings.margin, 0.5, 0.9)
        self.usable = patches.usable.copy()  # (n,) false also for grains that a correction has fixed
        self.pose = np.full((n, 3), np.nan)  # x, y [px], rotation [rad]
        self.predicted = np.full((n, 3), np.nan)  # pose predicted by the neighbours' motion
        self.sigma = np.full(n, np.nan)  # [px]
        self.zncc = np.full(n, -1.0)
        self.second_zncc = np.full(n, np.nan)  # of the best other place, where a search was done
        self.residual = np.full(n, np.nan)  # [grey²]
        self.gain = np.full(n, np.nan)  # [grey]
        self.offset = np.full(n, np.nan)  # [grey]
        self.poor = np.zeros(n, dtype=np.bool_)  # the residual exceeds what noise explains
        self.status = np.full(n, TrackStatus.LOST, dtype=np.uint8)

    @property
    def accepted(self) -> NDArray[np.bool_]:
        """Grains that have a pose (n,)."""
        return self.status != TrackStatus.LOST

    @property
    def missing(self) -> NDArray[np.bool_]:
        """Usable grains without a pose (n,)."""
        return self.usable & ~self.accepted

    def accept(self, rows: Rows, fits: Fits, status: TrackStatus) -> None:
        """Keep the fits that converged, exceed every accidental ZNCC, and are better than the stored ones."""
        good = fits.converged & (fits.zncc > self.accepted_zncc[rows]) & (fits.zncc > self.zncc[rows])
        self._store(rows, fits, good)
        self.poor[rows[good]] = fits.residual[good] > self.settings.robust_excess * self._explained_variance(rows[good])
        self.status[rows[good]] = status

    def accept_robust(self, patches: Patches, rows: Rows, fits: Fits, noise: float) -> None:
        """Keep robust fits that use enough of the patch and explain it as well as a clean fit would.

        A robust fit selects the pixels that agree, so its ZNCC must be greater than that of a plain fit. noise
        [grey]: standard deviation of a clean residual.
        """
        contrast = patches.norm[rows] / np.sqrt(np.maximum(patches.pixel_count[rows], 1))
        floor = np.clip(1.0 - 5.0 * (noise / contrast) ** 2, 0.8, 0.95)
        needed = np.maximum(floor, np.minimum(self.accepted_zncc[rows] / np.sqrt(np.maximum(fits.kept, 1e-3)), 0.97))
        good = fits.converged & (fits.kept > self.settings.min_kept) & (fits.zncc > needed)
        good &= fits.zncc > self.zncc[rows]
        self._store(rows, fits, good)
        self.poor[rows[good]] = False
        self.status[rows[good]] = TrackStatus.ROBUST

    def local_light(self, patches: Patches, rows: Rows, pose: Array) -> tuple[Array, Array]:
        """Gain and offset (m,) [grey] of `rows` at `pose` (m, 3), from the clean grains nearby.

        Without clean grains the light is that of the reference.
        """
        # A pose given by hand has no light where nothing correlates there.
        clean = np.flatnonzero(self.accepted & ~self.poor & np.isfinite(self.gain) & np.isfinite(self.offset))
        if len(clean) == 0:
            return patches.norm[rows].copy(), patches.mean[rows].copy()
        ratio = self.gain[clean] / patches.norm[clean]
        where = self.pose[clean, :2]
        contrast = nearby_median(where, ratio, pose[:, :2])
        shift = nearby_median(where, self.offset[clean] - ratio * patches.mean[clean], pose[:, :2])
        return contrast * patches.norm[rows], contrast * patches.mean[rows] + shift

    def flag_poor(self, noise: float) -> float:
        """Flag the grains whose residual exceeds what noise explains.

        The frame's median residual counts as explained (the light changes, paint shines), but no more than 15 % of the
        contrast: an object that covers most grains must not set the norm.

        Parameters
        ----------
        noise : float
            Standard deviation of a pixel's noise [grey].

        Returns
        -------
        float
            Standard deviation of a clean residual [grey].
        """
        floor = 2.0 * noise**2
        accepted = np.flatnonzero(self.accepted & np.isfinite(self.residual))
        self.poor[:] = False
        if len(accepted) == 0:
            return float(np.sqrt(floor))
        self._common, self._floor = float(np.median(self.residual[accepted])), floor
        explained = self._explained_variance(accepted)
        self.poor[accepted] = self.residual[accepted] > self.settings.robust_excess * explained
        return float(np.sqrt(np.median(explained)))

    def _explained_variance(self, rows: Rows) -> Array:
        """The residual variance (m,) [grey²] that noise and the light explain."""
        return np.maximum(np.minimum(self._common, (0.15 * self._contrast[rows]) ** 2), self._floor)

    def mark_suspect(self, rows: Rows) -> None:
        """Mark grains as suspect, except those whose pose was given."""
        self.status[rows[self.status[rows] != TrackStatus.GIVEN]] = TrackStatus.SUSPECT

    def exclude(self, rows: Rows) -> None:
        """Stop the search for grains."""
        self.usable[rows] = False

    def set_given(self, rows: Rows, pose: Array, sigma: float) -> None:
        """Store given poses (m, 3) with a standard deviation [px]."""
        self.pose[rows] = pose
        self.sigma[rows] = sigma
        self.zncc[rows] = np.nan
        self.status[rows] = TrackStatus.GIVEN

    def predict_from_neighbours(self, last: Array) -> Rows:
        """Predict the missing grains from the accepted ones nearby; returns the rows predicted."""
        rows = np.flatnonzero(self.missing)
        known = np.flatnonzero(self.accepted & np.isfinite(last[:, 0]))
        if len(rows) == 0 or len(known) == 0:
            return rows[:0]
        moved = self.pose[known, :2] - last[known, :2]
        predicted, _ = local_motion(last[known, :2], moved, last[rows, :2], exclude_self=False)
        self.predicted[rows, :2] = last[rows, :2] + predicted
        self.predicted[rows, 2] = last[rows, 2]
        return rows

    def _store(self, rows: Rows, fits: Fits, good: NDArray[np.bool_]) -> None:
        chosen = rows[good]
        self.pose[chosen] = fits.pose[good]
        self.sigma[chosen] = fits.sigma[good]
        self.zncc[chosen] = fits.zncc[good]
        self.residual[chosen] = fits.residual[good]
        self.gain[chosen] = fits.gain[good]
        self.offset[chosen] = fits.offset[good]
