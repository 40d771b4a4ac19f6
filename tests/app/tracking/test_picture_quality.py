"""Quality of photographs before tracking: measurements, and each fault on photographs that have it."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from rodsight.tracking.correlation.noise import image_noise
from rodsight.tracking.detection.detect import Detection
from rodsight.tracking.picture_quality import PictureQuality, measure_pictures
from rodsight.tracking.tracker import Tracker

NOISE = 3.0  # [grey]
SPECKLE = 5.0  # [px]


def speckle_pattern(speckle: float, seed: int = 0, side: int = 480) -> np.ndarray:
    """Gaussian noise smoothed to a pattern of grains so wide (full width at half maximum of its autocorrelation)."""
    white = np.random.default_rng(seed).standard_normal((side, side))
    length = speckle / (2.0 * np.sqrt(2.0 * np.log(2.0)))
    smooth = cv2.GaussianBlur(white, (0, 0), length / np.sqrt(2.0))
    return 120.0 + 35.0 * smooth / smooth.std()


def add_noise(picture: np.ndarray, seed: int, noise: float = NOISE) -> np.ndarray:
    noisy = picture + noise * np.random.default_rng(100 + seed).standard_normal(picture.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.float32)


def photograph_series(change: Callable[[np.ndarray, int], np.ndarray] = lambda picture, _: picture) -> list[np.ndarray]:
    picture = speckle_pattern(SPECKLE)
    return [add_noise(change(picture, k), k) for k in range(5)]


def faults_of(quality: PictureQuality) -> str:
    return " ".join(quality.faults())


def test_good_photographs_are_measured_and_have_no_faults():
    quality = measure_pictures(photograph_series())
    assert quality.faults() == []
    assert quality.noise == pytest.approx(NOISE, rel=0.15)
    assert quality.speckle[0] == pytest.approx(SPECKLE, rel=0.15)
    assert quality.contrast[0] == pytest.approx(35.0, rel=0.15)
    assert "5." in quality.facts()[1]
    assert f"{quality.sigma:.2g} px" in quality.facts()[1]


def test_the_expected_sigma_is_the_tracking_error():
    centre = np.stack(np.meshgrid(np.arange(60.0, 421.0, 60.0), np.arange(60.0, 421.0, 60.0)), axis=-1).reshape(-1, 2)
    radius, picture = np.full(len(centre), 24.0), speckle_pattern(SPECKLE)
    first = add_noise(picture, 0, 6.0)
    tracker = Tracker(first, _detection(centre, radius))
    error = []
    for k in range(1, 7):
        pose = tracker.follow(add_noise(picture, k, 6.0), [tracker.first()])
        error.append(np.stack([pose.x, pose.y], axis=1) - centre)
    error_sd = float(np.sqrt(np.mean(np.square(error))))
    assert measure_pictures([first], centre, radius).sigma == pytest.approx(error_sd, rel=0.2)


def _detection(centre: np.ndarray, radius: np.ndarray):
    n = len(radius)
    return Detection(centre[:, 0], centre[:, 1], radius, np.full(n, 0.01), np.ones(n))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda p, k: p * (1.0 - 0.1 * k), "light changes by -40% until photograph 4"),
        (lambda p, k: p if k != 2 else 12.0 + 0.02 * p, "Photograph 2 has"),
        (lambda p, k: p if k != 3 else cv2.GaussianBlur(p, (0, 0), 2.5), "Photograph 3 is blurred"),
        (lambda p, k: p + 110.0, "are black or saturated"),
        (lambda p, _: 120.0 + 0.1 * (p - 120.0), "hardly any pattern"),
    ],
)
def test_each_fault_is_named(change, words):
    assert words in faults_of(measure_pictures(photograph_series(change)))


def test_a_camera_of_twelve_bits_has_a_pattern():
    """Its photographs fill a sixteenth of the range of 16 bits."""
    assert "pattern" not in faults_of(measure_pictures(photograph_series(lambda p, _: p / 16.0)))


def test_discs_tracked_by_their_rims_need_no_pattern():
    plain = photograph_series(lambda p, k: (120.0 + 0.1 * (p - 120.0)) * (1.0 - 0.1 * k))
    quality = measure_pictures(plain, patterned=False)
    assert len(quality.facts()) == 1
    assert "light changes" in faults_of(quality)
    assert "pattern" not in faults_of(quality)


def test_too_fine_and_too_wide_a_pattern_is_named():
    assert "finer than" in faults_of(measure_pictures([add_noise(speckle_pattern(1.8), 0)]))
    centre, radius = np.array([[100.0, 100.0], [300.0, 300.0]]), np.full(2, 24.0)
    assert "so wide" in faults_of(measure_pictures([add_noise(speckle_pattern(30.0), 0)], centre, radius))
    assert faults_of(measure_pictures([add_noise(speckle_pattern(6.0), 0)], centre, radius)) == ""


def test_much_noise_is_named():
    assert "is coarse" in faults_of(measure_pictures([add_noise(speckle_pattern(SPECKLE), 0, 40.0)]))


def test_noise_is_estimated_where_most_of_the_photograph_is_one_grey():
    picture = add_noise(speckle_pattern(SPECKLE), 0)
    picture[:, :300] = 90.0  # beyond a region, or black as can be
    assert image_noise(picture) == pytest.approx(NOISE, rel=0.2)
