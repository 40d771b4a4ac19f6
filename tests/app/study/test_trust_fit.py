"""Fit of the expected correlation and of its bound on frames whose law is known."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.study.fitting.additive_fit import fit_additive
from rodsight.study.fitting.bound_fit import JudgedFrames, fit_bound

FRAMES = 4000


@pytest.fixture(scope="module")
def rng():
    return np.random.default_rng(7)


def test_a_sum_of_falling_functions_is_found(rng):
    measures = {"steep": rng.uniform(0.0, 1.0, FRAMES), "flat": rng.uniform(0.0, 1.0, FRAMES)}
    target = 2.0 - 1.5 * measures["steep"] + rng.normal(0.0, 0.05, FRAMES)
    fit = fit_additive(measures, {}, tuple(measures), target, np.ones(FRAMES))
    at, value = fit.terms["steep"]
    assert np.polyfit(at, value, 1)[0] == pytest.approx(-1.5, abs=0.2)
    assert np.ptp(fit.terms["flat"][1]) < 0.05
    assert np.mean(np.abs(fit.score(measures, {}) - target)) < 0.08


def test_a_measure_that_shows_little_speaks_for_r_as_far_as_its_strength_only(rng):
    """Half of the frames have a strength of .2: where the measure is good, they gain a fifth of what the others do."""
    x = rng.uniform(-1.0, 1.0, FRAMES)
    strength = np.where(np.arange(FRAMES) % 2 == 0, 1.0, 0.2)
    target = 1.0 + np.where(x < 0.0, -strength * x, -x) + rng.normal(0.0, 0.02, FRAMES)
    fit = fit_additive({"x": x}, {"x": strength}, ("x",), target, np.ones(FRAMES))
    good = np.full(2, -0.8)
    full, weak = fit.score({"x": good}, {"x": np.array([1.0, 0.2])}) - fit.constant
    assert full == pytest.approx(0.8, abs=0.15)
    assert weak == pytest.approx(0.2 * full)
    bad = fit.score({"x": -good}, {"x": np.array([1.0, 0.2])})
    assert bad[0] == bad[1]  # evidence against r counts wholly
    fitted_alike = fit_additive({"x": x}, {}, ("x",), target, np.ones(FRAMES)).score({"x": good}, {})[0]
    assert fitted_alike - fit.constant < full - 0.1


def test_the_bound_keeps_its_limits_in_every_group(rng):
    """One group errs more than the other, and by itself would need a wider margin."""
    score = rng.uniform(0.8, 2.5, FRAMES)
    noisy = np.arange(FRAMES) % 2 == 0
    error = rng.normal(0.0, np.where(noisy, 0.3, 0.1))
    r = np.tanh(score + error)
    frames = JudgedFrames(r, score, error, np.ones(FRAMES), np.arange(FRAMES) % 6)
    bound = fit_bound(frames, [noisy, ~noisy], ((0.03, 0.03),)).bound(score)
    too_high = [np.mean(bound[group] > r[group] + 0.03) for group in (noisy, ~noisy)]
    assert 0.015 < max(too_high) <= 0.032
    assert np.mean(bound[~noisy] > r[~noisy] - 0.15) > 0.5  # not so low that it states nothing
