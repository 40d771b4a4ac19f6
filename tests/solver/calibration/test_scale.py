"""The scale of a sequence, on pairs of discs that touch and pairs that do not, so that the truth is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.bodies.wall_shapes import OUT, STRAIGHT, circle_ends
from rodsight.solver.calibration import scale
from rodsight.solver.calibration.calibrate import calibrate
from rodsight.solver.calibration.gaps import MeasuredSequence
from rodsight.solver.calibration.priors import CalibrationPriors
from rodsight.solver.calibration.scale import ScaleErrors, find_scale, scale_walls

RADII = np.array([7e-3, 8e-3, 11e-3])  # [m]
FIELD = 0.05  # [m] side of the square that a pair has for itself
PRIORS = CalibrationPriors(centre=0.0, radius=0.0, pixel_size=5e-3, radius_class=8e-6)
FEW_MICROMETRES = 3e-6  # [m] of a mean diameter: about the shift of the peak by the tail of open gaps


def scatter_pairs(
    rng: np.random.Generator, *, pairs: int = 300, touching: float = 0.6, noise: float = 10e-6, frames: int = 4
) -> tuple[MeasuredSequence, np.ndarray]:
    """Make isolated pairs of discs, most of them touching, others up to 1 mm apart; and the classes."""
    classes = rng.integers(0, len(RADII), (pairs, 2))
    radius = RADII[classes]
    gap = np.where(rng.random(pairs) < touching, 0.0, rng.uniform(0.0, 1e-3, pairs))
    angle = rng.uniform(0.0, 2 * np.pi, pairs)
    side = int(np.ceil(np.sqrt(pairs)))
    centre = FIELD * (1.0 + np.stack([np.arange(pairs) % side, np.arange(pairs) // side], axis=1))
    branch = (radius.sum(axis=1) + gap)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    position = np.stack([centre - 0.5 * branch, centre + 0.5 * branch], axis=1).reshape(-1, 2)
    n = 2 * pairs
    position = position + rng.normal(0.0, noise, (frames, n, 2))
    reach = FIELD * (side + 1)
    walls = np.array([[[0.0, 0.0], [reach, 0.0]], [[reach, reach], [0.0, reach]]])
    sequence = MeasuredSequence(
        radius.ravel(), position, np.zeros((frames, n)), np.ones((frames, n), bool),
        np.broadcast_to(walls, (frames, 2, 2, 2)), np.full((frames, n), noise),
    )  # fmt: skip
    return sequence, classes.ravel()


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20260211)


@pytest.mark.parametrize("error", [-1e-2, -3e-3, 3e-3, 1e-2])
@pytest.mark.parametrize("noise", [3e-6, 40e-6])
def test_pixel_size_error_of_either_sign_is_found(rng, error, noise):
    true, classes = scatter_pairs(rng, noise=noise)
    measured = replace(true, position=true.position / (1.0 + error))
    found = find_scale(measured, PRIORS, 0.0, classes)
    assert found.found
    assert abs(found.pixel_size - error) < 3 * found.pixel_size_sd
    assert found.pixel_size_sd < 2e-3
    corrected = found.correct(measured, classes)
    left = np.linalg.norm(corrected.position - true.position, axis=2) / np.linalg.norm(true.position, axis=2)
    # An error of all classes within their prior, 0.1 %, cannot be separated from the pixel size.
    assert left.max() < 2e-3


@pytest.mark.parametrize("noise", [0.0, 10e-6, 40e-6, 100e-6])
def test_exact_scale_is_not_corrected(rng, noise):
    true, classes = scatter_pairs(rng, noise=noise)
    found = find_scale(true, PRIORS, 0.0, classes)
    assert not found.found
    assert found.pixel_size == 0.0
    assert 0.0 < found.pixel_size_sd < PRIORS.pixel_size
    assert found.correct(true, classes) is true


def test_elastic_overlap_is_not_a_scale_error(rng):
    true, classes = scatter_pairs(rng)
    overlap = 5e-6
    softened = replace(true, radius=true.radius + 0.5 * overlap)
    assert not find_scale(softened, PRIORS, overlap, classes).found
    hard, soft = (scale._find_peaks(softened, classes, each) for each in (0.0, overlap))
    np.testing.assert_allclose(soft.excess - hard.excess, overlap)


@pytest.mark.parametrize("error", [-80e-6, 80e-6])
@pytest.mark.parametrize("wrong", [0, 1, 2])
def test_one_wrong_class_is_separated_from_the_pixel_size(rng, error, wrong):
    true, classes = scatter_pairs(rng)
    measured = replace(true, radius=true.radius - np.where(classes == wrong, error, 0.0))
    found = find_scale(measured, PRIORS, 0.0, classes)
    assert found.found
    expected = np.zeros(3)
    expected[wrong] = error
    np.testing.assert_allclose(found.radius_class, expected, atol=3 * FEW_MICROMETRES)
    assert abs(found.pixel_size) < found.pixel_size_sd


@pytest.mark.parametrize("follow", [True, False])
def test_walls_are_scaled_only_if_measured_with_the_same_pixel_size(rng, follow):
    true, classes = scatter_pairs(rng)
    lowest = (true.position[..., 1] - true.radius).min()
    highest = (true.position[..., 1] + true.radius).max()
    walls = true.endpoints.copy()
    walls[:, 0, :, 1], walls[:, 1, :, 1] = lowest, highest
    error = 5e-3
    measured = replace(true, position=true.position / (1.0 + error), endpoints=walls / (1.0 + error * follow))
    found = find_scale(measured, PRIORS, 0.0, classes)
    assert found.walls_follow == follow
    # The prior of the radii again: 0.1 % of 0.9 m.
    np.testing.assert_allclose(found.correct(measured, classes).endpoints, walls, atol=1e-3)


def test_without_touching_pairs_the_prior_stays(rng):
    true, classes = scatter_pairs(rng, pairs=20)
    apart = replace(true, radius=0.5 * true.radius)
    found = find_scale(apart, PRIORS, 0.0, classes)
    assert not found.found
    assert found.pixel_size_sd == PRIORS.pixel_size
    np.testing.assert_array_equal(found.radius_class, np.zeros(3))


def test_exact_quantities_are_not_corrected(rng):
    true, classes = scatter_pairs(rng)
    measured = replace(true, position=true.position / 1.005)
    assert not find_scale(measured, replace(PRIORS, pixel_size=0.0, radius_class=0.0), 0.0, classes).found
    held = find_scale(measured, replace(PRIORS, pixel_size=0.0), 0.0, classes)
    assert held.pixel_size == 0.0
    assert held.pixel_size_sd == 0.0


def test_errors_that_make_a_radius_vanish_are_not_applied(rng, monkeypatch):
    measured, classes = scatter_pairs(rng)
    errors = np.array([0.0, -RADII[0], 0.0, 0.0, 0.0])
    monkeypatch.setattr(scale, "_estimate_errors", lambda peaks, limit: (errors, np.full(5, 1e-3), 1e4))
    found = find_scale(measured, replace(PRIORS, radius_offset=1e-3), 0.0, classes)
    assert not found.found
    assert found.correct(measured, classes) is measured


@pytest.mark.parametrize("offset", [-3e-4, 3e-4])
def test_common_radius_error_is_separated_from_the_pixel_size(rng, offset):
    true, classes = scatter_pairs(rng, noise=5e-6)
    measured = replace(true, radius=true.radius - offset)
    found = find_scale(measured, replace(PRIORS, radius_offset=4e-5), 0.0, classes)
    assert found.separable
    assert abs(found.radius_offset - offset) < 3 * np.hypot(found.radius_offset_sd, FEW_MICROMETRES)
    assert abs(found.pixel_size) < 3 * found.pixel_size_sd
    assert found.correct(measured, classes).radius == pytest.approx(true.radius, abs=5e-6)


def test_rods_of_one_size_cannot_separate_them(rng):
    true, _ = scatter_pairs(rng, noise=5e-6)
    middle = true.position.reshape(4, -1, 2, 2).mean(axis=2, keepdims=True)
    away = true.position.reshape(4, -1, 2, 2) - middle
    distance = np.linalg.norm(away, axis=-1, keepdims=True)
    sum_of_radii = true.radius.reshape(-1, 2).sum(axis=1)[None, :, None, None]
    same = middle + away / distance * (distance + 8e-3 - 0.5 * sum_of_radii)  # the same gaps between rods of 8 mm
    measured = replace(true, radius=np.full_like(true.radius, 8e-3 - 3e-5), position=same.reshape(true.position.shape))
    found = find_scale(measured, replace(PRIORS, radius_offset=4e-5), 0.0, None)
    assert found.found
    assert not found.separable


def test_calibration_reports_and_applies_the_pixel_size(rng):
    true, classes = scatter_pairs(rng, noise=5e-6)
    measured = replace(true, position=true.position / 1.005)
    result = calibrate(measured, PRIORS, rng=rng, radius_class=classes)
    assert result.applied
    assert "pixel size" in result.verdict
    assert abs(result.pixel_size - 5e-3) < 3 * result.pixel_size_sd
    assert result.after.spread < 0.3 * result.before.spread
    scale = ScaleErrors(
        result.pixel_size, 0.0, np.zeros(1), np.zeros(1), walls_follow=result.walls_follow, found=True
    )  # fmt: skip
    np.testing.assert_allclose(result.correct(measured).position, scale.correct(measured, None).position)


FACTOR_PRIORS = replace(PRIORS, radius_offset=4e-5, radius_factor=2e-2, wall=2e-5)
DISC_RADIUS = 5e-3  # [m]


def touch_discs(sequence: MeasuredSequence, rng: np.random.Generator) -> MeasuredSequence:
    """Fix discs to the boundary, each touched by one grain of a pair, on the side away from the other."""
    grains = 2 * rng.choice(sequence.grain_count // 2, 4, replace=False)
    away = sequence.position[0, grains] - sequence.position[0, grains + 1]
    away *= ((DISC_RADIUS + sequence.radius[grains]) / np.linalg.norm(away, axis=1))[:, None]
    centre = sequence.position[:, grains] + away
    discs = circle_ends(centre, np.full(centre.shape[:2], DISC_RADIUS), np.zeros(centre.shape[:2]))
    return replace(
        sequence,
        endpoints=np.concatenate([sequence.endpoints, discs], axis=1),
        side=np.array([STRAIGHT, STRAIGHT, OUT, OUT, OUT, OUT], np.int8),
    )


@pytest.mark.parametrize("error", [-2e-2, 1.5e-2])
def test_discs_separate_a_factor_of_all_radii_from_the_pixel_size(rng, error):
    true, classes = scatter_pairs(rng, noise=5e-6)
    cornered = touch_discs(true, rng)
    found = find_scale(replace(cornered, radius=cornered.radius * (1.0 + error)), FACTOR_PRIORS, 0.0, classes)
    assert found.walls_decide
    assert found.pixel_size == 0.0
    assert found.radius_factor == pytest.approx(1.0 / (1.0 + error) - 1.0, abs=1e-3)

    scaled = scale_walls(cornered.endpoints, 1.0 / (1.0 + error), cornered.side)
    wrong_pixel = replace(cornered, position=cornered.position / (1.0 + error), endpoints=scaled)
    found = find_scale(wrong_pixel, FACTOR_PRIORS, 0.0, classes)
    assert found.walls_decide
    assert found.radius_factor == 0.0
    assert found.pixel_size == pytest.approx(error, abs=3e-3)  # the rest is within the priors of radii
    np.testing.assert_allclose(found.correct(wrong_pixel, classes).endpoints, cornered.endpoints, atol=3e-3)


def test_without_discs_the_wider_prior_explains_a_large_error_only(rng):
    true, classes = scatter_pairs(rng, noise=5e-6)
    large = find_scale(replace(true, radius=0.98 * true.radius), FACTOR_PRIORS, 0.0, classes)
    assert large.radius_factor == pytest.approx(1.0 / 0.98 - 1.0, abs=1e-3)
    assert not large.walls_decide
    small = find_scale(replace(true, position=true.position / 1.003), FACTOR_PRIORS, 0.0, classes)
    assert small.radius_factor == 0.0
    assert small.pixel_size == pytest.approx(3e-3, abs=1e-3)


def test_calibration_leaves_positions_where_radii_share_a_factor(rng):
    true, classes = scatter_pairs(rng, noise=5e-6)
    cornered = touch_discs(true, rng)
    measured = replace(cornered, radius=0.98 * cornered.radius)
    result = calibrate(measured, FACTOR_PRIORS, rng=rng, radius_class=classes)
    assert result.applied
    assert "factor of all radii" in result.verdict
    assert result.pixel_size == 0.0
    assert result.radius_factor == pytest.approx(1.0 / 0.98 - 1.0, abs=max(3.0 * result.radius_factor_sd, 5e-4))
    corrected = result.correct(measured)
    np.testing.assert_allclose(corrected.radius, true.radius, atol=1e-5)
    np.testing.assert_allclose(corrected.position, measured.position, atol=1e-5)
