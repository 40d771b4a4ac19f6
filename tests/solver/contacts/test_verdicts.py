"""Effect of reviewers' verdicts on the contacts of a frame, and their sources."""

import numpy as np
import pytest
from rodsight.solver.contacts.contacts import ContactSource, detect_contacts
from rodsight.solver.contacts.verdicts import NO_VERDICTS, Verdicts, apply_verdicts, contact_sources, find_ignored

from tests.packings import box, motion, rods

GRAINS = rods(0.01, 0.01, 0.01, 0.01)
POSITION = motion(np.array([[0.02, 0.05], [0.04, 0.05], [0.06, 0.05], [0.09, 0.05]])).position
PRESENT = np.ones(4, bool)
WALLS = box(0.2, 0.1)
BODIES = 8
NEAR = [0 * BODIES + 1, 1 * BODIES + 2]
FAR = 2 * BODIES + 3


def keys(*key):
    return np.array(key, np.int64)


def changed(verdicts, present=PRESENT):
    contacts = detect_contacts(GRAINS, POSITION, PRESENT, WALLS, 1e-6)
    assert contacts.key.tolist() == NEAR
    return apply_verdicts(contacts, verdicts, GRAINS, POSITION, present, WALLS)


def test_forced_pairs_are_added_and_forbidden_ones_removed():
    contacts, before = changed(Verdicts(forced=keys(FAR), forbidden=keys(NEAR[0])))
    assert contacts.key.tolist() == [NEAR[1], FAR]
    assert before.tolist() == [1, -1]
    assert contacts.gap[1] == pytest.approx(0.01)


def test_forced_pair_that_was_detected_keeps_its_row():
    contacts, before = changed(Verdicts(forced=keys(NEAR[1])))
    assert contacts.key.tolist() == NEAR
    assert before.tolist() == [0, 1]
    assert changed(NO_VERDICTS)[1].tolist() == [0, 1]


@pytest.mark.parametrize("lost", [2, 3])
def test_forced_pair_of_an_absent_grain_is_ignored(lost):
    contacts, _ = changed(Verdicts(forced=keys(FAR)), np.arange(4) != lost)
    assert contacts.key.tolist() == NEAR


def test_only_undetected_pairs_count_as_added():
    contacts, _ = changed(Verdicts(forced=keys(NEAR[1], FAR)))
    given = Verdicts(forced=keys(NEAR[1], FAR))
    for touch, expected in (
        ([0.1, 0.9, 0.0], [0, 0, 1]),
        ([0.9, 0.4, np.nan], [0, 1, 0]),  # not computed: detection is unknown
    ):
        found = contact_sources(contacts, np.array(touch), given)
        assert (found == ContactSource.ADDED_BY_REVIEWER).tolist() == [bool(each) for each in expected]


def test_pair_cannot_be_forced_and_forbidden():
    with pytest.raises(ValueError, match=f"pair {FAR}"):
        Verdicts(forced=keys(FAR), forbidden=keys(FAR))


def test_ignored_frames_are_found():
    assert find_ignored({1: Verdicts(ignored=True), 2: Verdicts(reset=True), 9: Verdicts(ignored=True)}) == {1, 9}
