import numpy as np
import pytest
from rodsight.solver.posterior import gap_series
from rodsight.solver.posterior.gap_series import GapNoise, GapSeries, measure_gap_noise, smooth_series


def make_series(gap: np.ndarray) -> GapSeries:
    return GapSeries(np.arange(gap.shape[1]), gap, 10_000, 10_000)


def test_noise_and_walk_are_separated() -> None:
    rng = np.random.default_rng(5)
    walk = np.cumsum(rng.normal(0.0, 0.5, (12, 3000)), axis=0)
    found = measure_gap_noise(make_series(walk + rng.normal(0.0, 1.0, walk.shape)), stated=0.3)
    assert found.noise == pytest.approx(1.0, rel=0.1)
    assert found.walk == pytest.approx(0.25, rel=0.35)
    assert found.sigma == pytest.approx(np.sqrt(0.5), rel=0.05)


def test_moving_pairs_give_the_walk_and_resting_ones_the_noise() -> None:
    rng = np.random.default_rng(5)
    gap = rng.normal(0.0, 1.0, (12, 3000))
    gap[:, :750] += np.cumsum(rng.normal(0.0, 8.0, (12, 750)), axis=0)
    found = measure_gap_noise(make_series(gap), stated=0.3)
    assert 0.8 < found.noise < 2.2  # a quarter that moves adds to it, but not its 64
    assert found.walk > 10.0
    assert found.smoothing < 0.15


def test_two_photographs_leave_the_stated_noise() -> None:
    rng = np.random.default_rng(5)
    found = measure_gap_noise(make_series(rng.normal(0.0, 1.0, (2, 3000))), stated=0.7)
    assert found.noise == pytest.approx(2.0 * 0.7**2)


def test_smoothing_keeps_constant_gaps_and_reduces_noise() -> None:
    rng = np.random.default_rng(5)
    gap = np.full((12, 500), 3.0)
    smooth, fraction = smooth_series(gap, GapNoise(1.0, 1e-3))
    np.testing.assert_allclose(smooth, 3.0)
    noisy, _ = smooth_series(rng.normal(0.0, 1.0, gap.shape), GapNoise(1.0, 1e-3))
    assert noisy[6].std() < np.sqrt(fraction[6, 0])
    assert fraction[6, 0] < fraction[0, 0] < 1.0


def test_fast_walks_are_not_smoothed() -> None:
    rng = np.random.default_rng(5)
    gap = rng.normal(0.0, 1.0, (6, 10))
    smooth, fraction = smooth_series(gap, GapNoise(1e-6, 1.0))
    np.testing.assert_allclose(smooth, gap, atol=1e-5)
    np.testing.assert_allclose(fraction, 1.0, atol=1e-5)


def test_unknown_gaps_stay_unknown_and_affect_no_others() -> None:
    gap = np.full((5, 2), 2.0)
    gap[2, 0] = np.nan
    gap[:, 1] = np.nan
    smooth, fraction = smooth_series(gap, GapNoise(1.0, 0.5))
    np.testing.assert_allclose(smooth[[0, 1, 3, 4], 0], 2.0)
    assert np.isnan(smooth[2, 0])
    assert np.isnan(smooth[:, 1]).all()
    assert np.isnan(fraction[:, 1]).all()


def test_long_sequences_are_smoothed_alike(monkeypatch) -> None:
    rng = np.random.default_rng(5)
    gap = np.cumsum(rng.normal(0.0, 0.5, (60, 40)), axis=0)
    gap[:10, :10] = gap[20:50, 5:20] = gap[59, 15:30] = gap[:, 39] = np.nan
    for noise in (GapNoise(1.0, 0.5), GapNoise(1.0, 1e-3)):
        short = smooth_series(gap, noise)
        monkeypatch.setattr(gap_series, "DENSE", 0)
        for one, other in zip(short, smooth_series(gap, noise), strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-9)
        monkeypatch.undo()
