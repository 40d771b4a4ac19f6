"""Main effects of functions whose Sobol indices are known in closed form."""

import numpy as np
import pytest
from rodsight.robustness.indices import main_effects
from scipy.stats import qmc

SAMPLES = 128
NEAR = 0.03  # of an index, by 128 Sobol points


def points(dimensions: int) -> np.ndarray:
    return qmc.Sobol(dimensions, rng=np.random.default_rng(5)).random(SAMPLES)


def test_an_additive_function_is_divided_exactly():
    x = points(3)
    result = 7.0 + 4.0 * x[:, 0] + 6.0 * (x[:, 1] - 0.5) ** 2
    # Var(4 x) = 16/12; Var(6 (x − ½)²) = 36/180.
    parts = np.array([16 / 12, 36 / 180, 0.0])
    found = main_effects(x, result)
    assert found.index == pytest.approx(parts / parts.sum(), abs=NEAR)
    assert found.change == pytest.approx([4.0, 0.0, 0.0], abs=1e-9)  # the model holds the function itself
    assert found.explained == pytest.approx(1.0)


def test_an_interaction_is_left_unexplained():
    x = points(2)
    # y = (x₁ − ½)(x₂ − ½) has no main effects at all.
    found = main_effects(x, (x[:, 0] - 0.5) * (x[:, 1] - 0.5))
    assert found.index.max() < NEAR
    assert found.explained < 2 * NEAR


def test_noise_has_no_main_effect():
    x = points(5)
    found = main_effects(x, np.random.default_rng(0).standard_normal(SAMPLES))
    assert found.explained < 0.15  # adjusted for ten coefficients on 128 runs


def test_a_constant_result_has_no_indices():
    found = main_effects(points(2), np.full(SAMPLES, 3.0))
    assert found.index.tolist() == [0.0, 0.0]


def test_a_factor_of_two_levels_has_an_index():
    x = points(2)
    x[:, 0] = np.round(x[:, 0])
    assert main_effects(x, x[:, 0] + 0.0 * x[:, 1]).index == pytest.approx([1.0, 0.0], abs=NEAR)


def test_too_few_runs_are_refused():
    with pytest.raises(ValueError, match="too few"):
        main_effects(np.zeros((5, 2)), np.zeros(5))
