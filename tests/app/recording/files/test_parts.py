"""A long recording in parts: each part opens alone, and all are read as one recording."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader
from rodsight.recording.archive.catalogue import find_recordings
from rodsight.recording.archive.readback import read_forces
from rodsight.recording.archive.share import share_recording
from rodsight.recording.files.finished_run import RecordingOptions, write_recording
from rodsight.recording.look import entities
from rodsight.recording.parts import part_of, parts_of
from rodsight.recording.viewing.pictures import timeline_values
from rodsight.results.results import Results

from tests.app.recording.fake_results import make_results

FRAMES, IN_ONE = 7, 3


@pytest.fixture(scope="module")
def results() -> Results:
    return make_results(FRAMES, 4, 4, sweeps=8)


@pytest.fixture(scope="module")
def whole(results, tmp_path_factory) -> Path:
    return write_recording(results, tmp_path_factory.mktemp("whole") / "recording.rrd").path


@pytest.fixture(scope="module")
def split(results, tmp_path_factory) -> Path:
    file = tmp_path_factory.mktemp("split") / "recording.rrd"
    written = write_recording(results, file, options=RecordingOptions(part_frames=IN_ONE))
    assert written.parts == 3
    assert written.size == sum(each.stat().st_size for each in file.parent.iterdir())
    assert "3 files" in written.notes[-1]
    return file


@pytest.mark.thorough
def test_all_parts_together_equal_the_recording(whole, split):
    one, many = read_forces(whole), read_forces(split)
    assert list(one) == list(many) == list(range(FRAMES))
    for frame in one:
        np.testing.assert_array_equal(one[frame].fn, many[frame].fn)
    for timeline in (entities.FRAME, entities.SWEEP):
        assert timeline_values(split, timeline) == timeline_values(whole, timeline)
    assert [each.name for each in parts_of(split)] == [part_of(split, 1 + k).name for k in range(3)]


@pytest.mark.thorough
def test_every_part_opens_alone(whole, split):
    paths = set(RrdReader(str(whole)).store().schema().entity_paths())
    for number, part in enumerate(parts_of(split)):
        entry, store = RrdReader(str(part)).recordings()[0], RrdReader(str(part)).store()
        assert entry.recording_id == RrdReader(str(split)).recordings()[0].recording_id
        layers = {path for path in paths if path.startswith(entities.FILM_FRAMES)} | {"/flags"}  # only in some frames
        assert paths - layers - set(store.schema().entity_paths()) == set()
        frames = {int(k) for c in store.stream().filter(has_timeline=entities.FRAME).to_chunks()
                  for k in c.to_record_batch().column(entities.FRAME).to_pylist()}  # fmt: skip
        assert frames == set(range(FRAMES)[number * IN_ONE : (number + 1) * IN_ONE])


@pytest.mark.thorough
def test_some_frames_of_several_parts_are_shared(split, tmp_path):
    shared = share_recording(split, tmp_path / "few.rrd", first=2, stop=5)
    assert list(read_forces(shared.path)) == [2, 3, 4]
    assert shared.former_size == sum(each.stat().st_size for each in parts_of(split))


def test_parts_are_not_listed_as_recordings_of_a_folder(split):
    assert find_recordings(split.parent) == [split]


@pytest.mark.thorough
def test_a_shorter_recording_leaves_no_part_behind(results, tmp_path):
    file = tmp_path / "recording.rrd"
    write_recording(results, file, options=RecordingOptions(part_frames=IN_ONE))
    write_recording(replace(results, frames=results.frames[:FRAMES]), file)
    assert [each.name for each in tmp_path.iterdir()] == ["recording.rrd"]


def test_a_part_of_another_recording_is_ignored(whole, split, tmp_path):
    for source, name in ((whole, "recording.rrd"), (part_of(split, 2), "recording-part-2.rrd")):
        (tmp_path / name).write_bytes(source.read_bytes())
    assert parts_of(tmp_path / "recording.rrd") == [tmp_path / "recording.rrd"]


@pytest.mark.slow
def test_a_size_is_that_of_all_parts(results, tmp_path):
    full = write_recording(results, tmp_path / "full.rrd", options=RecordingOptions(part_frames=IN_ONE, sweeps="all"))
    less = write_recording(
        results,
        tmp_path / "less.rrd",
        options=RecordingOptions(part_frames=IN_ONE, sweeps="all", max_size=full.size - 1),
    )
    assert less.size < full.size
    assert not list(tmp_path.glob("*.part"))
