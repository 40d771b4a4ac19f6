"""Contacts per grain, coordination number and rattlers."""

import numpy as np
import pytest
from rodsight.solver.contacts.connectivity import contacts_per_grain, coordination_number, expected_rattlers, rattlers
from rodsight.solver.contacts.contacts import Contacts


def contacts(*pairs, grains=5, walls=1):
    i, j = np.array(pairs, np.int32).T
    c = len(i)
    return Contacts(i, j, np.zeros(c), np.zeros((c, 2)), np.zeros((c, 2)), grains, walls)


# A ring of 0, 1, 2 on the wall (5); 3 touches only 2 and 4, 4 only 3.
RING = contacts((0, 1), (0, 2), (0, 5), (1, 2), (2, 3), (3, 4))
ALL, PRESENT = np.ones(6, bool), np.ones(5, bool)


def test_contact_counts_for_both_its_grains_and_a_wall_for_one():
    assert contacts_per_grain(RING, ALL).tolist() == [3, 2, 3, 2, 1]
    assert contacts_per_grain(RING, np.arange(6) != 1).tolist() == [2, 2, 2, 2, 1]


def test_grain_supported_by_a_rattler_is_a_rattler():
    assert rattlers(RING, ALL, PRESENT).tolist() == [False, False, False, True, True]
    assert rattlers(RING, ALL & (np.arange(6) != 0), PRESENT).tolist() == [True] * 5


def test_expected_number_of_rattlers_is_the_mean_over_uncertain_contacts():
    certain = ALL.astype(float)
    assert expected_rattlers(RING, certain, PRESENT) == 2.0
    uncertain = np.where(np.arange(6) == 0, 0.75, certain)  # without it all five are rattlers
    assert expected_rattlers(RING, uncertain, PRESENT) == 0.75 * 2 + 0.25 * 5


def test_coordination_number_is_the_mean_over_present_grains():
    assert coordination_number(RING, ALL, PRESENT) == pytest.approx(11 / 5)
    # Without 3 and 4 and their contacts: 3 + 2 + 2 over the remaining three.
    assert coordination_number(RING, ALL, PRESENT, without_rattlers=True) == pytest.approx(7 / 3)
    assert coordination_number(RING, ALL, np.zeros(5, bool)) == 0.0


def test_rattlers_do_not_depend_on_the_numbering():
    # The same with 0 on 1, and 1 on the ring of 2, 3, 4.
    renumbered = contacts((0, 1), (1, 2), (2, 3), (2, 4), (3, 4), (4, 5))
    assert rattlers(renumbered, ALL, PRESENT).tolist() == [True, True, False, False, False]
    assert coordination_number(renumbered, ALL, PRESENT, without_rattlers=True) == pytest.approx(7 / 3)
