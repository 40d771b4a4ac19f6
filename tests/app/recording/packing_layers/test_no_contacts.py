"""A frame without contacts is recorded."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rodsight.recording.archive.readback import read_forces
from rodsight.recording.files.finished_run import write_recording
from rodsight.solver.frame_forces import FrameForces
from rodsight.solver.quantity import columns

from tests.app.recording.fake_results import make_results


def without_contacts(frame: FrameForces) -> FrameForces:
    none = np.zeros(frame.contacts.count, bool)
    columns_of_all = {name: getattr(frame, name) for name in columns(FrameForces, "contact")}
    nothing = {name: value[none] for name, value in columns_of_all.items() if value is not None}
    history = replace(frame.history, fn=frame.history.fn[:, none], ft=frame.history.ft[:, none])
    return replace(frame, contacts=frame.contacts.select(none), history=history, **nothing)


@pytest.mark.parametrize("empty", [{0}, {2}, {0, 1, 2, 3}])
def test_a_frame_without_contacts_is_recorded(empty, tmp_path):
    results = make_results()
    frames = [without_contacts(frame) if frame.frame in empty else frame for frame in results.frames]
    write_recording(replace(results, frames=frames), tmp_path / "run.rrd")
    found = read_forces(tmp_path / "run.rrd")
    assert [len(found[k].fn) == 0 for k in range(4)] == [k in empty for k in range(4)]
