import numpy as np
import pytest

from solver.posterior.gap_series import GapNoise, GapSeries, measure_noise, smooth_series


def series_of(gap: np.ndarray) -> GapSeries:
    return GapSeries(np.arange(gap.shape[1]), gap, 10_000, 10_000)


def test_noise_and_walk_are_told_apart() -> None:
    rng = np.random.default_rng(5)
    walk = np.cumsum(rng.normal(0.0, 0.5, (12, 3000)), axis=0)
    found = measure_noise(series_of(walk + rng.normal(0.0, 1.0, walk.shape)), stated=0.3)
    assert found.noise == pytest.approx(1.0, rel=0.1)
    assert found.walk == pytest.approx(0.25, rel=0.35)
    assert found.sigma == pytest.approx(np.sqrt(0.5), rel=0.05)


def test_lively_pairs_tell_the_walk_and_quiet_ones_the_noise() -> None:
    rng = np.random.default_rng(5)
    gap = rng.normal(0.0, 1.0, (12, 3000))
    gap[:, :750] += np.cumsum(rng.normal(0.0, 8.0, (12, 750)), axis=0)
    found = measure_noise(series_of(gap), stated=0.3)
    assert 0.8 < found.noise < 2.2  # a quarter that moves adds to it, but not its 64
    assert found.walk > 10.0
    assert found.smoothing < 0.15


def test_with_two_photographs_the_stated_noise_stands() -> None:
    rng = np.random.default_rng(5)
    found = measure_noise(series_of(rng.normal(0.0, 1.0, (2, 3000))), stated=0.7)
    assert found.noise == pytest.approx(2.0 * 0.7**2)


def test_smoothing_keeps_what_stays_and_halves_what_scatters() -> None:
    rng = np.random.default_rng(5)
    gap = np.full((12, 500), 3.0)
    still, left = smooth_series(gap, GapNoise(1.0, 1e-3))
    np.testing.assert_allclose(still, 3.0)
    noisy, _ = smooth_series(rng.normal(0.0, 1.0, gap.shape), GapNoise(1.0, 1e-3))
    assert noisy[6].std() < np.sqrt(left[6, 0])
    assert left[6, 0] < left[0, 0] < 1.0


def test_gaps_that_walk_fast_stay_as_they_are() -> None:
    rng = np.random.default_rng(5)
    gap = rng.normal(0.0, 1.0, (6, 10))
    smooth, left = smooth_series(gap, GapNoise(1e-6, 1.0))
    np.testing.assert_allclose(smooth, gap, atol=1e-5)
    np.testing.assert_allclose(left, 1.0, atol=1e-5)


def test_unknown_gaps_stay_unknown_and_do_not_spread() -> None:
    gap = np.full((5, 2), 2.0)
    gap[2, 0] = np.nan
    gap[:, 1] = np.nan
    smooth, left = smooth_series(gap, GapNoise(1.0, 0.5))
    np.testing.assert_allclose(smooth[[0, 1, 3, 4], 0], 2.0)
    assert np.isnan(smooth[2, 0])
    assert np.isnan(smooth[:, 1]).all()
    assert np.isnan(left[:, 1]).all()
