"""Recovery of grains that their own motion did not find: by their neighbours' motion, then near and wide searches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...solver.bodies.grains import Array
from ...tracks import TrackStatus
from ..correlation.correlator import Rows, SearchRange
from ..correlation.search import DISTINCT_ANGLE
from .prediction import fit_from_neighbour_motion
from .registration import Registration

# A search is repeated only when its prediction has moved by this fraction of the window.
REPEAT_DISTANCE = 0.25

# The first wide search is of one in so many grains: their motion often leads to the others.
SAMPLE_STRIDE = 8

# A plain fit that reaches this fraction of the greatest accidental ZNCC may be the right place, partly covered.
PROMISING = 0.7

# Steps of the fit at the second best place: its ZNCC is needed to a hundredth, its pose is not.
SECOND_BEST_STEPS = 2
SAME_PLACE = 2.0  # [px] distance below which that fit has reached the accepted place


@dataclass(frozen=True, slots=True)
class SearchMethod:
    """One kind of search."""

    near: bool  # around the neighbours' prediction, or through the widest window
    parts: bool  # halves of a patch as well
    candidates: int  # places that are fitted
    coarse_count: int  # see Correlator.search
    occluded: bool  # failed plain fits are repeated robustly


NEAR = SearchMethod(near=True, parts=False, candidates=3, coarse_count=4, occluded=False)
WIDE = SearchMethod(near=False, parts=False, candidates=8, coarse_count=24, occluded=True)
NEAR_PARTS = SearchMethod(near=True, parts=True, candidates=8, coarse_count=0, occluded=True)
PARTS = SearchMethod(near=False, parts=True, candidates=16, coarse_count=0, occluded=True)


def rescue(registration: Registration) -> None:
    """Search for every missing grain; the motion of each that is found predicts its neighbours, until none is found.

    Displacements beyond the widest window are found as well if some grains move less: the motion of those predicts the
    others.
    """
    results, last, radius = registration.results, registration.last, registration.patches.radius
    window = {True: 0.5 * radius, False: np.maximum(registration.settings.search_window, 1.5 * radius)}
    methods = (NEAR, WIDE, NEAR_PARTS, PARTS)
    searched = {method: np.full((len(radius), 2), np.inf) for method in methods}  # middle of each grain's last search
    sampling, sampled = True, False
    while results.missing.any():
        before = results.accepted.sum()
        fit_from_neighbour_motion(registration)
        for method in searched:
            if method.near and not results.accepted.any():
                continue
            results.predict_from_neighbours(last)
            middle = np.where(np.isfinite(results.predicted), results.predicted, last)
            with np.errstate(invalid="ignore"):
                moved = np.linalg.norm(middle[:, :2] - searched[method], axis=1)
                not_searched = ~(moved < REPEAT_DISTANCE * window[method.near])
            rows = np.flatnonzero(results.missing & not_searched)
            sampled = sampling and method is WIDE and len(rows) >= 2 * SAMPLE_STRIDE
            if sampled:
                rows = rows[::SAMPLE_STRIDE]
                sampling = False
            searched[method][rows] = middle[rows, :2]
            if len(rows) == 0:
                continue
            _search(registration, method, rows, SearchRange(middle[rows], window[method.near][rows], np.pi))
            if sampled:
                break
        if results.accepted.sum() == before and not sampled:
            return


def _search(registration: Registration, method: SearchMethod, rows: Rows, within: SearchRange) -> None:
    """Search for `rows` (m,) and accept the fits at the places found."""
    places = registration.correlator.search(
        registration.photograph, rows, within, method.candidates, coarse_count=method.coarse_count, parts=method.parts
    )
    _fit_places(registration, method, rows, places)
    if method is WIDE:  # the grain may be at its predicted place, under a stain
        missing = registration.results.missing[rows]
        registration.refit_occluded(rows[missing], within.middle[missing])


def _fit_places(registration: Registration, method: SearchMethod, rows: Rows, places: Array) -> None:
    """Fit the places (m, c, 4) in the order of their coarse correlation until one is accepted.

    A method without robust fits tries only places above every accidental correlation; later methods try the others. The
    ZNCC of the best other place is stored with an accepted fit.
    """
    results, patches = registration.results, registration.patches
    left = np.arange(len(rows))
    least = np.zeros(len(rows)) if method.occluded else patches.accidental_coarse_zncc[rows]
    for candidate in range(places.shape[1]):
        left = left[places[left, candidate, 3] > least[left]]
        if len(left) == 0:
            return
        chosen, start = rows[left], places[left, candidate, :3]
        fits = registration.fit_and_accept(chosen, start, TrackStatus.RESCUED)
        if method.occluded:
            promising = fits.zncc > PROMISING * patches.accidental_zncc[chosen]
            tried = results.missing[chosen] & (promising | method.parts)
            pose = np.where(fits.converged[:, None], fits.pose, start)
            registration.refit_occluded(chosen[tried], pose[tried])
        found = ~results.missing[chosen]
        _store_second_best(registration, chosen[found], places[left[found]], candidate)
        left = left[~found]


def _store_second_best(registration: Registration, rows: Rows, places: Array, accepted: int) -> None:
    """Fit the best place (m, c, 4) besides the accepted one, and store its ZNCC."""
    results = registration.results
    if places.shape[1] < 2 or len(rows) == 0:
        return
    other = places[:, 0 if accepted > 0 else 1]
    exists = other[:, 3] > 0.0
    results.second_zncc[rows] = 0.0  # no other place correlates
    chosen, start = rows[exists], other[exists, :3]
    fits = registration.fit(chosen, start, steps=SECOND_BEST_STEPS)
    same = np.linalg.norm(fits.pose[:, :2] - results.pose[chosen, :2], axis=1) < SAME_PLACE
    same &= np.abs(np.angle(np.exp(1j * (fits.pose[:, 2] - results.pose[chosen, 2])))) < DISTINCT_ANGLE
    results.second_zncc[chosen] = np.where(same, 0.0, np.maximum(fits.zncc, 0.0))
