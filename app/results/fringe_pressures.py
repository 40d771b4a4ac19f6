"""Pressures of photoelastic discs by their fringes, beside those of the inferred forces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ..solver.bodies.grains import Array
from ..solver.frame_forces import FrameStatus
from ..solver.posterior.fringe_calibration import fit_curve
from ..solver.statistics.agreement import pearson
from ..solver.statistics.balance import sum_on_grains
from .results import Results

FEWEST = 20  # discs with fringes and forces


@dataclass(frozen=True, slots=True)
class FringePressures:
    """Sums of the normal forces on every disc [N], by the forces and by the fringes; NaN where unknown."""

    inferred: Float[Array, "f n"]
    measured: Float[Array, "f n"]  # by the curve
    knot: Float[Array, " q"]  # G² of the curve
    level: Float[Array, " q"]  # [N]

    @property
    def mean(self) -> float:
        """Mean of the inferred sums [N]."""
        return float(np.nanmean(self.inferred))

    def correlation(self, frame: int) -> float:
        """Correlation of both in a frame; NaN of few discs."""
        known = np.isfinite(self.measured[frame]) & np.isfinite(self.inferred[frame])
        return pearson(self.measured[frame, known], self.inferred[frame, known]) if known.sum() > 2 else float("nan")


def compare_with_fringes(results: Results) -> FringePressures | None:
    """Compare the sums of the normal forces with the fringes; None without photoelastic photographs.

    Notes
    -----
    The curve from G² to the sum is the isotonic regression of all photographs of the run, of the discs that are
    present and no boundary grains.
    """
    tracks = results.tracks
    if tracks.fringes is None:
        return None
    f, n = tracks.fringes.shape
    inferred = np.full((f, n), np.nan)
    for k, forces in enumerate(results.frames):
        if forces.status is FrameStatus.FAILED:
            continue
        total = sum_on_grains(forces.contacts, forces.fn)
        used = tracks.present[k] if tracks.boundary is None else tracks.present[k] & ~tracks.boundary
        inferred[k, used] = total[:n][used]
    known = np.isfinite(inferred) & np.isfinite(tracks.fringes)
    if known.sum() < FEWEST:
        return None
    knot, level = fit_curve(tracks.fringes[known], inferred[known])
    measured = np.full((f, n), np.nan)
    measured[known] = np.interp(tracks.fringes[known], knot, level)
    return FringePressures(inferred, measured, knot, level)
