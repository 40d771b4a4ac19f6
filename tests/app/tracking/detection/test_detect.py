"""Detection of grains: completeness, false detections and accuracy."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.tracking.detection.detect import Detection, DetectionSettings, detect_grains, refine_grains

from tests.app.tracking.laid_rods import CLASSES, HEIGHT, WIDTH, lay_rods, match
from tests.app.tracking.speckled import Rods

CENTRE_ALLOWED = 0.1  # [px] rms


@pytest.fixture(scope="module", params=[0, pytest.param(1, marks=pytest.mark.screen)])
def packed(request: pytest.FixtureRequest) -> tuple[Rods, Detection]:
    rods = lay_rods(request.param)
    return rods, detect_grains(rods.reference(), DetectionSettings(radii=CLASSES))


def test_every_rod_is_found_and_nothing_else(packed: tuple[Rods, Detection]) -> None:
    rods, found = packed
    assert rods.count > 40
    index, near = match(found, rods)
    assert near.all()
    assert found.count == rods.count
    assert np.array_equal(found.radius[index], rods.radius)


@pytest.mark.screen
def test_every_rod_of_a_large_photograph_is_found() -> None:
    """Large rods are searched for on a shrunk photograph, whose pixels are wide."""
    classes = (78.0, 89.0, 122.0)
    rods = lay_rods(2, classes, width=1700, height=1500)
    assert detect_grains(rods.reference(), DetectionSettings(radii=classes)).count == rods.count


def test_centres_are_exact_to_a_tenth_of_a_pixel(packed: tuple[Rods, Detection]) -> None:
    rods, found = packed
    index, _ = match(found, rods)
    error = np.stack([found.x[index] - rods.x, found.y[index] - rods.y], axis=1)
    assert np.sqrt((error**2).mean()) < CENTRE_ALLOWED
    scaled = error / found.sigma[index, None]
    # The rods are few and their shading is no noise: the agreement is to a factor, not to a per cent.
    assert 0.4 < np.sqrt((scaled**2).mean()) < 2.0


@pytest.mark.slow
def test_unknown_radii_are_measured() -> None:
    rods = lay_rods(2)
    found = detect_grains(rods.reference(), DetectionSettings(radius_range=(20.0, 55.0)))
    index, near = match(found, rods)
    assert near.mean() > 0.95
    assert near.sum() / found.count > 0.95
    assert np.median(np.abs(found.radius[index[near]] - rods.radius[near])) < 0.5


@pytest.mark.thorough
def test_rods_cut_by_the_border_are_found_when_half_in_view() -> None:
    rods = lay_rods(3, cut=True)
    found = detect_grains(rods.reference(), DetectionSettings(radii=CLASSES))
    index, near = match(found, rods)
    in_view = (rods.y + 0.2 * rods.radius < HEIGHT) & (rods.x > 0) & (rods.x < WIDTH)
    assert (rods.y + rods.radius > HEIGHT)[in_view].any()
    assert near[in_view].all()
    # Further detections are rods as well.
    assert found.count == len(np.unique(index[near]))


@pytest.mark.thorough
def test_given_positions_are_refined() -> None:
    rods = lay_rods(4)
    generator = np.random.default_rng(0)
    x, y = rods.x + generator.uniform(-1.5, 1.5, rods.count), rods.y + generator.uniform(-1.5, 1.5, rods.count)
    found = refine_grains(rods.reference(), x, y, rods.radius)
    error = np.stack([found.x - rods.x, found.y - rods.y], axis=1)
    assert np.sqrt((error**2).mean()) < CENTRE_ALLOWED
    assert np.array_equal(found.radius, rods.radius)


def test_nothing_is_found_on_an_empty_photograph() -> None:
    noise = np.random.default_rng(0).normal(30.0, 2.0, (300, 300)).astype(np.float32)
    assert detect_grains(noise, DetectionSettings(radii=CLASSES)).count == 0


@pytest.mark.slow
def test_position_without_a_grain_has_no_quality() -> None:
    blank = np.full((300, 300), 30.0, np.float32)
    found = refine_grains(blank, np.array([150.0]), np.array([150.0]), np.array([30.0]))
    assert found.quality[0] == 0.0
    assert np.isnan(found.sigma[0])
    assert (found.x[0], found.y[0]) == (150.0, 150.0)


def test_invalid_radii_are_refused() -> None:
    with pytest.raises(ValueError, match="at this pixel_size"):
        DetectionSettings(radii=(0.5,))
