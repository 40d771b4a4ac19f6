"""Contacts per grain, and grains that nothing holds."""

import numpy as np
import pytest

from solver.contacts.connectivity import contacts_per_grain, coordination_number, expected_rattlers, rattlers
from solver.contacts.contacts import Contacts


def contacts(*pairs, grains=5, walls=1):
    i, j = np.array(pairs, np.int32).T
    c = len(i)
    return Contacts(i, j, np.zeros(c), np.zeros((c, 2)), np.zeros((c, 2)), grains, walls)


# A ring of 0, 1, 2 on the wall (5); 3 hangs on 2, 4 on 3.
RING = contacts((0, 1), (0, 2), (0, 5), (1, 2), (2, 3), (3, 4))
ALL, HERE = np.ones(6, bool), np.ones(5, bool)


def test_a_contact_counts_for_both_its_grains_and_a_wall_for_one():
    assert contacts_per_grain(RING, ALL).tolist() == [3, 2, 3, 2, 1]
    assert contacts_per_grain(RING, np.arange(6) != 1).tolist() == [2, 2, 2, 2, 1]


def test_what_hangs_on_a_loose_grain_is_loose_too():
    assert rattlers(RING, ALL, HERE).tolist() == [False, False, False, True, True]
    assert rattlers(RING, ALL & (np.arange(6) != 0), HERE).tolist() == [True] * 5


def test_as_many_rattle_as_are_expected_to_where_a_contact_is_doubtful():
    sure = ALL.astype(float)
    assert expected_rattlers(RING, sure, HERE) == 2.0
    doubtful = np.where(np.arange(6) == 0, 0.75, sure)  # likely enough to count alone, and all five rattle without it
    assert expected_rattlers(RING, doubtful, HERE) == 0.75 * 2 + 0.25 * 5


def test_the_coordination_number_is_the_mean_over_grains_that_are_there():
    assert coordination_number(RING, ALL, HERE) == pytest.approx(11 / 5)
    # Without 3 and 4 and what they touch: 3 + 2 + 2 over the three that are left.
    assert coordination_number(RING, ALL, HERE, without_rattlers=True) == pytest.approx(7 / 3)
    assert coordination_number(RING, ALL, np.zeros(5, bool)) == 0.0


def test_it_does_not_matter_which_of_two_grains_has_the_lower_number():
    # The same with 0 hanging on 1, 1 on the ring of 2, 3, 4.
    turned = contacts((0, 1), (1, 2), (2, 3), (2, 4), (3, 4), (4, 5))
    assert rattlers(turned, ALL, HERE).tolist() == [True, True, False, False, False]
    assert coordination_number(turned, ALL, HERE, without_rattlers=True) == pytest.approx(7 / 3)
