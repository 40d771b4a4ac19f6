"""What Python gets: the promised names, runs as tables with their units, forces of arrays as the command finds them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import rodsight

from tests.program import rodsight as command

FEW = {"solver.sweeps": 50}


@pytest.fixture(scope="module")
def run(made_tracks: Path, tmp_path_factory: pytest.TempPathFactory) -> rodsight.Run:
    return rodsight.run(made_tracks, out=tmp_path_factory.mktemp("notebook") / "run", settings=FEW)


@pytest.fixture(scope="module")
def poses(made_tracks: Path) -> pd.DataFrame:
    """The experiment's tables as one data frame, as somebody has it who tracks with other tools."""
    tracks, grains, times = (pd.read_csv(made_tracks / f"{name}.csv") for name in ("tracks", "grains", "times"))
    return tracks.merge(grains, on="id").merge(times, on="frame")


@pytest.fixture(scope="module")
def walls(made_tracks: Path) -> pd.DataFrame:
    return pd.read_csv(made_tracks / "walls.csv")


def solve(poses, walls, **choices):  # type: ignore[no-untyped-def]
    pressed = {"top": 50e3}
    return rodsight.solve(poses, walls, pressure=pressed, settings=FEW | choices.pop("settings", {}), **choices)


def test_importing_loads_no_numerics():
    code = "import rodsight, sys; print([m for m in ('numpy', 'numba', 'pandas', 'h5py') if m in sys.modules])"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stdout.strip() == "[]"


def test_every_promised_name_is_there_and_no_other():
    assert set(rodsight.__all__) <= set(dir(rodsight))
    for name in rodsight.__all__:
        assert getattr(rodsight, name) is not None
    with pytest.raises(AttributeError, match="has no attribute 'solv'"):
        rodsight.solv  # noqa: B018


def test_a_run_in_python_leaves_what_the_command_leaves(made_tracks, run, tmp_path):
    assert command("run", str(made_tracks), "--out", str(tmp_path / "run"), "--quiet", "--set", "solver.sweeps=50") == 0
    assert run.file is not None
    assert {file.name for file in run.file.parent.iterdir()} == {file.name for file in (tmp_path / "run").iterdir()}
    pd.testing.assert_frame_equal(run.contacts(), rodsight.open(tmp_path / "run").contacts())


def test_results_are_not_read_before_they_are_asked_for(run):
    assert "results" not in vars(rodsight.open(run.file))


def test_tables_name_units_and_hold_what_was_stored(run):
    contacts, results = run.contacts(2), run.results
    forces = results.frames[2]
    assert contacts.attrs["units"]["fn"] == "N"
    assert contacts.attrs["units"]["gap"] == "m"
    np.testing.assert_array_equal(contacts["fn"], forces.fn)
    np.testing.assert_array_equal(contacts[["x", "y"]], forces.contacts.point)
    np.testing.assert_array_equal(contacts["i"], results.tracks.id[forces.contacts.i])
    wall = forces.contacts.j[forces.contacts.with_wall] - results.grains.count
    assert contacts["j"][forces.contacts.with_wall].tolist() == [results.walls.name[w] for w in wall]
    wanted = {"frame", "i", "j", "x", "y", "nx", "ny", "gap", "fn", "ft", "fn_sd", "ft_sd", "state"}
    assert wanted <= set(contacts.columns)


def test_frames_grains_and_walls_have_a_row_each(run):
    frames, tracks = run.frames(), run.results.tracks
    assert len(frames) == tracks.frame_count
    assert frames["status"].tolist() == [each.status.name.lower() for each in run.results.frames]
    assert len(run.grains()) == tracks.frame_count * tracks.grain_count
    np.testing.assert_array_equal(run.grains(1)["theta"], tracks.rotation[1])
    ends = run.walls(3)[["x1", "y1", "x2", "y2"]].to_numpy().reshape(-1, 2, 2)
    np.testing.assert_array_equal(ends, run.results.walls.endpoints[3])
    assert run.walls().attrs["units"]["wall_force_x"] == "N"


def test_a_frame_that_is_not_there_is_named(run):
    with pytest.raises(IndexError, match="no frame 5: frames go from 0 to 4"):
        run.contacts(5)


def test_arrays_give_what_the_experiment_gives(run, poses, walls):
    solved = solve(poses, walls)
    assert solved.file is None
    pd.testing.assert_frame_equal(solved.contacts(), run.contacts())
    columns = {name: poses[name].to_numpy() for name in poses}
    pd.testing.assert_frame_equal(solve(columns, walls).contacts(), run.contacts())


def test_settings_and_material_of_a_call_are_obeyed(run, poses, walls):
    other = solve(poses, walls, material={"friction": 0.4}, settings={"solver.estimator": "nlgs"})
    assert other.results.friction == 0.4
    assert not np.array_equal(other.contacts(4)["fn"].sum(), run.contacts(4)["fn"].sum())


@pytest.mark.parametrize(
    ("spoil", "told"),
    [
        (lambda p, w: (p.drop(columns="x"), w, {}), "tracks: column x: there is no such column"),
        (
            lambda p, w: (p.assign(x=p["x"].where(p.index != 3)), w, {}),
            "tracks: row 3, x = 'nan': is not a finite number",
        ),
        (
            lambda p, w: (p.assign(radius=p["radius"] * (1 + p.index)), w, {}),
            "tracks: id = 0: has more than one radius",
        ),
        (lambda p, w: (p, w.iloc[1:], {}), "has no row of wall"),
        (lambda p, w: (p, w, {"settings": {"solver.kapa": 1}}), "did you mean solver.kappa"),
        (lambda p, w: (p, w, {"settings": {"contacts.threshold": 1e-4}}), "has no effect on the ensemble"),
        (lambda p, w: (p, w, {"precision": -1.0}), "precision: -1.0: is not a positive number"),
        (lambda p, w: (p.iloc[:0], w, {}), "tracks: has no rows"),
    ],
)
def test_a_mistake_is_named(poses, walls, spoil, told):
    tracks, bars, choices = spoil(poses, walls)
    with pytest.raises(rodsight.InputError, match=told):
        solve(tracks, bars, **choices)


def test_a_wall_that_is_not_there_cannot_be_pressed(poses, walls):
    with pytest.raises(rodsight.InputError, match="'lid': is not the name of a wall"):
        rodsight.solve(poses, walls, pressure={"lid": 1e4})
