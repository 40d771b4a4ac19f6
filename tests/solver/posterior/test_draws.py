import math

import numpy as np
import pytest
from scipy import stats

from solver.posterior.draws import draw_above, draw_between, log_normal_cdf

DRAWS = 4000
SURE = 4.5  # standard errors, of a fixed seed


@pytest.mark.parametrize("x", [-60.0, -25.0, -20.001, -19.999, -3.0, 0.0, 2.0, 5.9])
def test_the_logarithm_of_the_normal_cdf_is_right_into_its_tail(x: float) -> None:
    assert log_normal_cdf(x) == pytest.approx(stats.norm.logcdf(x), rel=1e-6)


@pytest.mark.parametrize("low", [-8.0, -0.5, 0.3, 0.6, 3.0, 12.0])
def test_draws_above_a_bound_follow_the_truncated_law(low: float) -> None:
    rng = np.random.default_rng(1)
    drawn = np.array([draw_above(rng, low) for _ in range(DRAWS)])
    law = stats.truncnorm(low, np.inf)
    assert drawn.min() >= low
    assert abs(drawn.mean() - law.mean()) < SURE * law.std() / math.sqrt(DRAWS)
    assert drawn.std() == pytest.approx(law.std(), rel=0.1)


@pytest.mark.parametrize(
    ("low", "high"),
    [(-0.4, 0.7), (-1.4, 0.05), (-3.0, 2.0), (0.2, 0.5), (1.0, 9.0), (5.0, 5.01), (-9.0, -1.0), (-1.2, -1.1)],
)
def test_draws_between_bounds_follow_the_truncated_law(low: float, high: float) -> None:
    rng = np.random.default_rng(1)
    drawn = np.array([draw_between(rng, low, high) for _ in range(DRAWS)])
    law = stats.truncnorm(low, high)
    assert low <= drawn.min()
    assert drawn.max() <= high
    assert abs(drawn.mean() - law.mean()) < SURE * law.std() / math.sqrt(DRAWS)
    assert drawn.std() == pytest.approx(law.std(), rel=0.1)
