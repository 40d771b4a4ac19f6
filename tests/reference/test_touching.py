import numpy as np
import pytest

from solver.posterior.touching_kernels import add_gaps, weigh_gaps
from tests.reference.twins.touching import densities

ROUNDING = 1e-7  # of the tail of the normal law, which the kernel has from a polynomial


@pytest.fixture
def gaps() -> tuple[np.ndarray, np.ndarray, np.ndarray, float, np.ndarray]:
    """Gaps from deep overlaps to beyond the reach, some unknown; one pair has no room."""
    rng = np.random.default_rng(2)
    mean, room = rng.normal(0.0, 0.5, 80), rng.uniform(0.5, 20.0, 80)
    gap = rng.uniform(-6.0, 25.0, (5, 80))
    gap[:, :20] = rng.normal(0.0, 0.7, (5, 20))
    gap[1, 3] = np.nan
    return gap, mean, room, 0.7, rng.uniform(0.3, 0.9, 5)


def test_likelihood_and_sums_are_those_of_whole_arrays(gaps: tuple) -> None:
    gap, mean, room, s, share = gaps
    touching, opened = densities(gap, mean, room, s, share)
    near = gap < mean + room  # beyond it nothing is asked
    gap = np.where(near, gap, np.nan)
    density = np.where(near, touching + opened, 1.0)
    weight, rest = np.where(near, touching, 0.0) / density, np.where(near, gap - mean, 0.0)
    by_pair, by_frame = np.empty((3, 80)), np.empty(5)
    likelihood = add_gaps(gap, mean, room, s, share, by_pair, by_frame)
    assert likelihood == pytest.approx(np.log(density).sum(), rel=ROUNDING)
    np.testing.assert_allclose(by_frame, weight.sum(axis=1), rtol=ROUNDING)
    expected = [np.sum(weight * rest**power, axis=0) for power in range(3)]
    np.testing.assert_allclose(by_pair, expected, rtol=1e-6, atol=ROUNDING)


def test_probabilities_are_those_of_whole_arrays_and_none_beyond_the_reach(gaps: tuple) -> None:
    gap, mean, room, s, share = gaps
    touching, opened = densities(gap, mean, room, s, share)
    with np.errstate(invalid="ignore", divide="ignore"):
        expected = np.where(gap < mean + room, touching / (touching + opened), 0.0)
    touch = np.empty_like(gap)
    weigh_gaps(gap, mean, room, s, share, touch)
    np.testing.assert_allclose(touch, expected, atol=ROUNDING)
