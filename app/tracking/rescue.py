"""Find grains that their own motion did not: from their neighbours' motion, then by searching, near and wide."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from app.tracking.correlation import Correlator, Rows
from app.tracking.progress import Progress
from app.tracking.splines import Pyramid
from app.tracks import TrackStatus
from solver.grains import Array

if TYPE_CHECKING:
    from app.tracking.tracker import TrackingSettings

NEAR_SWEEP = np.deg2rad(30.0)

# A grain is searched for again only when what its neighbours say has moved by this share of the window.
NEWS = 0.25


def rescue(
    correlator: Correlator, photograph: Pyramid, progress: Progress, last: Array, settings: TrackingSettings
) -> None:
    """Look for every open grain; whatever is found tells its neighbours where to look, until nothing is.

    A displacement far beyond the widest window is reached in this way too, as long as it begins within it
    somewhere: the motion found there leads to the grains farther on.
    """
    reach = correlator.patches.reach
    near, wide = 0.5 * reach, np.maximum(settings.search_window, 1.5 * reach)
    searched = np.full((2, len(reach), 2), np.inf)  # where the near and the wide search have been
    while progress.open.any():
        before = progress.accepted.sum()
        follow_neighbours(correlator, photograph, progress, last)
        for which, (window, sweep) in enumerate(((near, NEAR_SWEEP), (wide, np.pi))):
            progress.expect_from_neighbours(last)
            middle = np.where(np.isfinite(progress.expected), progress.expected, last)
            with np.errstate(invalid="ignore"):
                news = ~(np.linalg.norm(middle[:, :2] - searched[which], axis=1) < NEWS * window)
            rows = np.flatnonzero(progress.open & news)
            searched[which, rows] = middle[rows, :2]
            _search(correlator, photograph, progress, rows, middle[rows], window[rows], sweep, settings.candidates)
        if progress.accepted.sum() == before:
            return


def follow_neighbours(correlator: Correlator, photograph: Pyramid, progress: Progress, last: Array) -> None:
    """Fit what is open from its neighbours' motion, as long as that finds grains."""
    while True:
        rows = progress.expect_from_neighbours(last)
        before = progress.accepted.sum()
        if len(rows):
            fits = correlator.fit(photograph, rows, progress.expected[rows], leash(correlator, rows))
            progress.take(rows, fits, TrackStatus.OK)
        if progress.accepted.sum() == before:
            return


def leash(correlator: Correlator, rows: Rows | NDArray[np.bool_]) -> Array:
    """How far a fit may run [px]: a small part of the patch, for its basin is a speckle's size."""
    return np.maximum(4.0, 0.35 * correlator.patches.reach[rows])


def _search(
    correlator: Correlator, photograph: Pyramid, progress: Progress, rows: Rows, middle: Array, window: Array,
    sweep: float, count: int,
) -> None:  # fmt: skip
    """Fit the candidates in the order of their coarse correlation until one is accepted."""
    if len(rows) == 0:
        return
    places = correlator.search(photograph, rows, middle, window, float(sweep), count)
    left = np.arange(len(rows))
    for candidate in range(count):
        left = left[places[left, candidate, 3] > 0.0]
        if len(left) == 0:
            return
        chosen = rows[left]
        fits = correlator.fit(photograph, chosen, places[left, candidate, :3], leash(correlator, chosen))
        progress.take(chosen, fits, TrackStatus.RESCUED)
        left = left[progress.open[chosen]]
