from __future__ import annotations

import sys

import numpy as np
import pytest
from rodsight.cli.main import main
from rodsight.recording.archive.catalogue import find_recordings, read_properties
from rodsight.recording.files.finished_run import write_recording
from rodsight.recording.viewing.recording_server import RecordingServer

from tests.app.recording.fake_results import make_results, make_truth
from tests.browser import open_when_served, wait_for_forces


def view(*arguments: str) -> int:
    with pytest.raises(SystemExit) as end:
        main(["view", *arguments])
    return int(end.value.code or 0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory):
    """Return a folder with two runs, a single recording and side files."""
    runs = tmp_path_factory.mktemp("runs")
    for name in ("soft", "stiff"):
        (runs / name).mkdir()
    results = make_results(3, sweeps=20)
    write_recording(results, runs / "soft" / "recording.rrd", truth=make_truth(results, np.random.default_rng(3)))
    write_recording(make_results(4, 5, 4, sweeps=20), runs / "stiff" / "recording.rrd")
    write_recording(make_results(1, sweeps=20), runs / "one.rrd")
    (runs / "stiff" / "recording-sweeps.rrd").write_bytes(b"")
    (runs / "recording-live.rrd").write_bytes(b"")
    return runs


def test_a_folder_is_searched_for_runs_and_single_recordings(folder):
    found = [str(file.relative_to(folder)) for file in find_recordings(folder)]
    assert found == ["one.rrd", "soft/recording.rrd", "stiff/recording.rrd"]


def test_every_property_of_a_run_is_a_separate_value(folder):
    soft = read_properties(folder / "soft" / "recording.rrd")
    assert soft["experiment:name"] == "fake"
    assert soft["experiment:frames"] == 3
    assert soft["experiment:grains"] == 56
    assert soft["experiment:friction"] == 0.25
    assert soft["experiment:pressure_kpa"] == 50.0
    assert soft["outcome:settled_share"] == 0.0
    assert 0.0 < soft["outcome:trust_least"] <= soft["outcome:trust_median"] < 1.0
    assert soft["outcome:r_fn_mean"] > 0.9
    assert "outcome:r_fn_mean" not in read_properties(folder / "stiff" / "recording.rrd")


def test_the_list_has_a_line_for_every_recording_and_its_properties_as_columns(folder, capsys):
    assert view(str(folder), "--list") == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == ["recording", "one.rrd", "soft/recording.rrd", "stiff/recording.rrd"]
    assert all(heading in lines[0] for heading in ("frames", "grains", "settled", "least trust", "r(f_n)"))
    assert lines[2].split()[1:4] == ["fake", "3", "56"]
    assert lines[3].split()[-1] == "–"  # no truth


def test_without_a_display_only_the_list_is_shown(folder, capsys, monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert view(str(folder)) == 0
    output = capsys.readouterr().out
    assert "stiff/recording.rrd" in output
    assert "--web" in output


def test_a_folder_without_recordings_is_refused(tmp_path, capsys):
    assert view(str(tmp_path)) == 2
    assert "holds no recording" in capsys.readouterr().err


def test_a_damaged_recording_does_not_hide_the_others(folder, tmp_path, capsys):
    whole = (folder / "one.rrd").read_bytes()
    (tmp_path / "bad.rrd").write_bytes(whole[:1000])
    (tmp_path / "good.rrd").write_bytes(whole)
    assert view(str(tmp_path), "--list") == 0
    output = capsys.readouterr().out
    assert ["good.rrd", "fake"] in [line.split()[:2] for line in output.splitlines()]
    assert f"--repair {tmp_path / 'bad.rrd'}" in output.replace("\n", "")


@pytest.mark.slow
@pytest.mark.screen
def test_recordings_open_together_in_a_browser(folder, page):
    server = RecordingServer(find_recordings(folder))
    try:
        open_when_served(page, f"{server.address}&renderer=webgl")
        wait_for_forces(page)
    finally:
        server.close()
