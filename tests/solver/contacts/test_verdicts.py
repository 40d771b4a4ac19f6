"""What people said of a frame changes which pairs count, and says so."""

import numpy as np
import pytest

from solver.contacts.contacts import ContactSource, detect_contacts
from solver.contacts.verdicts import NO_VERDICTS, Verdicts, apply_verdicts, find_ignored, sources
from tests.packings import box, motion, rods

GRAINS = rods(0.01, 0.01, 0.01, 0.01)
PLACE = motion(np.array([[0.02, 0.05], [0.04, 0.05], [0.06, 0.05], [0.09, 0.05]])).position
HERE = np.ones(4, bool)
WALLS = box(0.2, 0.1)
BODIES = 8
NEAR = [0 * BODIES + 1, 1 * BODIES + 2]
FAR = 2 * BODIES + 3


def keys(*key):
    return np.array(key, np.int64)


def changed(verdicts, present=HERE):
    contacts = detect_contacts(GRAINS, PLACE, HERE, WALLS, 1e-6)
    assert contacts.key.tolist() == NEAR
    return apply_verdicts(contacts, verdicts, GRAINS, PLACE, present, WALLS)


def test_forced_pairs_come_in_and_forbidden_ones_go_out():
    contacts, before = changed(Verdicts(forced=keys(FAR), forbidden=keys(NEAR[0])))
    assert contacts.key.tolist() == [NEAR[1], FAR]
    assert before.tolist() == [1, -1]
    assert contacts.gap[1] == pytest.approx(0.01)


def test_a_forced_pair_that_was_there_anyway_stays_where_it_was():
    contacts, before = changed(Verdicts(forced=keys(NEAR[1])))
    assert contacts.key.tolist() == NEAR
    assert before.tolist() == [0, 1]
    assert changed(NO_VERDICTS)[1].tolist() == [0, 1]


@pytest.mark.parametrize("lost", [2, 3])
def test_a_forced_pair_of_an_absent_grain_is_left_out(lost):
    contacts, _ = changed(Verdicts(forced=keys(FAR)), np.arange(4) != lost)
    assert contacts.key.tolist() == NEAR


def test_only_what_the_detector_did_not_see_counts_as_added():
    contacts, _ = changed(Verdicts(forced=keys(NEAR[1], FAR)))
    given = Verdicts(forced=keys(NEAR[1], FAR))
    for touch, expected in (
        ([0.1, 0.9, 0.0], [0, 0, 1]),
        ([0.9, 0.4, np.nan], [0, 1, 0]),  # not computed: nobody knows that it was not seen
    ):
        found = sources(contacts, np.array(touch), given)
        assert (found == ContactSource.ADDED_BY_REVIEWER).tolist() == [bool(each) for each in expected]


def test_a_pair_cannot_be_both():
    with pytest.raises(ValueError, match=f"pair {FAR}"):
        Verdicts(forced=keys(FAR), forbidden=keys(FAR))


def test_frames_that_people_flagged_are_found():
    assert find_ignored({1: Verdicts(ignored=True), 2: Verdicts(reset=True), 9: Verdicts(ignored=True)}) == {1, 9}
