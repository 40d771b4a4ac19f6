"""Discs in the corners of a frame are found by their rims, behind bars that hide a part of them."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
import pytest
from rodsight.tracking.walls.corner_rims import BETWEEN_BARS, CLICKED, find_disc

SHAPE = (420, 460)
DISC = (300.4, 131.7, 34.3)  # x, y, radius [px]
FINE = 3  # sub-pixels a side
ACCURACY = 0.15  # [px]


@cache
def photograph(*discs: tuple[float, float, float], bars: bool = True, hidden: float = 0.0) -> np.ndarray:
    """Draw bright discs; bars to the left and downwards of the first; hidden: fraction of its rim behind a cloth."""
    row, column = (np.mgrid[: SHAPE[0] * FINE, : SHAPE[1] * FINE].astype(np.float32) + 0.5) / FINE - 0.5
    picture = np.full(row.shape, 40.0, np.float32)
    for x, y, radius in discs:
        picture[np.hypot(column - x, row - y) < radius] = 190.0
    x, y, _ = discs[0]
    if bars:
        picture[(column < x) & (np.abs(row - y) < 9.0)] = 120.0
        picture[(row > y) & (np.abs(column - x) < 9.0)] = 120.0
    if hidden:
        picture[np.abs(np.arctan2(row - y, column - x)) < np.pi * hidden] = 40.0
    small = cv2.resize(picture, SHAPE[::-1], interpolation=cv2.INTER_AREA)
    return cv2.GaussianBlur(small, (0, 0), 0.8) + np.random.default_rng(1).normal(0.0, 1.5, SHAPE).astype(np.float32)


@pytest.mark.parametrize("away", [(0.0, 0.0), (5.0, -6.0)])
def test_a_disc_is_measured_where_bars_meet(away: tuple[float, float]) -> None:
    found = find_disc(photograph(DISC), (DISC[0] + away[0], DISC[1] + away[1]), within=BETWEEN_BARS)
    assert found == pytest.approx(DISC, abs=ACCURACY)


@pytest.mark.thorough
def test_a_click_anywhere_on_a_disc_finds_it_and_a_meeting_of_bars_only_its_centre() -> None:
    image, (x, y, radius) = photograph(DISC), DISC
    click = x + 0.5 * radius, y - 0.4 * radius
    assert find_disc(image, click, within=CLICKED) == pytest.approx(DISC, abs=ACCURACY)
    assert find_disc(image, click, within=BETWEEN_BARS) is None
    assert find_disc(image, (x + 1.3 * radius, y - radius), within=CLICKED) is None


def test_the_disc_of_which_most_is_seen_is_chosen() -> None:
    inner = (DISC[0] + 1.0, DISC[1] + 1.0, 24.0)  # a hole whose rim is hidden for the greater part
    image = photograph(DISC).copy()
    ring = photograph(inner, bars=False)
    row, column = np.mgrid[: SHAPE[0], : SHAPE[1]]
    shown = np.abs(np.arctan2(row - inner[1], column - inner[0])) < 0.45 * np.pi
    image[shown & (ring > 100.0)] += 50.0
    assert find_disc(image, DISC[:2], within=BETWEEN_BARS) == pytest.approx(DISC, abs=2.0 * ACCURACY)


@pytest.mark.thorough
@pytest.mark.parametrize(("hidden", "seen"), [(0.3, True), (0.75, False)])
def test_a_disc_needs_a_part_of_its_rim(hidden: float, seen: bool) -> None:
    found = find_disc(photograph(DISC, hidden=hidden), DISC[:2], within=BETWEEN_BARS)
    assert (found is not None) == seen
    if found is not None:
        assert found == pytest.approx(DISC, abs=3.0 * ACCURACY)


def test_no_disc_is_found_without_a_rim_or_in_too_small_a_photograph() -> None:
    bare = np.random.default_rng(2).normal(100.0, 2.0, SHAPE).astype(np.float32)
    assert find_disc(bare, (200.0, 200.0), within=CLICKED) is None
    assert find_disc(bare[:100, :100], (50.0, 50.0), within=CLICKED) is None
    assert find_disc(photograph(DISC), (SHAPE[1] + 200.0, 10.0), within=CLICKED) is None
