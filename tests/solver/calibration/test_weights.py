"""Weights of gaps, their bias, and the standard deviation of touching gaps."""

import numpy as np
import pytest
from rodsight.solver.calibration.weights import FINAL_SCALE, contact_width, weigh_gaps, weighting_bias
from scipy.integrate import quad
from scipy.stats import norm


def test_open_gaps_lose_weight_and_only_impossible_overlaps_do():
    assert weigh_gaps(np.array([0.0, 1.0, 2.0])) == pytest.approx([1.0, 0.25, 0.04])
    assert weigh_gaps(np.array([-0.5, -2.0, -4.0, -8.0])) == pytest.approx([1.0, 1.0, 0.25, 0.0625])


def test_open_gaps_do_not_widen_the_touching_ones():
    rng, overlap = np.random.default_rng(1), 3e-6
    touching = rng.normal(-overlap, 1e-5, 20_000)
    gap = np.concatenate([touching, rng.uniform(0.0, 1e-3, 50_000)])
    assert contact_width(gap, overlap) == pytest.approx(1e-5, rel=0.03)
    assert contact_width(np.array([1e-5, 2e-5]), overlap) == 0.0


@pytest.mark.parametrize("ratio", [0.1, 0.25, 0.5])
def test_the_bias_is_that_of_a_weighted_mean_of_noisy_gaps(ratio):
    s = 4e-5
    sigma = ratio * s / FINAL_SCALE * 2.0

    def weighted(power: int) -> float:
        return quad(lambda x: x**power * float(weigh_gaps(np.array([sigma * x / s]))[0]) * norm.pdf(x), -8, 8)[0]

    expected = -sigma * weighted(1) / weighted(0)
    assert expected > 0.0
    assert weighting_bias(np.array([s]), np.array([sigma])) == pytest.approx([expected], rel=0.01)
