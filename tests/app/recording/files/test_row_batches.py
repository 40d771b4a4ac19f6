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


class Sent:
    """A stream that notes the numbers of rows that it is sent."""

    def __init__(self) -> None:
        self.rows: list[tuple[str, int]] = []

    def send_columns(self, path, when, columns) -> None:
        self.rows.append((path, len(next(iter(columns)).as_arrow_array())))


def test_rows_are_sent_once_they_are_large_and_points_may_wait(monkeypatch):
    stream = Sent()
    batches = row_batches.RowBatches(stream)

    def add(frame: int) -> None:
        when = [rr.TimeColumn("frame", sequence=[frame])]
        batches.add("/rows", when, rr.Scalars.columns(scalars=[1.0]))

    monkeypatch.setattr(row_batches, "LARGEST", 10**9)
    add(0)
    one_row = next(iter(batches._rows.values())).size
    monkeypatch.setattr(row_batches, "LARGEST", 3 * one_row)
    add(1)
    assert stream.rows == []
    add(2)
    assert stream.rows == [("/rows", 3)]
    add(3)
    batches.begin((("frame", 3),))
    batches.add_point("/curve", [1.0])
    batches.send(points=False)
    assert stream.rows[1:] == [("/rows", 1)]
    batches.send()
    assert stream.rows[2:] == [("/curve", 1)]
