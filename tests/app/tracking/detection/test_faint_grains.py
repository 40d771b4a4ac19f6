"""Plain grains of which little is seen are found, and the texture of a ground is not taken for grains."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from rodsight.experiment.plausibility import neighbour_spacing
from rodsight.tracking.detection.circles.circle_measurement import CircleMeasurer
from rodsight.tracking.detection.detect import Detection, DetectionSettings, detect_grains
from rodsight.tracking.detection.faint_grains import find_faint_grains
from rodsight.tracking.missed_rods import WIDE_RIMS, detect_rods
from scipy.spatial import KDTree

from tests.app.tracking.detection.thick_discs import draw_thick_discs, with_ground
from tests.app.tracking.laid_rods import lay_rods
from tests.app.tracking.real_like import Laboratory, brown_photograph
from tests.app.tracking.speckled import Rods

CLASSES = (18.0, 25.0)  # [px]
FOUND = 5.0  # [px] of a centre: of a thick disc that between its faces is seen
LEAST = 0.15, 0.3  # slope and quality, as `DetectionSettings` has them


def _found(found: Detection, rods: Rods, above: float = 0.0) -> tuple[float, int]:
    """Fraction of the rods that are found, and number of circles that are no rod."""
    true = KDTree(np.column_stack([rods.x, rods.y + above]))
    away, nearest = true.query(np.column_stack([found.x, found.y]))
    return len(np.unique(nearest[away < FOUND])) / rods.count, int((away >= FOUND).sum())


@pytest.mark.slow
@pytest.mark.parametrize(("radii", "least"), [((), 0.93), (CLASSES, 0.85)])
def test_thick_discs_whose_sides_fill_the_gaps_are_found(radii: tuple[float, ...], least: float) -> None:
    rods = lay_rods(3, CLASSES, width=500, height=420)
    image = draw_thick_discs(500, 420, rods.x, rods.y, rods.radius, side=6.0, seed=4)
    found = detect_rods(image, DetectionSettings(radii=radii))
    recall, wrong = _found(found, rods)
    assert recall >= least
    assert wrong <= 2
    spacing = np.median(neighbour_spacing(np.column_stack([found.x, found.y]), found.radius))
    assert radii or spacing > 1.0 - WIDE_RIMS


@pytest.mark.slow
def test_the_texture_of_a_ground_is_no_grain() -> None:
    rods = lay_rods(3, (20.0, 28.0), width=420, height=400)
    image = brown_photograph(
        Laboratory(), 420, 400, rods.x, rods.y, rods.radius, np.zeros(rods.count), pattern_seed=4, noise_seed=3
    )
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY).astype(np.float32)
    ground = with_ground(grey, 45.0, 300, texture=10.0, seed=5)
    assert _found(detect_grains(ground, DetectionSettings(radii=(20.0, 28.0))), rods, 300.0) == (1.0, 0)


def _three_discs() -> np.ndarray:
    """A light disc, one of a quarter of its light, and a dark place in the texture of a ground."""
    row, column = np.mgrid[0:100, 0:260]
    image = np.full(row.shape, 10.0)
    for x, light in ((50.0, 180.0), (130.0, 70.0)):
        image[np.hypot(column - x, row - 50.0) < 20.0] = light
    return cv2.GaussianBlur(image, (0, 0), 0.8).astype(np.float32)


def test_a_circle_that_is_no_brighter_than_the_dark_beside_it_is_removed_unless_it_is_clear() -> None:
    image = _three_discs()
    measurer = CircleMeasurer(image, 20.0)

    def kept(quality: float) -> list[float]:
        table = np.array([(50.0, 50.0, 20.0, 0.4), (130.0, 50.0, 20.0, 0.4), (210.0, 50.0, 20.0, quality)])
        _, after = find_faint_grains(image, measurer, table, (20.0,), LEAST)
        return sorted(np.rint(after[:, 0]).tolist())

    assert kept(0.4) == [50.0, 130.0]
    assert kept(0.6) == [50.0, 130.0, 210.0]


def test_a_dark_even_disc_stays_where_it_was_found_but_is_not_added() -> None:
    row, column = np.mgrid[0:100, 0:260]
    image = _three_discs()
    away, angle = np.hypot(column - 210.0, row - 50.0), np.arctan2(row - 50.0, column - 210.0)
    image[(away < 30.0) & ((angle / (0.5 * np.pi) % 1.0 > 0.3) | (away < 20.0))] = 45.0  # four gaps are dark
    image = cv2.GaussianBlur(image, (0, 0), 0.8) + np.random.default_rng(1).normal(0.0, 1.0, image.shape)
    image = image.astype(np.float32)
    found = np.array([(50.0, 50.0, 20.0, 0.4), (210.0, 50.0, 20.0, 0.4)])
    for table in (found, found[:1]):
        _, after = find_faint_grains(image, CircleMeasurer(image, 20.0), table, (20.0,), LEAST)
        assert (np.abs(after[:, 0] - 210.0) < 3.0).sum() == len(table) - 1


def test_of_no_circles_nothing_follows() -> None:
    image = np.zeros((60, 60), np.float32)
    measurer = CircleMeasurer(image, 10.0)
    same, table = find_faint_grains(image, measurer, np.empty((0, 4)), (), LEAST)
    assert same is measurer
    assert len(table) == 0


@pytest.mark.parametrize(("seen", "is_found"), [(0.3, True), (0.05, False)])
def test_a_plain_disc_is_found_by_a_third_of_its_rim(seen: float, is_found: bool) -> None:
    row, column = np.mgrid[0:100, 0:260]
    away, angle = np.hypot(column - 130.0, row - 50.0), np.arctan2(row - 50.0, column - 130.0)
    image = _three_discs()
    image[(away < 30.0) & ((angle / (0.5 * np.pi) % 1.0 > seen) | (away < 20.0))] = 150.0  # four gaps are dark
    image += np.random.default_rng(1).normal(0.0, 1.0, image.shape).astype(np.float32)
    table = np.array([(50.0, 50.0, 20.0, 1.0)])
    plain, after = find_faint_grains(image, CircleMeasurer(image, 20.0), table, (20.0,), LEAST)
    assert plain.plain
    assert (len(after) == 2) == is_found
    np.testing.assert_allclose(after[0, :2], [50.0, 50.0])
