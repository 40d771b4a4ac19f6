"""What resists sliding is judged with contacts that only the balance shows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.solver.convex import friction_check
from rodsight.solver.convex.ensemble_members import measured_slip
from rodsight.solver.convex.friction_check import on_better_contacts, sliding_frame
from rodsight.solver.convex.program import solve_convex_member
from rodsight.solver.detection.touch_probability import ContactProbabilitySettings, probable_contacts

from tests.solver.sequence.test_frames import sheared_frames

SETTINGS = ContactProbabilitySettings(overlap=1e-6)
FRAME = 3


def test_a_strong_contact_that_was_not_detected_is_added(monkeypatch: pytest.MonkeyPatch) -> None:
    packing, snapshots = sheared_frames(8)
    sound = sliding_frame(packing, snapshots, FRAME, SETTINGS)
    none = np.zeros(sound.contacts.count)
    forces = solve_convex_member(sound.balance, sound.slip, sound.probability, none, none)
    key = sound.contacts.key[np.argsort(np.where(sound.contacts.with_wall, 0.0, forces.fn))[-4]]

    def incomplete(*arguments, **options):
        contacts, touch = probable_contacts(*arguments, **options)
        return contacts.select(contacts.key != key), touch[contacts.key != key]

    monkeypatch.setattr(friction_check, "probable_contacts", incomplete)
    assert key not in sliding_frame(packing, snapshots, FRAME, SETTINGS).contacts.key
    found = sliding_frame(packing, snapshots, FRAME, SETTINGS, completed=True)
    row = np.flatnonzero(found.contacts.key == key)
    assert len(row) == 1
    assert 0.3 < found.probability[row[0]] <= 0.95
    assert found.contacts.count == len(found.probability) == len(found.slip)


def test_sliding_is_that_between_the_photographs_on_both_sides() -> None:
    packing, snapshots = sheared_frames(8)
    turned = np.random.default_rng(1).normal(0.0, 0.1, packing.grains.count)
    snapshots[FRAME + 1] = replace(snapshots[FRAME + 1], rotation=turned)
    found = sliding_frame(packing, snapshots, FRAME, SETTINGS)
    walls = packing.walls_of(snapshots[FRAME])
    beside = snapshots[FRAME - 1], snapshots[FRAME + 1]
    np.testing.assert_array_equal(found.slip, measured_slip(found.contacts, packing.grains, walls, beside))
    assert np.abs(found.slip).max() > 0.0


@pytest.mark.parametrize(
    ("detected", "completed", "better"),
    [(0.37, 0.05, "completed"), (0.37, 0.24, "detected"), (0.8, 0.4, "detected"), (0.09, 0.01, None)],
)
def test_completed_contacts_are_used_where_they_explain_the_sliding(
    monkeypatch: pytest.MonkeyPatch, detected: float, completed: float, better: str | None
) -> None:
    gap, made = {"detected": detected, "completed": completed}, []

    def make(_: int, complete: bool) -> str:
        made.append("completed" if complete else "detected")
        return made[-1]

    monkeypatch.setattr(friction_check, "power_gaps", lambda frames: [gap[each] for each in frames])
    assert on_better_contacts(make, [FRAME]) == [better or "detected"]
    assert made == (["detected", "completed"] if better else ["detected"])  # a small gap needs no other contacts
