"""Detection without settings or on poor photographs: any size, blurred or small photographs, shaded rims."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from rodsight.experiment.pictures.image import LUMA
from rodsight.tracking.detection.circles.circle_measurement import CircleMeasurer, MeasuredCircle
from rodsight.tracking.detection.detect import DetectionSettings, _accidental, detect_grains

from tests.app.tracking.real_like import Laboratory, brown_photograph

SIDE = 300  # [px]
BLUR_ALLOWED = 0.12  # [px] texture takes part in the fit
RADIUS_ALLOWED = 0.15  # [px] median; the steepest point of a blurred circle lies .05 inside
CENTRE_ALLOWED = 0.12  # [px] rms, where rims are shaded by half on one side


def rods_on_a_grid(radius: float, pitch: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    generator = np.random.default_rng(seed)
    line = np.arange(0.75 * pitch, SIDE - 0.6 * pitch, pitch)
    x, y = (axis.ravel() + generator.uniform(-0.5, 0.5, axis.size) for axis in np.meshgrid(line, line))
    return x, y, np.full(len(x), radius)


def photograph(
    laboratory: Laboratory, x: np.ndarray, y: np.ndarray, radius: np.ndarray, *, side: int = SIDE
) -> np.ndarray:
    image = brown_photograph(laboratory, side, side, x, y, radius, np.zeros(len(x)), pattern_seed=1, noise_seed=1)
    return np.ascontiguousarray(image.astype(np.float32) @ LUMA, dtype=np.float32)


@pytest.mark.thorough
@pytest.mark.parametrize(
    "blur", [0.6, pytest.param(1.1, marks=pytest.mark.slow), pytest.param(1.5, marks=pytest.mark.slow)]
)
def test_the_blur_of_a_photograph_is_measured_and_does_not_move_radii(blur: float) -> None:
    x, y, radius = rods_on_a_grid(22.0, 60.0)
    image = photograph(Laboratory(blur=blur, light=0.0), x, y, radius)
    measurer = CircleMeasurer(image, 22.0)
    rough = np.column_stack([x, y, *(np.full(len(x), each) for each in (22.0, 2.0, 0.0, np.inf))])
    measured = [MeasuredCircle(*one) for one in measurer.measure(rough).tolist()]
    # A pixel is a square of side 1: it blurs by 1/sqrt(12) more.
    assert measurer.estimate_blur(measured) == pytest.approx(np.hypot(blur, 0.29), abs=BLUR_ALLOWED)
    found = detect_grains(image, DetectionSettings(radius_range=(15.0, 30.0)))
    assert found.count == len(x)
    assert abs(float(np.median(found.radius)) - 22.0) < RADIUS_ALLOWED


def test_a_sharp_binary_picture_is_no_obstacle() -> None:
    x, y, radius = rods_on_a_grid(22.0, 60.0)
    row, column = np.mgrid[0:SIDE, 0:SIDE]
    inside = [np.hypot(column - a, row - b) < r for a, b, r in zip(x, y, radius, strict=True)]
    found = detect_grains(np.where(np.any(inside, axis=0), 255.0, 0.0).astype(np.float32))
    assert found.count == len(x)
    assert np.abs(found.radius - 22.0).max() < 0.5


@pytest.mark.thorough
def test_sizes_one_to_eight_are_found_without_settings() -> None:
    """Circles in a large rod's texture are rejected, and rods beyond the usual sizes are found."""
    x = np.array([110.0, 300.3, 300.0, 60.5, 120.2, 180.0, 240.0, 389.0, 224.0])
    y = np.array([110.0, 90.4, 270.0, 300.0, 260.6, 320.0, 390.0, 389.0, 190.0])
    radius = np.array([96.0, 72.0, 80.0, 30.0, 22.0, 16.0, 14.0, 12.0, 12.0])
    found = detect_grains(photograph(Laboratory(grain=14.0, lathe=10.0), x, y, radius, side=420))
    near = np.hypot(found.x[:, None] - x, found.y[:, None] - y)
    assert found.count == len(x)
    assert near.min(axis=0).max() < 0.5
    assert np.abs(found.radius - radius[near.argmin(axis=1)]).max() < 1.0


@pytest.mark.thorough
def test_sigma_covers_a_one_sided_shadow() -> None:
    x, y, radius = rods_on_a_grid(20.0, 44.0)
    found = detect_grains(
        photograph(Laboratory(shadow=0.5, highlight=30.0), x, y, radius), DetectionSettings(radius_range=(14.0, 28.0))
    )
    assert found.count == len(x)
    nearest = np.hypot(found.x[:, None] - x, found.y[:, None] - y).argmin(axis=1)
    error = np.stack([found.x - x[nearest], found.y - y[nearest]], axis=1)
    assert np.sqrt((error**2).mean()) < CENTRE_ALLOWED
    # Shading displaces all rods alike, so many rods are no better evidence than few: a factor of 1.5 is allowed.
    assert np.sqrt(((error / found.sigma[:, None]) ** 2).mean()) < 1.5


@pytest.mark.thorough
def test_a_circle_hardly_in_view_is_not_guessed() -> None:
    x, y, radius = np.array([150.0, -18.0]), np.array([150.0, 140.0]), np.array([60.0, 60.0])
    image = photograph(Laboratory(), x, y, radius)
    found = detect_grains(image)
    assert found.count >= 1
    assert (found.sigma < np.maximum(1.0, 0.05 * found.radius)).all()
    assert np.hypot(found.x - 150.0, found.y - 150.0).min() < 0.5


def test_half_the_resolution_finds_the_same_rods() -> None:
    x, y, radius = rods_on_a_grid(28.0, 62.0)
    image = photograph(Laboratory(shadow=0.2, blur=1.3), x, y, radius)
    half = np.asarray(cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA), dtype=np.float32)
    found = detect_grains(half)
    assert found.count == len(x)
    near = np.hypot(found.x[:, None] - (x - 0.5) / 2, found.y[:, None] - (y - 0.5) / 2).min(axis=0)
    assert near.max() < 0.5


def test_faint_circles_of_a_size_that_no_clear_one_has_are_accidental():
    radius = np.array([*[30.0] * 20, *[44.0] * 5, 16.0, 24.0, 31.0, 60.0])
    quality = np.array([*[0.8] * 25, 0.3, 0.5, 0.3, 0.2])
    good = np.ones(len(radius), bool)
    assert np.flatnonzero(_accidental(radius, quality, good)).tolist() == [25, 28]
    assert not _accidental(radius[6:], quality[6:], good[6:]).any()  # too few are clear
