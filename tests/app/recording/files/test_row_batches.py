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


@pytest.mark.thorough
@pytest.mark.parametrize("every", [1, 2])
def test_rows_are_the_same_however_many_frames_share_a_message(results, tmp_path, monkeypatch, every):
    write_recording(results, tmp_path / "joined.rrd")
    # Small batches: every frame has messages of its own.
    made = recorder.Recorder
    monkeypatch.setattr(finished_run, "Recorder", lambda *args, **kwargs: made(*args, **kwargs, send_every=every))
    monkeypatch.setattr(row_batches, "WAITING", 1)
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


def test_the_most_rows_are_sent_once_all_are_many_and_points_wait(monkeypatch):
    stream = Sent()
    batches = row_batches.RowBatches(stream)

    def add(path: str, frame: int) -> None:
        when = [rr.TimeColumn("frame", sequence=[frame])]
        batches.add(path, when, rr.Scalars.columns(scalars=[1.0]))

    monkeypatch.setattr(row_batches, "WAITING", 10**9)
    add("/rows", 0)
    one_row = batches._sizes["/rows"]
    monkeypatch.setattr(row_batches, "WAITING", 5 * one_row)
    add("/few", 0)
    add("/rows", 1)
    assert stream.rows == []
    add("/few", 1)
    assert stream.rows == []
    add("/rows", 2)
    assert stream.rows == [("/rows", 3)]
    add("/rows", 3)
    assert stream.rows[1:] == []
    batches.begin((("frame", 3),))
    batches.add_point("/curve", [1.0])
    batches.send()
    assert sorted(stream.rows[1:]) == [("/curve", 1), ("/few", 2), ("/rows", 1)]
    batches.send()
    assert len(stream.rows) == 4


def test_the_stream_is_flushed_while_many_rows_and_points_are_sent(monkeypatch):
    """What a stream holds until it is written would add to all rows that wait."""
    stream, flushed = Sent(), []
    batches = row_batches.RowBatches(stream, flush=lambda each: flushed.append(len(each.rows)))
    for frame in range(10):
        batches.begin((("frame", frame),))
        for name in "abcd":
            batches.add(f"/rows/{name}", [rr.TimeColumn("frame", sequence=[frame])], rr.Scalars.columns(scalars=[1.0]))
            batches.add_point(f"/curves/{name}", [1.0])
    monkeypatch.setattr(row_batches, "HELD", batches._sizes["/rows/a"] + 1)
    batches.send()
    assert len(stream.rows) == 8
    assert flushed[0] == 1
    assert flushed[-1] >= 5


def test_rows_of_one_entity_are_sent_together_in_the_order_in_which_they_were_added(monkeypatch):
    """Where a row and columns of one frame set the same component, the viewer shows the one that was sent last."""
    stream = Sent()
    batches = row_batches.RowBatches(stream)
    styled = rr.Points2D([[0.0, 0.0]], radii=1.0).as_component_batches()
    for frame in range(4):
        batches.begin((("frame", frame),))
        batches.add_row("/marks", styled)
        if frame == 1:  # the columns of this frame are the first that are too many
            monkeypatch.setattr(row_batches, "WAITING", batches._size + 1)
        batches.add(
            "/marks", [rr.TimeColumn("frame", sequence=[frame] * 2)], rr.Points2D.columns(positions=[[1.0, 1.0]] * 2)
        )
        monkeypatch.setattr(row_batches, "WAITING", 10**9)
    batches.send()
    assert [count for _, count in stream.rows] == [2, 4, 2, 4]  # styled rows before columns


def test_many_small_rows_are_joined():
    batches = row_batches.RowBatches(Sent())
    for frame in range(3 * row_batches.PIECES):
        batches.begin((("frame", frame),))
        batches.add_row("/text", rr.TextDocument("text").as_component_batches())
    (rows_of_path,) = batches._rows["/text"].values()
    assert all(len(column) < row_batches.PIECES for column in rows_of_path.columns)
