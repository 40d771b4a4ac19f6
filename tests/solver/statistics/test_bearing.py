"""Which contacts bear force: what the probability must do, whatever its constants."""

import numpy as np
import pytest

from solver.statistics.bearing import bearing_probability


def test_what_has_no_force_bears_none_and_what_has_much_surely_does():
    fn = np.array([0.0, 0.01, 0.3, 3.0, 2.0])
    found = bearing_probability(fn, np.ones(5))
    assert found[0] == 0.0
    assert np.all(np.diff(found[:4]) > 0)
    assert found[3] > 0.98
    assert found[1] < 0.6


def test_a_pair_that_hardly_touches_bears_a_faint_force_hardly_ever():
    fn = np.array([1.0, 0.05, 0.05, 0.05])
    sure, doubtful, unknown = bearing_probability(fn, np.array([1.0, 1.0, 0.05, np.nan]))[1:]
    assert doubtful < 0.1 < 0.5 < sure
    assert doubtful < unknown <= 1.0


def test_the_probability_of_bearing_does_not_care_for_the_unit_of_force():
    fn, touch = np.array([1.0, 0.2, 0.02, 0.0]), np.array([1.0, 0.6, 0.5, 0.1])
    assert bearing_probability(1e3 * fn, touch) == pytest.approx(bearing_probability(fn, touch))
    assert not bearing_probability(np.zeros(3), np.ones(3)).any()
