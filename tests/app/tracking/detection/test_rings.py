"""Means of slopes along circles, by one transform, are those of points on the circles."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from rodsight.tracking.detection.rings import CIRCLE_SD, _CircleSlopes

HEIGHT, WIDTH, LARGEST = 90, 121, 30.0
POINTS = 720  # on a circle


def smooth_slopes(seed: int) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    return [cv2.GaussianBlur(rng.normal(size=(HEIGHT, WIDTH)).astype(np.float32), (0, 0), 3.0) for _ in range(2)]


def mean_of_points(slopes: list[np.ndarray], radius: float, x: int, y: int) -> float:
    """Mean inward slope at points of a circle, of slopes that are continued beyond the border and blurred."""
    margin = int(LARGEST) + 8
    angle = 2.0 * np.pi * np.arange(POINTS) / POINTS
    normal = np.stack([np.cos(angle), np.sin(angle)]).astype(np.float32)
    place = margin + np.array([[x], [y]], np.float32) + np.float32(radius) * normal
    inward = 0.0
    for slope, along in zip(slopes, normal, strict=True):
        padded = cv2.copyMakeBorder(slope, margin, margin, margin, margin, cv2.BORDER_REPLICATE)
        blurred = cv2.GaussianBlur(padded, (0, 0), CIRCLE_SD)
        inward -= float(np.mean(cv2.remap(blurred, place[:1], place[1:], cv2.INTER_CUBIC) * along))
    return inward


@pytest.mark.parametrize("radius", [5.0, 11.3, LARGEST])
def test_the_mean_slope_is_that_of_points_on_the_circle(radius):
    slopes = smooth_slopes(3)
    found = _CircleSlopes(*slopes, LARGEST).mean(radius)
    assert found.shape == (HEIGHT, WIDTH)
    assert found.dtype == np.float32
    size = float(found.std())
    for x, y in ((60, 45), (41, 30), (2, 80), (118, 1), (0, 0)):  # inside, and where circles leave the picture
        assert found[y, x] == pytest.approx(mean_of_points(slopes, radius, x, y), abs=0.03 * size)
