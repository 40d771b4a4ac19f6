from dataclasses import replace

import numpy as np
import pytest

from solver.contacts.contacts import ContactSource
from solver.contacts.verdicts import Verdicts
from solver.detection.refinement import RefinedBlock
from solver.sequence.demand import NO_DEMAND, Demand
from solver.sequence.frames import solve_sequence
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
    """Let detection miss a pair in one frame."""
    detect = RefinedBlock.contacts_at

    def blind(self, snapshot, frame, grains, walls, least):
        contacts, touch = detect(self, snapshot, frame, grains, walls, least)
        kept = (contacts.key != key) | (frame != FRAME)
        return contacts.select(kept), touch[kept]

    monkeypatch.setattr(RefinedBlock, "contacts_at", blind)


def test_a_strong_contact_that_was_missed_comes_back_and_the_frame_says_so(sound, monkeypatch):
    key = strongest(sound[FRAME])
    hide(monkeypatch, key)
    frame = solve()[FRAME]
    row = int(np.flatnonzero(frame.contacts.key == key)[0])
    assert frame.source[row] == ContactSource.DEMANDED
    assert 0.3 < frame.probability[row] <= 0.95
    assert frame.fn[row] == pytest.approx(sound[FRAME].fn[np.flatnonzero(sound[FRAME].contacts.key == key)[0]], rel=0.2)
    assert "the balance demanded" in frame.reason


def test_nobody_gets_back_what_people_forbade(sound):
    key = strongest(sound[FRAME])
    frame = solve({FRAME: Verdicts(forbidden=np.array([key]))})[FRAME]
    row = frame.contacts.key == key
    assert row.any()
    assert (frame.source[row] == ContactSource.FORBIDDEN_BY_REVIEWER).all()
    assert (frame.fn[row] == 0.0).all()


def test_demands_join_by_pair_and_keep_the_greater_probability():
    one, two = Demand(np.array([3, 7]), np.array([0.4, 0.9])), Demand(np.array([5, 7]), np.array([0.6, 0.5]))
    both = one.joined(two)
    assert both.key.tolist() == [3, 5, 7]
    assert both.probability.tolist() == [0.4, 0.6, 0.9]
    assert both.only(np.array([5, 8])).key.tolist() == [5]
    assert NO_DEMAND.joined(one).key.tolist() == [3, 7]
