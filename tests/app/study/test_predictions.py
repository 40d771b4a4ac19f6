"""Predicted accuracy is compared with the result of a test, and its constants are fitted to results."""

import io
import math
from dataclasses import replace

import pytest
from rich.console import Console
from rodsight.inference.predicted_accuracy import ACCURACY_FIT, REFERENCE_STEP, DataQuality
from rodsight.process.errors import InputError
from rodsight.study.scenarios.predictions import PredictionOutcome, fit_prediction, print_predictions
from rodsight.study.scenarios.scenario_score import ScenarioScore

GOOD = DataQuality(3, 1e-5, 1e-5, 1.2e-4, REFERENCE_STEP, 0.2, 0.1, -5e-6, 1.4e-5, 0.016)
QUALITIES = [
    replace(GOOD, noise=noise, shear=step * REFERENCE_STEP) for noise in (1e-5, 2e-5, 5e-5) for step in (1.0, 2.0, 4.0)
]


def outcome(quality: DataQuality | None, r: float | None) -> PredictionOutcome:
    return PredictionOutcome(ScenarioScore("shear", 2, "", r=(None, None, None, r)), quality)


def test_the_fit_recovers_the_constants_behind_r():
    def error(quality: DataQuality, sign: int) -> float:
        noise, step = quality.predictors
        return math.exp(-3.0 + 0.3 * noise + 0.5 * step + 0.2 * sign)

    found = fit_prediction([outcome(each, 1.0 - error(each, sign)) for each in QUALITIES for sign in (-1, 1)])
    assert (found.a, found.b, found.c) == pytest.approx((-3.0, 0.3, 0.5))
    assert found.sd == pytest.approx(0.2 * math.sqrt(18 / 15))


def test_tests_without_result_or_prediction_are_not_fitted():
    with pytest.raises(InputError, match="needs 4"):
        fit_prediction(
            [outcome(QUALITIES[0], 0.9), outcome(None, 0.9), outcome(QUALITIES[1], None), outcome(QUALITIES[2], 0.9)]
        )


def test_results_outside_the_predicted_interval_are_marked():
    r, low, high = GOOD.expected
    cases = [
        outcome(GOOD, r),
        outcome(GOOD, low - 0.01),
        outcome(GOOD, high + 1e-3),
        outcome(None, 0.5),
        outcome(GOOD, None),
    ]
    assert [each.inside for each in cases] == [True, False, False, None, None]
    printed = io.StringIO()
    print_predictions(Console(file=printed, width=200), cases)
    assert printed.getvalue().count("outside") == 2
    assert "1 of 3 are in their interval" in printed.getvalue()
    assert "no prediction" in printed.getvalue()


def test_the_constants_in_use_lower_r_for_more_noise_and_larger_steps():
    assert ACCURACY_FIT.b > 0.0
    assert ACCURACY_FIT.c > 0.0
    assert 0.1 < ACCURACY_FIT.sd < 1.0
