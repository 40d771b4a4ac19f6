"""Statistics are compared with those of the truth."""

import numpy as np
from rodsight.study.scenarios.statistic_errors import (
    SHAPES,
    StatisticErrors,
    compared_names,
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
