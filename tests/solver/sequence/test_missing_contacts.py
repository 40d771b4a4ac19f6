"""Missing contacts: detection misses a strong contact, the balance shows it."""

import re
from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.contacts.contacts import ContactSource
from rodsight.solver.contacts.verdicts import Verdicts
from rodsight.solver.detection.refinement import RefinedBlock
from rodsight.solver.sequence.frames import solve_sequence
from rodsight.solver.sequence.missing_contacts import NO_MISSING, MissingContacts, find_missing_contacts

from tests.solver.sequence.test_frames import ENSEMBLE, sheared_frames

SETTINGS = replace(ENSEMBLE, positions="never")
FRAME = 2


def solve(verdicts=None):
    packing, snapshots = sheared_frames(4)
    return [frame for frame, _ in solve_sequence(packing, snapshots, SETTINGS, verdicts=verdicts)]


def strongest(frame) -> int:
    """Key of the strongest contact between grains."""
    between = ~frame.contacts.with_wall
    return int(frame.contacts.key[between][np.argmax(frame.fn[between])])


@pytest.fixture(scope="module")
def sound():
    return solve()


def hide(monkeypatch: pytest.MonkeyPatch, key: int) -> None:
    """Make detection miss a pair in one frame."""
    detect = RefinedBlock.contacts_at

    def incomplete(self, snapshot, frame, grains, walls, least):
        contacts, touch = detect(self, snapshot, frame, grains, walls, least)
        kept = (contacts.key != key) | (frame != FRAME)
        return contacts.select(kept), touch[kept]

    monkeypatch.setattr(RefinedBlock, "contacts_at", incomplete)


@pytest.mark.thorough
def test_a_missed_strong_contact_is_recovered_and_reported(sound, monkeypatch):
    key = strongest(sound[FRAME])
    hide(monkeypatch, key)
    frame = solve()[FRAME]
    row = int(np.flatnonzero(frame.contacts.key == key)[0])
    assert frame.source[row] == ContactSource.FROM_BALANCE
    assert 0.3 < frame.probability[row] <= 0.95
    assert frame.fn[row] == pytest.approx(sound[FRAME].fn[np.flatnonzero(sound[FRAME].contacts.key == key)[0]], rel=0.2)
    assert re.search("equilibrium needs (1 contact that was|[0-9]+ contacts that were) not detected", frame.reason)


def test_a_contact_excluded_by_a_reviewer_stays_excluded(sound, monkeypatch):
    key, offered = strongest(sound[FRAME]), []

    def offer(*arguments):
        found = find_missing_contacts(*arguments)
        offered.append(found.key)
        return found

    monkeypatch.setattr("rodsight.solver.sequence.ensemble.find_missing_contacts", offer)
    frame = solve({FRAME: Verdicts(forbidden=np.array([key]))})[FRAME]
    assert key not in np.concatenate(offered)  # where it would take the place of pairs that may touch
    row = frame.contacts.key == key
    assert row.any()
    assert (frame.source[row] == ContactSource.FORBIDDEN_BY_REVIEWER).all()
    assert (frame.fn[row] == 0.0).all()


def test_missing_contacts_join_by_pair_and_keep_the_greater_probability():
    one, two = (
        MissingContacts(np.array([3, 7]), np.array([0.4, 0.9])),
        MissingContacts(np.array([5, 7]), np.array([0.6, 0.5])),
    )
    both = one.joined(two)
    assert both.key.tolist() == [3, 5, 7]
    assert both.probability.tolist() == [0.4, 0.6, 0.9]
    assert both.only(np.array([5, 8])).key.tolist() == [5]
    assert NO_MISSING.joined(one).key.tolist() == [3, 7]
