"""Pairs without a contact, lost or forbidden, are lines in two parts, because their hues look alike to some."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from rodsight.recording.files.finished_run import write_recording
from rodsight.recording.look import entities
from rodsight.recording.packing_layers.contact_changes import END_FRACTION, broken_lines
from rodsight.solver.contacts.contacts import ContactSource
from rodsight.solver.frame_forces import FrameForces
from rodsight.solver.quantity import columns

from tests.app.recording.fake_results import make_results
from tests.app.recording.rows import latest


def without_first_contact(frame: FrameForces) -> FrameForces:
    kept = np.arange(frame.contacts.count) > 0
    rest = {name: getattr(frame, name) for name in columns(FrameForces, "contact")}
    history = replace(frame.history, fn=frame.history.fn[:, kept], ft=frame.history.ft[:, kept])
    shorter = {name: value[kept] for name, value in rest.items() if value is not None}
    return replace(frame, contacts=frame.contacts.select(kept), history=history, **shorter)


def test_a_broken_line_lacks_its_middle():
    lines = np.array([[[0.0, 0.0], [10.0, 20.0]], [[1.0, 1.0], [1.0, 1.0]]], np.float32)
    parts = broken_lines(lines)
    assert np.allclose(parts[0], [[0.0, 0.0], [10.0 * END_FRACTION, 20.0 * END_FRACTION]])
    assert np.allclose(parts[2], [[10.0 * (1.0 - END_FRACTION), 20.0 * (1.0 - END_FRACTION)], [10.0, 20.0]])
    assert np.allclose(parts[[1, 3]], 1.0)


def test_lost_and_forbidden_contacts_are_drawn_in_two_parts(tmp_path):
    results = make_results()
    first, second = results.frames[:2]
    source = second.source.copy()
    source[1:3] = ContactSource.FORBIDDEN_BY_REVIEWER, ContactSource.ADDED_BY_REVIEWER
    frames = [first, without_first_contact(replace(second, source=source)), *results.frames[2:]]
    write_recording(replace(results, frames=frames), tmp_path / "run.rrd")
    lost = np.array(latest(tmp_path / "run.rrd", entities.LOST_CONTACTS, entities.FRAME, 1)["LineStrips2D:strips"])
    apart = len(lost) // 2
    assert apart > 0
    whole = lost[apart:, 1] - lost[:apart, 0]
    assert np.allclose(lost[apart:, 0] - lost[:apart, 1], (1.0 - 2.0 * END_FRACTION) * whole, atol=1e-2)
    judged = latest(tmp_path / "run.rrd", entities.VERDICTS, entities.FRAME, 1)
    assert judged["source"] == ["added_by_reviewer", *2 * ["forbidden_by_reviewer"]]
    assert len(judged["LineStrips2D:strips"]) == len(judged["grain_a"]) == 3
