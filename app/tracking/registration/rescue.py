"""Find grains that their own motion did not: from their neighbours' motion, then by searching, near and wide."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.bodies.grains import Array

from ...tracks import TrackStatus
from ..correlation.correlator import Rows, SearchRange
from ..correlation.search import DISTINCT_TURN
from .prediction import follow_neighbours
from .registration import Registration

# A grain is searched for again only when what its neighbours say has moved by this share of the window.
NEWS = 0.25

# One in so many grains is searched for widely before all are: its motion often leads to the others.
SCOUTS = 8

# A plain fit that reaches this share of the greatest accidental ZNCC may be the right place, partly hidden.
PROMISING = 0.7

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


def rescue(registration: Registration) -> None:
    """Look for every open grain; whatever is found tells its neighbours where to look, until nothing is.

    A displacement far beyond the widest window is reached in this way too, as long as it begins within it
    somewhere: the motion found there leads to the grains farther on.
    """
    findings, last, reach = registration.findings, registration.last, registration.patches.reach
    window = {True: 0.5 * reach, False: np.maximum(registration.settings.search_window, 1.5 * reach)}
    searched = {way: np.full((len(reach), 2), np.inf) for way in (NEAR, WIDE, NEAR_PARTS, PARTS)}  # where each has been
    scouting, scouts = True, False
    while findings.open.any():
        before = findings.accepted.sum()
        follow_neighbours(registration)
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
            _search(registration, way, rows, SearchRange(middle[rows], window[way.near][rows], np.pi))
            if scouts:
                break
        if findings.accepted.sum() == before and not scouts:
            return


def _search(registration: Registration, way: Search, rows: Rows, within: SearchRange) -> None:
    """Search for `rows` (m,) and take what is found."""
    places = registration.correlator.search(
        registration.photograph, rows, within, way.candidates, looks=way.looks, parts=way.parts
    )
    _try_places(registration, way, rows, places)
    if way is WIDE:  # it may be where it should be, under a stain
        left = registration.findings.open[rows]
        registration.refit_hidden(rows[left], within.middle[left])


def _try_places(registration: Registration, way: Search, rows: Rows, places: Array) -> None:
    """Fit the places (m, c, 4) in the order of their coarse correlation until one is accepted.

    Where nothing hidden is looked for only what correlates as no accident does is tried: wider searches have the rest.
    What is accepted is told how well the best of the other places correlates.
    """
    findings, patches = registration.findings, registration.patches
    left = np.arange(len(rows))
    least = np.zeros(len(rows)) if way.hidden else patches.accidental_coarse_zncc[rows]
    for candidate in range(places.shape[1]):
        left = left[places[left, candidate, 3] > least[left]]
        if len(left) == 0:
            return
        chosen, start = rows[left], places[left, candidate, :3]
        fits = registration.take_fits(chosen, start, TrackStatus.RESCUED)
        if way.hidden:
            promising = fits.zncc > PROMISING * patches.accidental_zncc[chosen]
            tried = findings.open[chosen] & (promising | way.parts)
            pose = np.where(fits.converged[:, None], fits.pose, start)
            registration.refit_hidden(chosen[tried], pose[tried])
        found = ~findings.open[chosen]
        _tell_second(registration, chosen[found], places[left[found]], candidate)
        left = left[~found]


def _tell_second(registration: Registration, rows: Rows, places: Array, taken: int) -> None:
    """Correlate the best place (m, c, 4) other than the one taken, and remember how well it fits."""
    findings = registration.findings
    if places.shape[1] < 2 or len(rows) == 0:
        return
    other = places[:, 0 if taken > 0 else 1]
    there = other[:, 3] > 0.0
    findings.second_zncc[rows] = 0.0  # nothing else correlates at all
    chosen, start = rows[there], other[there, :3]
    fits = registration.fit(chosen, start, steps=RUNNER_UP_STEPS)
    same = np.linalg.norm(fits.pose[:, :2] - findings.pose[chosen, :2], axis=1) < SAME_PLACE
    same &= np.abs(np.angle(np.exp(1j * (fits.pose[:, 2] - findings.pose[chosen, 2])))) < DISTINCT_TURN
    findings.second_zncc[chosen] = np.where(same, 0.0, np.maximum(fits.zncc, 0.0))
