"""Photographs with edges that are several pixels wide: enlarged, or taken by a soft lens."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from rodsight.experiment.pictures.image import Image
from rodsight.tracking.correlation.edge_width import edge_width, sharpest_copy
from rodsight.tracking.detection.detect import DetectionSettings, detect_grains, refine_grains

from tests.app.tracking.detection.polydisperse import draw_discs
from tests.app.tracking.laid_rods import CLASSES, lay_rods
from tests.app.tracking.speckled import Rods

ENLARGED = 2.3


def drawn_discs(blur: float) -> Image:
    column, row = np.meshgrid(np.arange(50.0, 460.0, 80.0), np.arange(50.0, 460.0, 80.0))
    x, y = column.ravel(), row.ravel()
    return draw_discs(512, 512, x, y, np.full(len(x), 33.0), blur=blur, noise=2.0, noise_seed=1)


def enlarged(rods: Rods, blur: float) -> Image:
    """The photograph of rods enlarged, and blurred by a lens [px], with noise."""
    image = cv2.resize(rods.reference(), None, fx=ENLARGED, fy=ENLARGED, interpolation=cv2.INTER_CUBIC)
    image = cv2.GaussianBlur(image, (0, 0), blur) + np.random.default_rng(1).normal(0.0, 2.0, image.shape)
    return np.clip(np.rint(image), 0.0, 255.0).astype(np.float32)


@pytest.mark.parametrize("blur", [1.0, 2.0, 4.0])
def test_the_width_of_edges_is_measured(blur: float) -> None:
    assert edge_width(drawn_discs(blur)) == pytest.approx(blur, rel=0.2)


def test_edges_of_noise_alone_have_no_width() -> None:
    noise = np.random.default_rng(2).normal(100.0, 5.0, (400, 400)).astype(np.float32)
    assert edge_width(noise) == 0.0


def test_a_sharp_photograph_is_used_as_it_is() -> None:
    image = drawn_discs(1.0)
    copy = sharpest_copy(image)
    assert copy.image is image
    assert copy.factors == (1.0, 1.0)


def test_places_of_a_copy_are_those_of_the_photograph() -> None:
    copy = sharpest_copy(drawn_discs(4.0))
    assert 3.0 < copy.factor < 5.0
    place = np.array([10.25, 300.5])
    there = copy.to_copy(place, place)
    assert np.allclose(copy.from_copy(*there), place)
    # The middle of the first pixels that were averaged.
    across, down = copy.factors
    assert np.allclose(copy.from_copy(np.zeros(1), np.zeros(1)), [[0.5 * (across - 1.0)], [0.5 * (down - 1.0)]])


@pytest.mark.thorough
def test_rods_with_edges_of_three_pixels_are_found_and_centred() -> None:
    rods = lay_rods(4, width=620, height=560)
    image = enlarged(rods, 2.6)
    classes = tuple(ENLARGED * size for size in CLASSES)
    truth = np.stack([ENLARGED * (rods.x + 0.5) - 0.5, ENLARGED * (rods.y + 0.5) - 0.5], axis=1)

    found = detect_grains(image, DetectionSettings(radii=classes))

    assert found.count == rods.count
    index = [int(np.hypot(found.x - x, found.y - y).argmin()) for x, y in truth]
    centres = np.stack([found.x, found.y], axis=1)[index]
    assert np.sqrt(((centres - truth) ** 2).mean()) < 0.15 * ENLARGED
    assert np.array_equal(found.radius[index], ENLARGED * rods.radius)
    scaled = (centres - truth) / found.sigma[index, None]
    assert 0.4 < np.sqrt((scaled**2).mean()) < 2.5

    rough = truth + np.random.default_rng(3).uniform(-3.0, 3.0, truth.shape)
    refined = refine_grains(image, rough[:, 0], rough[:, 1], ENLARGED * rods.radius)
    away = np.stack([refined.x, refined.y], axis=1) - truth
    assert np.sqrt((away**2).mean()) < 0.15 * ENLARGED
    assert np.array_equal(refined.radius, ENLARGED * rods.radius)


@pytest.mark.screen
def test_soft_rods_of_unknown_sizes_are_measured() -> None:
    rods = lay_rods(5, width=620, height=560)
    found = detect_grains(enlarged(rods, 2.6), DetectionSettings(radius_range=(40.0, 110.0)))
    at = match_scaled(found.x, found.y, rods)
    assert (at >= 0).mean() > 0.95
    size = found.radius[at[at >= 0]] / (ENLARGED * rods.radius[at >= 0])
    assert np.median(np.abs(size - 1.0)) < 0.02


def match_scaled(x: np.ndarray, y: np.ndarray, rods: Rods) -> np.ndarray:
    """Row of the circle at every rod (n,), −1: none within 5 px."""
    away = np.hypot(
        x[None] - ENLARGED * (rods.x[:, None] + 0.5) + 0.5, y[None] - ENLARGED * (rods.y[:, None] + 0.5) + 0.5
    )
    return np.where(away.min(axis=1) < 5.0, away.argmin(axis=1), -1)
