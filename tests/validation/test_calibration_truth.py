"""Self-calibration on simulated packings: imposed errors are found, exact inputs are unchanged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.calibration.calibrate import calibrate, default_priors
from rodsight.solver.calibration.equations import move_walls, rotate_offsets
from rodsight.solver.calibration.gaps import MeasuredSequence
from rodsight.solver.calibration.priors import CalibrationPriors
from rodsight.solver.dem.dem_truth import DemSettings, DemTruth
from rodsight.solver.dem.shear_cell import shear_photographs
from rodsight.synthetic.dense_packing import prepare_packing

GRAINS, FRAMES, STEP = 250, 24, np.deg2rad(0.25)
SEEDS = (11, 12)
# [m] after 24 photographs, 6° of shear. Six other packings gave 10.4 … 12.5 µm and 15.2 … 19.3 µm.
CENTRE_ERROR = {3e-6: 16e-6, 10e-6: 24e-6}
COVERAGE = (0.5, 1.3)  # true errors over standard deviations; the six packings gave 0.69 … 1.16
DISTANCE_ERROR = 3e-6  # [m] rms of the distances of touching grains: noise over √24 photographs, 1e-4 of a diameter
WALL_ERROR = 20e-6  # [m]; the six packings gave 3 … 13 µm: a dozen rods at a wall, each with its own centre error

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", params=SEEDS)
def truth(request) -> DemTruth:
    settings = DemSettings()
    cell = prepare_packing(GRAINS, np.random.default_rng(request.param), settings)
    return DemTruth.of_frames(cell.grains.radius, list(shear_photographs(cell, STEP * np.arange(FRAMES))), settings)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(3)


def typical_overlap(truth: DemTruth) -> float:
    return float(truth.fn.mean() / truth.settings.normal_stiffness)


def measure(truth: DemTruth, noise: float, rng: np.random.Generator) -> MeasuredSequence:
    shape = truth.rotation.shape
    position = truth.position + rng.normal(0.0, noise, truth.position.shape)
    return MeasuredSequence(
        truth.radius, position, truth.rotation, np.ones(shape, bool), truth.endpoints, np.full(shape, noise)
    )


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.parametrize("noise", [3e-6, 10e-6])
@pytest.mark.parametrize("given", [True, False])
def test_centres_radii_and_walls_are_found(truth, rng, noise, given):
    exact = measure(truth, noise, rng)
    n = exact.grain_count
    offset, radius = rng.normal(0, 50e-6, (n, 2)), rng.normal(0, 10e-6, n)
    wall = np.array([50e-6, -30e-6, 40e-6, -60e-6])
    wrong = replace(
        exact,
        radius=exact.radius - radius,
        position=exact.position - rotate_offsets(exact, offset),
        endpoints=move_walls(exact.endpoints, -wall, np.zeros(4)),
    )
    priors = CalibrationPriors(50e-6, 10e-6, wall=50e-6) if given else None
    result = calibrate(wrong, priors, rng=rng, typical_overlap=typical_overlap(truth))
    assert result.applied
    assert rms(result.offset - offset) < CENTRE_ERROR[noise]
    assert rms(result.radius - radius) < rms(radius)
    assert rms(result.wall - wall) < WALL_ERROR
    assert COVERAGE[0] < rms((result.offset - offset) / result.offset_sd) < COVERAGE[1]
    assert result.after.width < 1.2 * np.hypot(np.sqrt(2) * noise, typical_overlap(truth))


@pytest.mark.parametrize("noise", [0.0, 3e-6, 10e-6])
def test_exact_centres_are_unchanged(truth, rng, noise):
    exact = measure(truth, noise, rng)
    result = calibrate(exact, rng=rng, typical_overlap=typical_overlap(truth))
    corrected = result.correct(exact)
    assert rms(corrected.position - exact.position) < 0.5e-6
    assert rms(corrected.radius - exact.radius) < 0.5e-6


def contact_distances(truth: DemTruth, sequence: MeasuredSequence) -> np.ndarray:
    """Gaps of pairs of grains that bear force, mean over the photographs of each pair [m]."""
    n = len(truth.radius)
    frame = np.repeat(np.arange(truth.frame_count), np.diff(truth.offset))
    rows = np.flatnonzero((truth.j < n) & (truth.fn > 0.1 * truth.fn.mean()))
    k, i, j = frame[rows], truth.i[rows], truth.j[rows]
    gap = np.linalg.norm(sequence.position[k, j] - sequence.position[k, i], axis=1) - sequence.radius[i]
    gap -= sequence.radius[j]
    pair = np.unique(i.astype(np.int64) * n + j, return_inverse=True)[1]
    return np.bincount(pair, gap) / np.bincount(pair)


@pytest.mark.parametrize("error", [-1e-2, -3e-3, 3e-3, 1e-2])
@pytest.mark.parametrize("follow", [True, False])
def test_wrong_pixel_size_is_found_and_walls_are_scaled_only_if_measured_with_it(truth, rng, error, follow):
    exact = measure(truth, 10e-6, rng)
    wrong = replace(
        exact, position=exact.position / (1.0 + error), endpoints=exact.endpoints / (1.0 + error * follow)
    )  # fmt: skip
    priors = default_priors(wrong, pixel_size=5e-3, radius_class=1e-3)
    classes = np.unique(truth.radius, return_inverse=True)[1]
    result = calibrate(wrong, priors, rng=rng, typical_overlap=typical_overlap(truth), radius_class=classes)
    assert result.applied
    assert abs(result.pixel_size - error) < 1e-3  # uncertainty of the known radii
    assert result.walls_follow == follow
    left = contact_distances(truth, result.correct(wrong)) - contact_distances(truth, exact)
    assert rms(left) < DISTANCE_ERROR


def test_rotated_wall_is_found(truth, rng):
    exact = measure(truth, 10e-6, rng)
    tilt = np.array([0.0, 0.0, 1e-3, 0.0])
    wrong = replace(exact, endpoints=move_walls(exact.endpoints, np.zeros(4), -tilt))
    result = calibrate(wrong, default_priors(wrong), rng=rng, typical_overlap=typical_overlap(truth))
    assert result.applied
    np.testing.assert_allclose(result.wall_tilt, tilt, atol=1.5e-4)  # 20 µm at the ends of 0.3 m
    np.testing.assert_array_equal(result.offset, np.zeros_like(result.offset))


@pytest.mark.parametrize("noise", [0.0, 10e-6, 40e-6])
def test_exact_scale_walls_and_lens_are_unchanged(truth, rng, noise):
    exact = measure(truth, noise, rng)
    priors = default_priors(exact, pixel_size=5e-3, radius_class=1e-3)
    classes = np.unique(truth.radius, return_inverse=True)[1]
    result = calibrate(exact, priors, rng=rng, typical_overlap=typical_overlap(truth), radius_class=classes)
    assert not result.applied
    assert result.pixel_size == 0.0
    assert 0.0 < result.pixel_size_sd < 5e-3
    assert result.lens == 0.0
