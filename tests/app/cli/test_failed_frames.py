"""A bad photograph or an unsolvable frame fails that frame only, with a message."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import cv2
import h5py
import numpy as np
import pytest
from rodsight.experiment.reading.tables import read_table
from rodsight.inference import solve_frames
from rodsight.run_folder import FAILURES

from tests.app.experiment.tables import edit
from tests.app.tracking.photographed import keep_first_walls
from tests.program import rodsight

BLACK = 2
FEW = ("--set", "solver.sweeps=30", "--sweeps", "none")


def blacken(experiment: Path, frame: int) -> None:
    file = sorted((experiment / "photos").iterdir())[frame]
    image = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
    assert image is not None
    cv2.imwrite(str(file), np.zeros_like(image))


@pytest.mark.thorough  # seconds of photographs
def test_a_black_photograph_fails_its_own_frame(made_photographs, tmp_path, capsys):
    experiment, out = Path(shutil.copytree(made_photographs, tmp_path / "black")), tmp_path / "out"
    keep_first_walls(experiment)  # walls are tracked in the photographs, and lost there, too
    blacken(experiment, BLACK)
    assert rodsight("run", experiment, "--out", out, *FEW) == 0
    assert "Frame 2 failed, without forces: 0 of 30 grains are found in" in capsys.readouterr().out.replace("\n", " ")
    summary = json.loads((out / "summary.json").read_text())
    assert [status == "failed" for status in summary["status"]] == [k == BLACK for k in range(4)]
    assert list(summary["failures"]) == [str(BLACK)]
    assert summary["trust"][BLACK] == 0.0
    with h5py.File(out / "results.h5") as store:
        reasons, offset = store["frames/failed_reason"].asstr()[()], store["contacts/offset"][()]
        assert [bool(reason) for reason in reasons] == [k == BLACK for k in range(4)]
        assert "wall" in reasons[BLACK]
        assert np.diff(offset)[BLACK] == 0
        assert (np.diff(offset)[[0, 1, 3]] > 20).all()
        assert np.isfinite(store["forces/fn"][()]).all()
        assert np.isnan(store["statistics/pressure"][BLACK])
    walls = read_table(out / "tracked_walls.csv", ("frame",)).integers("frame")
    assert sorted(set(walls)) == [0, 1, 3]


@pytest.mark.thorough
def test_a_frame_that_cannot_be_solved_is_reported_and_its_traceback_logged(tracked, tmp_path, capsys, monkeypatch):
    solve_sequence = solve_frames.solve_sequence

    def failing(*given, observer, **options):
        yield from solve_sequence(*given, observer=observer, **(options | {"failed": {3: "it failed"}}))
        observer(3, ZeroDivisionError("by nothing"))

    monkeypatch.setattr(solve_frames, "solve_sequence", failing)
    assert rodsight("solve", tracked, "--out", tmp_path / "out", *FEW) == 0
    printed = capsys.readouterr()
    assert "Frame 3 failed, without forces: it failed." in printed.out
    assert "Traceback" not in printed.out + printed.err
    log = (tmp_path / "out" / FAILURES).read_text()
    assert "solving, frame 3" in log
    assert "ZeroDivisionError: by nothing" in log


def test_a_run_without_a_solvable_frame_fails_in_one_line(tracked, tmp_path, capsys, monkeypatch):
    def fail(*given):
        raise ZeroDivisionError("by nothing")

    monkeypatch.setattr("rodsight.solver.sequence.frames.pose_frame", fail)
    assert rodsight("run", tracked, "--out", tmp_path / "out", "--quiet") == 1
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert "no frame could be solved" in printed.err
    assert "failures.log" in printed.err


def test_invalid_input_is_not_a_failed_frame(tracked, tmp_path, capsys):
    edit(tracked / "times.csv", "\n2,", "\n2,-")
    assert rodsight("run", tracked, "--out", tmp_path / "out", "--quiet") == 2
    assert "times.csv" in capsys.readouterr().err
