"""Results belong to the code and the libraries that made them."""

from __future__ import annotations

import json
import shutil
import sys
import threading
from pathlib import Path
from types import FrameType
from typing import Any

import h5py
import pytest
from rodsight import pipeline, run_folder
from rodsight.experiment.experiment import load_experiment
from rodsight.pipeline import EFFECTS, FORCES, TRACKING
from rodsight.process.sources import APP, program_sources
from rodsight.process.stages import Stage
from rodsight.run_folder import hold_run

from tests.program import rodsight

FEW = ("--set", "solver.estimator=nlgs", "--set", "solver.sweeps=20", "--sweeps", "none")


@pytest.fixture(scope="module")
def made_run(made_tracks, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("other_code") / "out"
    assert rodsight("solve", made_tracks, "--out", out, *FEW) == 0
    return out


@pytest.fixture
def out(made_run, tmp_path) -> Path:
    return Path(shutil.copytree(made_run, tmp_path / "out"))


def created(out: Path) -> str:
    with h5py.File(out / "results.h5") as store:
        return f"{store.attrs['code']} {store.attrs['libraries']}"


def other_code(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_folder, "hash_of_code", lambda *_: "other")


@pytest.mark.thorough
def test_results_name_their_code_and_libraries(made_run):
    with h5py.File(made_run / "results.h5") as store:
        assert len(store.attrs["code"]) == 64
        libraries = json.loads(store.attrs["libraries"])
    assert list(libraries) == ["numpy", "numba", "scipy", "OpenCV", "h5py"]
    assert libraries["h5py"] == h5py.__version__
    assert all(libraries.values())


def test_results_of_the_same_code_are_used_again(out, made_tracks, capsys):
    before = (out / "results.h5").read_bytes()
    assert rodsight("solve", made_tracks, "--out", out, *FEW) == 0
    assert (out / "results.h5").read_bytes() == before
    assert "computed anew" not in capsys.readouterr().out


@pytest.mark.slow
def test_results_of_other_code_are_solved_anew_and_one_line_states_why(out, made_tracks, monkeypatch, capsys):
    before = created(out)
    other_code(monkeypatch)
    assert rodsight("solve", made_tracks, "--out", out, *FEW) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert printed.count("were made by other code: they are computed anew") == 1
    assert created(out) != before
    assert created(out).startswith("other ")


@pytest.mark.slow
def test_results_of_another_library_are_solved_anew_and_a_line_names_both(out, made_tracks, monkeypatch, capsys):
    stated = run_folder.library_versions()
    monkeypatch.setattr(run_folder, "library_versions", lambda: stated | {"numpy": "99.0"})
    assert rodsight("solve", made_tracks, "--out", out, *FEW) == 0
    assert f"numpy {stated['numpy']} instead of 99.0" in " ".join(capsys.readouterr().out.split())


def test_old_results_can_be_looked_at(out, made_tracks, monkeypatch, capsys):
    before = (out / "results.h5").read_bytes()
    other_code(monkeypatch)
    assert rodsight("solve", made_tracks, "--out", out, *FEW, "--keep-old") == 0
    assert (out / "results.h5").read_bytes() == before
    assert "made by other code: they are shown as they are" in " ".join(capsys.readouterr().out.split())


def test_a_program_is_described_only_where_it_made_other_results_of_the_same_input(made_tracks, tmp_path):
    origin = run_folder.Run(load_experiment(made_tracks), tmp_path).origin(FORCES)
    same = {"made_from": "other", "inputs": origin.inputs, "code": "other", "libraries": origin.libraries}
    assert run_folder.describe_program(same, origin) == "other code"
    assert run_folder.describe_program(same | {"made_from": origin.fingerprint}, origin) == ""
    assert run_folder.describe_program(same | {"inputs": "other"}, origin) == ""


def test_settings_are_part_of_the_input(made_tracks, tmp_path):
    inputs = {
        run_folder.Run(load_experiment(made_tracks, settings), tmp_path).origin(FORCES).inputs
        for settings in ((), ("material.friction=0.3",), ("solver.sweeps=7",))
    }
    assert len(inputs) == 3


def test_frames_of_two_programs_do_not_mix(made_tracks, tmp_path, monkeypatch):
    run = run_folder.Run(load_experiment(made_tracks), tmp_path / "out")
    first = run.checkpoint("solving", run.origin(FORCES).fingerprint)
    (first.folder / "000000.piece").touch()
    assert run.checkpoint("solving", run.origin(FORCES).fingerprint).has(0)
    other_code(monkeypatch)
    assert not run.checkpoint("solving", run.origin(FORCES).fingerprint).has(0)


@pytest.mark.parametrize(
    "changed",
    [
        "solver/nlgs/sweeping/contact_law.py",
        "solver/assessment/fitted.toml",
        "experiment/reading/tables.py",
        "results/hdf5/writer.py",
        "pipeline.py",
    ],
)
def test_forces_depend_on_every_source_between_their_input_and_their_file(changed):
    sources = program_sources()
    assert changed in sources.needed_by(FORCES.code) | set(FORCES.alone)


# Sources that run while a stage does and change no stored number: they compile, refuse input, hold the folder.
WITHOUT_EFFECT = (
    "compilation/",
    "process/",
    "experiment/plausibility.py",
    "results/manifest.py",
    "run_folder.py",
    "run_truth.py",
)
OF_TRUTH = ("results/truth.py",)  # read, and compared with results by name only


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("stage", "of"), [(TRACKING, "made_photographs"), (FORCES, "made_tracks")], ids=["tracks", "forces"]
)
def test_every_source_that_runs_is_part_of_the_fingerprint(stage, of, request, tmp_path):
    run = run_folder.Run(load_experiment(request.getfixturevalue(of)), tmp_path / "out")
    used: set[str] = set()

    def note(frame: FrameType, event: str, argument: Any) -> None:
        if event == "call" and frame.f_code.co_name != "<module>":
            used.add(frame.f_code.co_filename)

    threading.setprofile(note)
    sys.setprofile(note)
    try:
        with hold_run(run):
            pipeline.track(run) if stage is TRACKING else pipeline.solve(run)
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
    assert unhashed(used, stage) == []


def unhashed(files: set[str], stage: Stage) -> list[str]:
    """Return the sources among these files that a stage's fingerprint leaves out although they have an effect."""
    sources, found = program_sources(), set()
    for file in map(Path, files):
        for place, prefix in ((APP, ""), (APP.parent / "solver", "solver/")):
            if file.is_relative_to(place):
                found.add(prefix + file.relative_to(place).as_posix())
    assert len(found) > 20
    missing = found - sources.needed_by(stage.code) - set(stage.alone)
    return sorted(name for name in missing if not name.startswith((*WITHOUT_EFFECT, *OF_TRUTH)))


def test_effects_of_a_sensitivity_study_depend_on_how_inputs_are_varied():
    needed = program_sources().needed_by(EFFECTS.code)
    assert {"robustness/factors.py", "robustness/design.py", "robustness/networks.py"} <= needed


@pytest.mark.parametrize("stage", [FORCES, TRACKING], ids=["forces", "tracks"])
def test_results_do_not_depend_on_pages_and_pictures(stage):
    needed = program_sources().needed_by(stage.code)
    assert not [name for name in needed if name.startswith(("cli/", "workbench/", "recording/", "figures/"))]
