"""Nominal sizes behind readings of radii, confirmed by the gaps of touching pairs."""

from __future__ import annotations

import numpy as np
import pytest
from rodsight.solver.boundary.size_classes import find_common_sizes, find_size_classes, group_readings

pytestmark = pytest.mark.unit

COUNT, NOISE = 15, 2e-5  # discs along a side; [m] of a position


def pack_rows(radius: np.ndarray, seed: int = 0) -> np.ndarray:
    """Discs in rows (2, n, 2) that touch along the rows; the rows stand too far apart to touch."""
    rows = radius.reshape(COUNT, COUNT)
    x = np.cumsum(rows, axis=1) + np.column_stack([np.zeros(COUNT), np.cumsum(rows, axis=1)[:, :-1]])
    y = 4.0 * radius.max() * np.arange(COUNT)[:, None] * np.ones(COUNT)
    place = np.stack([x, y], axis=-1).reshape(-1, 2)
    return place + NOISE * np.random.default_rng(seed).normal(size=(2, *place.shape))


def two_sizes(seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).choice([2e-3, 2.9e-3], COUNT**2)


def test_errors_of_readings_are_removed_and_sizes_stay() -> None:
    true = two_sizes()
    read = np.rint((true + 6e-5 * np.random.default_rng(2).normal(size=true.shape)) / 1e-4) * 1e-4 - 8e-5
    found = find_size_classes(pack_rows(true), read)
    assert found is not None
    assert len(found.size) == 2
    assert found.error_fraction > 0.9
    error = found.radius - true
    assert error.std() < 0.3 * (read - true).std()
    assert error.mean() == pytest.approx((read - true).mean(), abs=1e-5)  # a common error looks like overlap
    assert "2 sizes" in found.describe()


def test_sizes_that_are_alike_are_distinguished() -> None:
    rng = np.random.default_rng(6)
    true = rng.choice([7e-3, 8e-3, 11e-3], COUNT**2)
    found = find_size_classes(pack_rows(true), true * (1.0 + 0.01 * rng.normal(size=COUNT**2)))
    assert found is not None
    assert len(found.size) == 3
    assert found.error_fraction > 0.95
    assert (found.radius - true).std() < 2e-5


def test_grains_that_truly_differ_keep_their_readings() -> None:
    """Two sizes whose grains vary by 2 %, and readings that are right: no class mean replaces them."""
    true = two_sizes() * (1.0 + 0.02 * np.random.default_rng(3).uniform(-1.0, 1.0, COUNT**2))
    assert group_readings(true) is not None
    assert find_size_classes(pack_rows(true), true) is None


def test_of_errors_and_true_differences_only_the_errors_are_removed() -> None:
    rng = np.random.default_rng(4)
    true = two_sizes() + 2.5e-5 * rng.normal(size=COUNT**2).clip(-2.0, 2.0)
    read = true + 2.5e-5 * rng.normal(size=COUNT**2).clip(-2.0, 2.0)
    found = find_size_classes(pack_rows(true), read)
    assert found is not None
    assert found.error_fraction == pytest.approx(0.5, abs=0.15)
    assert (found.radius - true).std() < 0.85 * (read - true).std()


@pytest.mark.parametrize(("low", "high"), [(1.0, 10.0), (2.0, 3.0), (2.0, 2.2)])
def test_no_class_is_invented_among_uniform_sizes(low: float, high: float) -> None:
    true = 1e-3 * np.random.default_rng(5).uniform(low, high, COUNT**2)
    assert find_size_classes(pack_rows(true), true) is None


def test_exact_sizes_are_not_touched() -> None:
    true = two_sizes()
    assert find_size_classes(pack_rows(true), true) is None
    assert find_size_classes(pack_rows(true)[:, :5], true[:5]) is None  # and too few are no classes


def test_few_readings_between_sizes_belong_to_the_nearest_size() -> None:
    radius = np.concatenate([np.full(300, 4.4e-3), np.full(300, 5.5e-3), np.full(4, 4.9e-3), np.full(3, 8e-3)])
    found = group_readings(radius)
    assert found is not None
    assert np.bincount(found).tolist() == [304, 300, 3]


def test_common_sizes_leave_out_grains_of_other_sizes() -> None:
    radius = np.concatenate([np.full(150, 4.4e-3), np.full(150, 5.5e-3), np.linspace(1e-3, 3e-3, 20)])
    found = find_common_sizes(radius)
    assert found is not None
    sizes, other = found
    assert sizes == pytest.approx([4.4e-3, 5.5e-3])
    assert np.array_equal(np.flatnonzero(other), np.arange(300, 320))
    assert find_common_sizes(np.append(radius, np.linspace(1e-3, 3e-3, 20))) is None  # too many of other sizes
    assert find_common_sizes(np.repeat([1.0, 2.0, 3.0, 4.0, 5.0], 20)) is None  # and too many sizes
    assert find_common_sizes(radius[:5]) is None
