"""Which contacts bear force, and which slide: what the probabilities must do, whatever their constants."""

import numpy as np
import pytest

from solver.statistics.bearing import bearing_probability, cone_share, sliding_probability


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


def test_what_its_members_see_on_the_cone_slides():
    mobilised = np.array([0.2, 0.95, 0.95, 0.95])
    share = np.array([[0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    found = sliding_probability(mobilised, share)
    assert found[0] < 0.05
    assert np.all(np.diff(found) > 0)
    assert found[3] > 0.7


def test_a_chain_slides_where_its_own_force_is_on_the_cone():
    found = sliding_probability(np.array([0.1, 0.8, 1.0, 1.3]), None)
    assert found[0] < 0.05
    assert found[2] > 0.5 > found[1]
    assert found[3] == found[2]


def test_shares_are_counted_by_the_kind_of_member():
    convex = np.array([False, True, True])
    fn = np.array([[1.0, 1.0], [1.0, 0.0], [2.0, 1.0]])
    ft = np.array([[0.25, 0.1], [-0.25, 0.0], [0.1, 0.25]])
    assert cone_share(fn, ft, np.array([0.25, 0.25]), convex) == pytest.approx(np.array([[0.5, 1.0], [0.5, 0.0]]))
    assert not cone_share(fn[:1], ft[:1], np.array([0.25, 0.25]), convex[:1])[:, 0].any()
