"""The commands end to end on small experiments."""

import json
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest
from rodsight.results.hdf5.store import load_results
from rodsight.results.hdf5.writer import columns_of_results
from rodsight.results.results import Results

from tests.program import KEPT, REPORTING, rodsight, wait_for_report

FEW = ("--set", "solver.sweeps=50")


def same_frames(a: Results, b: Results) -> bool:
    """Compare all stored numbers bit for bit."""
    one, other = columns_of_results(a), columns_of_results(b)
    return one.keys() == other.keys() and all(
        np.array_equal(values, other[path], equal_nan=values.dtype.kind == "f") for path, values in one.items()
    )


def test_a_tracked_experiment_runs_to_results_recording_and_summary(tracked, tmp_path, capsys):
    out = tmp_path / "out"
    assert rodsight("run", str(tracked), "--out", str(out)) == 0
    printed = capsys.readouterr().out
    assert "Against the truth" in printed
    assert "rodsight view" in printed
    assert sorted(file.name for file in out.iterdir() if file.is_file()) == [
        "manifest.json",
        "recording.rrd",
        "results.h5",
        "summary.json",
    ]
    summary = json.loads((out / "summary.json").read_text())
    r = summary["accuracy"]["r_fn"]
    assert len(r) == 5
    assert min(r[2:]) > 0.8  # 40 grains, tracked to 10 µm
    assert summary["status"][0] == "reset"


def test_the_results_file_has_the_public_layout(tracked, tmp_path, capsys):
    out = tmp_path / "out"
    assert rodsight("solve", str(tracked), "--out", str(out), *FEW) == 0
    capsys.readouterr()
    with h5py.File(out / "results.h5") as store:
        n, w, f = len(store["grains/id"]), len(store["walls/name"]), len(store["frames/time"])
        assert store["tracks/position"].shape == (f, n, 2)
        assert store["walls/endpoints"].shape == (f, w, 2, 2)
        offset = store["contacts/offset"][()]
        assert offset.shape == (f + 1,)
        for path in ("i", "j", "gap", "un", "ut", "state", "age", "source", "probability"):
            assert store[f"contacts/{path}"].shape == (offset[-1],)
        for path in ("fn", "ft", "nlgs_fn", "nlgs_ft", "fn_sd", "ft_sd"):
            assert store[f"forces/{path}"].shape == (offset[-1],)
        names = h5py.check_enum_dtype(store["frames/status"].dtype)
        assert set(names) == {"reset", "suspect", "rearranging", "settling", "settled", "failed"}
        assert set(h5py.check_enum_dtype(store["contacts/state"].dtype)) == {"open", "sticking", "sliding"}
        for path in ("sweeps", "natural_map", "unbalance", "kappa", "correction", "old_unbalance", "trust"):
            assert store[f"frames/{path}"].shape == (f,)
        sweeps = store["sweeps/offset"][()]
        assert sweeps.shape == (f + 1,)
        for path in ("number", "force_change", "natural_map", "unbalance"):
            assert store[f"sweeps/{path}"].shape == (sweeps[-1],)
        assert np.isfinite(store["sweeps/natural_map"][()]).all()
        last = store["sweeps/number"][()][sweeps[1:] - 1]
        assert (last == store["sweeps/count"][()] - 1).all()
        assert store["forces/fn"].attrs["unit"] == "N"
        assert store.attrs["schema_version"] == 2
        assert "friction = 0.25" in store.attrs["configuration"]


@pytest.mark.slow
def test_results_read_back_as_they_were_stored(tracked, tmp_path, capsys):
    from rodsight.results.checkpoint import flatten
    from rodsight.results.hdf5.store import Provenance, save_results

    out = tmp_path / "out"
    assert rodsight("solve", str(tracked), "--out", str(out), *FEW) == 0
    capsys.readouterr()
    results = load_results(out / "results.h5")
    save_results(tmp_path / "again.h5", results, Provenance("x", "y", (0, None), {}))
    again = load_results(tmp_path / "again.h5")
    for one, other in zip(
        [results.tracks, results.walls, *results.frames, *results.statistics],
        [again.tracks, again.walls, *again.frames, *again.statistics],
        strict=True,
    ):
        for (name, value), (_, copy) in zip(flatten(one), flatten(other), strict=True):
            equal = np.array_equal(value, copy, equal_nan=value.dtype.kind == "f")
            assert equal, name


@pytest.mark.slow
def test_the_same_command_finds_everything_done(tracked, tmp_path, capsys):
    out = tmp_path / "out"
    assert rodsight("run", str(tracked), "--out", str(out), *FEW) == 0
    before = (out / "results.h5").stat().st_mtime_ns
    assert rodsight("run", str(tracked), "--out", str(out), *FEW) == 0
    assert (out / "results.h5").stat().st_mtime_ns == before
    assert rodsight("run", str(tracked), "--out", str(out), *FEW, "--set", "solver.kappa=0.1") == 0
    assert (out / "results.h5").stat().st_mtime_ns != before
    capsys.readouterr()


@pytest.mark.screen
def test_a_killed_run_goes_on_where_it_stopped(tracked, tmp_path, capsys):
    slow = ("--set", "solver.sweeps=4000", "--set", "recording.sweeps=none")
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    assert rodsight("solve", tracked, "--out", whole, *slow) == 0
    command = [*REPORTING, "solve", str(tracked), "--out", str(cut), *slow]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as run:
        wait_for_report(run, KEPT, 2)
        run.kill()
    kept = cut / ".unfinished" / "solving"
    assert not (cut / "results.h5").exists(), "the run ended before it could be killed"
    assert sorted(file.name for file in kept.glob("*.piece"))[:2] == ["000000.piece", "000001.piece"]
    assert rodsight("solve", tracked, "--out", cut, *slow) == 0
    capsys.readouterr()
    assert same_frames(load_results(whole / "results.h5"), load_results(cut / "results.h5"))
    assert not kept.exists()


def test_an_interrupt_ends_with_130_and_a_hint(tracked, tmp_path, monkeypatch, capsys):
    def interrupt(*_args, **_kwargs):
        raise KeyboardInterrupt

    monkeypatch.setattr("rodsight.pipeline.solve", interrupt)
    assert rodsight("run", str(tracked), "--out", str(tmp_path / "out")) == 130
    assert "resumes" in capsys.readouterr().err


def test_photographs_are_tracked_and_solved(made_photographs, tmp_path, capsys):
    out = tmp_path / "out"
    assert rodsight("run", str(made_photographs), "--out", str(out)) == 0
    capsys.readouterr()
    results = load_results(out / "results.h5")
    assert results.grains.count == 30
    assert results.tracks.present.all()
    summary = json.loads((out / "summary.json").read_text())
    assert summary["lost_poses"] == 0
    assert summary["accuracy"]["contact_recall"][3] == 1.0


@pytest.mark.slow
def test_a_range_of_frames_is_scored_against_its_own_truth(tracked, tmp_path, capsys):
    out = tmp_path / "out"
    assert rodsight("run", str(tracked), "--out", str(out), "--frames", "1:5", "--quiet") == 0
    summary = json.loads((out / "summary.json").read_text())
    assert summary["frame_count"] == 4
    assert summary["accuracy"]["r_fn"][3] > 0.8
    capsys.readouterr()
    assert rodsight("score", str(out), "--json") == 0
    scored = json.loads(capsys.readouterr().out)
    baselines = scored.pop("baselines")
    assert scored == summary["accuracy"]
    assert set(baselines) == {"r_ours", "r_static", "r_overlap", "r_uniform"}
    assert all(len(values) == 4 for values in baselines.values())
    assert baselines["r_ours"][3] > baselines["r_uniform"][3] > 0.2


@pytest.mark.thorough
def test_scoring_the_truth_against_itself_is_perfect(tracked, tmp_path, capsys):
    from rodsight.results.truth import accuracy
    from rodsight.results.truth import score as score_frames

    out = tmp_path / "out"
    assert rodsight("solve", str(tracked), "--out", str(out), *FEW) == 0
    capsys.readouterr()
    results = load_results(out / "results.h5")
    from rodsight.results.results import TruthContacts

    frame = np.concatenate([np.full(f.contacts.count, k) for k, f in enumerate(results.frames)])
    own = TruthContacts(
        frame,
        *(np.concatenate([getattr(f.contacts, key) for f in results.frames]).astype(np.int64) for key in "ij"),
        *(np.concatenate([getattr(f, key) for f in results.frames]) for key in ("fn", "ft")),
    )
    found = accuracy(score_frames(results, own))
    assert found["r_fn"] == pytest.approx([1.0] * 5)
    assert found["relative_l2"] == pytest.approx([0.0] * 5)
    assert found["scale"] == pytest.approx([1.0] * 5)
    assert found["contact_recall"] == [1.0] * 5


@pytest.mark.slow
def test_check_describes_the_input_and_writes_nothing(tracked, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert rodsight("check", str(tracked)) == 0
    assert "40 grains tracked over 5 frames, 4 walls" in capsys.readouterr().out
    assert not Path("runs").exists()


@pytest.mark.thorough
def test_check_predicts_the_accuracy_from_the_first_photographs(made_photographs, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert rodsight("check", made_photographs) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "grains in the first, 4 walls" in printed
    assert "First 3 photographs: positions have a noise" in printed
    assert not list(tmp_path.iterdir())
    assert rodsight("check", made_photographs, "--no-budget") == 0
    assert "noise" not in capsys.readouterr().out


@pytest.mark.parametrize(
    "command", ["run", "check", "track", "solve", "record", "view", "score", "synth", "study", "settings"]
)
def test_every_command_has_help_with_an_example(command, capsys):
    assert rodsight(command, "--help") == 0
    assert f"Example: rodsight {command}" in " ".join(capsys.readouterr().out.split())


@pytest.mark.slow
def test_imposed_walls_alone_give_forces_up_to_a_scale(tracked, tmp_path, capsys):
    out = tmp_path / "out"
    text = (tracked / "experiment.toml").read_text()
    (tracked / "experiment.toml").write_text(text.replace("[walls.top]\npressure = 50000.0\n", ""))
    assert rodsight("run", str(tracked), "--out", str(out)) == 0
    assert "up to a scale" in capsys.readouterr().out
    summary = json.loads((out / "summary.json").read_text())
    assert summary["loaded_walls"] == []
    assert summary["accuracy"]["r_fn"][-1] > 0.7


@pytest.mark.slow
def test_recorded_wall_forces_are_compared_with_inferred_ones(tracked, tmp_path, capsys):
    out = tmp_path / "out"
    assert rodsight("solve", str(tracked), "--out", str(out)) == 0
    printed = capsys.readouterr().out
    summary = json.loads((out / "summary.json").read_text())
    if summary["settled_after"] is not None:  # they are compared over settled frames
        assert set(summary["wall_force_error"]) == {"bottom", "right", "top", "left"}
        assert max(summary["wall_force_error"].values()) < 0.5
        assert "recorded wall forces" in printed
    with h5py.File(out / "results.h5") as store:
        recorded, inferred = store["walls/force"][()], store["statistics/wall_force"][()]
    # Recorded and inferred wall forces have the same direction and magnitude.
    assert np.sum(recorded[3:] * inferred[3:]) > 0.8 * np.sum(recorded[3:] ** 2)
