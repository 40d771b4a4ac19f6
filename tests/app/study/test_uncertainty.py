"""Coverage of error bars: how it is counted, and (slow) that stated error bars cover the truth."""

from io import StringIO

import numpy as np
import pytest
from rich.console import Console
from rodsight.robustness.ensemble_sd import SD_WEIGHTS, combine_sd
from rodsight.study.report.uncertainty import ErrorBars, fit_sd_weights, measure_error_bars, study_uncertainty
from rodsight.study.scenarios.interval_coverage import coverage
from rodsight.study.truths import simulate


def test_coverage_of_a_normal_error_is_that_of_the_normal_law():
    error = np.random.default_rng(0).standard_normal(20_000)
    assert coverage(error, np.ones(20_000)) == pytest.approx((0.683, 0.954), abs=0.01)


def test_the_fit_recovers_the_constants_of_simulated_errors():
    rng = np.random.default_rng(1)
    n = 20_000
    ensemble_sd, formula_sd = rng.uniform(0.01, 0.5, (n, 1)), rng.uniform(0.01, 0.5, (n, 1))
    error = np.hypot(0.5 * ensemble_sd, 0.8 * formula_sd) * rng.standard_normal((n, 1))
    a, b = fit_sd_weights(ErrorBars(np.zeros(n), error, ensemble_sd, formula_sd), 0)
    assert (a, b) == pytest.approx((0.5, 0.8), rel=0.1)


@pytest.mark.slow
def test_a_study_prints_coverages_and_constants(tmp_path, monkeypatch):
    truth = simulate(0, grains=30, folder=tmp_path, reversal_angle=3.0)
    monkeypatch.setattr("rodsight.study.report.uncertainty.simulate", lambda *_, **__: truth)
    monkeypatch.setattr("rodsight.study.report.uncertainty.WINDOW", 4)
    monkeypatch.setattr("rodsight.study.report.uncertainty.available_cores", lambda: 1)
    monkeypatch.setattr("rodsight.study.report.uncertainty.NOISES", (0.0, 1e-5))
    printed = StringIO()
    fit = study_uncertainty(
        ([0], [1]), members=2, grains=30, estimator="nlgs", folder=tmp_path, console=Console(file=printed, width=150)
    )
    assert np.all(np.array(fit) >= 0.0)
    assert "packings held out" in printed.getvalue()
    assert "in use" in printed.getvalue()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("estimator", "noise"),
    [
        ("ensemble", 2e-5),
        ("ensemble", 4e-5),
        ("nlgs", 2e-5),
        ("nlgs", 4e-5),
    ],
)
def test_error_bars_of_an_ensemble_cover_the_truth(estimator, noise, tmp_path):
    truth = simulate(31, grains=250, folder=tmp_path)  # not a packing of the fit
    bars = measure_error_bars([truth], 8, estimator, noises=(noise,))
    for component, constants in enumerate(SD_WEIGHTS[estimator]):
        sigma = combine_sd(bars.ensemble_sd[:, component], bars.formula_sd[:, component], constants)
        one, two = coverage(bars.error[:, component], sigma)
        # Fitted over all noises and packings: single ones deviate by this much.
        assert 0.58 < one < 0.82, component
        assert 0.86 < two < 0.99, component
        if estimator == "nlgs" and noise > 2e-5:  # the formula of a single chain does not contain the noise
            assert coverage(bars.error[:, component], bars.formula_sd[:, component])[1] < 0.8
