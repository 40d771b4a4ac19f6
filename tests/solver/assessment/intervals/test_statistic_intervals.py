"""Standard deviations of statistics: they follow the trust, and the value where they are relative."""

from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.assessment.intervals.statistic_intervals import (
    CONSTANT,
    SIZED,
    direction_sd,
    widen_for_friction,
    with_sd,
)
from rodsight.solver.quantity import quantities
from rodsight.solver.statistics.frame_statistics import FrameStatistics

from tests.app.recording.fake_results import make_results


@pytest.fixture(scope="module")
def run():
    return make_results(2, 8, 7, sweeps=2)


def statistics_with_sd(run, trust, position_weight=0.0, **options):
    frame = replace(run.frames[1], trust=trust, position_weight=position_weight)
    return with_sd(run.statistics[1], frame, **({"scale_is_known": True, "moved": True} | options))


def test_every_constant_has_a_field_and_its_unit():
    fields = {each.name: each.quantity for each in quantities(FrameStatistics)}
    for name in CONSTANT:
        assert fields[f"{name}_sd"].unit == fields[name].unit


def test_standard_deviations_increase_with_the_root_of_the_penalty(run):
    sure, penalised = statistics_with_sd(run, 0.9), statistics_with_sd(run, 0.6)
    for name in set(CONSTANT) - {"principal_direction"}:  # whose standard deviation is bounded
        ratio = getattr(penalised, f"{name}_sd") / getattr(sure, f"{name}_sd")
        assert ratio == pytest.approx(2.0), name
    assert sure.pressure_sd == pytest.approx(CONSTANT["pressure"][0] * sure.pressure * np.sqrt(0.1))
    assert sure.friction_angle_sd == pytest.approx(CONSTANT["friction_angle"][0] * np.sqrt(0.1))


def test_angles_from_positions_alone_have_larger_standard_deviations(run):
    assert (
        statistics_with_sd(run, 0.9, position_weight=1.0).friction_angle_sd
        > 5 * statistics_with_sd(run, 0.9).friction_angle_sd
    )


def test_unknown_scale_or_trust_gives_no_standard_deviation(run):
    unsized = statistics_with_sd(run, 0.9, scale_is_known=False)
    assert all(np.isnan(getattr(unsized, f"{name}_sd")) == (name in SIZED) for name in CONSTANT)
    for unknown in (statistics_with_sd(run, np.nan), statistics_with_sd(run, 0.9, moved=False)):
        assert np.isnan(unknown.friction_angle_sd)


def test_standard_deviations_have_their_fitted_values(run):
    sure = statistics_with_sd(run, 0.9)
    assert sure.pressure_sd == pytest.approx(0.097 * sure.pressure * np.sqrt(0.1))
    mixed, positions = (statistics_with_sd(run, 0.9, position_weight=weight) for weight in (0.5, 1.0))
    assert mixed.mean_fn_sd == pytest.approx(0.24 * sure.mean_fn * np.sqrt(0.1))
    assert positions.fabric_anisotropy_sd == pytest.approx(0.066 * np.sqrt(0.1))
    assert statistics_with_sd(run, 0.999).friction_angle_sd == pytest.approx(0.032 * np.sqrt(0.03))


def test_a_wrong_friction_adds_its_error_to_every_statistic_that_depends_on_it(run):
    before = statistics_with_sd(run, 0.9)
    after = widen_for_friction(before, 0.26, 0.2)
    step = np.log(1.3)
    assert after.mean_fn_sd == pytest.approx(np.hypot(before.mean_fn_sd, 0.23 * step * before.mean_fn))
    assert after.friction_angle_sd == pytest.approx(np.hypot(before.friction_angle_sd, 0.14 * step))
    assert after.rattler_count_sd == before.rattler_count_sd


def test_the_direction_is_known_as_well_as_the_deviator(run):
    stated = run.statistics[1]
    deviator = (stated.sigma_1 - stated.sigma_2) / (stated.sigma_1 + stated.sigma_2)
    weak = replace(stated, sigma_1=1.001 * stated.sigma_2)
    frame = replace(run.frames[1], trust=0.9, position_weight=0.5)
    sd = with_sd(stated, frame, scale_is_known=False, moved=True).principal_direction_sd
    assert sd == pytest.approx(0.5 * 0.072 * np.sqrt(0.1) / deviator, rel=0.02)
    assert with_sd(weak, frame, scale_is_known=False, moved=True).principal_direction_sd > 0.85


@pytest.mark.parametrize("ratio", [0.0, 0.5, 1.0, 2.0, 5.0])
def test_the_standard_deviation_of_a_direction_is_that_of_deviators_with_errors(ratio):
    error = 0.03 * np.random.default_rng(1).normal(size=(2, 20_000))
    angle = 0.5 * np.arctan2(error[1], ratio * 0.03 + error[0])
    rms = float(np.sqrt(np.mean(angle**2)))
    assert direction_sd(1.0 + ratio * 0.03, 1.0 - ratio * 0.03, 0.03) == pytest.approx(rms, rel=0.25)


def test_without_any_stress_no_direction_is_known():
    assert direction_sd(0.0, 0.0, 0.1) == pytest.approx(np.pi / np.sqrt(12.0))
