"""The size budget as a user states it."""

from __future__ import annotations

import pytest

from tests.program import rodsight

FEW = ("--set", "solver.sweeps=300", "--set", "solver.estimator=nlgs")


@pytest.mark.slow
def test_a_size_limit_is_kept_and_its_reductions_are_reported(tracked, tmp_path, capsys):
    out = tmp_path / "out"
    common = ("record", str(tracked), "--out", str(out), "--sweeps", "all", *FEW)
    assert rodsight(*common) == 0
    full = (out / "recording.rrd").stat().st_size
    assert rodsight(*common, "--max-size", "0.1") == 0
    assert "Still larger" in capsys.readouterr().out
    least = (out / "recording.rrd").stat().st_size
    limit = 0.5 * (least + full)
    assert rodsight(*common, "--max-size", str(1e-6 * limit)) == 0
    assert (out / "recording.rrd").stat().st_size <= limit
    assert "Limited to" in capsys.readouterr().out
    assert rodsight(*common, "--max-size", "-3") == 2
    assert "--max-size" in capsys.readouterr().err


@pytest.mark.slow
def test_every_sweep_of_chosen_frames_goes_to_a_side_file(tracked, tmp_path, capsys):
    out = tmp_path / "out"
    common = ("record", str(tracked), "--out", str(out), "--sweeps", "all", *FEW)
    assert rodsight(*common, "--full-frames", "2", "3") == 0
    assert "frames 2, 3" in capsys.readouterr().out
    assert (out / "recording-sweeps.rrd").is_file()
    assert rodsight(*common, "--full-frames", "9") == 2
    assert "no frame 9" in capsys.readouterr().err
    assert rodsight(*common) == 0
    assert not (out / "recording-sweeps.rrd").exists()  # the recording contains all sweeps again
