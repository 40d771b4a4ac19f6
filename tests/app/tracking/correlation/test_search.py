"""Search for grains: against slow references, among similar places, and with covered patches."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.tracking.correlation.search import disc_offsets, search_patch
from rodsight.tracking.correlation.search_parts import search_parts
from rodsight.tracking.correlation.splines import spline_coefficients
from rodsight.tracking.interpolation.recursive_filter import quintic_coefficients
from rodsight.tracking.interpolation.spline_values import interpolate_quintic
from rodsight.tracking.tracker import Tracker
from rodsight.tracks import TrackStatus
from scipy.ndimage import map_coordinates, spline_filter

from tests.app.tracking.speckled import Rods, grid_of_rods
from tests.app.tracking.test_tracker import OCCLUDED_RMS_ALLOWED, WRONG, cover, errors, unflagged

SPLINE_ALLOWED = 2e-3  # [grey] single precision, and a prefilter that is truncated at a millionth
HALF_BLOCK = 27  # [px] half side of the square that is copied from one rod to another: the whole rod
ALIKE = 0.95  # ZNCC of a place that is a copy, noise and all


@pytest.fixture(scope="module")
def rods() -> Rods:
    return grid_of_rods(6, 6, radius=23.5, pitch=49.0, margin=90.0, seed=2)


@pytest.fixture
def texture() -> np.ndarray:
    return np.random.default_rng(5).uniform(0.0, 200.0, (40, 44)).astype(np.float32)


def test_the_quintic_spline_is_that_of_a_slow_reference(texture: np.ndarray) -> None:
    coefficients = quintic_coefficients(texture)
    assert np.abs(coefficients - spline_filter(texture.astype(float), 5, mode="mirror")).max() < 0.1
    at = np.random.default_rng(1).uniform(4.0, 34.0, (50, 2))
    expected = map_coordinates(texture.astype(float), at[:, ::-1].T, order=5, mode="mirror")
    found = [
        interpolate_quintic(coefficients, int(x), int(y), np.float32(x - int(x)), np.float32(y - int(y))) for x, y in at
    ]
    assert np.abs(np.array(found) - expected).max() < SPLINE_ALLOWED


@pytest.mark.slow
@pytest.mark.parametrize("search", [search_patch, search_parts])
def test_a_search_finds_the_greatest_zncc(texture: np.ndarray, search) -> None:
    radius, origin = 5.0, (20.0, 18.0)
    image = np.roll(texture, (3, -4), axis=(0, 1)) + np.random.default_rng(2).normal(0, 20, texture.shape)
    best = np.empty((3, 4))
    search(
        spline_coefficients(texture), image.astype(np.float32), *origin, radius, 19.0, 19.0, 0.0, 8.0, 0.2, 3.0, best
    )
    dx, dy, _ = disc_offsets(radius)
    template = texture[18 + dy, 20 + dx]
    there = image[21 + dy, 16 + dx]
    assert best[0, :2].tolist() == [16.0, 21.0]
    assert best[0, 2] == 0.0
    # A half may correlate better than the whole, but its ZNCC is divided by √2.
    assert best[0, 3] == pytest.approx(np.corrcoef(template, there)[0, 1], abs=1e-4)
    assert (np.diff(best[:, 3]) <= 0.0).all()


def test_the_halves_of_a_covered_patch_are_found_where_the_whole_is_not(texture: np.ndarray) -> None:
    radius, origin = 6.0, (20.0, 18.0)
    image = texture.copy()
    image[:, 22:] = 0.0
    image[:10, :12] = 0.0
    best = np.empty((1, 4))
    found = {}
    for search in (search_patch, search_parts):
        search(spline_coefficients(texture), image, *origin, radius, 20.0, 18.0, 0.0, 9.0, 0.2, 3.0, best)
        found[search] = best[0].copy()
    assert found[search_parts][:2].tolist() == list(origin)
    assert found[search_parts][3] > found[search_patch][3]


def test_second_best_is_stored_and_low_where_paint_is_random(rods: Rods) -> None:
    tracker = Tracker(rods.reference(), (rods.x, rods.y, rods.radius))
    rotation = np.deg2rad(60.0) * np.where(np.arange(rods.count) % 2, 1.0, -1.0)
    first = tracker.first()
    assert np.isnan(first.second_zncc).all()
    poses = tracker.follow(rods.moved(40.0, 0.0, rotation), [first])
    rescued = poses.status == TrackStatus.RESCUED
    assert rescued.all()
    assert np.isfinite(poses.second_zncc).all()
    assert (poses.second_zncc < poses.zncc - 0.3).all()
    again = tracker.follow(rods.moved(41.0, 0.0, rotation, noise_seed=7), [first, poses])
    assert np.isnan(again.second_zncc[again.status == TrackStatus.OK]).all()


def test_a_grain_with_a_copy_within_the_window_is_suspect(rods: Rods) -> None:
    x, y = rods.x.copy(), rods.y.copy()
    x[1], y[1] = x[0] + 49, y[0]  # the first grain belongs to the sample of the wide search

    def copy_first_grain(image: np.ndarray, dx: int, dy: int) -> np.ndarray:
        cx, cy = round(x[0]) + dx, round(y[0]) + dy
        block = image[cy - HALF_BLOCK : cy + HALF_BLOCK + 1, cx - 24 : cx + 25]
        image[cy - HALF_BLOCK : cy + HALF_BLOCK + 1, cx + 25 : cx + 74] = block
        return image

    alike = Rods(rods.width, rods.height, x, y, rods.radius, rods.settings)
    tracker = Tracker(copy_first_grain(alike.reference(), 0, 0), (x, y, rods.radius))
    rotation = np.where(np.arange(rods.count) < 2, 0.0, 1.0)
    poses = tracker.follow(copy_first_grain(alike.moved(10.0, 12.0, rotation), 10, 12), [tracker.first()])
    assert poses.second_zncc[0] > ALIKE
    assert poses.status[0] == TrackStatus.SUSPECT
    wrong = np.abs(errors(poses, alike, 10.0, 12.0)).max(axis=1) > WRONG
    assert not (wrong & unflagged(poses)).any()
    assert unflagged(poses)[2:].all()


def test_a_grain_that_looks_the_same_upside_down_is_suspect(rods: Rods) -> None:
    x, y = rods.x.copy(), rods.y.copy()
    x[14], y[14] = np.round(x[14]), np.round(y[14])

    alike = Rods(rods.width, rods.height, x, y, rods.radius, rods.settings)
    reference, image = alike.reference(), alike.moved(40.0, 0.0, 1.0)
    cx, cy = int(x[14]), int(y[14])
    block = reference[cy - 24 : cy + 25, cx - 24 : cx + 25]
    block[25:] = block[:24][::-1, ::-1]
    block[24, 25:] = block[24, :24][::-1]
    image[cy - 24 : cy + 25, cx + 16 : cx + 65] = np.rot90(block)
    tracker = Tracker(reference, (x, y, rods.radius))
    poses = tracker.follow(image, [tracker.first()])
    assert poses.second_zncc[14] > ALIKE
    assert poses.status[14] == TrackStatus.SUSPECT
    assert (poses.status != TrackStatus.SUSPECT).sum() == rods.count - 1


@pytest.mark.parametrize("grey", [0.0, 255.0])
@pytest.mark.parametrize(
    ("dx", "dy", "degrees"), [(12.0, 5.0, 23.0), pytest.param(40.0, 0.0, 60.0, marks=pytest.mark.slow)]
)
def test_thirty_per_cent_covered_is_found_without_prediction(
    rods: Rods, grey: float, dx: float, dy: float, degrees: float
) -> None:
    tracker = Tracker(rods.reference(), (rods.x, rods.y, rods.radius))
    rotation = np.deg2rad(degrees) * np.where(np.arange(rods.count) % 2, 1.0, -1.0)
    image = rods.moved(dx, dy, rotation)
    cover(image, rods.x + dx, rods.y + dy, 0.3, grey)
    poses = tracker.follow(image, [tracker.first()])
    assert poses.has_pose.all()
    error = errors(poses, rods, dx, dy)
    assert np.abs(error).max() < WRONG
    assert np.sqrt((error**2).mean()) < OCCLUDED_RMS_ALLOWED
