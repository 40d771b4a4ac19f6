import numba
import numpy as np
import pytest
from rodsight.solver.posterior.touching_gaps import MIN_FRACTION, fit_touching

REACH = 10.0
MANY_SECONDS = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="many seconds as plain Python")


def make_gaps(fraction: float, frames: int = 4, pairs: int = 1500, slope: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Make touching gaps N(−0.5, 0.7²) and open gaps uniform beyond, with one covariate of unit variance."""
    rng = np.random.default_rng(5)
    covariate = rng.normal(0.0, 1.0, (pairs, 1))
    opened = np.where(rng.random((frames, pairs)) < fraction, 0.0, rng.uniform(0.0, REACH, (frames, pairs)))
    gap = -0.5 + slope * covariate[:, 0] + opened + rng.normal(0.0, 0.7, (frames, pairs))
    return np.where(gap < REACH, gap, np.nan), covariate


@pytest.mark.parametrize("fraction", [0.5, 0.8])
def test_mean_sd_and_fraction_of_touching_gaps_are_found(fraction: float) -> None:
    gap, covariate = make_gaps(fraction, slope=0.4)
    found = fit_touching(gap, covariate, REACH, narrow_sd=0.3)
    assert found.offset == pytest.approx(-0.5, abs=0.06)
    assert found.slope[0] == pytest.approx(0.4, abs=0.06)
    assert found.sd == pytest.approx(0.7, rel=0.06)
    np.testing.assert_allclose(found.touching_fraction, fraction, atol=0.06)


@MANY_SECONDS
def test_each_frame_has_its_own_touching_fraction() -> None:
    less, covariate = make_gaps(0.5, frames=10, slope=0.4)
    more, _ = make_gaps(0.8, frames=10, slope=0.4)
    found = fit_touching(np.concatenate([less, more]), covariate, REACH, narrow_sd=0.3)
    np.testing.assert_allclose(found.touching_fraction, np.repeat([0.5, 0.8], 10), atol=0.07)
    assert found.slope[0] == pytest.approx(0.4, abs=0.04)


@MANY_SECONDS
def test_touching_fraction_has_a_lower_limit() -> None:
    gap, covariate = make_gaps(0.15)
    assert fit_touching(gap, covariate, REACH, narrow_sd=0.3).touching_fraction.min() == MIN_FRACTION


def test_touch_probability_vanishes_for_wide_and_unknown_gaps() -> None:
    gap, covariate = make_gaps(0.7)
    gap[0, :3] = -0.5, 6.0, np.nan
    touch = fit_touching(gap, covariate, REACH, narrow_sd=0.3).probability(gap, covariate, REACH)
    assert touch[0, 0] > 0.9
    assert touch[0, 1] < 1e-6
    assert touch[0, 2] == 0.0


def test_no_pair_within_reach_raises() -> None:
    with pytest.raises(ValueError, match="no pair of bodies"):
        fit_touching(np.full((2, 3), np.nan), np.zeros((3, 1)), REACH, 1.0)


def test_the_standard_error_of_the_mean_counts_the_touching_pairs_of_a_frame_once() -> None:
    gap, covariate = make_gaps(0.8, frames=12)
    found = fit_touching(gap, covariate, REACH, narrow_sd=0.3)
    assert found.offset_sd == pytest.approx(0.7 / np.sqrt(0.8 * 1500), rel=0.1)


def test_the_touching_fraction_is_that_of_the_known_gaps() -> None:
    gap, covariate = make_gaps(0.8)
    gap[:, ::3] = np.nan
    found = fit_touching(gap, covariate, REACH, narrow_sd=0.3)
    np.testing.assert_allclose(found.touching_fraction, 0.8, atol=0.06)
