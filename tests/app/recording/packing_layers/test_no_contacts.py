"""A frame in which no grain touches another is recorded like any other."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from rodsight.recording.files.finished_run import record
from rodsight.recording.files.readback import read_forces

from solver.sequence.frame_forces import FrameForces
from tests.app.recording.fake_results import make_results


def without_contacts(frame: FrameForces) -> FrameForces:
    none = np.zeros(frame.contacts.count, bool)
    columns = {
        each.name: value[none] for each in fields(frame) if isinstance(value := getattr(frame, each.name), np.ndarray)
    }
    history = replace(frame.history, fn=frame.history.fn[:, none], ft=frame.history.ft[:, none])
    return replace(frame, contacts=frame.contacts.select(none), history=history, **columns)


@pytest.mark.parametrize("empty", [{0}, {2}, {0, 1, 2, 3}])
def test_a_frame_without_contacts_is_recorded(empty, tmp_path):
    results = make_results()
    frames = [without_contacts(frame) if frame.frame in empty else frame for frame in results.frames]
    record(replace(results, frames=frames), tmp_path / "run.rrd")
    found = read_forces(tmp_path / "run.rrd")
    assert [len(found[k].fn) == 0 for k in range(4)] == [k in empty for k in range(4)]
