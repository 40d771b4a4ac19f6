"""Error bars counted against the truth: the counting itself, and (slow) that they cover what they promise."""

from io import StringIO

import numpy as np
import pytest
from rich.console import Console
from rodsight.sensitivity.spread import DEVIATION, deviation
from rodsight.study.report.uncertainty import ErrorBars, coverage, fit_deviation, measure_error_bars, study_uncertainty
from rodsight.study.truths import simulate


def test_coverage_of_a_normal_error_is_that_of_the_normal_law():
    error = np.random.default_rng(0).standard_normal(20_000)
    assert coverage(error, np.ones(20_000)) == pytest.approx((0.683, 0.954), abs=0.01)


def test_the_fit_finds_how_the_errors_were_made():
    rng = np.random.default_rng(1)
    n = 20_000
    spread, free = rng.uniform(0.01, 0.5, (n, 1)), rng.uniform(0.01, 0.5, (n, 1))
    error = np.hypot(0.5 * spread, 0.8 * free) * rng.standard_normal((n, 1))
    a, b = fit_deviation(ErrorBars(np.zeros(n), error, spread, free), 0)
    assert (a, b) == pytest.approx((0.5, 0.8), rel=0.1)


def test_a_study_prints_coverages_and_constants(tmp_path, monkeypatch):
    truth = simulate(0, grains=30, folder=tmp_path, turn=3.0)
    monkeypatch.setattr("rodsight.study.report.uncertainty.simulate", lambda *_, **__: truth)
    monkeypatch.setattr("rodsight.study.report.uncertainty.WINDOW", 4)
    monkeypatch.setattr("rodsight.study.report.uncertainty.available_cores", lambda: 1)
    monkeypatch.setattr("rodsight.study.report.uncertainty.NOISES", (1e-5,))
    told = StringIO()
    fit = study_uncertainty(
        [0], [1], members=2, grains=30, estimator="nlgs", folder=tmp_path, console=Console(file=told, width=150)
    )
    assert np.all(np.array(fit) >= 0.0)
    assert "packings held out" in told.getvalue()
    assert "in use" in told.getvalue()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("estimator", "noise"),
    [
        ("ensemble", 2e-5),
        pytest.param(
            "ensemble", 4e-5, marks=pytest.mark.xfail(reason="too narrow by a fifth at so much noise, as docs say")
        ),
        ("nlgs", 2e-5),
        ("nlgs", 4e-5),
    ],
)
def test_error_bars_of_an_ensemble_cover_the_truth(estimator, noise, tmp_path):
    truth = simulate(31, grains=250, folder=tmp_path)  # no packing of the fit
    bars = measure_error_bars([truth], 8, estimator, noises=(noise,))
    for component, constants in enumerate(DEVIATION[estimator]):
        sigma = deviation(bars.spread[:, component], bars.free[:, component], constants)
        one, two = coverage(bars.error[:, component], sigma)
        # Fitted over noises and packings together: one of them may be off by so much.
        assert 0.58 < one < 0.82, component
        assert 0.86 < two < 0.99, component
        if estimator == "nlgs" and noise > 2e-5:  # the free formula of a single chain does not know the noise
            assert coverage(bars.error[:, component], bars.free[:, component])[1] < 0.8
