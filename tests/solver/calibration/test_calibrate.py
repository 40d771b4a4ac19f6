"""Self-calibration on rows of discs that slide over each other in exact contact, so that the truth is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.calibration import calibrate as module
from rodsight.solver.calibration.calibrate import calibrate
from rodsight.solver.calibration.equations import GapEquations, move_walls, rotate_offsets
from rodsight.solver.calibration.gaps import MeasuredSequence, find_gap_rows
from rodsight.solver.calibration.priors import CalibrationPriors, narrow_priors, reduce_priors
from rodsight.solver.calibration.weights import contact_width

RADIUS = 8e-3  # [m]
SPACING = 2.2 * RADIUS  # between the discs of a row: they never touch each other
ROUNDING = 1e-12  # [m]: lengths of a metre in double precision, a few operations
PRIORS = CalibrationPriors(centre=50e-6, radius=10e-6, wall=50e-6)


def slide_rows(rng: np.random.Generator, *, frames: int = 30, rows: int = 6, columns: int = 7) -> MeasuredSequence:
    """Rows of discs, each carried by the row below, sliding at its own speed; the discs rotate at random."""
    slip = rng.uniform(0.5, 1.0, rows) * SPACING / frames * rng.choice([-1.5, 1.5], rows)
    start = rng.uniform(0.0, SPACING, rows)
    column = np.arange(columns) * SPACING
    position = np.empty((frames, rows * columns, 2))
    endpoints = np.empty((frames, 2, 2, 2))
    for k in range(frames):
        shift = np.cumsum(start + slip * k)
        height = RADIUS
        for r in range(rows):
            if r > 0:
                phase = np.mod(shift[r] - shift[r - 1], SPACING)
                height += np.sqrt(4 * RADIUS**2 - min(phase, SPACING - phase) ** 2)
            # The row is shifted by whole spacings, so that the rows stay above each other.
            x = column + np.mod(shift[r], SPACING)
            position[k, r * columns : (r + 1) * columns] = np.stack([x, np.full(columns, height)], axis=1)
        left, right, top = -2 * SPACING, (columns + 3) * SPACING, height + RADIUS
        endpoints[k] = [[[left, 0.0], [right, 0.0]], [[right, top], [left, top]]]
    n = rows * columns
    rotation = np.cumsum(rng.normal(0.0, 0.3, (frames, n)), axis=0)
    sigma = np.full((frames, n), 1e-6)
    return MeasuredSequence(np.full(n, RADIUS), position, rotation, np.ones((frames, n), bool), endpoints, sigma)


def falsify(
    true: MeasuredSequence,
    *,
    offset: np.ndarray | float = 0.0,
    radius: np.ndarray | float = 0.0,
    wall: np.ndarray | float = 0.0,
    tilt: np.ndarray | float = 0.0,
) -> MeasuredSequence:
    """Make the measurement whose true corrections are these."""
    offset = np.broadcast_to(offset, (true.grain_count, 2))
    wall, tilt = np.broadcast_to(wall, true.wall_count), np.broadcast_to(tilt, true.wall_count)
    return replace(
        true,
        radius=true.radius - radius,
        position=true.position - rotate_offsets(true, offset),
        endpoints=move_walls(true.endpoints, -wall, -tilt),
    )


def add_noise(sequence: MeasuredSequence, sigma: float, rng: np.random.Generator) -> MeasuredSequence:
    position = sequence.position + rng.normal(0.0, sigma, sequence.position.shape)
    return replace(sequence, position=position, sigma=np.full_like(sequence.sigma, sigma))


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20260107)


@pytest.fixture
def true(rng: np.random.Generator) -> MeasuredSequence:
    return slide_rows(rng)


def test_sliding_rows_touch_and_never_overlap(true):
    equations = GapEquations(true)
    rows = find_gap_rows(true, 0.05 * RADIUS)
    gap = equations.measure(rows, np.zeros(equations.layout.count)).gap
    assert gap.min() > -ROUNDING
    assert np.count_nonzero(gap < ROUNDING) > 40 * true.frame_count


def test_true_corrections_restore_the_true_gaps(true, rng):
    offset, radius = rng.normal(0, 50e-6, (true.grain_count, 2)), rng.normal(0, 10e-6, true.grain_count)
    wall, tilt = np.array([40e-6, -60e-6]), np.array([-1e-3, 5e-4])
    measured = falsify(true, offset=offset, radius=radius, wall=wall, tilt=tilt)
    rows = find_gap_rows(true, 0.05 * RADIUS)
    equations = GapEquations(measured)
    layout = equations.layout
    unknowns = np.zeros(layout.count)
    unknowns[layout.offset], unknowns[layout.radius] = offset.ravel(), radius
    unknowns[layout.wall], unknowns[layout.wall_tilt] = wall, tilt
    expected = GapEquations(true).measure(rows, np.zeros(layout.count)).gap
    second_order = 1e-6  # [m] of a tilt: 1e-6 of a length that is less than a metre
    np.testing.assert_allclose(equations.measure(rows, unknowns).gap, expected, atol=second_order)


@pytest.mark.unit
def test_derivatives_match_finite_differences(true, rng):
    classes = rng.integers(0, 2, true.grain_count)
    equations = GapEquations(true, classes)
    rows = find_gap_rows(true, 0.05 * RADIUS)
    rows = rows.select(np.sort(rng.choice(rows.count, 200, replace=False)))
    unknowns = rng.normal(0.0, 50e-6, equations.layout.count)
    unknowns[equations.layout.wall_tilt] = 0.0  # a tilted wall's normal rotates: an effect of second order
    direction = rng.normal(0.0, 1.0, equations.layout.count)
    step = 1e-6  # truncation ~ step² / RADIUS, rounding ~ 1e-16 / step: both far below the tolerance
    ahead = equations.measure(rows, unknowns + step * direction).gap
    behind = equations.measure(rows, unknowns - step * direction).gap
    derivative = equations.derive(rows, equations.measure(rows, unknowns)).times(direction)
    np.testing.assert_allclose(derivative, (ahead - behind) / (2 * step), rtol=1e-6, atol=1e-6)


def test_equations_of_some_frames_measure_the_same_gaps_with_the_same_unknowns(true, rng):
    present = true.present.copy()
    present[0, :5] = False  # their angles count from another frame
    whole = GapEquations(replace(true, present=present))
    count = true.frame_count // 2
    some, k = whole.thinned(count), true.spread_frames(count)
    rows = find_gap_rows(some.sequence, 0.05 * RADIUS)
    unknowns = rng.normal(0.0, 50e-6, whole.layout.count)
    at = replace(rows, frame=k[rows.frame].astype(np.int32))
    expected = whole.measure(at, unknowns)
    found = some.measure(rows, unknowns)
    np.testing.assert_array_equal(found.gap, expected.gap)
    assert len(k) == count
    assert (k[0], k[-1]) == (0, true.frame_count - 1)
    np.testing.assert_array_equal(some.derive(rows, found).value, whole.derive(at, expected).value)
    np.testing.assert_array_equal(some.derive(rows, found).own, whole.derive(at, expected).own)


def test_contact_width_ignores_open_gaps(rng):
    touching, opened = rng.normal(0.0, 5e-6, 20_000), rng.uniform(0.0, 1e-3, 100_000) + 1e-5
    few_percent = 0.03  # of a median over 10 000 values
    assert contact_width(np.concatenate([touching, opened]), 0.0) == pytest.approx(5e-6, rel=few_percent)
    assert contact_width(touching - 4e-6, 4e-6) == pytest.approx(5e-6, rel=few_percent)
    assert contact_width(opened, 0.0) == 0.0


@pytest.mark.parametrize("noise", [0.0, 3e-6])
def test_centre_and_radius_errors_are_found(true, rng, noise):
    offset, radius = rng.normal(0, 50e-6, (true.grain_count, 2)), rng.normal(0, 10e-6, true.grain_count)
    measured = add_noise(falsify(true, offset=offset, radius=radius), noise, rng)
    result = calibrate(measured, PRIORS, rng=rng)
    assert result.applied
    assert rms(result.offset - offset) < 0.25 * rms(offset)
    assert rms(result.radius - radius) < rms(radius)
    # Without noise one wrong contact exceeds standard deviations of nanometres.
    calibrated = (0.3, 1.5) if noise else (0.0, np.inf)  # true errors over standard deviations
    assert calibrated[0] < rms((result.offset - offset) / result.offset_sd) < calibrated[1]
    assert result.after.width < 0.2 * result.before.width


def test_corrected_sequence_has_narrow_gaps(true, rng):
    measured = falsify(true, offset=rng.normal(0, 50e-6, (true.grain_count, 2)), wall=np.array([80e-6, -80e-6]))
    corrected = calibrate(measured, PRIORS, rng=rng).correct(measured)
    touching = find_gap_rows(true, ROUNDING)
    for sequence, least, most in ((measured, 40e-6, 150e-6), (corrected, 0.0, 5e-6)):
        equations = GapEquations(sequence)
        gap_rms = rms(equations.measure(touching, np.zeros(equations.layout.count)).gap)
        assert least < gap_rms < most
    np.testing.assert_array_equal(corrected.rotation, measured.rotation)


@pytest.mark.parametrize("noise", [0.0, 10e-6])
@pytest.mark.parametrize("priors", [None, PRIORS])
def test_exact_input_is_not_corrected(true, rng, noise, priors):
    measured = add_noise(true, noise, rng)
    result = calibrate(measured, priors, rng=rng)
    assert not result.applied
    assert result.verdict.startswith("not applied")
    np.testing.assert_array_equal(result.correct(measured).position, measured.position)
    np.testing.assert_array_equal(result.correct(measured).radius, measured.radius)


def test_elastic_overlaps_are_not_corrected(true, rng):
    softened = replace(true, radius=true.radius + 2.5e-6)  # every contact overlaps by 5 µm
    result = calibrate(add_noise(softened, 3e-6, rng), PRIORS, rng=rng, typical_overlap=5e-6)
    assert not result.applied


def test_shifted_wall_is_found_and_named(true, rng):
    wall = np.array([60e-6, -45e-6])
    result = calibrate(add_noise(falsify(true, wall=wall), 3e-6, rng), PRIORS, rng=rng)
    assert result.applied
    assert "walls" in result.verdict
    np.testing.assert_allclose(result.wall, wall, atol=4e-6)  # noise over 7 grains × 30 frames, robustly weighted
    assert rms(result.offset) < 1e-6  # centres were exact and stay so


def test_rotated_wall_is_found_and_named(true, rng):
    tilt = np.array([1e-3, -2e-4])
    measured = add_noise(falsify(true, tilt=tilt, wall=np.array([0.0, 30e-6])), 3e-6, rng)
    result = calibrate(measured, replace(PRIORS, wall_tilt=5e-4), rng=rng)
    assert result.applied
    assert "directions of walls" in result.verdict
    # 4 µm, as for a shifted wall, over half of the 0.12 m that the grains take up
    np.testing.assert_allclose(result.wall_tilt, tilt, atol=7e-5)
    np.testing.assert_allclose(result.wall, [0.0, 30e-6], atol=8e-6)
    ends = result.correct(measured).endpoints
    beside = 20e-6  # [m] at the ends, which lie as far again beyond the grains
    np.testing.assert_allclose(ends, true.endpoints, atol=beside)


def test_without_a_prior_walls_are_not_rotated(true, rng):
    result = calibrate(falsify(true, wall=60e-6), PRIORS, rng=rng)
    np.testing.assert_array_equal(result.wall_tilt, [0.0, 0.0])
    np.testing.assert_array_equal(result.wall_tilt_sd, [0.0, 0.0])


def test_radius_error_of_a_class_is_found(true, rng):
    classes = np.arange(true.grain_count) % 2
    error = np.where(classes == 0, 30e-6, -20e-6)
    priors = CalibrationPriors(centre=1e-6, radius=1e-6, radius_class=50e-6)
    result = calibrate(falsify(true, radius=error), priors, rng=rng, radius_class=classes)
    np.testing.assert_allclose(result.radius, error, atol=5e-6)
    assert "radius classes" in result.verdict


def test_lost_grains_are_ignored(true, rng):
    offset = rng.normal(0, 50e-6, (true.grain_count, 2))
    measured = falsify(true, offset=offset)
    present = rng.random(measured.present.shape) > 0.1
    present[0] = True  # offsets are named in the body frame of frame 0
    present[:, 3] = False  # never seen
    position = np.where(present[..., None], measured.position, np.nan)
    rotation = np.where(present, measured.rotation, np.nan)
    sigma = np.where(present, measured.sigma, np.nan)
    lossy = replace(measured, position=position, rotation=rotation, sigma=sigma, present=present)
    result = calibrate(lossy, PRIORS, rng=rng)
    seen = np.arange(true.grain_count) != 3
    assert rms((result.offset - offset)[seen]) < 0.3 * rms(offset)
    np.testing.assert_array_equal(result.offset[3], [0.0, 0.0])
    np.testing.assert_allclose(result.offset_sd[3], result.priors.centre, rtol=0.3)


def test_one_photograph_leaves_most_to_the_prior(rng):
    true = slide_rows(rng, frames=1)
    offset = rng.normal(0, 50e-6, (true.grain_count, 2))
    result = calibrate(falsify(true, offset=offset), PRIORS, rng=rng)
    assert rms(result.offset - offset) < rms(offset)
    assert np.median(result.offset_sd) > 0.4 * result.priors.centre
    assert np.all(result.offset_sd <= result.priors.centre)


def test_corrections_beyond_the_prior_are_reported(true, rng):
    measured = falsify(true, offset=rng.normal(0, 100e-6, (true.grain_count, 2)))
    result = calibrate(measured, replace(PRIORS, centre=10e-6), rng=rng)
    assert "wider than the prior" in result.verdict
    assert "wider than the prior" not in calibrate(measured, replace(PRIORS, centre=100e-6), rng=rng).verdict


def test_offsets_rotate_with_the_frame_of_reference(true, rng):
    offset = rng.normal(0, 50e-6, (true.grain_count, 2))
    measured = falsify(true, offset=offset)
    rotation = np.array([[0.6, -0.8], [0.8, 0.6]])
    rotated = replace(measured, position=measured.position @ rotation.T, endpoints=measured.endpoints @ rotation.T)
    one = calibrate(measured, PRIORS, rng=np.random.default_rng(1))
    two = calibrate(rotated, PRIORS, rng=np.random.default_rng(1))
    # The priors follow from random draws that do not rotate.
    np.testing.assert_allclose(two.offset, one.offset @ rotation.T, atol=3e-6)


def test_same_generator_gives_the_same_bits(true, rng):
    measured = falsify(true, offset=rng.normal(0, 50e-6, (true.grain_count, 2)))
    one, two = (calibrate(measured, rng=np.random.default_rng(5)) for _ in range(2))
    np.testing.assert_array_equal(one.offset, two.offset)
    np.testing.assert_array_equal(one.offset_sd, two.offset_sd)


def test_grains_without_neighbours_are_not_corrected(rng):
    grid = np.stack(np.meshgrid(np.arange(3.0), np.arange(3.0)), axis=-1).reshape(-1, 2)
    shape = (2, 9)
    sequence = MeasuredSequence(
        np.full(9, 0.1), np.broadcast_to(grid, (2, 9, 2)), np.zeros(shape), np.ones(shape, bool),
        np.zeros((2, 0, 2, 2)), np.full(shape, 1e-5),
    )  # fmt: skip
    for priors in (None, PRIORS, CalibrationPriors(0.0, 0.0)):
        result = calibrate(sequence, priors, rng=rng)
        assert not result.applied
        np.testing.assert_array_equal(result.offset, np.zeros((9, 2)))


def test_invalid_input_is_rejected(true, rng):
    with pytest.raises(ValueError, match="negative"):
        CalibrationPriors(-1e-6, 0.0)
    with pytest.raises(ValueError, match="not a number"):
        CalibrationPriors(float("nan"), 0.0)
    with pytest.raises(ValueError, match="typical_overlap"):
        calibrate(true, rng=rng, typical_overlap=-1e-6)
    with pytest.raises(ValueError, match="rotation of a present grain"):
        replace(true, rotation=np.full_like(true.rotation, np.nan))
    with pytest.raises(ValueError, match="radius_class"):
        calibrate(true, PRIORS, rng=rng, radius_class=np.zeros(3, int))


def test_wrong_tracks_do_not_affect_the_others(true, rng):
    offset = rng.normal(0, 50e-6, (true.grain_count, 2))
    measured = add_noise(falsify(true, offset=offset), 3e-6, rng)
    wrong = rng.random(measured.present.shape) < 0.01
    displaced = measured.position + np.where(wrong[..., None], rng.normal(0, 500e-6, measured.position.shape), 0.0)
    result = calibrate(replace(measured, position=displaced), PRIORS, rng=rng)
    assert rms(result.offset - offset) < 0.3 * rms(offset)
    assert result.after.impossible > 0.0


def test_understated_noise_is_reported(true, rng, monkeypatch):
    offset = rng.normal(0, 50e-6, (true.grain_count, 2))
    measured = add_noise(falsify(true, offset=offset), 10e-6, rng)
    understated = replace(measured, sigma=measured.sigma / 4)
    used, once = [], module._calibrate

    def record(sequence, *rest):
        used.append(float(sequence.sigma.mean()))
        return once(sequence, *rest)

    monkeypatch.setattr(module, "_calibrate", record)
    result = calibrate(understated, PRIORS, rng=rng)
    assert 2.0 < result.noise_factor < 5.0
    assert used[1] / used[0] == pytest.approx(result.noise_factor, rel=0.3)  # repeated with the measured noise
    assert "times the stated noise" in result.verdict
    stated = calibrate(measured, PRIORS, rng=rng)
    assert stated.noise_factor < 1.2
    assert "times the stated noise" not in stated.verdict


def test_priors_are_narrowed_to_the_width_of_the_overlaps(true, rng):
    measured = falsify(true, offset=rng.normal(0, 20e-6, (true.grain_count, 2)))
    wide = replace(PRIORS, centre=200e-6, radius=0.0)
    narrow, ratio = narrow_priors(GapEquations(measured), wide, 0.0)
    assert ratio < 0.5
    assert narrow.centre == pytest.approx(ratio * wide.centre)
    assert narrow_priors(GapEquations(measured), replace(wide, centre=1e-6), 0.0)[0].centre == 1e-6  # a limit


def test_reduced_priors_count_the_estimate_and_its_error(true):
    equations = GapEquations(true)
    unknowns, draws = np.zeros(equations.layout.count), np.zeros((4, equations.layout.count))
    unknowns[equations.layout.offset], draws[:, equations.layout.offset] = 3e-6, 4e-6
    draws[:, equations.layout.radius] = 1.0
    found = reduce_priors(replace(PRIORS, centre=1e-3, radius=7e-6), equations, unknowns, draws)
    assert found.centre == pytest.approx(5e-6)
    assert found.radius == 7e-6  # the limit


def test_a_centre_that_is_less_certain_may_err_by_more(rng):
    true = slide_rows(rng)
    offset = rng.normal(0.0, 10e-6, (true.grain_count, 2))
    offset[10] = 400e-6, -300e-6
    measured = add_noise(falsify(true, offset=offset), 2e-6, rng)
    spread = np.ones(true.grain_count)
    spread[10] = 40.0
    alike, apart = (
        calibrate(each, PRIORS, rng=np.random.default_rng(1)).offset - offset
        for each in (measured, replace(measured, centre_spread=spread))
    )
    assert np.abs(apart[10]).max() < 30e-6 < np.abs(alike[10]).max()
    others = np.arange(true.grain_count) != 10
    assert rms(apart[others]) < 6e-6


def test_an_expected_spread_is_positive_and_of_every_grain(rng):
    true = slide_rows(rng, frames=2)
    for wrong in (np.ones(3), np.zeros(true.grain_count)):
        with pytest.raises(ValueError, match="centre_spread"):
            replace(true, centre_spread=wrong)
