from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from rodsight.solver.assessment.changes import correlate, find_changes
from rodsight.solver.bodies.grains import Array
from rodsight.solver.contacts.contacts import Contacts
from rodsight.solver.nlgs.force_memory import ForceMemory
from rodsight.solver.sequence.frames import solve_sequence
from rodsight.solver.statistics.balance import grain_unbalance

from tests.solver.sequence.test_frames import ENSEMBLE, SETTINGS, sheared_frames

ROUNDING = 1e-12


def contacts_of(*pairs: tuple[int, int]) -> Contacts:
    i, j = np.array(pairs, np.int32).T
    c = len(pairs)
    return Contacts(i, j, np.zeros(c), np.tile([1.0, 0.0], (c, 1)), np.zeros((c, 2)), 5, 1)


def memory_of(contacts: Contacts, fn: Array) -> ForceMemory:
    return ForceMemory(contacts.key, np.column_stack([fn, np.zeros_like(fn)]))


def test_new_and_lost_contacts_are_counted_without_those_of_lost_grains() -> None:
    before, now = contacts_of((0, 1), (1, 2), (2, 3), (3, 5)), contacts_of((0, 1), (0, 4), (3, 5))
    former = memory_of(before, np.ones(4))
    here = np.ones(5, bool)
    changes = find_changes(former, now, np.ones(3), here)
    assert (changes.new, changes.lost) == (1, 2)
    here[3] = False
    assert find_changes(former, now.select(np.array([True, True, False])), np.ones(2), here).lost == 1


def test_similarity_is_the_correlation_over_common_contacts() -> None:
    before, now = contacts_of((0, 1), (1, 2), (2, 3), (3, 5)), contacts_of((0, 1), (0, 4), (1, 2), (3, 5))
    old, new = np.array([1.0, 3.0, 9.0, 2.0]), np.array([2.0, 7.0, 2.5, 1.0])
    found = find_changes(memory_of(before, old), now, new, np.ones(5, bool)).similarity
    assert found == pytest.approx(np.corrcoef([1.0, 3.0, 2.0], [2.0, 2.5, 1.0])[0, 1], rel=ROUNDING)


def test_correlation_is_undefined_without_variation_or_with_fewer_than_three() -> None:
    assert np.isnan(correlate(np.ones(5), np.arange(5.0)))
    assert np.isnan(correlate(np.array([1.0, np.nan, 2.0]), np.arange(3.0)))


@pytest.mark.parametrize("settings", [SETTINGS, ENSEMBLE], ids=["nlgs", "ensemble"])
def test_frames_report_changes_and_force_residuals(settings) -> None:
    packing, snapshots = sheared_frames(5, lost=[(2, 20)])
    frames = [frame for frame, _ in solve_sequence(packing, snapshots, settings)]
    assert np.isnan(frames[0].similarity)
    assert (frames[0].new_contact_count, frames[0].lost_contact_count) == (0, 0)
    for former, frame in pairwise(frames):
        old, new = set(former.contacts.key.tolist()), set(frame.contacts.key.tolist())
        gone = former.contacts.select(np.isin(former.contacts.key, sorted(old - new)))
        lost = ~snapshots[frame.frame].present
        of_lost = sum(
            lost[[each for each in pair if each < len(lost)]].any() for pair in zip(gone.i, gone.j, strict=True)
        )
        assert frame.new_contact_count == len(new - old)
        assert frame.lost_contact_count == len(old - new) - of_lost
        assert -1.0 <= frame.similarity <= 1.0
        there = snapshots[frame.frame].present
        again = grain_unbalance(frame.contacts, frame.fn, frame.ft, packing.weight, there)
        np.testing.assert_array_equal(frame.grain_unbalance, again)
        assert np.isnan(again).tolist() == lost.tolist()
    assert frames[3].new_contact_count > 0  # the lost grain is back, and its contacts with it
