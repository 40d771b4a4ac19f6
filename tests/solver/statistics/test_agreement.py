"""Agreement of two force networks; absent contacts have zero force."""

import numpy as np
import pytest
from rodsight.solver.contacts.pairs import align
from rodsight.solver.statistics.agreement import compare_forces, pearson, ranks, relative_change
from scipy.stats import rankdata

TRUE_KEY, TRUE = np.array([1, 4, 6, 9]), np.array([[3.0, 0.5], [1.0, -0.2], [0.0, 0.0], [2.0, 0.0]])
KEY, FORCE = np.array([1, 5, 9]), np.array([[2.0, 0.5], [1.0, 0.3], [2.5, 0.1]])


def test_agreement_is_over_the_union_of_contacts():
    found = compare_forces(KEY, FORCE, TRUE_KEY, TRUE)
    _, inferred, true = align(KEY, FORCE, TRUE_KEY, TRUE)
    assert found.r_fn == pytest.approx(np.corrcoef(inferred[:, 0], true[:, 0])[0, 1])
    assert found.r_ft == pytest.approx(np.corrcoef(inferred[:, 1], true[:, 1])[0, 1])
    assert found.relative_l2 == pytest.approx(np.linalg.norm(inferred - true) / np.linalg.norm(true))
    assert found.scale == pytest.approx(5.5 / 6.0)
    assert found.contact_precision == pytest.approx(2 / 3)  # 1 and 9 of the three listed
    assert found.contact_recall == pytest.approx(2 / 3)  # 1 and 9 of the three that bear: 6 does not


def test_precision_is_over_listed_and_recall_over_bearing_contacts():
    found = compare_forces(np.array([1]), np.array([[1.0, 0.0]]), TRUE_KEY, TRUE)
    assert (found.contact_precision, found.contact_recall) == (1.0, pytest.approx(1 / 3))


def test_relative_change_is_relative_to_the_first():
    assert relative_change(KEY, FORCE, KEY, 1.5 * FORCE) == pytest.approx(0.5)
    assert relative_change(KEY, FORCE, KEY, 0.0 * FORCE) == 1.0
    assert relative_change(KEY, 0.0 * FORCE, KEY, FORCE) == 0.0


def test_constant_values_have_no_correlation():
    assert np.isnan(pearson(np.ones(3), np.arange(3.0)))
    assert np.isnan(pearson(np.ones(1), np.ones(1)))
    assert pearson(np.arange(3.0), -np.arange(3.0)) == pytest.approx(-1.0)


def test_ranks_are_those_of_scipy():
    rng = np.random.default_rng(5)
    for values in (rng.random(50), rng.integers(0, 7, 60).astype(float), np.zeros(4), np.empty(0)):
        assert np.array_equal(ranks(values), rankdata(values))
