"""Searches for missing grains: the accepted place, the second best one, and the predictions that follow."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from rodsight.tracking.correlation.correlator import Fits, Rows, SearchRange
from rodsight.tracking.registration.rescue import rescue
from rodsight.tracks import TrackStatus

from tests.app.tracking.registration.registered import fits_of, grid, patches_at, results_at

FIRST, SECOND = (30.0, 5.0, 0.2), (-20.0, 10.0, 1.5)  # x, y [px], rotation [rad] of two places
BASIN = 3.0  # [px]


class Landscape:
    """A registration of one photograph in which fits end at known places with known ZNCC."""

    def __init__(self, last: np.ndarray, places: dict[tuple[float, float, float], float]) -> None:
        """places: the ZNCC of fits that begin near a pose, for every grain relative to its last place."""
        self.results, self.patches, self.photograph = results_at(last), patches_at(last), None
        self.settings = self.results.settings
        self.last = np.column_stack([last, np.zeros(len(last))])
        self.correlator = SimpleNamespace(search=self._search)
        self.searched: list[tuple[list[int], float]] = []  # rows and window of every search
        self._places = places
        self.candidates: dict[int, list[tuple[float, float, float, float]]] = {}  # results of the search, by row

    def _search(self, photograph: None, rows: Rows, within: SearchRange, count: int, **more: object) -> np.ndarray:
        self.searched.append((rows.tolist(), float(within.window[0])))
        best = np.zeros((len(rows), count, 4))
        best[:, :, 3] = -1.0
        for m, row in enumerate(rows):
            for k, place in enumerate(self.candidates.get(int(row), [])):
                best[m, k] = place
                best[m, k, :3] += self.last[row]
        return best

    def fit(self, rows: Rows, pose: np.ndarray, *, steps: int | None = None) -> Fits:
        zncc, found = np.full(len(rows), 0.1), np.array(pose)
        for m, row in enumerate(rows):
            for place, value in self._places.items():
                off = pose[m] - self.last[row] - place
                if np.hypot(off[0], off[1]) < BASIN and abs(off[2]) < 0.4:
                    zncc[m], found[m] = value, self.last[row] + place
        return fits_of(found, zncc)

    def fit_and_accept(self, rows: Rows, pose: np.ndarray, status: TrackStatus) -> Fits:
        fits = self.fit(rows, pose)
        self.results.accept(rows, fits, status)
        return fits

    def refit_occluded(self, rows: Rows, pose: np.ndarray) -> None:
        pass


def rescued(candidates: list[tuple[float, float, float, float]], places: dict) -> Landscape:
    """One grain after its search: candidates x, y, rotation, coarse ZNCC, and the fits' ZNCC at places."""
    landscape = Landscape(np.array([[200.0, 200.0]]), places)
    landscape.candidates = {0: candidates}
    rescue(landscape)  # type: ignore[arg-type]
    return landscape


def test_the_best_place_is_accepted_and_the_second_stored() -> None:
    results = rescued([(*FIRST, 0.8), (*SECOND, 0.6)], {FIRST: 0.9, SECOND: 0.55}).results
    assert results.status[0] == TrackStatus.RESCUED
    assert results.pose[0] == pytest.approx([230.0, 205.0, 0.2])
    assert results.second_zncc[0] == 0.55


def test_a_better_coarse_place_whose_fit_failed_is_the_second_best() -> None:
    results = rescued([(*SECOND, 0.8), (*FIRST, 0.6)], {FIRST: 0.9, SECOND: 0.4}).results
    assert results.pose[0] == pytest.approx([230.0, 205.0, 0.2])
    assert results.second_zncc[0] == 0.4


def test_a_second_place_that_converges_to_the_first_is_none() -> None:
    near = (FIRST[0] + 2.0, FIRST[1], FIRST[2])
    results = rescued([(*FIRST, 0.8), (*near, 0.7)], {FIRST: 0.9}).results
    assert results.second_zncc[0] == 0.0


def test_a_second_angle_at_the_same_place_is_another_place() -> None:
    reversed_ = (FIRST[0], FIRST[1], FIRST[2] + np.pi)
    results = rescued([(*FIRST, 0.8), (*reversed_, 0.7)], {FIRST: 0.9, reversed_: 0.85}).results
    assert results.second_zncc[0] == 0.85
    revolution = (FIRST[0], FIRST[1], FIRST[2] + 2.0 * np.pi)
    results = rescued([(*FIRST, 0.8), (*revolution, 0.7)], {FIRST: 0.9, revolution: 0.85}).results
    assert results.second_zncc[0] == 0.0


def test_without_a_second_place_its_zncc_is_zero() -> None:
    assert rescued([(*FIRST, 0.8)], {FIRST: 0.9}).results.second_zncc[0] == 0.0


def test_no_place_is_accepted_below_the_accidental_zncc() -> None:
    landscape = rescued([(*FIRST, 0.8), (*SECOND, 0.6)], {FIRST: 0.44, SECOND: 0.4})
    assert landscape.results.status[0] == TrackStatus.LOST
    assert np.isnan(landscape.results.second_zncc[0])
    # The wide search and the search for parts; a search that found nothing is not repeated.
    assert [window for _, window in landscape.searched] == [60.0, 60.0]


def test_the_motion_of_a_sample_finds_the_other_grains() -> None:
    landscape = Landscape(grid(6, 6), {FIRST: 0.9})
    landscape.candidates = {row: [(*FIRST, 0.8)] for row in range(36)}
    rescue(landscape)  # type: ignore[arg-type]
    assert landscape.results.accepted.all()
    assert landscape.searched == [(list(range(0, 36, 8)), 60.0)]
    assert (landscape.results.status == TrackStatus.RESCUED).sum() == 5
    assert (landscape.results.status == TrackStatus.OK).sum() == 31
