"""What is known so far about one photograph's grains, while they are being found."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array

from ...tracks import TrackStatus
from ..correlation.correlator import Fits, Rows
from ..correlation.patches import Patches
from ..settings import TrackingSettings
from .neighbours import local_motion, nearby_median


class Findings:
    """The best fit of every grain so far; a better one replaces it."""

    def __init__(self, patches: Patches, settings: TrackingSettings) -> None:
        n = len(patches.centre)
        self.settings = settings
        self._contrast = patches.norm / np.sqrt(np.maximum(patches.pixel_count, 1))  # (n,) [grey]
        self._common, self._floor = np.inf, 0.0  # [grey²] residual typical of the frame, and the least that noise has
        # ZNCC above which a place is the right one (n,): the smaller a patch, the more it takes.
        self.accepted_zncc = np.clip(patches.accidental_zncc + settings.margin, 0.5, 0.9)
        self.usable = patches.usable.copy()  # (n,) false too for what a user has settled
        self.pose = np.full((n, 3), np.nan)  # x, y [px], rotation [rad]
        self.expected = np.full((n, 3), np.nan)  # where the neighbours' motion leads
        self.sigma = np.full(n, np.nan)  # [px]
        self.zncc = np.full(n, -1.0)
        self.second_zncc = np.full(n, np.nan)  # of the best other place, where a search was done
        self.residual = np.full(n, np.nan)  # [grey²]
        self.gain = np.full(n, np.nan)  # [grey]
        self.offset = np.full(n, np.nan)  # [grey]
        self.poor = np.zeros(n, dtype=np.bool_)  # fits worse than noise explains
        self.status = np.full(n, TrackStatus.LOST, dtype=np.uint8)

    @property
    def accepted(self) -> NDArray[np.bool_]:
        """Grains that have a pose (n,)."""
        return self.status != TrackStatus.LOST

    @property
    def open(self) -> NDArray[np.bool_]:
        """Grains that are still to be found (n,)."""
        return self.usable & ~self.accepted

    def take(self, rows: Rows, fits: Fits, status: TrackStatus) -> None:
        """Keep those fits that converged, whose ZNCC no accident reaches, and that are better than before."""
        good = fits.converged & (fits.zncc > self.accepted_zncc[rows]) & (fits.zncc > self.zncc[rows])
        self._keep(rows, fits, good)
        self.poor[rows[good]] = fits.residual[good] > self.settings.robust_excess * self._explained(rows[good])
        self.status[rows[good]] = status

    def take_robust(self, patches: Patches, rows: Rows, fits: Fits, noise: float) -> None:
        """Keep robust fits that rest on enough of the patch and explain it as well as a clean one would.

        A fit that disregards pixels picks those that agree, so it must convince with what is left. noise
        [grey]: deviation of a clean residual.
        """
        contrast = patches.norm[rows] / np.sqrt(np.maximum(patches.pixel_count[rows], 1))
        floor = np.clip(1.0 - 5.0 * (noise / contrast) ** 2, 0.8, 0.95)
        needed = np.maximum(floor, np.minimum(self.accepted_zncc[rows] / np.sqrt(np.maximum(fits.kept, 1e-3)), 0.97))
        good = fits.converged & (fits.kept > self.settings.kept_least) & (fits.zncc > needed)
        good &= fits.zncc > self.zncc[rows]
        self._keep(rows, fits, good)
        self.poor[rows[good]] = False
        self.status[rows[good]] = TrackStatus.ROBUST

    def light_at(self, patches: Patches, rows: Rows, pose: Array) -> tuple[Array, Array]:
        """Gain and offset [grey] that `rows` should have at `pose` (m, 3), seen from the clean grains about them.

        Without any the light is taken to be that of the reference.
        """
        clean = np.flatnonzero(self.accepted & ~self.poor)
        if len(clean) == 0:
            return patches.norm[rows].copy(), patches.mean[rows].copy()
        ratio = self.gain[clean] / patches.norm[clean]
        where = self.pose[clean, :2]
        contrast = nearby_median(where, ratio, pose[:, :2])
        shift = nearby_median(where, self.offset[clean] - ratio * patches.mean[clean], pose[:, :2])
        return contrast * patches.norm[rows], contrast * patches.mean[rows] + shift

    def judge_residuals(self, noise: float) -> float:
        """Mark the grains that fit worse than noise explains; returns a clean residual's deviation [grey].

        What is typical of the frame counts as explained (the light changes, paint shines), but no more than
        15 % of the contrast: where something covers most grains, it must not become the rule.
        """
        floor = 2.0 * noise**2
        accepted = np.flatnonzero(self.accepted & np.isfinite(self.residual))
        self.poor[:] = False
        if len(accepted) == 0:
            return float(np.sqrt(floor))
        self._common, self._floor = float(np.median(self.residual[accepted])), floor
        explained = self._explained(accepted)
        self.poor[accepted] = self.residual[accepted] > self.settings.robust_excess * explained
        return float(np.sqrt(np.median(explained)))

    def _explained(self, rows: Rows) -> Array:
        """The residual variance (m,) [grey²] that noise and the light account for."""
        return np.maximum(np.minimum(self._common, (0.15 * self._contrast[rows]) ** 2), self._floor)

    def doubt(self, rows: Rows) -> None:
        self.status[rows[self.status[rows] != TrackStatus.GIVEN]] = TrackStatus.SUSPECT

    def close(self, rows: Rows) -> None:
        """Look no further for `rows`."""
        self.usable[rows] = False

    def give(self, rows: Rows, pose: Array, sigma: float) -> None:
        """Take poses (m, 3) as they are told, good to `sigma` [px]."""
        self.pose[rows] = pose
        self.sigma[rows] = sigma
        self.zncc[rows] = np.nan
        self.status[rows] = TrackStatus.GIVEN

    def expect_from_neighbours(self, last: Array) -> Rows:
        """Predict the open grains from the accepted ones about them; returns the rows predicted."""
        rows = np.flatnonzero(self.open)
        known = np.flatnonzero(self.accepted)
        if len(rows) == 0 or len(known) == 0:
            return rows[:0]
        moved = self.pose[known, :2] - last[known, :2]
        predicted, _ = local_motion(last[known, :2], moved, last[rows, :2], itself=False)
        self.expected[rows, :2] = last[rows, :2] + predicted
        self.expected[rows, 2] = last[rows, 2]
        return rows

    def _keep(self, rows: Rows, fits: Fits, good: NDArray[np.bool_]) -> None:
        chosen = rows[good]
        self.pose[chosen] = fits.pose[good]
        self.sigma[chosen] = fits.sigma[good]
        self.zncc[chosen] = fits.zncc[good]
        self.residual[chosen] = fits.residual[good]
        self.gain[chosen] = fits.gain[good]
        self.offset[chosen] = fits.offset[good]
