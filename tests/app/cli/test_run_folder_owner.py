"""A run's folder belongs to one experiment: another one of the same name neither shows nor overwrites its results."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from rodsight import run_folder
from rodsight.experiment.experiment import load_experiment
from rodsight.process.errors import InputError
from rodsight.run_folder import Run, has_input, hold_run, owner_of
from rodsight.workbench.service.project import Project
from rodsight.workbench.service.workbench import Workbench

from tests.app.workbench.conftest import Visitor
from tests.program import rodsight


@pytest.fixture
def claimed(tracked: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder runs/<name> of a run of the experiment."""
    monkeypatch.chdir(tracked.parent)
    run = Run(load_experiment(tracked), Path("runs/tracked"))
    with hold_run(run):
        run.claim()
        run.write_manifest()
        (run.folder / "tracks.h5").touch()  # as a page finds them
    return run.folder


def test_another_experiment_of_the_same_name_is_refused_in_one_line_that_names_both(tracked, claimed, capsys):
    copy = Path(shutil.copytree(tracked, "copied"))
    before = {file: file.read_bytes() for file in claimed.iterdir()}
    for command in ("run", "solve", "track", "record"):
        assert rodsight(command, copy, "--quiet") == 2
        line = capsys.readouterr().err
        assert line.count("\n") == 1
        assert str((tracked / "experiment.toml").resolve()) in line
        assert str((copy / "experiment.toml").resolve()) in line
        assert "--out" in line
    assert {file: file.read_bytes() for file in claimed.iterdir()} == before


def test_an_interrupted_run_owns_its_folder_before_its_first_frame(tracked, tmp_path):
    run = Run(load_experiment(tracked), tmp_path / "out")
    run.checkpoint("solving", "print")
    assert owner_of(run.folder) == (tracked / "experiment.toml").resolve()


def test_the_experiment_itself_keeps_its_folder_by_any_path_and_after_an_edit(tracked, claimed, tmp_path):
    (tmp_path / "link").symlink_to(tracked)
    (tracked / "experiment.toml").write_text((tracked / "experiment.toml").read_text() + "\n# edited\n")
    for path in (tracked, tmp_path / "link", tracked / "experiment.toml"):
        with hold_run(Run(load_experiment(path), claimed)):
            pass


def test_a_moved_experiment_keeps_its_folder_and_an_edited_one_in_its_place_does_not(tracked, claimed):
    moved = Path(shutil.move(tracked, "moved"))
    with hold_run(Run(load_experiment(moved), claimed)):
        pass
    (moved / "experiment.toml").write_text((moved / "experiment.toml").read_text() + "\n# another\n")
    with pytest.raises(InputError, match="of another experiment"), hold_run(Run(load_experiment(moved), claimed)):
        pass


def test_a_copied_experiment_is_not_run_yet_on_the_page(tracked, claimed, tmp_path):
    copy = Path(shutil.copytree(tracked, tmp_path / "copied"))
    assert Project(tmp_path, tracked).overview()["run"] is not None
    assert Project(tmp_path, copy).overview()["run"] is None
    assert not Project(tmp_path, copy).results.exists()
    refused = Visitor(Workbench(tmp_path)).enter().refused("run_start", at="copied")
    assert "holds the run of another experiment" in refused
    assert "--out" in refused


def test_the_results_of_another_experiment_are_not_reviewed(tracked, claimed, capsys):
    copy = Path(shutil.copytree(tracked, "copied"))
    (claimed / "results.h5").touch()
    assert rodsight("review", copy, "--no-browser") == 2
    assert "holds the run of another experiment" in capsys.readouterr().err


def test_an_experiment_file_that_is_unchanged_is_that_of_the_run_whatever_else_changed(tracked):
    file = tracked / "experiment.toml"
    others = dict.fromkeys(("tracks.csv", "grains.csv"), "other")
    assert has_input(file, {file.name: hashlib.sha256(file.read_bytes()).hexdigest(), **others})
    assert not has_input(file, {file.name: "other", **others})


def test_a_folder_that_another_experiment_claims_meanwhile_is_refused(tracked, tmp_path, monkeypatch):
    other, out = Path(shutil.copytree(tracked, tmp_path / "other")), tmp_path / "out"
    hold = run_folder.hold_folder

    @contextmanager
    def claimed_first(folder: Path, *rest: object) -> Iterator[None]:
        Run(load_experiment(other), folder).claim()
        with hold(folder, *rest):
            yield

    out.mkdir()
    monkeypatch.setattr(run_folder, "hold_folder", claimed_first)
    with pytest.raises(InputError, match="of another experiment"), hold_run(Run(load_experiment(tracked), out)):
        pass


@pytest.mark.parametrize("command", ["run", "track", "solve", "record", "sensitivity"])
def test_results_go_neither_to_a_file_nor_into_an_experiment(command, tracked, capsys):
    before = {file: file.read_bytes() for file in tracked.iterdir()}
    table = tracked / "tracks.csv"
    for out, words in ((table, "is a file"), (table / "below", "is a file"), (tracked, "folder of an experiment")):
        assert rodsight(command, tracked, "--out", out, "--quiet") == 2
        line = capsys.readouterr().err
        assert words in line
        assert "--out" in line
        assert line.count("\n") == 1
    assert before == {file: file.read_bytes() for file in tracked.iterdir()}
