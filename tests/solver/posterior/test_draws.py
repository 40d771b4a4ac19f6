import math

import numpy as np
import pytest
from rodsight.solver.posterior.sampler.draws import draw_above, draw_between, scaled_cdf
from scipy import stats

pytestmark = pytest.mark.unit

DRAWS = 4000
TOLERANCE = 4.5  # standard errors, with a fixed seed


@pytest.mark.parametrize("x", [-1e6, -60.0, -20.0, -3.0, -1e-9, 0.0, 1e-9, 0.7, 2.0, 5.999, 6.001, 9.0])
def test_normal_cdf_is_accurate_in_its_tail(x: float) -> None:
    exponent = -0.5 * x * x if x < 0.0 else 0.0
    level = math.log(scaled_cdf(x)) + exponent - 0.5 * math.log(2.0 * math.pi)
    assert level == pytest.approx(stats.norm.logcdf(x), rel=1e-8, abs=2e-8)


@pytest.mark.parametrize("low", [-8.0, -0.5, 0.3, 0.6, 3.0, 12.0])
def test_draws_above_a_bound_follow_the_truncated_normal(low: float) -> None:
    rng = np.random.default_rng(1)
    drawn = np.array([draw_above(rng, low) for _ in range(DRAWS)])
    law = stats.truncnorm(low, np.inf)
    assert drawn.min() >= low
    assert abs(drawn.mean() - law.mean()) < TOLERANCE * law.std() / math.sqrt(DRAWS)
    assert drawn.std() == pytest.approx(law.std(), rel=0.1)


@pytest.mark.parametrize(
    ("low", "high"),
    [
        (-0.4, 0.7),
        (-1.4, 0.05),
        (-3.0, 2.0),
        (0.2, 0.5),
        (1.0, 2.0),
        (1.0, 9.0),
        (5.0, 5.01),
        (-9.0, -1.0),
        (-1.2, -1.1),
    ],
)
def test_draws_between_bounds_follow_the_truncated_normal(low: float, high: float) -> None:
    rng = np.random.default_rng(1)
    drawn = np.array([draw_between(rng, low, high) for _ in range(DRAWS)])
    law = stats.truncnorm(low, high)
    assert low <= drawn.min()
    assert drawn.max() <= high
    assert abs(drawn.mean() - law.mean()) < TOLERANCE * law.std() / math.sqrt(DRAWS)
    assert drawn.std() == pytest.approx(law.std(), rel=0.1)
