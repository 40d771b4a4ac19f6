"""What is known so far about one photograph's grains, while they are being found."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from app.tracking.correlation import Fits, Patches, Rows
from app.tracking.neighbours import local_motion
from app.tracks import TrackStatus
from solver.grains import Array

if TYPE_CHECKING:
    from app.tracking.tracker import TrackingSettings


class Progress:
    """The best fit of every grain so far; a better one replaces it."""

    def __init__(self, patches: Patches, accepted_zncc: Array, settings: TrackingSettings) -> None:
        n = len(patches.centre)
        self.settings = settings
        self.accepted_zncc = accepted_zncc  # (n,)
        self.usable = patches.usable  # (n,)
        self.pose = np.full((n, 3), np.nan)  # x, y [px], rotation [rad]
        self.expected = np.full((n, 3), np.nan)  # where the neighbours' motion leads
        self.sigma = np.full(n, np.nan)  # [px]
        self.zncc = np.full(n, -1.0)
        self.residual = np.full(n, np.nan)  # [grey²]
        self.gain = np.full(n, np.nan)  # [grey]
        self.offset = np.full(n, np.nan)  # [grey]
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
        self.status[rows[good]] = status

    def take_robust(self, rows: Rows, fits: Fits) -> None:
        """Keep robust fits that rest on enough of the patch and explain it as well as a clean one would.

        A fit that disregards pixels picks those that agree, so it must convince with what is left.
        """
        share = np.maximum(fits.kept, 1e-3)
        needed = np.clip(self.accepted_zncc[rows] / np.sqrt(share), 0.8, 0.97)
        good = fits.converged & (fits.kept > self.settings.kept_least) & (fits.zncc > needed)
        good &= fits.zncc > self.zncc[rows]
        self._keep(rows, fits, good)
        self.status[rows[good]] = TrackStatus.ROBUST

    def doubt(self, rows: Rows) -> None:
        self.status[rows] = TrackStatus.SUSPECT

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
