"""Rows of several frames are sent together: the same rows, in fewer messages."""

from __future__ import annotations

import numpy as np
import pytest
import rerun as rr
from rodsight.recording.files import finished_run, recorder, row_batches
from rodsight.recording.files.finished_run import write_recording
from rodsight.recording.look import entities

from tests.app.recording.rows import rows, store


def _messages(file, path) -> int:
    return len(list(store(file).stream().filter(content=path).to_chunks()))


def _contents(file, path) -> list[str]:
    return sorted(
        repr({name: row[name] for name in sorted(row) if name != "rerun.controls.RowId"}) for row in rows(file, path)
    )


@pytest.mark.parametrize("every", [1, 2])
def test_rows_are_the_same_however_many_frames_share_a_message(results, tmp_path, monkeypatch, every):
    write_recording(results, tmp_path / "joined.rrd")
    # Small batches: every frame has messages of its own.
    made = recorder.Recorder
    monkeypatch.setattr(finished_run, "Recorder", lambda *args, **kwargs: made(*args, **kwargs, flush_every=every))
    monkeypatch.setattr(row_batches, "LARGEST", 1)
    write_recording(results, tmp_path / "single.rrd")
    for path in (entities.FORCES, entities.SWEEP_UNBALANCE, entities.UNBALANCE_MAP, entities.TRUST):
        assert _contents(tmp_path / "joined.rrd", path) == _contents(tmp_path / "single.rrd", path), path
        if path != entities.TRUST or every == 1:
            assert _messages(tmp_path / "joined.rrd", path) < _messages(tmp_path / "single.rrd", path), path


def test_points_are_at_the_times_that_were_set(tmp_path):
    stream = rr.RecordingStream("test")
    batches = row_batches.RowBatches(stream)
    stream.save(tmp_path / "points.rrd")
    stream.set_log_time_enabled(False)
    for frame, values in enumerate(([1.5], [], [2.5])):
        batches.begin((("frame", frame), ("time", np.timedelta64(frame, "s"))))
        batches.add_point("/curve", values)
    batches.send()
    stream.disconnect()
    found = rows(tmp_path / "points.rrd", "/curve")
    assert [(row["frame"], row["Scalars:scalars"]) for row in found] == [(0, [1.5]), (1, []), (2, [2.5])]
