"""Probability of bearing force: properties that hold for any constants."""

import numpy as np
import pytest
from rodsight.solver.statistics.bearing import bearing_probability


def test_probability_rises_from_zero_force_to_nearly_one():
    fn = np.array([0.0, 0.01, 0.3, 3.0, 2.0])
    found = bearing_probability(fn, np.ones(5))
    assert found[0] == 0.0
    assert np.all(np.diff(found[:4]) > 0)
    assert found[3] > 0.98
    assert found[1] < 0.6


def test_improbable_contact_with_a_weak_force_rarely_bears():
    fn = np.array([1.0, 0.05, 0.05, 0.05])
    certain, uncertain, unknown = bearing_probability(fn, np.array([1.0, 1.0, 0.05, np.nan]))[1:]
    assert uncertain < 0.1 < 0.5 < certain
    assert uncertain < unknown <= 1.0


def test_probability_does_not_depend_on_the_unit_of_force():
    fn, touch = np.array([1.0, 0.2, 0.02, 0.0]), np.array([1.0, 0.6, 0.5, 0.1])
    assert bearing_probability(1e3 * fn, touch) == pytest.approx(bearing_probability(fn, touch))
    assert not bearing_probability(np.zeros(3), np.ones(3)).any()
