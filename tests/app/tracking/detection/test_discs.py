"""Discs in the bright area of a photograph: what is excluded, and what may be skipped."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from rodsight.tracking.detection import discs
from rodsight.tracking.detection.discs import find_discs

SIDE = 120
ROUGH = 0.7  # [px] of a rough radius: the nearest dark pixel may lie between two directions of the grid
NONE = np.empty((0, 4))


def level_with_discs(*circles: tuple[float, float, float]) -> np.ndarray:
    """Relative light (SIDE, SIDE) of discs x, y, radius [px] on the dark."""
    row, column = np.mgrid[:SIDE, :SIDE]
    level = np.zeros((SIDE, SIDE), np.float32)
    for x, y, radius in circles:
        level = np.maximum(level, np.clip(radius + 0.5 - np.hypot(column - x, row - y), 0.0, 1.0).astype(np.float32))
    return level


def test_every_disc_that_is_wide_enough_is_found() -> None:
    found = find_discs(level_with_discs((30.0, 40.0, 12.0), (80.0, 70.0, 7.0), (30.0, 90.0, 3.0)), NONE, 5.0)
    assert found.candidates.x == pytest.approx([30.0, 80.0], abs=ROUGH)
    assert found.candidates.radius == pytest.approx([12.0, 7.0], abs=ROUGH)
    assert found.covered > 0.95


@pytest.mark.parametrize("radius", [4.0, 4.5, 5.0, 5.3])
@pytest.mark.parametrize("smallest", [4.0, 4.6, 5.1])
def test_whether_distances_are_measured_changes_nothing(
    radius: float, smallest: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    level = level_with_discs((60.0, 60.0, 20.0), (20.3, 20.6, radius))
    excluded = np.array([[60.0, 60.0, 20.0]])
    found = find_discs(level, excluded, smallest)
    monkeypatch.setattr(discs, "_possible_centres", lambda bright, _: bright)
    assert found.area == find_discs(level, excluded, smallest).area
    assert len(found.candidates.x) == len(find_discs(level, excluded, smallest).candidates.x)


def test_distances_of_few_centres_are_those_of_all(monkeypatch: pytest.MonkeyPatch) -> None:
    level = level_with_discs((60.0, 60.0, 20.0), (20.3, 20.6, 5.0), (0.0, 70.0, 9.0), (116.0, 117.0, 6.4))
    found = {}
    for fraction in (0.0, 1.0):  # of all pixels, and of the possible centres alone
        monkeypatch.setattr(discs, "FEW_CENTRES", fraction)
        found[fraction] = find_discs(level, NONE, 4.0)
    assert found[0.0].candidates.radius.tolist() == found[1.0].candidates.radius.tolist()
    assert found[0.0].candidates.x.tolist() == found[1.0].candidates.x.tolist()
    assert len(found[0.0].candidates.x) == 4
    assert (found[0.0].area, found[0.0].covered) == (found[1.0].area, found[1.0].covered)


def test_every_highest_distance_is_found_however_many(monkeypatch: pytest.MonkeyPatch) -> None:
    level = level_with_discs((20.0, 20.0, 8.0), (60.0, 60.0, 8.0), (90.0, 90.0, 8.0))
    expected = find_discs(level, NONE, 5.0).candidates.x.tolist()
    monkeypatch.setattr(discs, "FIRST_PLACES", 1)
    assert find_discs(level, NONE, 5.0).candidates.x.tolist() == expected


def test_no_distances_are_measured_where_everything_is_excluded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cv2, "distanceTransform", lambda *_: pytest.fail("distances are measured"))
    found = find_discs(level_with_discs((60.0, 60.0, 20.0)), np.array([[60.0, 60.0, 20.0]]), 4.0)
    assert (found.area, found.covered, len(found.candidates.x)) == (0.0, 0.0, 0)
