"""Elementary functions, uniform numbers and truncated normal draws of lanes against exact ones."""

import math

import numpy as np
import pytest
from numba import njit
from rodsight.solver.posterior.sampler.lanes import LANES, draw_uniform, exponential, logarithm, seed_lanes
from rodsight.solver.posterior.sampler.truncated_normal import (
    distance_above,
    draw_above,
    mills_ratio,
    normal_of,
    scaled_log_tail,
)
from scipy import stats
from scipy.special import log_ndtr, ndtri_exp

pytestmark = pytest.mark.unit

SINGLE = np.float32


@njit
def map_exponential(x):
    return exponential(x)


@njit
def map_logarithm(x):
    return logarithm(x)


@njit
def log_tail(x):
    _, found = scaled_log_tail(x)
    return found


@njit
def distances(low, tail, log_uniform, out):
    for k in range(len(out)):
        out[k] = distance_above(low, tail, log_uniform[k])


@njit
def normals(log_uniform, out):
    for k in range(len(out)):
        out[k] = normal_of(log_uniform[k])


@njit
def one_above(low, log_uniform):
    return draw_above(low, log_uniform)


@njit
def ratio(x):
    return mills_ratio(x)


@njit
def fill(random, out):
    for first in range(0, len(out), LANES):
        draw_uniform(random, out, first)


def drawn_logarithms(count: int) -> np.ndarray:
    return np.log(np.random.default_rng(1).random(count) + 1e-7).astype(SINGLE)


@pytest.mark.parametrize("x", [-86.0, -20.3, -1.0, -1e-7, 0.0, 0.3, 0.35, 1.0, 20.0, 87.9])
def test_the_exponential_is_accurate(x: float) -> None:
    assert map_exponential(SINGLE(x)) == pytest.approx(math.exp(float(SINGLE(x))), rel=3e-7)


def test_the_exponential_stays_within_single_precision() -> None:
    assert map_exponential(SINGLE(1e9)) == map_exponential(SINGLE(88.0)) < math.inf
    assert map_exponential(SINGLE(-1e9)) == map_exponential(SINGLE(-87.0)) > 0.0


@pytest.mark.parametrize("x", [1e-30, 2.0**-25, 0.1, 0.7071, 0.7072, 0.999, 1.0, 1.001, 1.4142, 1.4143, 7.0, 1e30])
def test_the_logarithm_is_accurate(x: float) -> None:
    assert map_logarithm(SINGLE(x)) == pytest.approx(math.log(float(SINGLE(x))), rel=2e-7, abs=1e-7)


def test_compiled_uniform_numbers_are_the_plain_ones() -> None:
    one = seed_lanes(np.random.default_rng(3))
    two, found, plain = one.copy(), np.empty(4 * LANES, SINGLE), np.empty(4 * LANES, SINGLE)
    fill(one, found)
    for first in range(0, 4 * LANES, LANES):
        draw_uniform(two, plain, first)
    np.testing.assert_array_equal(found, plain)
    np.testing.assert_array_equal(one, two)


def test_a_lane_is_xoshiro_of_four_words() -> None:
    random = np.zeros(4 * LANES, np.uint32)
    random[::LANES] = 1, 2, 3, 4  # of lane 0; its first numbers are those that the authors' program prints
    found = np.empty(3 * LANES, SINGLE)
    fill(random, found)
    words = [641, 1573767, 3222811527]
    np.testing.assert_allclose(found[::LANES], [(each // 256 + 0.5) / 2**24 for each in words], rtol=1e-6)


def test_uniform_numbers_of_all_lanes_are_uniform_and_independent() -> None:
    found = np.empty(4000 * LANES, SINGLE)
    fill(seed_lanes(np.random.default_rng(0)), found)
    assert 0.0 < found.min() < found.max() < 1.0
    assert stats.kstest(found, "uniform").pvalue > 0.01
    lanes = found.reshape(-1, LANES)
    correlation = np.corrcoef(np.column_stack([lanes[:-1], lanes[1:]]).T) - np.eye(2 * LANES)
    assert np.abs(correlation).max() < 0.08


@pytest.mark.parametrize("x", [-1e3, -60.0, -20.0, -3.0, -1e-6, 0.0, 1e-6, 0.7, 2.0, 5.9, 6.1, 9.0, 30.0])
def test_the_logarithm_of_the_tail_is_accurate(x: float) -> None:
    assert log_tail(SINGLE(x)) == pytest.approx(float(log_ndtr(-float(SINGLE(x)))), rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("t", [0.0, 0.3, 2.0, 12.0, 1e4])
def test_mills_ratio_is_accurate_in_double_precision_too(t: float) -> None:
    assert ratio(t) == pytest.approx(math.exp(log_ndtr(-t) + 0.5 * t * t) * math.sqrt(2.0 * math.pi), rel=2e-7)


@pytest.mark.parametrize(
    ("low", "error"), [(-1e3, 4e-4), (-8.0, 2e-4), (-0.5, 2e-4), (0.3, 2e-4), (3.0, 2e-4), (5.9, 5e-4), (6.1, 6e-3),
                       (12.0, 1e-3), (1e3, 1e-5)]
)  # fmt: skip
def test_draws_above_a_bound_are_the_inverse_of_the_tail(low: float, error: float) -> None:
    log_uniform = drawn_logarithms(4000)
    tail, found = float(log_ndtr(-low)), np.empty(len(log_uniform), SINGLE)
    distances(SINGLE(low), SINGLE(tail), log_uniform, found)
    x = low + found.astype(float)
    assert found.min() >= 0.0
    # The logarithm of the uniform number that would lead to the draw, by which its distribution errs.
    exact = -ndtri_exp(tail + log_uniform.astype(float)) - low
    hazard = np.exp(-0.5 * x**2 - 0.5 * math.log(2.0 * math.pi) - log_ndtr(-x))
    assert np.abs((found - exact) * hazard).max() < error
    assert one_above(low, log_uniform[0]) == pytest.approx(exact[0], rel=1e-2)


def test_normal_numbers_are_the_inverse_of_the_tail() -> None:
    log_uniform = np.linspace(-17.0, -1e-6, 2000).astype(SINGLE)
    found = np.empty(len(log_uniform), SINGLE)
    normals(log_uniform, found)
    expected = -ndtri_exp(log_uniform.astype(float))
    inner = log_uniform < -1e-5
    np.testing.assert_allclose(found[inner], expected[inner], atol=1e-3)
    near = (log_uniform < -0.01) & (log_uniform > -6.0)
    np.testing.assert_allclose(found[near], expected[near], atol=2e-5)
