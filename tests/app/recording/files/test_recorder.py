from __future__ import annotations

import subprocess
from dataclasses import replace

import numpy as np
import pytest
import rerun as rr
from rerun.chunk import RrdReader
from rodsight.drawing.force_range import ForceRange
from rodsight.experiment.units import Scale
from rodsight.recording.archive.readback import read_forces
from rodsight.recording.files.finished_run import RecordingOptions, _check_complete, write_recording
from rodsight.recording.files.recorder import Recorder
from rodsight.recording.look import entities
from rodsight.recording.look.canvas import Canvas
from rodsight.recording.look.force_style import ForceStyle
from rodsight.recording.look.scene import Scene
from rodsight.recording.packing_layers.forces.network import SweepChoice
from rodsight.recording.tabs.blueprint import Tab
from rodsight.recording.viewing.viewer import viewer_binary
from rodsight.solver.frame_forces import FrameStatus

from tests.app.recording.fake_photographs import PIXEL, SHAPE, photograph
from tests.app.recording.fake_results import make_results
from tests.app.recording.rows import latest


def rerun(*arguments: object) -> subprocess.CompletedProcess:
    return subprocess.run([viewer_binary(), *map(str, arguments)], capture_output=True, text=True, timeout=120)


def test_the_viewers_own_check_accepts_the_file(recording):
    done = rerun("rrd", "verify", recording.path)
    assert done.returncode == 0, done.stderr


@pytest.mark.thorough
def test_the_same_run_recorded_twice_is_the_same(results, truth, tmp_path):
    paths = [tmp_path / "first.rrd", tmp_path / "second.rrd"]
    for path in paths:
        write_recording(results, path, photograph=photograph, scale=Scale(PIXEL, SHAPE[0]), truth=truth)
    done = rerun("rrd", "compare", "--unordered", *paths)
    assert done.returncode == 0, done.stderr


@pytest.mark.thorough
def test_the_comparison_detects_a_differing_force(results, tmp_path):
    write_recording(results, tmp_path / "first.rrd")
    fn = results.frames[1].fn.copy()
    fn[0] *= 1.001
    frames = [results.frames[0], replace(results.frames[1], fn=fn), *results.frames[2:]]
    write_recording(replace(results, frames=frames), tmp_path / "second.rrd")
    assert rerun("rrd", "compare", "--unordered", tmp_path / "first.rrd", tmp_path / "second.rrd").returncode != 0


def test_the_file_embeds_its_blueprint(recording):
    assert len(RrdReader(str(recording.path)).blueprints()) == 1
    assert len(RrdReader(str(recording.path)).recordings()) == 1


@pytest.mark.thorough
def test_an_interrupted_recording_leaves_the_former_file_unchanged(results, tmp_path):
    path = tmp_path / "run.rrd"
    write_recording(results, path)
    former = path.read_bytes()

    def interrupt(done: int, total: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_recording(results, path, progress=interrupt)
    assert path.read_bytes() == former
    assert [child.name for child in tmp_path.iterdir()] == ["run.rrd"]


def test_progress_is_reported_after_every_frame(results, tmp_path):
    calls = []
    write_recording(results, tmp_path / "run.rrd", progress=lambda done, total: calls.append((done, total)))
    assert calls == [(1, 4), (2, 4), (3, 4), (4, 4)]


def test_a_stream_in_memory_receives_the_same_frames_one_by_one(results, tmp_path):
    canvas = Canvas.around(results.tracks, None)
    style = ForceStyle.on(canvas, ForceRange.of(results.frames))
    scene = Scene(
        results.name, results.tracks, results.walls, results.grains, results.friction, results.configuration, canvas,
        style,
    )  # fmt: skip
    stream = rr.RecordingStream(entities.APPLICATION_ID)
    memory = stream.binary_stream()
    recorder = Recorder(stream)
    recorder.start(scene)
    for forces, statistics in zip(results.frames, results.statistics, strict=True):
        recorder.frame(forces, statistics)
    recorder.finish()
    (tmp_path / "live.rrd").write_bytes(memory.read() or b"")
    found = read_forces(tmp_path / "live.rrd")
    assert all(np.array_equal(found[forces.frame].fn, forces.fn) for forces in results.frames)


def test_a_recorder_that_was_not_started_raises(results):
    recorder = Recorder(rr.RecordingStream(entities.APPLICATION_ID))
    with pytest.raises(RuntimeError, match="start"):
        recorder.frame(results.frames[0], results.statistics[0])


@pytest.mark.slow
def test_a_size_limit_reduces_the_sweeps_and_adds_a_note(tmp_path):
    results = make_results(3, 10, 10, sweeps=400)
    full = write_recording(results, tmp_path / "full.rrd", options=RecordingOptions(sweeps="all"))
    least = write_recording(results, tmp_path / "least.rrd", options=RecordingOptions(sweeps="none"))
    limit = (full.size + least.size) // 2
    report = write_recording(results, tmp_path / "limited.rrd", options=RecordingOptions(sweeps="all", max_size=limit))
    assert report.size <= limit < full.size
    assert report.sweeps is SweepChoice.LOG
    assert "Limited" in report.notes[0]
    hopeless = write_recording(
        results, tmp_path / "hopeless.rrd", options=RecordingOptions(sweeps="all", max_size=1000)
    )
    assert hopeless.sweeps is SweepChoice.NONE
    assert "Still larger" in hopeless.notes[-1]
    assert len(read_forces(hopeless.path)) == 3


def test_frames_without_contacts_or_forces_are_recorded(tmp_path):
    results = make_results(3, sweeps=20)
    empty = results.frames[1].contacts.select(np.zeros(results.frames[1].contacts.count, bool))
    none, number = np.empty(0), np.empty((20, 0), np.float32)
    history = replace(results.frames[1].history, fn=number, ft=number)
    bare = replace(
        results.frames[1], contacts=empty, fn=none, ft=none, nlgs_fn=none, nlgs_ft=none, un=none, ut=none,
        state=np.empty(0, np.uint8), age=np.empty(0, np.int32), source=np.empty(0, np.uint8), probability=none,
        fn_sd=none, ft_sd=none, status=FrameStatus.FAILED, history=history,
    )  # fmt: skip
    failed = results.frames[2]
    failed = replace(failed, fn=np.full_like(failed.fn, np.nan), status=FrameStatus.FAILED, natural_map=np.inf)
    nothing = replace(
        results.statistics[1], stress=np.full((2, 2), np.nan), pressure=np.nan, friction_angle=np.nan, mean_fn=np.nan
    )
    report = write_recording(
        replace(
            results, frames=[results.frames[0], bare, failed], statistics=[results.statistics[0], nothing, nothing]
        ),
        tmp_path / "run.rrd",
    )
    assert report.frames == 3
    assert np.isnan(read_forces(report.path)[2].fn).all()


def test_photographs_need_a_scale(results, tmp_path):
    with pytest.raises(ValueError, match="scale"):
        write_recording(results, tmp_path / "run.rrd", photograph=photograph)


def test_an_unknown_tab_is_refused(results, tmp_path):
    with pytest.raises(ValueError, match="Truth"):
        write_recording(results, tmp_path / "run.rrd", options=RecordingOptions(active=Tab.TRUTH))
    assert list(tmp_path.iterdir()) == []


def test_a_file_without_its_end_is_refused(tmp_path):
    stream = rr.RecordingStream(entities.APPLICATION_ID)
    stream.save(tmp_path / "cut.rrd", write_footer=False)
    stream.log("/summary", rr.TextDocument("nothing"), static=True)
    stream.disconnect()
    with pytest.raises(OSError, match="completely"):
        _check_complete(tmp_path / "cut.rrd")


@pytest.mark.thorough
def test_a_side_file_opens_as_one_recording_with_every_sweep(tmp_path):
    from rodsight.recording.files.side_file import record_side_file

    results = make_results(3, sweeps=200)
    main = write_recording(results, tmp_path / "run.rrd", options=RecordingOptions(sweeps="log")).path
    size = record_side_file(results, main, tmp_path / "side.rrd", [1])
    assert size == (tmp_path / "side.rrd").stat().st_size
    entries = [RrdReader(str(path)).recordings()[0] for path in (main, tmp_path / "side.rrd")]
    assert entries[0].recording_id == entries[1].recording_id
    assert entries[0].application_id == entries[1].application_id
    done = rerun("rrd", "merge", main, tmp_path / "side.rrd", "-o", tmp_path / "both.rrd")
    assert done.returncode == 0, done.stderr
    assert len(RrdReader(str(tmp_path / "both.rrd")).recordings()) == 1
    style = ForceStyle.on(Canvas.around(results.tracks, None), ForceRange.of(results.frames))
    for sweep in (57, 58, 101):  # log spacing has at most one of two neighbours
        shown = latest(tmp_path / "both.rrd", entities.FORCES, entities.SWEEP, 201 + sweep)
        assert shown["LineStrips2D:radii"] == style.radii(results.frames[1].history.fn[sweep]).tolist()
        assert shown["fn"] == results.frames[1].fn.tolist()
    with pytest.raises(ValueError, match="no frame 7"):
        record_side_file(results, main, tmp_path / "side.rrd", [7])
