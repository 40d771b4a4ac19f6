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
    monkeypatch.setattr(discs, "_may_hold_disc", lambda *_: True)
    assert found.area == find_discs(level, excluded, smallest).area
    assert len(found.candidates.x) == len(find_discs(level, excluded, smallest).candidates.x)


def test_no_distances_are_measured_where_everything_is_excluded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cv2, "distanceTransform", lambda *_: pytest.fail("distances are measured"))
    found = find_discs(level_with_discs((60.0, 60.0, 20.0)), np.array([[60.0, 60.0, 20.0]]), 4.0)
    assert (found.area, found.covered, len(found.candidates.x)) == (0.0, 0.0, 0)
