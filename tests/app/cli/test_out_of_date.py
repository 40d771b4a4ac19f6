"""Results whose input, settings, verdicts or code have changed since are marked wherever they are shown."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from rodsight import out_of_date as state
from rodsight import run_folder
from rodsight.cli.commands import view_commands
from rodsight.experiment.experiment import load_experiment
from rodsight.out_of_date import out_of_date
from rodsight.results.manifest import Manifest
from rodsight.run_folder import RESULTS
from rodsight.verdicts.log import VERDICTS, Entry, Flag, VerdictLog
from rodsight.workbench.service.project import Project
from rodsight.workbench.service.workbench import Workbench

from tests.app.experiment.tables import edit
from tests.app.workbench.conftest import Visitor
from tests.program import rodsight

FEW = ("--set", "solver.estimator=nlgs", "--set", "solver.sweeps=20", "--sweeps", "none", "--quiet")


@pytest.fixture(scope="module")
def made(made_tracks: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("outdated")
    shutil.copytree(made_tracks, root / "tracked")
    assert rodsight("run", root / "tracked", "--out", root / "runs" / "tracked", *FEW) == 0
    return root


@pytest.fixture
def root(made: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "root"))


def pressure(root: Path) -> None:
    edit(root / "tracked" / "experiment.toml", "pressure = 50000.0", "pressure = 500000.0")


PRESSURE = "walls.top.pressure was 50000 and is 500000"
CHANGES = {
    PRESSURE: pressure,
    "walls.csv has changed": lambda root: edit(root / "tracked" / "walls.csv", "0.", "0.0"),
    "truth_contacts.csv has been removed": lambda root: (root / "tracked" / "truth_contacts.csv").unlink(),
    "verdicts have changed": lambda root: VerdictLog(root / "runs/tracked" / VERDICTS).append(
        Entry(3, "anna", flag=Flag.RESET)
    ),
}


@pytest.mark.thorough
def test_a_finished_run_is_up_to_date_also_with_settings_of_the_command_line(root):
    assert out_of_date(root / "runs" / "tracked") == []
    assert json.loads((root / "runs" / "tracked" / "summary.json").read_text())["out_of_date"] == []


@pytest.mark.thorough
def test_comments_change_nothing(root):
    file = root / "tracked" / "experiment.toml"
    file.write_text("# a comment\n" + file.read_text())
    assert out_of_date(root / "runs" / "tracked") == []


@pytest.mark.parametrize("reason", CHANGES)
def test_a_change_is_a_reason(root, reason):
    CHANGES[reason](root)
    assert reason in out_of_date(root / "runs" / "tracked")


def test_a_new_input_is_a_reason(root):
    manifest = Manifest(root / "runs" / "tracked")
    piece = manifest.piece(RESULTS)
    files = {name: checksum for name, checksum in piece["files"].items() if name != "truth_contacts.csv"}
    manifest.note(RESULTS, piece | {"files": files})
    assert out_of_date(root / "runs" / "tracked") == ["truth_contacts.csv has been added"]


def test_changed_settings_are_named_where_the_input_cannot_be_read(root):
    edit(root / "tracked" / "experiment.toml", "pressure = 50000.0", 'pressure = "high"')
    first, second = out_of_date(root / "runs" / "tracked")
    assert first == "walls.top.pressure was 50000 and is high"
    assert "its input cannot be read" in second


def test_settings_that_are_new_gone_or_many_are_named(root):
    file = root / "tracked" / "experiment.toml"
    text = file.read_text().replace('name = "tracked"', 'name = "other"')
    assert "[walls.top]" in text
    text = text.replace("pressure = 50000.0", 'ends = "bar"') + "\n[solver]\nkappa = 0.1\nsweeps = 10\n"
    file.write_text(text)
    assert out_of_date(root / "runs" / "tracked")[:4] == [
        "name was tracked and is other", "solver.kappa was not given and is 0.1",
        "solver.sweeps was not given and is 10", "2 more settings have changed",
    ]  # fmt: skip


def test_other_code_is_a_reason(root, monkeypatch):
    monkeypatch.setattr(state, "hash_of_code", lambda *_: "other")
    assert out_of_date(root / "runs" / "tracked") == ["other code or libraries made it"]


def test_an_interrupted_run_of_newer_input_leaves_old_results_out_of_date(root):
    pressure(root)
    run = run_folder.Run(load_experiment(root / "tracked"), root / "runs" / "tracked")
    run.write_manifest()
    assert out_of_date(run.folder) == [PRESSURE]


@pytest.mark.thorough
def test_it_is_shared_only_with_a_flag(root, capsys):
    pressure(root)
    assert rodsight("share", root / "runs" / "tracked") == 2
    printed = capsys.readouterr().err
    assert printed.count("\n") == 1
    assert f"is out of date: {PRESSURE}" in printed
    assert rodsight("share", root / "runs" / "tracked", "--although-out-of-date") == 0


def test_the_viewer_is_opened_with_a_line(root, capsys, monkeypatch):
    monkeypatch.setattr(view_commands, "show", lambda *_: 0)
    assert rodsight("view", root / "runs" / "tracked") == 0
    assert "Out of date" not in capsys.readouterr().out
    pressure(root)
    assert rodsight("view", root / "runs" / "tracked") == 0
    assert f"Out of date: {PRESSURE}" in capsys.readouterr().out


def test_the_page_shows_it_and_refuses_to_share(root):
    assert Project(root, root / "tracked").overview()["run"]["out_of_date"] == []
    pressure(root)
    project = Project(root, root / "tracked")
    assert project.overview()["run"]["out_of_date"] == [PRESSURE]
    visitor = Visitor(Workbench(root)).enter()
    assert visitor.request("project", at="tracked")["run"]["out_of_date"] == [PRESSURE]
    assert visitor.request("project", at="tracked")["run"]["faults"][0] == f"Out of date: {PRESSURE}. Run again."
    assert "out of date" in visitor.refused("share", at="tracked")
