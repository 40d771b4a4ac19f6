"""Find grains that their own motion did not: from their neighbours' motion, then by searching, near and wide."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from app.tracking.correlation import Correlator, Rows
from app.tracking.findings import Findings
from app.tracking.splines import Pyramid
from app.tracks import TrackStatus
from solver.grains import Array

if TYPE_CHECKING:
    from app.tracking.tracker import TrackingSettings

NEAR_SWEEP = np.deg2rad(30.0)

# A grain is searched for again only when what its neighbours say has moved by this share of the window.
NEWS = 0.25


# Places of the near search that are tried: where few places compete the true one is among the first.
NEAR_CANDIDATES = 2

# A plain fit that reaches this share of the greatest accidental ZNCC may be the right place, partly hidden.
PROMISING = 0.7


def rescue(
    correlator: Correlator, photograph: Pyramid, findings: Findings, last: Array, settings: TrackingSettings,
    noise: float,
) -> None:  # fmt: skip
    """Look for every open grain; whatever is found tells its neighbours where to look, until nothing is.

    A displacement far beyond the widest window is reached in this way too, as long as it begins within it
    somewhere: the motion found there leads to the grains farther on.
    """
    reach = correlator.patches.reach
    near, wide = 0.5 * reach, np.maximum(settings.search_window, 1.5 * reach)
    searched = np.full((3, len(reach), 2), np.inf)  # where each search has been
    while findings.open.any():
        before = findings.accepted.sum()
        follow_neighbours(correlator, photograph, findings, last)
        for which, (window, sweep) in enumerate(((near, NEAR_SWEEP), (wide, np.pi), (wide, np.pi))):
            findings.expect_from_neighbours(last)
            middle = np.where(np.isfinite(findings.expected), findings.expected, last)
            with np.errstate(invalid="ignore"):
                news = ~(np.linalg.norm(middle[:, :2] - searched[which], axis=1) < NEWS * window)
            rows = np.flatnonzero(findings.open & news)
            thorough = which == 2
            if thorough:  # what sifting may have lost, and only that
                rows = rows[correlator.sifts(rows, window[rows])]
            searched[which, rows] = middle[rows, :2]
            if len(rows) == 0:
                continue
            count = NEAR_CANDIDATES if which == 0 else settings.candidates
            places = correlator.search(
                photograph, rows, middle[rows], window[rows], float(sweep), count, thorough=thorough
            )
            _try_places(correlator, photograph, findings, rows, places, noise, hidden=which > 0)
            if which == 1:  # it may be where it should be, under a stain
                rows = rows[findings.open[rows]]
                refit_hidden(correlator, photograph, findings, rows, middle[rows], noise)
        if findings.accepted.sum() == before:
            return


def follow_neighbours(correlator: Correlator, photograph: Pyramid, findings: Findings, last: Array) -> None:
    """Fit what is open from its neighbours' motion, as long as that finds grains."""
    while True:
        rows = findings.expect_from_neighbours(last)
        before = findings.accepted.sum()
        if len(rows):
            fits = correlator.fit(photograph, rows, findings.expected[rows], leash(correlator, rows))
            findings.take(rows, fits, TrackStatus.OK)
        if findings.accepted.sum() == before:
            return


def leash(correlator: Correlator, rows: Rows | NDArray[np.bool_]) -> Array:
    """How far a fit may run [px]: a small part of the patch, for its basin is a speckle's size."""
    return np.maximum(4.0, 0.35 * correlator.patches.reach[rows])


def refit_hidden(
    correlator: Correlator, photograph: Pyramid, findings: Findings, rows: Rows, pose: Array, noise: float
) -> None:
    """Fit with Tukey's weights from `pose` (m, 3): what covers a part of a grain then does not count."""
    if len(rows) == 0:
        return
    gain, offset = findings.light_at(correlator.patches, rows, pose)
    fits = correlator.fit_robust(photograph, rows, pose, leash(correlator, rows), noise, gain, offset)
    findings.take_robust(correlator.patches, rows, fits, noise)


def _try_places(
    correlator: Correlator,
    photograph: Pyramid,
    findings: Findings,
    rows: Rows,
    places: Array,
    noise: float,
    *,
    hidden: bool,
) -> None:
    """Fit the candidates (m, c, 4) in the order of their coarse correlation until one is accepted.

    hidden: what almost correlates is refitted robustly, too.
    """
    left = np.arange(len(rows))
    for candidate in range(places.shape[1]):
        left = left[places[left, candidate, 3] > 0.0]
        if len(left) == 0:
            return
        chosen, start = rows[left], places[left, candidate, :3]
        fits = correlator.fit(photograph, chosen, start, leash(correlator, chosen))
        findings.take(chosen, fits, TrackStatus.RESCUED)
        if hidden:
            promising = findings.open[chosen] & (fits.zncc > PROMISING * correlator.patches.accidental_zncc[chosen])
            pose = np.where(fits.converged[:, None], fits.pose, start)
            refit_hidden(correlator, photograph, findings, chosen[promising], pose[promising], noise)
        left = left[findings.open[chosen]]
