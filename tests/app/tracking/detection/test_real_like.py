"""Detection and tracking of brown, scratched, dimly lit rods without speckle, down to a radius of 14 pixels."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from rodsight.experiment.pictures.picture_file import read_photograph
from rodsight.tracking.detection.detect import DetectionSettings, detect_grains
from rodsight.tracking.tracker import Tracker
from rodsight.tracks import TrackStatus

from tests.app.tracking.laid_rods import HEIGHT, WIDTH, lay_rods, match
from tests.app.tracking.real_like import Laboratory, brown_photograph
from tests.app.tracking.speckled import Rods

SIDE = 420  # [px]
CLASSES = (14.0, 20.0, 28.0)  # [px]
CENTRE_ALLOWED = 0.1  # [px] rms
FOLLOWED_ALLOWED = 0.06  # [px] rms; noise of 2 grey on a dull texture of 6, softened by 1.4 px, leaves .04
WRONG = 0.5  # [px]
DULL = Laboratory(face=90.0, grain=6.0, light=0.45, blur=1.4, noise=2.0)


def photographed(
    folder: Path, laboratory: Laboratory, rods: Rods, dx: np.ndarray | float, dy: np.ndarray | float,
    rotation: np.ndarray, noise_seed: int,
) -> np.ndarray:  # fmt: skip
    file = folder / f"{noise_seed}.png"
    image = brown_photograph(
        laboratory,
        rods.width,
        rods.height,
        rods.x + dx,
        rods.y + dy,
        rods.radius,
        rotation,
        pattern_seed=1,
        noise_seed=noise_seed,
    )
    cv2.imwrite(str(file), image)
    return read_photograph(file)


@pytest.fixture(scope="module", params=[Laboratory(), DULL], ids=["plain", "dull"])
def laboratory(request: pytest.FixtureRequest) -> Laboratory:
    return request.param


@pytest.fixture(scope="module")
def rods() -> Rods:
    return lay_rods(0, CLASSES, width=SIDE, height=SIDE)


@pytest.fixture(scope="module")
def first(laboratory: Laboratory, rods: Rods, tmp_path_factory: pytest.TempPathFactory) -> np.ndarray:
    return photographed(tmp_path_factory.mktemp("brown"), laboratory, rods, 0.0, 0.0, np.zeros(rods.count), 1)


@pytest.mark.slow
@pytest.mark.parametrize("known", [True, False])
def test_brown_rods_are_all_found(first: np.ndarray, rods: Rods, known: bool) -> None:
    settings = DetectionSettings(radii=CLASSES) if known else DetectionSettings(radius_range=(11.0, 36.0))
    found = detect_grains(first, settings)
    index, near = match(found, rods)
    assert near.all()
    assert found.count == rods.count
    error = np.stack([found.x[index] - rods.x, found.y[index] - rods.y])
    assert np.sqrt((error**2).mean()) < CENTRE_ALLOWED
    assert np.abs(found.radius[index] - rods.radius).max() < 1.0


@pytest.mark.thorough
def test_brown_rods_are_followed_over_thirteen_pixels_and_five_degrees(
    laboratory: Laboratory, first: np.ndarray, rods: Rods, tmp_path: Path
) -> None:
    generator = np.random.default_rng(3)
    rotation = generator.normal(np.deg2rad(5.0), 0.03, rods.count)
    dx, dy = 12.0 + generator.normal(0.0, 0.4, rods.count), -5.0 + generator.normal(0.0, 0.4, rods.count)
    tracker = Tracker(first, (rods.x, rods.y, rods.radius))
    poses = tracker.follow(photographed(tmp_path, laboratory, rods, dx, dy, rotation, 2), [tracker.first()])
    error = np.stack([poses.x - rods.x - dx, poses.y - rods.y - dy])
    assert poses.has_pose.all()
    assert np.abs(error).max() < WRONG
    assert np.sqrt((error**2).mean()) < FOLLOWED_ALLOWED
    assert np.sqrt(np.mean((poses.rotation - rotation) ** 2)) < 0.005
    assert (poses.status != TrackStatus.SUSPECT).mean() > 0.97


@pytest.mark.slow
@pytest.mark.parametrize("size", [(SIDE, SIDE), pytest.param((WIDTH, HEIGHT), marks=pytest.mark.screen)])
def test_circles_at_the_border_do_not_run_away_and_swallow_others(
    laboratory: Laboratory, tmp_path: Path, size: tuple[int, int]
) -> None:
    rods = lay_rods(3, CLASSES, cut=True, width=size[0], height=size[1])
    image = photographed(tmp_path, laboratory, rods, 0.0, 0.0, np.zeros(rods.count), 1)
    found = detect_grains(image, DetectionSettings(radius_range=(11.0, 36.0)))
    index, near = match(found, rods)
    whole = (rods.x > rods.radius) & (rods.x < rods.width - rods.radius) & (rods.y < rods.height - rods.radius)
    assert near[whole].all()
    assert found.radius.max() < 40.0
    assert np.abs(found.radius[index] - rods.radius)[whole].max() < 1.0
