"""A run locks its folder, validates stored files, and stores no names of persons or places."""

from __future__ import annotations

import getpass
import json
import os
import shutil
import socket
from pathlib import Path

import h5py
import numpy as np
import pytest
from rodsight import pipeline
from rodsight.experiment.reading.input_files import InputFiles
from rodsight.process.lock import LOCK, Holder, hold_folder
from rodsight.results.checkpoint import Checkpoint
from rodsight.results.hdf5.store import load_results
from rodsight.verdicts.log import VERDICTS, Entry, Flag, VerdictLog

from tests.program import rodsight

FEW = ("--set", "solver.estimator=nlgs", "--set", "solver.sweeps=30", "--sweeps", "none", "--quiet")
DEAD = 2**22 + 1  # above the greatest process id


def lock_of(folder: Path, **changes: object) -> None:
    folder.mkdir(exist_ok=True)
    this = Holder.this()
    lock = {"process": this.process, "began": this.began, "host": this.host} | changes
    (folder / LOCK).write_text(json.dumps(lock))


def forces(out: Path) -> np.ndarray:
    with h5py.File(out / "results.h5") as store:
        return store["forces/fn"][()]


class StoppedError(Exception):
    """Simulates a kill."""


def cut_off(monkeypatch: pytest.MonkeyPatch, frames: int, *arguments: object) -> None:
    """Run a command and stop it after a number of frames."""
    save, saved = Checkpoint.save, []

    def saving(self: Checkpoint, frame: int, *values: object) -> None:
        save(self, frame, *values)
        saved.append(frame)
        if len(saved) == frames:
            raise StoppedError

    with monkeypatch.context() as patch:
        patch.setattr(Checkpoint, "save", saving)
        with pytest.raises(StoppedError):
            rodsight(*arguments)


def test_a_folder_in_use_is_refused_and_left_alone(tracked, tmp_path, capsys):
    out = tmp_path / "out"
    lock_of(out)
    before = (out / LOCK).read_bytes()
    assert rodsight("solve", tracked, "--out", out, *FEW) == 1
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert f"process {os.getpid()} works in it" in printed.err
    assert [each.name for each in out.iterdir()] == [LOCK]
    assert (out / LOCK).read_bytes() == before


def test_a_lock_of_another_machine_is_refused_with_a_cure(tracked, tmp_path, capsys):
    out = tmp_path / "out"
    lock_of(out, host="elsewhere")
    assert rodsight("solve", tracked, "--out", out, *FEW) == 1
    printed = capsys.readouterr().err
    assert "on elsewhere" in printed
    assert f"delete {out / LOCK}" in printed


@pytest.mark.parametrize("left", [{"process": DEAD}, {"began": "1"}], ids=["dead", "its number used again"])
def test_a_lock_of_a_dead_process_is_reported_and_taken_over(tmp_path, left):
    lock_of(tmp_path, **left)
    notes = []
    with hold_folder(tmp_path, notes.append):
        assert json.loads((tmp_path / LOCK).read_text())["process"] == os.getpid()
    assert not (tmp_path / LOCK).exists()
    assert len(notes) == 1
    assert "taken over" in notes[0]


def test_an_incomplete_lock_is_ignored(tmp_path):
    (tmp_path / LOCK).write_text('{"process": 1')
    with hold_folder(tmp_path, pytest.fail):
        pass


def test_a_refused_experiment_leaves_no_folder_behind(tracked, tmp_path):
    (tracked / "times.csv").unlink()
    assert rodsight("solve", tracked, "--out", tmp_path / "deep" / "out", *FEW) == 2
    assert not (tmp_path / "deep").exists()


@pytest.mark.slow  # several whole runs
def test_cut_off_runs_of_different_settings_do_not_mix_frames(tracked, tmp_path, monkeypatch):
    out, other = tmp_path / "out", ("--set", "material.friction=0.4")
    command = ("solve", tracked, "--out", out, *FEW)
    assert rodsight("solve", tracked, "--out", tmp_path / "whole", *FEW, *other) == 0
    cut_off(monkeypatch, 2, *command)
    kept = (out / ".unfinished" / "solving" / "000001.piece").read_bytes()
    cut_off(monkeypatch, 1, *command, *other)
    # A late frame of the first run beside those of the second must not be used.
    (out / ".unfinished" / "solving" / "000001.piece").write_bytes(kept)
    assert rodsight(*command, *other) == 0
    assert np.array_equal(forces(out), forces(tmp_path / "whole"))


@pytest.mark.thorough  # several whole runs
@pytest.mark.parametrize(
    "piece", ["results.h5", pytest.param(".unfinished/solving/000001.piece", marks=pytest.mark.slow)]
)
def test_a_damaged_piece_is_reported_and_computed_again(tracked, tmp_path, monkeypatch, capsys, piece):
    out = tmp_path / "out"
    command = ("solve", tracked, "--out", out, *FEW[:-1])
    assert rodsight("solve", tracked, "--out", tmp_path / "whole", *FEW) == 0
    if piece == "results.h5":
        assert rodsight(*command) == 0
    else:
        cut_off(monkeypatch, 3, *command)
    content = bytearray((out / piece).read_bytes())
    content[len(content) // 2] ^= 0xFF
    (out / piece).write_bytes(content)
    capsys.readouterr()
    assert rodsight(*command) == 0
    printed = capsys.readouterr()
    assert "damaged" in printed.out
    assert "Traceback" not in printed.err
    assert np.array_equal(forces(out), forces(tmp_path / "whole"))


@pytest.mark.slow
def test_damaged_results_are_not_read(tracked, tmp_path, capsys):
    out = tmp_path / "out"
    assert rodsight("solve", tracked, "--out", out, *FEW) == 0
    content = bytearray((out / "results.h5").read_bytes())
    content[len(content) // 2] ^= 0xFF
    (out / "results.h5").write_bytes(content)
    assert rodsight("score", out) == 2
    assert "damaged or changed" in capsys.readouterr().err


def test_a_file_that_changes_while_it_is_used_ends_the_run(tracked, tmp_path, capsys, monkeypatch):
    read, changed = InputFiles.read, []

    def changing(self: InputFiles, file: Path, **options: bool) -> bytes:
        content = read(self, file, **options)
        if file.name == "tracks.csv" and not changed:
            changed.append(file)
            file.write_bytes(content.replace(b"0.1", b"0.2", 1))
        return content

    monkeypatch.setattr(InputFiles, "read", changing)
    assert rodsight("solve", tracked, "--out", tmp_path / "out", *FEW) == 1
    printed = capsys.readouterr().err
    assert "tracks.csv: has changed while it was in use" in printed
    assert printed.count("\n") == 1
    assert not (tmp_path / "out" / "results.h5").exists()


@pytest.mark.thorough  # several whole runs
def test_a_verdict_given_during_a_run_is_used_by_the_next_run_only(tracked, tmp_path, monkeypatch):
    out = tmp_path / "out"
    command = ("solve", tracked, "--out", out, *FEW)
    track, verdicts = pipeline.track, []

    def tracking(run):
        if not verdicts:
            verdicts.append(VerdictLog(out / VERDICTS).append(Entry(3, "anna", flag=Flag.RESET)))
        return track(run)

    with monkeypatch.context() as patch:
        patch.setattr(pipeline, "track", tracking)
        assert rodsight(*command) == 0
    manifest = json.loads((out / "manifest.json").read_text())
    assert manifest["verdicts"]["lines"] == []
    assert load_results(out / "results.h5").frames[3].status.name != "RESET"
    assert rodsight(*command) == 0
    manifest = json.loads((out / "manifest.json").read_text())
    assert manifest["verdicts"]["lines"] == [verdicts[0].line]
    assert load_results(out / "results.h5").frames[3].status.name == "RESET"


@pytest.mark.slow
def test_partial_files_of_a_stopped_run_are_removed_and_no_others(tracked, tmp_path):
    out = tmp_path / "out"
    (out / ".unfinished" / "solving").mkdir(parents=True)
    left = [out / "results.h5.part", out / ".unfinished" / "solving" / "000003.piece.part"]
    for file in (*left, out / "mine.part"):
        file.write_text("half")
    assert rodsight("solve", tracked, "--out", out, *FEW) == 0
    assert not any(file.exists() for file in left)
    assert (out / "mine.part").exists()


@pytest.mark.slow  # several whole runs
def test_pieces_left_beside_complete_results_are_removed(tracked, tmp_path, monkeypatch):
    arguments = ("solve", tracked, "--out", tmp_path / "out", *FEW)

    def dying(self: Checkpoint) -> None:
        raise StoppedError

    with monkeypatch.context() as patch:
        patch.setattr(Checkpoint, "clear", dying)
        with pytest.raises(StoppedError):
            rodsight(*arguments)
    assert list((tmp_path / "out").rglob("*.piece"))
    assert rodsight(*arguments) == 0
    assert not (tmp_path / "out" / ".unfinished").exists()


@pytest.mark.slow
def test_results_contain_no_names_of_persons_or_places(tracked, tmp_path, monkeypatch):
    monkeypatch.setattr(socket, "gethostname", lambda: "machine-of-somebody")
    home = Path(shutil.move(tracked, tmp_path / "of_somebody"))
    out = tmp_path / "out"
    assert rodsight("run", home, "--out", out, *FEW) == 0
    with h5py.File(out / "results.h5") as store:
        assert store.attrs["experiment"] == "experiment.toml"
    for name in ("results.h5", "recording.rrd"):
        content = (out / name).read_bytes()
        for private in (str(tmp_path), "of_somebody", "machine-of-somebody", f"/{getpass.getuser()}/"):
            assert private.encode() not in content, (name, private)
    manifest = json.loads((out / "manifest.json").read_text())
    assert manifest["experiment"] == "../of_somebody/experiment.toml"
    assert set(manifest["inputs"]) >= {"experiment.toml", "tracks.csv", "grains.csv", "times.csv", "walls.csv"}
    assert rodsight("score", out) == 0
