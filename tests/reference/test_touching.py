import numpy as np
import pytest
from rodsight.solver.posterior.touching_kernels import accumulate_gaps, compute_touch_probabilities

from tests.reference.twins.touching import densities

ROUNDING = 1e-7  # of the tail of the normal distribution, a polynomial in the kernel


@pytest.fixture
def gaps() -> tuple[np.ndarray, np.ndarray, np.ndarray, float, np.ndarray]:
    """Gaps from deep overlaps to beyond the reach, some unknown; one pair has no upper bound."""
    rng = np.random.default_rng(2)
    mean, open_range = rng.normal(0.0, 0.5, 80), rng.uniform(0.5, 20.0, 80)
    gap = rng.uniform(-6.0, 25.0, (5, 80))
    gap[:, :20] = rng.normal(0.0, 0.7, (5, 20))
    gap[1, 3] = np.nan
    return gap, mean, open_range, 0.7, rng.uniform(0.3, 0.9, 5)


def test_likelihood_and_sums_are_those_of_whole_arrays(gaps: tuple) -> None:
    gap, mean, open_range, s, fraction = gaps
    touching, opened = densities(gap, mean, open_range, s, fraction)
    in_range = gap < mean + open_range  # no density is computed beyond
    gap = np.where(in_range, gap, np.nan)
    density = np.where(in_range, touching + opened, 1.0)
    weight, rest = np.where(in_range, touching, 0.0) / density, np.where(in_range, gap - mean, 0.0)
    by_pair, by_frame = np.empty((3, 80)), np.empty(5)
    likelihood = accumulate_gaps(gap, mean, open_range, s, fraction, by_pair, by_frame)
    assert likelihood == pytest.approx(np.log(density).sum(), rel=ROUNDING)
    np.testing.assert_allclose(by_frame, weight.sum(axis=1), rtol=ROUNDING)
    expected = [np.sum(weight * rest**power, axis=0) for power in range(3)]
    np.testing.assert_allclose(by_pair, expected, rtol=1e-6, atol=ROUNDING)


def test_probabilities_are_those_of_whole_arrays_and_none_beyond_the_reach(gaps: tuple) -> None:
    gap, mean, open_range, s, fraction = gaps
    touching, opened = densities(gap, mean, open_range, s, fraction)
    with np.errstate(invalid="ignore", divide="ignore"):
        expected = np.where(gap < mean + open_range, touching / (touching + opened), 0.0)
    touch = np.empty_like(gap)
    compute_touch_probabilities(gap, mean, open_range, s, fraction, touch)
    np.testing.assert_allclose(touch, expected, atol=ROUNDING)
