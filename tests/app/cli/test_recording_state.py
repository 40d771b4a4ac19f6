"""A recording, a summary and results belong together, and to their own experiment, wherever a folder was copied to."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
import rodsight as product
from rodsight.experiment.experiment import load_experiment
from rodsight.out_of_date import out_of_date, recording_out_of_date
from rodsight.process.stages import FORCES
from rodsight.results.manifest import MANIFEST, Manifest
from rodsight.run_folder import Run, hold_run, owner_of
from rodsight.synthetic.synthesis import SynthesisSettings, synthesize
from rodsight.verdicts.log import VerdictLog
from rodsight.workbench.service.project import Project

from tests.app.cli.test_out_of_date import FEW, PRESSURE, pressure
from tests.program import rodsight

pytestmark = pytest.mark.thorough


@pytest.fixture(scope="module")
def made(made_tracks: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("recorded")
    shutil.copytree(made_tracks, root / "tracked")
    assert rodsight("run", root / "tracked", "--out", root / "runs" / "tracked", *FEW) == 0
    return root


@pytest.fixture
def root(made: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "root"))


@pytest.fixture
def solved_again(root: Path) -> Path:
    """A run's folder whose results are newer than its recording."""
    pressure(root)
    assert rodsight("solve", root / "tracked", "--out", root / "runs" / "tracked", *FEW) == 0
    return root / "runs" / "tracked"


def test_a_recording_of_earlier_results_is_out_of_date_and_its_results_are_not(solved_again, root, capsys):
    assert out_of_date(solved_again) == []
    assert recording_out_of_date(solved_again) == ["recording.rrd shows earlier results"]
    assert rodsight("share", solved_again) == 2
    assert "recording.rrd shows earlier results" in capsys.readouterr().err
    assert rodsight("view", solved_again.parent, "--list") == 0
    assert "shows earlier" in " ".join(capsys.readouterr().out.split())
    assert Project(root, root / "tracked").out_of_date() == ["recording.rrd shows earlier results"]
    assert rodsight("record", root / "tracked", "--out", solved_again, *FEW) == 0
    assert recording_out_of_date(solved_again) == []


@pytest.mark.slow
def test_the_summary_is_that_of_the_results_whichever_command_solved_them(root):
    folder = root / "runs" / "tracked"
    before = json.loads((folder / "summary.json").read_text())["loads"]
    pressure(root)
    assert rodsight("record", root / "tracked", "--out", folder, *FEW) == 0
    assert json.loads((folder / "summary.json").read_text())["loads"] != before


def test_input_that_changes_during_a_run_makes_its_results_out_of_date(root):
    """The run has read its input; what is written meanwhile is not what it was made from."""
    folder = root / "runs" / "tracked"
    run = Run(load_experiment(root / "tracked"), folder)
    log = VerdictLog(folder / "verdicts.jsonl").snapshot()
    origin = run.origin(FORCES, log)
    pressure(root)
    walls = root / "tracked" / "walls.csv"
    walls.write_text(walls.read_text() + "\n")
    with hold_run(run):
        run.manifest.add("results.h5", origin.fingerprint, origin.program | run.state_of_input(log))
    assert out_of_date(folder)[:2] == [PRESSURE, "walls.csv has changed"]


def test_results_of_a_version_that_stored_no_input_are_out_of_date(root):
    folder = root / "runs" / "tracked"
    stored = json.loads((folder / MANIFEST).read_text())
    stored["pieces"] = {"results.h5": {key: stored["pieces"]["results.h5"][key] for key in ("made_from", "sha256")}}
    (folder / MANIFEST).write_text(json.dumps(stored))
    (reason,) = out_of_date(folder)
    assert "earlier version" in reason


@pytest.mark.slow
def test_commands_that_read_results_print_it(root, capsys):
    folder = root / "runs" / "tracked"
    pressure(root)
    for command in (("score", folder, "--json"), ("export", "tables", folder), ("compare", folder, folder)):
        out = () if command[0] == "score" else ("--out", root / f"out.{command[0]}")
        assert rodsight(*command, *out) == 0
        assert f"Out of date: {PRESSURE}" in " ".join(capsys.readouterr().err.split()), command


def test_it_is_opened_in_python_with_a_warning(root):
    folder = root / "runs" / "tracked"
    assert product.open(folder).out_of_date == []
    pressure(root)
    with pytest.warns(UserWarning, match=f"out of date: {PRESSURE}"):
        opened = product.open(folder / "results.h5")
    assert opened.summary()["out_of_date"] == opened.out_of_date == [PRESSURE]
    assert "out of date" in repr(opened)


@pytest.fixture(scope="module")
def made_neighbour(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Another experiment of the same name; not to be written to."""
    folder = tmp_path_factory.mktemp("neighbour") / "tracked"
    synthesize(folder, SynthesisSettings(grains=30, frames=5, photographs=False, noise=1e-5, seed=7))
    return folder


@pytest.fixture
def neighbour(made_neighbour: Path, tmp_path: Path) -> Path:
    """A copy of it, in the same place of another folder."""
    shutil.copytree(made_neighbour, tmp_path / "other" / "tracked")
    return tmp_path / "other"


def test_a_run_copied_beside_another_experiment_still_belongs_to_its_own(made, root, neighbour, capsys):
    own = made / "tracked" / "experiment.toml"
    copy = Path(shutil.copytree(root / "runs" / "tracked", neighbour / "runs" / "tracked"))
    assert owner_of(copy) == own
    assert Project(neighbour, neighbour / "tracked").overview()["run"] is None
    assert rodsight("run", neighbour / "tracked", "--out", copy, *FEW) == 2
    assert "of another experiment" in capsys.readouterr().err
    Manifest(copy).store({"place": str(root / "gone" / "experiment.toml")})
    assert rodsight("score", copy, "--json") == 2
    assert "is not at hand" in capsys.readouterr().err


def test_a_whole_folder_that_was_moved_and_edited_keeps_its_run(root, tmp_path):
    moved = Path(shutil.move(root, tmp_path / "moved"))
    pressure(moved)
    assert owner_of(moved / "runs" / "tracked") == moved / "tracked" / "experiment.toml"
    assert out_of_date(moved / "runs" / "tracked") == [PRESSURE]


@pytest.mark.slow
def test_results_alone_use_no_experiment_that_happens_to_be_in_the_current_folder(
    root, neighbour, tmp_path, monkeypatch, capsys
):
    (tmp_path / "sent").mkdir()
    shutil.copy(root / "runs" / "tracked" / "results.h5", tmp_path / "sent")
    monkeypatch.chdir(neighbour / "tracked")
    assert rodsight("score", tmp_path / "sent") == 2
    assert "is not at hand" in capsys.readouterr().err
    assert rodsight("export", "figures", tmp_path / "sent", "--formats", "png", "--quiet") == 0
    assert not (tmp_path / "sent" / "figures" / "truth.png").exists()
    truth = root / "tracked" / "truth_contacts.csv"
    assert product.score(tmp_path / "sent", truth)["r_fn"].mean() > 0.5
    monkeypatch.chdir(root / "tracked")  # its own
    assert rodsight("score", tmp_path / "sent", "--json") == 0
