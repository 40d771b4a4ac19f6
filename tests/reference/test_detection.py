"""The compiled loops of detection against the plain ones."""

import numpy as np
import pytest
from rodsight.solver.detection.touch_probability import ContactProbabilitySettings, smooth_gaps

from tests.reference.twins.touch_probability import plain_smooth

pytestmark = pytest.mark.unit

ROUNDING = 1e-9  # absolute, of a probability; the passes are normalised at different places
SCALES = np.array([60e-6, 75e-6, 20e-6, 90e-6, 75e-6, 40e-6])  # [m] per interval
OVERLAPS = (0.0, 6e-6)  # [m]


@pytest.fixture(scope="module")
def gaps():
    """Gaps (f, c) [m] of pairs that touch, open, close, stay away, jump, are lost, and their standard deviation."""
    rng = np.random.default_rng(2)
    frames = len(SCALES) + 1
    opening = np.linspace(0.0, 200e-6, frames)
    true = np.stack([
        np.zeros(frames), opening, opening[::-1], np.full(frames, 40e-6), np.full(frames, 3e-3),
        np.where(np.arange(frames) == 3, -2e-3, 5e-6), np.zeros(frames), np.full(frames, 15e-6),
    ], axis=1)  # fmt: skip
    sigma = rng.uniform(8e-6, 20e-6, true.shape)
    measured = true + sigma * rng.standard_normal(true.shape)
    measured[2:4, 6] = np.nan
    measured[0, 7] = measured[-1, 7] = np.nan
    return measured, sigma


@pytest.mark.parametrize("overlap", OVERLAPS)
def test_the_smoother_is_the_plain_one(gaps, overlap):
    measured, sigma = gaps
    found = smooth_gaps(measured, sigma, SCALES, ContactProbabilitySettings(overlap=overlap))
    touch, mean, variance = plain_smooth(measured, sigma, SCALES, overlap)
    assert found.touch == pytest.approx(touch, abs=ROUNDING)
    assert found.mean == pytest.approx(mean, abs=ROUNDING * np.abs(mean).max())
    assert found.variance == pytest.approx(variance, abs=ROUNDING * variance.max())


def test_the_gaps_reach_every_branch(gaps):
    measured, sigma = gaps
    touch, _, _ = plain_smooth(measured, sigma, SCALES, 0.0)
    widest = max(6.0 * SCALES.max(), 12.0 * np.median(sigma[np.isfinite(measured)]))
    known = np.isfinite(measured)
    assert (~known[0]).any()
    assert (~known[-1]).any()
    assert (measured[known] < -5.0 * sigma[known]).any()  # below any modelled overlap
    assert (measured[known] > widest).any()  # beyond the last state
    assert touch.max() > 0.95
    assert touch.min() < 1e-3
    assert ((touch > 0.05) & (touch < 0.95)).any()


def test_a_single_photograph_is_smoothed(gaps):
    measured, sigma = gaps
    found = smooth_gaps(measured[:1], sigma[:1], SCALES[:0], ContactProbabilitySettings())
    touch, mean, _ = plain_smooth(measured[:1], sigma[:1], SCALES[:0], 0.0)
    assert found.touch == pytest.approx(touch, abs=ROUNDING)
    assert found.mean == pytest.approx(mean, abs=ROUNDING * np.abs(mean).max())
