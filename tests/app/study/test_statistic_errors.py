"""Statistics are compared with those of the truth."""

import numpy as np
from rodsight.solver.assessment.intervals.statistic_intervals import CONSTANT, direction_sd
from rodsight.study.scenarios.statistic_errors import (
    SHAPES,
    StatisticErrors,
    compared_names,
    fit_sd_constants,
    is_compared,
    scenario_rows,
)

from tests.app.recording.fake_results import make_results


def test_compared_statistics_are_scalars_or_distributions():
    (statistics, *_) = make_results(1, 12, 12, sweeps=2).statistics
    names = compared_names()
    assert {"sliding_fraction", "contact_count", "tail_exponent", *SHAPES} <= set(names)
    for name in names:
        assert np.ndim(getattr(statistics, name)) == (name in SHAPES), name


def test_a_scenario_is_listed_with_its_bias_and_the_coverage_of_its_interval():
    ten, none = np.full(10, 0.2), np.zeros(10, np.uint8)
    error = np.r_[np.zeros(5), np.full(4, 0.015), 0.03]
    found = [
        StatisticErrors(scenario, 2, name, ten + error, ten, np.full(10, 0.01), 0.1 * ten, none)
        for scenario in ("gravity", "soft") for name in ("sliding_fraction", "mobilisation")
    ]  # fmt: skip
    expected = ["0.2", "0.209", "+4.5 %", "0.01", "50", "90", ""]
    assert scenario_rows(found, "sliding_fraction") == [["gravity", *expected], ["soft", *expected]]


def test_magnitudes_of_forces_are_compared_only_with_a_known_scale():
    assert is_compared("shear", "pressure")
    assert not is_compared("isotropic", "pressure")
    assert is_compared("isotropic", "sliding_fraction")


def test_a_large_bias_of_a_scenario_is_marked_unless_its_interval_covers():
    ten, none = np.full(10, 0.2), np.zeros(10, np.uint8)
    for bias, width, mark in ((0.04, 0.025, "covered"), (0.04, 0.01, "far off"), (0.02, 0.001, "")):
        found = StatisticErrors("soft", 2, "sliding_fraction", ten + bias, ten, np.full(10, width), 0.1 * ten, none)
        assert scenario_rows([found], "sliding_fraction")[0][-1] == mark


def test_the_constant_of_the_direction_is_the_error_of_the_deviator():
    rng, count = np.random.default_rng(2), 4000
    constant, penalty, deviator = 0.05, rng.uniform(0.05, 0.5, count), rng.uniform(0.0, 0.4, count)
    error = constant * np.sqrt(penalty) * rng.normal(size=(2, count))
    direction = 0.5 * np.arctan2(error[1], deviator + error[0])
    zero, one = np.zeros(count), np.ones(count)
    true = {"principal_direction": zero, "friction_angle": np.arcsin(deviator)}
    found = [
        StatisticErrors("soft", 2, name, direction if name == "principal_direction" else true.get(name, one),
                        true.get(name, one), zero, penalty, np.zeros(count, np.uint8))
        for name in CONSTANT
    ]  # fmt: skip
    fitted = fit_sd_constants(found)["principal_direction"][0]
    assert abs(fitted / constant - 1.0) < 0.1
    size = np.hypot(deviator + error[0], error[1])
    sd = np.array([direction_sd(1.0 + d, 1.0 - d, s) for d, s in zip(size, fitted * np.sqrt(penalty), strict=True)])
    for widths, fraction in ((1.0, 0.68), (2.0, 0.95)):
        assert abs((np.abs(direction) < widths * sd).mean() - fraction) < 0.06
