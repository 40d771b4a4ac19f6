"""results.h5 alone, without its experiment and its folder, can be scored, recorded, exported, compared and opened."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
import rodsight as product

from tests.golden.stored import unpack
from tests.program import rodsight

FEW = ("--set", "solver.estimator=nlgs", "--set", "solver.sweeps=20", "--sweeps", "none", "--quiet")


@pytest.fixture(scope="module")
def made(made_tracks: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with results.h5 and a truth, and nothing else; what the experiment's own score is, beside them."""
    folder = tmp_path_factory.mktemp("alone")
    experiment = Path(shutil.copytree(made_tracks, folder / "experiment"))
    assert rodsight("solve", experiment, "--out", folder / "run", *FEW) == 0
    (folder / "sent").mkdir()
    shutil.copy(folder / "run" / "results.h5", folder / "sent")
    shutil.copy(experiment / "truth_contacts.csv", folder / "sent" / "truth.csv")
    shutil.rmtree(experiment)
    return folder


@pytest.fixture
def sent(made: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(made / "sent", tmp_path / "sent"))


@pytest.mark.thorough
def test_it_is_scored_as_with_its_experiment(made, sent, capsys):
    summary = json.loads((made / "run" / "summary.json").read_text())
    capsys.readouterr()
    assert rodsight("score", sent / "results.h5", "--truth", sent / "truth.csv", "--json") == 0
    scored = json.loads(capsys.readouterr().out)
    assert scored["r_fn"] == summary["accuracy"]["r_fn"]
    assert rodsight("score", sent, "--truth", sent / "truth.csv") == 0
    assert "r(f_n) over all frames" in capsys.readouterr().out


@pytest.mark.thorough
def test_it_is_recorded_without_photographs(sent, capsys):
    assert rodsight("record", sent / "results.h5", "--sweeps", "none", "--quiet") == 0
    assert (sent / "recording.rrd").stat().st_size > 0
    assert rodsight("record", sent, "--quiet") == 2  # it would be replaced
    assert "--out" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("what", ["tables", "vtk", "graph", "figures"])
def test_it_is_exported(sent, what):
    options = ("--formats", "png") if what == "figures" else ()
    assert rodsight("export", what, sent / "results.h5", "--quiet", *options) == 0
    assert list((sent / what).iterdir())


@pytest.mark.thorough
def test_it_is_compared_and_opened(sent, tmp_path):
    file = sent / "results.h5"
    assert rodsight("compare", file, file, "--out", tmp_path / "both.rrd") == 0
    assert len(product.open(file).contacts(frame=1))


@pytest.mark.slow
@pytest.mark.parametrize("version", [1, 2])
def test_files_of_earlier_schemas_stand_alone_too(tmp_path, version):
    file = unpack(version, tmp_path)
    assert rodsight("record", file, "--sweeps", "none", "--quiet", "--out", tmp_path / "out") == 0
    assert rodsight("export", "tables", file, "--quiet", "--out", tmp_path / "tables") == 0
    assert product.open(file).summary()["frame_count"] > 0


def test_a_missing_file_is_named(tmp_path, capsys):
    assert rodsight("score", tmp_path / "results.h5", "--truth", tmp_path / "truth.csv") == 2
    assert "results.h5" in capsys.readouterr().err
