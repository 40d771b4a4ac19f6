"""Forces, their assessment and statistics do not change."""

import numpy as np
import pytest

from tests.golden.forces import RODS, STORED, TOLERANCE, difference, solve_stored, stored

THEN = stored()


@pytest.fixture(scope="module")
def now():
    return solve_stored()


@pytest.mark.parametrize("name", THEN)
def test_a_column_equals_that_of_an_earlier_version(now, name):
    assert difference(now[name], THEN[name]) <= TOLERANCE


def test_the_stored_run_covers_contacts_lost_rods_and_trust(now):
    assert set(now) == set(THEN)
    assert STORED.stat().st_size < 200_000
    for estimator in ("nlgs", "ensemble"):
        fn, ft = THEN[f"{estimator}/fn"], THEN[f"{estimator}/ft"]
        assert len(fn) > 4 * RODS
        assert fn.mean() > 1.0
        assert np.count_nonzero(np.abs(ft) > 0.01 * fn.mean()) > RODS
        assert THEN[f"{estimator}/age"].max() == 3
        assert THEN[f"{estimator}/hidden_fraction"][2] > 0  # the lost rod was interpolated
        assert np.isnan(THEN[f"{estimator}/trust"][0])
        assert (THEN[f"{estimator}/trust"][1:] > 0.0).all()


def test_a_difference_is_measured():
    then = np.array([1.0, -2.0, np.nan])
    assert difference(then + np.array([0.0, 2e-6, 0.0]), then) == pytest.approx(1e-6)
    assert difference(then[:2], then) == np.inf
    assert difference(np.array([1.0, np.nan, np.nan]), then) == np.inf
