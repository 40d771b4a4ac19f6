"""Find grains that their own motion did not: from their neighbours' motion, then by searching, near and wide."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array

from ..tracks import TrackStatus
from .correlation.correlator import PROMISING, Correlator, Rows
from .correlation.search import DISTINCT_TURN
from .correlation.splines import Pyramid
from .findings import Findings

if TYPE_CHECKING:
    from .settings import TrackingSettings

# A grain is searched for again only when what its neighbours say has moved by this share of the window.
NEWS = 0.25

# One in so many grains is searched for widely before all are: its motion often leads to the others.
SCOUTS = 8

# Steps of the fit to the second best place: its ZNCC is wanted to a hundredth, not its pose.
RUNNER_UP_STEPS = 2
SAME_PLACE = 2.0  # [px]: it has come to the place that was taken


@dataclass(frozen=True, slots=True)
class Search:
    """One way of looking for grains."""

    near: bool  # about where the neighbours' motion leads, or through the widest window
    parts: bool  # for halves of a patch, too
    candidates: int  # places that are fitted
    looks: int  # see Correlator.search
    hidden: bool  # what does not fit plainly is refitted robustly


NEAR = Search(near=True, parts=False, candidates=3, looks=4, hidden=False)
WIDE = Search(near=False, parts=False, candidates=8, looks=24, hidden=True)
NEAR_PARTS = Search(near=True, parts=True, candidates=8, looks=0, hidden=True)
PARTS = Search(near=False, parts=True, candidates=16, looks=0, hidden=True)


def rescue(
    correlator: Correlator, photograph: Pyramid, findings: Findings, last: Array, settings: TrackingSettings,
    noise: float,
) -> None:  # fmt: skip
    """Look for every open grain; whatever is found tells its neighbours where to look, until nothing is.

    A displacement far beyond the widest window is reached in this way too, as long as it begins within it
    somewhere: the motion found there leads to the grains farther on.
    """
    reach = correlator.patches.reach
    window = {True: 0.5 * reach, False: np.maximum(settings.search_window, 1.5 * reach)}
    searched = {way: np.full((len(reach), 2), np.inf) for way in (NEAR, WIDE, NEAR_PARTS, PARTS)}  # where each has been
    scouting, scouts = True, False
    while findings.open.any():
        before = findings.accepted.sum()
        follow_neighbours(correlator, photograph, findings, last)
        for way in searched:
            if way.near and not findings.accepted.any():
                continue
            findings.expect_from_neighbours(last)
            middle = np.where(np.isfinite(findings.expected), findings.expected, last)
            with np.errstate(invalid="ignore"):
                news = ~(np.linalg.norm(middle[:, :2] - searched[way], axis=1) < NEWS * window[way.near])
            rows = np.flatnonzero(findings.open & news)
            scouts = scouting and way is WIDE and len(rows) >= 2 * SCOUTS
            if scouts:
                rows = rows[::SCOUTS]
                scouting = False
            searched[way][rows] = middle[rows, :2]
            if len(rows) == 0:
                continue
            _search(correlator, photograph, findings, way, rows, middle[rows], window[way.near][rows], noise)
            if scouts:
                break
        if findings.accepted.sum() == before and not scouts:
            return


def _search(
    correlator: Correlator, photograph: Pyramid, findings: Findings, way: Search, rows: Rows, middle: Array,
    window: Array, noise: float,
) -> None:  # fmt: skip
    """Search for `rows` about `middle` (m, 3) and take what is found."""
    places = correlator.search(
        photograph, rows, middle, window, np.pi, way.candidates, looks=way.looks, parts=way.parts
    )  # fmt: skip
    _try_places(correlator, photograph, findings, rows, places, noise, way)
    if way is WIDE:  # it may be where it should be, under a stain
        rows, middle = rows[findings.open[rows]], middle[findings.open[rows]]
        refit_hidden(correlator, photograph, findings, rows, middle, noise)


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
    correlator: Correlator, photograph: Pyramid, findings: Findings, rows: Rows, places: Array, noise: float,
    way: Search,
) -> None:  # fmt: skip
    """Fit the places (m, c, 4) in the order of their coarse correlation until one is accepted.

    Where nothing hidden is looked for only what correlates as no accident does is tried: wider searches have the rest.
    What is accepted is told how well the best of the other places correlates.
    """
    left = np.arange(len(rows))
    least = np.zeros(len(rows)) if way.hidden else correlator.patches.accidental_coarse_zncc[rows]
    for candidate in range(places.shape[1]):
        left = left[places[left, candidate, 3] > least[left]]
        if len(left) == 0:
            return
        chosen, start = rows[left], places[left, candidate, :3]
        fits = correlator.fit(photograph, chosen, start, leash(correlator, chosen))
        findings.take(chosen, fits, TrackStatus.RESCUED)
        if way.hidden:
            promising = fits.zncc > PROMISING * correlator.patches.accidental_zncc[chosen]
            tried = findings.open[chosen] & (promising | way.parts)
            pose = np.where(fits.converged[:, None], fits.pose, start)
            refit_hidden(correlator, photograph, findings, chosen[tried], pose[tried], noise)
        found = ~findings.open[chosen]
        _tell_second(correlator, photograph, findings, chosen[found], places[left[found]], candidate)
        left = left[~found]


def _tell_second(
    correlator: Correlator, photograph: Pyramid, findings: Findings, rows: Rows, places: Array, taken: int
) -> None:
    """Correlate the best place (m, c, 4) other than the one taken, and remember how well it fits."""
    if places.shape[1] < 2 or len(rows) == 0:
        return
    other = places[:, 0 if taken > 0 else 1]
    there = other[:, 3] > 0.0
    findings.second_zncc[rows] = 0.0  # nothing else correlates at all
    chosen, start = rows[there], other[there, :3]
    fits = correlator.fit(photograph, chosen, start, leash(correlator, chosen), steps=RUNNER_UP_STEPS)
    same = np.linalg.norm(fits.pose[:, :2] - findings.pose[chosen, :2], axis=1) < SAME_PLACE
    same &= np.abs(np.angle(np.exp(1j * (fits.pose[:, 2] - findings.pose[chosen, 2])))) < DISTINCT_TURN
    findings.second_zncc[chosen] = np.where(same, 0.0, np.maximum(fits.zncc, 0.0))
