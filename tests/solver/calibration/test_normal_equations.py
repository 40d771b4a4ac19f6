"""Normal equations of gaps against dense matrices."""

import numpy as np
import pytest
from rodsight.solver.bodies.grains import Array
from rodsight.solver.calibration.derivatives import Derivatives
from rodsight.solver.calibration.normal_equations import Couplings, NormalEquations

GRAINS, SHARED, ROWS = 12, 3, 90
ROUNDING = 1e-9


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(4)


@pytest.fixture
def derivatives(rng: np.random.Generator) -> Derivatives:
    """Rows of pairs in either order of elimination, some at a wall; one has the same shared unknown twice."""
    first = rng.integers(0, GRAINS - 1, ROWS)
    second = np.minimum(first + rng.integers(1, 4, ROWS), GRAINS - 1)
    wall = rng.random(ROWS) < 0.2
    second[wall] = first[wall]
    other = np.where(wall[:, None], 0.0, rng.normal(0.0, 1.0, (ROWS, 3)))
    column, value = rng.integers(0, SHARED, (ROWS, 2)), rng.normal(0.0, 1.0, (ROWS, 2))
    column[0] = 1
    value[1:30, 0] = 0.0
    return Derivatives(first, second, rng.normal(0.0, 1.0, (ROWS, 3)), other, column, value, GRAINS, SHARED)


def full(d: Derivatives) -> Array:
    """A (m, u), column by column."""
    matrix = np.zeros((ROWS, d.unknown_count))
    for c in range(ROWS):
        for grain, part in ((d.first[c], d.own[c]), (d.second[c], d.other[c])):
            matrix[c, [2 * grain, 2 * grain + 1, 2 * GRAINS + grain]] += part
        for k, v in zip(d.column[c], d.value[c], strict=True):
            matrix[c, 3 * GRAINS + k] += v
    return matrix


def test_products_match_the_dense_matrix(derivatives: Derivatives, rng: np.random.Generator) -> None:
    x, v = rng.normal(0.0, 1.0, derivatives.unknown_count), rng.normal(0.0, 1.0, ROWS)
    np.testing.assert_allclose(derivatives.times(x), full(derivatives) @ x, atol=ROUNDING)
    np.testing.assert_allclose(derivatives.transposed_times(v), full(derivatives).T @ v, atol=ROUNDING)


@pytest.mark.parametrize("held", ["nothing", "radii", "centres and one that is shared", "all grains"])
def test_solutions_match_the_dense_equations_and_are_zero_where_held(
    derivatives: Derivatives, rng: np.random.Generator, held: str
) -> None:
    penalty, n = rng.uniform(0.5, 2.0, derivatives.unknown_count), GRAINS
    parts = {
        "radii": [slice(2 * n, 3 * n)], "all grains": [slice(0, 3 * n)],
        "centres and one that is shared": [slice(0, 2 * n), slice(3 * n + 1, 3 * n + 2)],
    }  # fmt: skip
    for part in parts.get(held, []):
        penalty[part] = np.inf
    free, precision = np.isfinite(penalty), rng.uniform(0.5, 3.0, ROWS)
    couplings = Couplings.of(n, derivatives.first, derivatives.second)
    normal = NormalEquations(derivatives.restrict_to(free), couplings, precision, penalty)
    matrix, right = full(derivatives)[:, free], rng.normal(0.0, 1.0, derivatives.unknown_count)
    expected = np.zeros(len(free))
    expected[free] = np.linalg.solve(matrix.T @ (precision[:, None] * matrix) + np.diag(penalty[free]), right[free])
    np.testing.assert_allclose(normal.solve(right), expected, atol=ROUNDING)


def test_selected_rows_keep_their_couplings(derivatives: Derivatives, rng: np.random.Generator) -> None:
    some = np.flatnonzero(rng.random(ROWS) < 0.5)
    couplings = Couplings.of(GRAINS, derivatives.first, derivatives.second)
    penalty, right = np.ones(derivatives.unknown_count), rng.normal(0.0, 1.0, derivatives.unknown_count)
    normal = NormalEquations(derivatives.select(some), couplings.select(some), np.ones(len(some)), penalty)
    matrix = full(derivatives)[some]
    expected = np.linalg.solve(matrix.T @ matrix + np.eye(len(penalty)), right)
    np.testing.assert_allclose(normal.solve(right), expected, atol=ROUNDING)
