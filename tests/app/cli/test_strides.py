"""Every so many photographs: --frames A:B:STEP solves the same as a table of these photographs alone."""

from __future__ import annotations

import json

import numpy as np
import pytest
from rodsight.cli.arguments import parse_frames
from rodsight.experiment.experiment import load_experiment
from rodsight.experiment.jpeg_photographs import JpegPhotographs
from rodsight.process.errors import InputError
from rodsight.results.hdf5.store import load_results, origin_of
from rodsight.reviewing.reviewed_run import open_reviewed_run
from rodsight.run_folder import Run, hold_run

from tests.program import rodsight

FEW = ("--quiet", "--set", "solver.sweeps=20")


def keep_every_second(folder):
    """Leave photographs 0, 2, 4 in all tables of an experiment, as frames 0, 1, 2."""
    for name in ("tracks.csv", "walls.csv", "times.csv", "truth_contacts.csv", "wall_forces.csv"):
        head, *rows = (folder / name).read_text().splitlines()
        cells = [row.split(",", 1) for row in rows]
        kept = [f"{int(frame) // 2},{rest}" for frame, rest in cells if int(frame) % 2 == 0]
        (folder / name).write_text("\n".join([head, *kept]) + "\n")


@pytest.mark.slow
def test_a_stride_solves_what_a_table_of_these_photographs_would(tracked, tmp_path, capsys):
    assert rodsight("solve", str(tracked), "--out", str(tmp_path / "stride"), "--frames", "::2", *FEW) == 0
    of_stride = load_results(tmp_path / "stride/results.h5")
    assert origin_of(tmp_path / "stride/results.h5").frames == (0, None, 2)
    assert rodsight("score", str(tmp_path / "stride"), "--json") == 0
    scored = json.loads(capsys.readouterr().out)
    with pytest.raises(InputError, match="one photograph in 2"):
        open_reviewed_run(tmp_path / "stride")
    keep_every_second(tracked)
    assert rodsight("solve", str(tracked), "--out", str(tmp_path / "table"), *FEW) == 0
    of_table = load_results(tmp_path / "table/results.h5")
    assert len(of_stride.frames) == 3
    assert np.array_equal(of_stride.tracks.time, of_table.tracks.time)
    for one, two in zip(of_stride.frames, of_table.frames, strict=True):
        assert np.array_equal(one.fn, two.fn)
    capsys.readouterr()
    assert rodsight("score", str(tmp_path / "table"), "--json") == 0
    assert scored["r_fn"] == json.loads(capsys.readouterr().out)["r_fn"]


@pytest.mark.parametrize(
    ("given", "other", "covered"),
    [
        (":", "0:12", True), ("0:12", "0:12", True), ("0:2", "0:12", False), ("0:2", ":", False), ("0:12", "2:4", True),
        ("2:", "0:4", False), ("::2", ":", False), (":", "::3", True), ("::2", "::4", True), ("1::2", "::4", False),
    ],
)  # fmt: skip
def test_a_range_covers_another(given, other, covered):
    assert parse_frames(given).covers(parse_frames(other)) == covered


@pytest.mark.parametrize("command", ["record", "sensitivity"])
def test_finished_frames_are_not_replaced_by_fewer(command, tracked, tmp_path, capsys):
    out = tmp_path / "out"
    run = Run(load_experiment(tracked), out)
    with hold_run(run):
        run.write_manifest()
        (out / "results.h5").write_bytes(b"of all frames")
    before = {file: file.read_bytes() for file in out.iterdir()}
    assert rodsight(command, tracked, "--out", out, "--frames", "0:2", "--quiet") == 2
    line = capsys.readouterr().err
    assert f"--frames: 0:2: {out / 'results.h5'} holds all frames, which" in line
    assert "rodsight share" in line
    assert before == {file: file.read_bytes() for file in out.iterdir()}


def test_a_range_may_have_a_step():
    assert parse_frames("2:9:3") == (2, 9, 3)
    assert parse_frames("::4") == (0, None, 4)
    assert parse_frames("2:9") == (2, 9, 1)
    assert parse_frames("2:9:3").number(2) == 8
    assert str(parse_frames("2:9:3")) == "2:9:3"


def test_photographs_of_a_stride_are_those_that_it_covers():
    shots = [np.full((16, 16), 20.0 * k, np.float32) for k in range(9)]
    shown = JpegPhotographs(shots, parse_frames("1:9:3"))
    assert np.array_equal(shown[2].jpeg, JpegPhotographs(shots, parse_frames(None))[7].jpeg)


def test_a_step_is_refused_where_it_would_be_ignored(tmp_path, capsys):
    (tmp_path / "recording.rrd").write_bytes(b"")
    assert rodsight("share", str(tmp_path), "--frames", "0:4:2") == 2
    assert "--frames: 0:4:2: has a step" in capsys.readouterr().err
