"""The Python interface: public names, tables with units, and the same forces from arrays as from the command."""

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
    """The experiment's tables as one data frame, as from another tracking program."""
    tracks, grains, times = (pd.read_csv(made_tracks / f"{name}.csv") for name in ("tracks", "grains", "times"))
    return tracks.merge(grains, on="id").merge(times, on="frame")


@pytest.fixture(scope="module")
def walls(made_tracks: Path) -> pd.DataFrame:
    return pd.read_csv(made_tracks / "walls.csv")


def solve(poses, walls, **choices):  # type: ignore[no-untyped-def]
    pressure = choices.pop("pressure", {"top": 50e3})
    return rodsight.solve(poses, walls, pressure=pressure, settings=FEW | choices.pop("settings", {}), **choices)


def test_importing_loads_no_numerics():
    code = "import rodsight, sys; print([m for m in ('numpy', 'numba', 'pandas', 'h5py') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_public_names_exist_and_no_others():
    assert set(rodsight.__all__) <= set(dir(rodsight))
    for name in rodsight.__all__:
        assert getattr(rodsight, name) is not None
    with pytest.raises(AttributeError, match="has no attribute 'solv'"):
        rodsight.solv  # noqa: B018


@pytest.mark.slow
def test_a_run_in_python_writes_the_same_files_as_the_command(made_tracks, run, tmp_path):
    assert command("run", str(made_tracks), "--out", str(tmp_path / "run"), "--quiet", "--set", "solver.sweeps=50") == 0
    assert run.file is not None
    assert {file.name for file in run.file.parent.iterdir()} == {file.name for file in (tmp_path / "run").iterdir()}
    pd.testing.assert_frame_equal(run.contacts(), rodsight.open(tmp_path / "run").contacts())


@pytest.mark.thorough
def test_results_are_read_on_first_access(run):
    assert "results" not in vars(rodsight.open(run.file))


def test_tables_have_units_and_the_stored_values(run):
    contacts, results = run.contacts(2), run.results
    forces = results.frames[2]
    assert contacts.attrs["units"]["fn"] == "N"
    assert contacts.attrs["units"]["gap"] == "m"
    np.testing.assert_array_equal(contacts["fn"], forces.fn)
    np.testing.assert_array_equal(contacts[["x", "y"]], forces.contacts.point)
    np.testing.assert_array_equal(contacts["i"], results.tracks.id[forces.contacts.i])
    wall = forces.contacts.j[forces.contacts.with_wall] - results.grains.count
    assert contacts["wall"][forces.contacts.with_wall].tolist() == [results.walls.name[w] for w in wall]
    required = {"frame", "i", "j", "x", "y", "nx", "ny", "gap", "fn", "ft", "fn_sd", "ft_sd", "state"}
    assert required <= set(contacts.columns)


def test_frames_grains_and_walls_have_one_row_each(run):
    frames, tracks = run.frames(), run.results.tracks
    assert len(frames) == tracks.frame_count
    assert frames["status"].tolist() == [each.status.name.lower() for each in run.results.frames]
    assert len(run.grains()) == tracks.frame_count * tracks.grain_count
    np.testing.assert_array_equal(run.grains(1)["theta"], tracks.rotation[1])
    ends = run.walls(3)[["x1", "y1", "x2", "y2"]].to_numpy().reshape(-1, 2, 2)
    np.testing.assert_array_equal(ends, run.results.walls.endpoints[3])
    assert run.walls().attrs["units"]["wall_force_x"] == "N"


def test_a_missing_frame_is_named(run):
    with pytest.raises(IndexError, match="no frame 5: frames go from 0 to 4"):
        run.contacts(5)


@pytest.mark.thorough
def test_arrays_give_the_same_forces_as_the_experiment(without_sensors, poses, walls, tmp_path):
    run = rodsight.run(without_sensors, out=tmp_path / "run", settings=FEW)
    solved = solve(poses, walls)
    assert solved.file is None
    pd.testing.assert_frame_equal(solved.contacts(), run.contacts())
    columns = {name: poses[name].to_numpy() for name in poses}
    pd.testing.assert_frame_equal(solve(columns, walls).contacts(), run.contacts())


def test_settings_and_material_of_a_call_are_used(run, poses, walls):
    other = solve(poses, walls, material={"friction": 0.4}, settings={"solver.estimator": "nlgs"})
    assert other.results.friction == 0.4
    assert not np.array_equal(other.contacts(4)["fn"].sum(), run.contacts(4)["fn"].sum())


@pytest.mark.parametrize(
    ("change", "message"),
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
        (lambda p, w: (p.assign(radius=1e3 * p["radius"]), w, {}), "column radius: .*they look like millimetres"),
        (lambda p, w: (p, w.rename(columns={"x1": "x2", "x2": "x1", "y1": "y2", "y2": "y1"}), {}), "look reversed"),
        (lambda p, w: (p.assign(x=p["x"] + 1.0), w, {}), "walls: frame 0, wall .*mm beyond it"),
        (lambda p, w: (p, w, {"pressure": {"top": True}}), "top = True: is not a number of pascals"),
        (lambda p, w: (p, w, {"pressure": {"top": 1e15}}), "is not a number of pascals from 0.001 to 1e"),
    ],
)
def test_invalid_input_is_named(poses, walls, change, message):
    tracks, bars, choices = change(poses, walls)
    with pytest.raises(rodsight.InputError, match=message):
        solve(tracks, bars, **choices)


def test_pressure_on_an_unknown_wall_is_refused(poses, walls):
    with pytest.raises(rodsight.InputError, match="'lid': is not the name of a wall"):
        rodsight.solve(poses, walls, pressure={"lid": 1e4})
