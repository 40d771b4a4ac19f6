"""Poses become suspect that contradict their neighbours, are ambiguous, or overlap."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.tracking.registration.consistency import flag_inconsistent
from rodsight.tracking.registration.neighbours import local_motion
from rodsight.tracks import TrackStatus

from tests.app.tracking.registration.registered import RADIUS, grid, registered

N, MIDDLE = 25, 12
CERTAIN, UNCERTAIN = 0.82, 0.7  # ZNCC above and below 0.8


def suspects(registration) -> list[int]:
    flag_inconsistent(registration, np.full(len(registration.last), RADIUS))
    return np.flatnonzero(registration.results.status == TrackStatus.SUSPECT).tolist()


def uniform(deviation: float) -> np.ndarray:
    """One displacement (n, 2) [px] of all grains, with a deviation of the middle one."""
    moved = np.tile([3.0, 1.0], (N, 1))
    moved[MIDDLE, 1] += deviation
    return moved


@pytest.mark.parametrize(("deviation", "expected"), [(4.9, []), (5.1, [MIDDLE]), (-5.1, [MIDDLE])])
def test_a_deviation_of_a_quarter_radius_is_suspect(deviation: float, expected: list[int]) -> None:
    assert suspects(registered(grid(5, 5), uniform(deviation), UNCERTAIN)) == expected


def test_a_sheared_packing_is_consistent() -> None:
    last = grid(5, 5)
    moved = last @ np.array([[0.0, 0.0], [0.2, 0.0]])
    assert suspects(registered(last, moved, UNCERTAIN)) == []


@pytest.mark.parametrize(("factor", "expected"), [(0.98, False), (1.02, True)])
def test_the_tolerance_increases_with_the_deviation_of_the_neighbours(factor: float, expected: bool) -> None:
    last = grid(5, 5)
    moved = uniform(0.0) + np.random.default_rng(2).normal(0.0, 0.4, (N, 2))
    predicted, median_deviation = local_motion(last, moved, last, exclude_self=True)
    assert median_deviation[MIDDLE] > 0.2
    moved[MIDDLE] = predicted[MIDDLE] + [0.0, factor * (6.0 * median_deviation[MIDDLE] + 0.25 * RADIUS)]
    assert (MIDDLE in suspects(registered(last, moved, UNCERTAIN))) == expected


@pytest.mark.parametrize(
    ("zncc", "accidental", "expected"),
    [(CERTAIN, 0.3, []), (0.79, 0.3, [MIDDLE]), (CERTAIN, 0.7, [MIDDLE]), (0.86, 0.7, [])],
)
def test_a_grain_with_a_high_zncc_may_move_unlike_its_neighbours(
    zncc: float, accidental: float, expected: list[int]
) -> None:
    # The second threshold is the accidental ZNCC and the margin: 0.85 for an accidental one of 0.7.
    assert suspects(registered(grid(5, 5), uniform(8.0), zncc, accidental)) == expected


@pytest.mark.parametrize(("second", "expected"), [(np.nan, []), (0.0, []), (0.74, []), (0.76, [3]), (0.95, [3])])
def test_a_second_place_within_the_margin_is_suspect(second: float, expected: list[int]) -> None:
    registration = registered(grid(5, 5), uniform(0.0), 0.9)
    registration.results.second_zncc[3] = second
    assert suspects(registration) == expected


@pytest.mark.parametrize(("lower", "higher"), [(3, 4), (4, 3)])
def test_of_two_overlapping_grains_that_of_lower_zncc_is_suspect(lower: int, higher: int) -> None:
    last, moved = grid(5, 5), uniform(0.0)
    moved[3, 0] += 8.0
    moved[4, 0] -= 8.0  # 34 px apart: an overlap of 6 px, where 4 px are allowed
    registration = registered(last, moved, 0.9)
    registration.results.zncc[lower], registration.results.zncc[higher] = 0.85, 0.95
    assert suspects(registration) == [lower]


@pytest.mark.parametrize(("given", "other"), [(3, 4), (4, 3)])
def test_a_pose_given_by_hand_makes_no_rod_suspect(given: int, other: int) -> None:
    last, moved = grid(5, 5), uniform(8.0)
    moved[3, 0] += 8.0
    moved[4, 0] -= 8.0
    registration = registered(last, moved, 0.95)
    for row in (given, MIDDLE):
        registration.results.status[row] = TrackStatus.GIVEN
        registration.results.zncc[row] = np.nan
    assert other not in suspects(registration)  # nothing but a hand supports the pose that overlaps it
    assert (registration.results.status[[given, MIDDLE]] == TrackStatus.GIVEN).all()


def test_lost_grains_are_neither_suspect_nor_neighbours() -> None:
    registration = registered(grid(5, 5), uniform(0.0), UNCERTAIN)
    registration.results.status[:10] = TrackStatus.LOST
    registration.results.pose[:10] = np.nan
    assert suspects(registration) == []
    registration.results.status[:] = TrackStatus.LOST
    assert suspects(registration) == []
