"""A scale that is wrong by a factor is noticed where the pattern of the grains holds circles of the wrong size."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from rodsight.tracking.detection.detect import DetectionSettings, detect_grains
from rodsight.tracking.detection.scale_comparison import find_other_scale, packed_fraction

RADIUS, SPECKLE = 40, 4  # [px]


@pytest.fixture(scope="module")
def speckled() -> np.ndarray:
    """Packed discs with dark speckles of a tenth of their radius."""
    rng = np.random.default_rng(3)
    image = np.full((620, 620), 20, np.uint8)
    for row in range(7):
        for column in range(7 - row % 2):
            centre = (int(60 + (column + 0.5 * (row % 2)) * 2 * RADIUS), int(60 + row * 3**0.5 * RADIUS))
            cv2.circle(image, centre, RADIUS, 220, -1, cv2.LINE_AA)
            for angle, away in zip(rng.uniform(0, 2 * np.pi, 14), rng.uniform(0, 0.8 * RADIUS, 14), strict=True):
                speckle = (int(centre[0] + away * np.cos(angle)), int(centre[1] + away * np.sin(angle)))
                cv2.circle(image, speckle, SPECKLE, 60, -1, cv2.LINE_AA)
    return image.astype(np.float32)


@pytest.mark.thorough
def test_speckles_of_the_size_of_grains_at_ten_times_the_scale_are_no_packing(speckled):
    mistaken = (RADIUS / 10,)
    found = detect_grains(speckled, DetectionSettings(mistaken))
    assert found.count > 50
    assert find_other_scale(speckled, mistaken, found) == (10.0, 46)


@pytest.mark.thorough
def test_packed_grains_are_not_looked_for_at_another_scale(speckled, monkeypatch):
    found = detect_grains(speckled, DetectionSettings((float(RADIUS),)))
    assert (found.count, packed_fraction(found)) == (46, pytest.approx(0.8, abs=0.1))
    monkeypatch.setattr("rodsight.tracking.detection.scale_comparison.detect_grains", None)
    assert find_other_scale(speckled, (float(RADIUS),), found) is None


@pytest.mark.thorough
def test_few_grains_in_a_wide_picture_are_no_other_scale():
    image = np.full((600, 600), 20, np.uint8)
    for x, y in ((100, 120), (480, 150), (300, 300), (90, 470), (500, 500), (320, 80)):
        cv2.circle(image, (x, y), RADIUS, 220, -1, cv2.LINE_AA)
    image = image.astype(np.float32)
    found = detect_grains(image, DetectionSettings((float(RADIUS),)))
    assert found.count == 6
    assert find_other_scale(image, (float(RADIUS),), found) is None
