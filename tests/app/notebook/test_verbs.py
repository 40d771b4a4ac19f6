"""The verbs of the commands in Python: defaults, returned values, refusals, and the tasks of the documentation."""

from __future__ import annotations

import inspect
import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import rodsight
from rodsight.manual.contents import FOLDER
from rodsight.results.hdf5.reader import StoredRun
from rodsight.solver.contacts.contacts import ContactSource

from tests.program import rodsight as command

FEW = {"solver.sweeps": 20}
VERBS = {
    "check", "init", "track", "solve", "run", "open", "follow", "review", "score", "compare", "sensitivity", "what_if",
    "campaign", "import_table", "export",
}  # fmt: skip
MOST_PARAMETERS = 7
MOST_LINES = 5


@pytest.fixture(scope="module")
def run(made_tracks: Path, tmp_path_factory: pytest.TempPathFactory) -> rodsight.Run:
    return rodsight.run(made_tracks, out=tmp_path_factory.mktemp("verbs") / "run", settings=FEW)


@pytest.mark.thorough
def test_all_verbs_are_public_functions_that_stay_so_whatever_is_imported(run):
    assert set(rodsight.__all__) >= VERBS
    for name in VERBS:
        assert inspect.isfunction(getattr(rodsight, name)), name


@pytest.mark.parametrize("name", sorted(VERBS - {"solve"}))
def test_verbs_have_few_parameters(name):
    assert len(inspect.signature(getattr(rodsight, name)).parameters) <= MOST_PARAMETERS


def test_the_five_tasks_take_at_most_five_lines_each():
    section = (FOLDER / "python.md").read_text(encoding="utf-8").partition("## Five tasks")[2].partition("\n## ")[0]
    tasks = re.findall(r"```python\n(.*?)```", section, re.DOTALL)
    assert len(tasks) == 5
    for task in tasks:
        lines = [line for line in task.splitlines() if line and not line.startswith("import ")]
        assert len(lines) <= MOST_LINES


def test_bad_input_is_an_input_error_with_one_line(made_tracks):
    with pytest.raises(rodsight.InputError, match=r"did you mean solver\.kappa"):
        rodsight.check(made_tracks, settings={"solver.kapa": 1})
    with pytest.raises(rodsight.InputError, match="has no effect on the ensemble"):
        rodsight.run(made_tracks, settings={"contacts.threshold": 1e-4})
    assert issubclass(rodsight.RunError, Exception)


@pytest.mark.slow
def test_check_gives_what_the_command_prints(made_tracks, capsys):
    found = rodsight.check(made_tracks)
    assert command("check", str(made_tracks), "--json") == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["grains"] == found["grains"] == 40
    assert printed["expected_correlation"] == found["expected_correlation"]
    assert printed["prediction"] == list(found["prediction"])


@pytest.mark.thorough
def test_tracks_solve_to_the_same_forces(made_tracks, without_sensors, tmp_path):
    run = rodsight.run(without_sensors, out=tmp_path / "without_sensors", settings=FEW)
    tracks = rodsight.track(made_tracks, out=tmp_path / "run")
    walls = pd.read_csv(made_tracks / "walls.csv")  # those of the run are corrected
    for rows in (tracks, tracks.sample(frac=1.0, random_state=3)):
        solved = rodsight.solve(rows, walls, pressure={"top": 50e3}, settings=FEW)
        pd.testing.assert_frame_equal(solved.contacts(), run.contacts())


@pytest.mark.thorough
def test_score_equals_the_command_and_accepts_a_table(made_tracks, run, capsys):
    scores = rodsight.score(run)
    assert command("score", str(run.file.parent), "--json") == 0
    assert json.loads(capsys.readouterr().out)["r_fn"] == scores["r_fn"].tolist()
    table = pd.read_csv(made_tracks / "truth_contacts.csv")
    pd.testing.assert_frame_equal(rodsight.score(run, table), scores)
    own = rodsight.score(run, run.contacts())  # walls in a column of their own
    assert own["r_fn"].to_numpy() == pytest.approx(1.0)


def test_compare_has_every_contact_of_either(made_tracks, run):
    both = rodsight.compare(run, pd.read_csv(made_tracks / "truth_contacts.csv"))
    last = both.query("frame == 4")
    r = np.corrcoef(last["fn"], last["fn_reference"])[0, 1]
    assert r == pytest.approx(rodsight.score(run)["r_fn"].iloc[4], abs=1e-6)
    assert last["fn_reference"].eq(0.0).any()
    own = run.contacts(4)
    merged = own.merge(last, on=["i", "j", "wall"])
    assert len(merged) == len(own)
    np.testing.assert_array_equal(merged["fn_x"], merged["fn_y"])


@pytest.mark.thorough
def test_a_forbidden_contact_bears_nothing_and_the_input_is_used_again(run):
    strongest = run.contacts(4).query("j >= 0").nlargest(1, "fn")[["i", "j"]].to_numpy()[0].tolist()
    unchanged = rodsight.what_if(run)
    pd.testing.assert_frame_equal(unchanged.contacts(), run.contacts())
    solved = rodsight.what_if(run, 4, forbid=[strongest])
    pair = "i == {} and j == {}".format(*strongest)
    assert solved.contacts(4).query(pair)["fn"].sum() == 0.0
    pd.testing.assert_frame_equal(solved.contacts(2), run.contacts(2))
    near = rodsight.what_if(run, 4, forbid=[strongest], local=True).contacts(4)
    assert near.query(pair)["fn"].item() == 0.0
    assert not np.array_equal(near["fn"], run.contacts(4)["fn"])


def test_a_local_change_of_one_frame_reads_no_other(run, monkeypatch):
    read = []
    own = StoredRun.frame
    monkeypatch.setattr(StoredRun, "frame", lambda stored, k, *more: read.append(k) or own(stored, k, *more))
    run = rodsight.open(run.file.parent)
    strongest = run.contacts(4).query("j >= 0").nlargest(1, "fn")[["i", "j"]].to_numpy()[0].tolist()
    read.clear()
    near = rodsight.what_if(run, 4, forbid=[strongest], local=True)
    assert set(read) <= {4}
    pd.testing.assert_frame_equal(near.contacts(2), run.contacts(2))


def test_friction_and_place_are_changed_locally(run):
    given = run.contacts(4)
    mu = 0.5 * run.results.friction
    limited = rodsight.what_if(run, 4, friction=mu, local=True).contacts(4)
    assert (given["ft"].abs() > mu * given["fn"] + 1.0).any()
    between = limited["wall"] == ""
    assert (limited["ft"].abs() <= mu * limited["fn"] + 1e-2 * given["fn"].mean())[between].all()
    pd.testing.assert_frame_equal(rodsight.what_if(run, 4, friction=0.9, local=True).contacts(4), given)
    name = int(given.nlargest(1, "fn")["i"].item())
    moved = rodsight.what_if(run, 4, move={name: (5e-5, 0.0)}, local=True).contacts(4)
    own = (moved["i"] == name) | (moved["j"] == name)
    assert not np.allclose(moved["nx"][own], given["nx"][own], atol=1e-6)
    assert not np.allclose(moved["fn"][own], given["fn"][own], rtol=1e-3)
    pd.testing.assert_series_equal(moved["nx"][~own], given["nx"][~own])


@pytest.mark.thorough
def test_a_forced_contact_is_listed(run):
    contacts = run.contacts(4)
    listed = set(zip(contacts["i"], contacts["j"], strict=True))
    grains = run.grains(4).set_index("id")[["x", "y", "radius"]]
    gaps = {
        (a, b): np.hypot(*(grains.loc[a, ["x", "y"]] - grains.loc[b, ["x", "y"]])) - grains["radius"][[a, b]].sum()
        for a in grains.index
        for b in grains.index
        if a < b and (a, b) not in listed
    }
    pair = min(gaps, key=gaps.__getitem__)
    solved = rodsight.what_if(run, 4, force=[pair])
    forces = solved.results.frames[4]
    assert pair in set(zip(solved.contacts(4)["i"], solved.contacts(4)["j"], strict=True))
    assert ContactSource.FORBIDDEN_BY_REVIEWER not in forces.source


@pytest.mark.thorough
def test_moved_grains_and_another_friction_change_the_inputs(run):
    moved = rodsight.what_if(run, 4, move={7: (2e-5, 0.0)})
    assert moved.inputs.tracks.position[4, 7, 0] - run.grains(4)["x"][7] == pytest.approx(2e-5, abs=1e-5)
    assert not np.array_equal(moved.frames()["mean_fn"], run.frames()["mean_fn"])
    assert rodsight.what_if(run, friction=0.4).results.friction == 0.4


@pytest.mark.thorough
def test_a_grain_that_is_moved_far_is_no_outlier(run):
    moved = rodsight.what_if(run, 2, move={7: (0.0, 4e-4)})
    assert moved.grains(2)["y"][7] - run.grains(2)["y"][7] == pytest.approx(4e-4, abs=5e-5)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"forbid": [(1, "lid")]}, "'lid' is neither a grain's id nor a wall's name"),
        ({"force": [(1, 1)]}, "is one body"),
        ({"force": [(0, 39)]}, r"force = \(0, 39\): are 115 mm apart in frame 0"),
        ({"force": [(0, 1)], "forbid": [(1, 0)]}, r"force = \(0, 1\): is forbidden as well"),
        ({"move": {7: (1.0, 0.0)}}, r"^what_if: move: frame 0, wall 'right': grain 7 lies "),
        ({"move": {999: (0.0, 0.0)}}, "is not the id of a grain"),
        ({"friction": -1.0}, "is not a coefficient of friction"),
        ({"local": True, "force": [(0, 39)]}, "does not apply to force"),
        ({"local": True, "friction": -1.0}, "is not a coefficient of friction"),
        ({"frame": 4, "forbid": [(0, 39)], "local": True}, "has no such contact"),
    ],
)
def test_unusable_assumptions_are_named(run, arguments, message):
    with pytest.raises(rodsight.InputError, match=message):
        rodsight.what_if(run, **arguments)


@pytest.mark.thorough
def test_what_if_refuses_a_run_whose_input_changed(tracked, tmp_path):
    run = rodsight.run(tracked, out=tmp_path / "run", settings=FEW | {"recording.sweeps": "none"})
    file = tracked / "tracks.csv"
    file.write_text(file.read_text() + "\n")
    with pytest.raises(rodsight.InputError, match=r"tracks\.csv: changed since this run was solved"):
        rodsight.what_if(run, friction=0.3)


@pytest.mark.thorough
def test_verdicts_of_a_table_are_stored(tracked, tmp_path):
    run = rodsight.run(tracked, out=tmp_path / "run", settings=FEW)
    table = run.contacts(2).head(2)[["frame", "i", "j", "wall"]].assign(verdict="contact")
    stored = rodsight.review(run, table, reviewer="anna")
    assert stored[["frame", "verdict", "reviewer"]].to_numpy().tolist() == [[2, "contact", "anna"]] * 2


def test_unknown_options_are_refused(run, tmp_path):
    with pytest.raises(rodsight.InputError, match="is not an option"):
        rodsight.export("tables", run, tmp_path, colour="red")  # type: ignore[call-arg]
    with pytest.raises(rodsight.InputError, match="is not a kind"):
        rodsight.export("csv", run)  # type: ignore[arg-type]
    with pytest.raises(rodsight.InputError, match="is not an option"):
        rodsight.import_table(tmp_path, tmp_path, scale=2.0)  # type: ignore[call-arg]


@pytest.mark.parametrize("frame", [2.5, "3", [1, 2]])
def test_what_is_no_frame_is_refused_with_its_value(run, frame):
    for table in (run.contacts, run.grains, run.walls, run.graph, lambda frame: run.figure("forces", frame)):
        with pytest.raises(rodsight.InputError, match=f"^frame: {re.escape(repr(frame))}: is not a whole number"):
            table(frame)
    with pytest.raises(rodsight.InputError, match=r"^frame: "):
        rodsight.what_if(run, frame)
    assert len(run.contacts(np.int64(1))) == len(run.contacts(1))


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ({"pressure": 5e4}, "pressure: 50000.0: is no mapping of walls to pascals"),
        ({"pressure": {"top": "5e4"}}, "pressure: top = '5e4'"),
        ({"precision": "1e-5"}, "precision: '1e-5'"),
        ({"settings": 3}, "settings: 3: is no mapping of keys to values"),
        ({"settings": {"solver.kappa": object}}, "settings['solver.kappa']: <class 'object'>"),
        ({"material": [0.25]}, "material: [0.25]: is no mapping of keys to values"),
        ({"walls": 4}, "walls: int: is neither a data frame nor a mapping of columns"),
        ({"walls": {"frame": [0], "wall": ["top", "left"]}}, "walls: is no table"),
        ({"boundary": 7}, "boundary: 7: must be ids"),
    ],
)
def test_arguments_of_another_kind_are_refused_with_their_value(made_tracks, given, named):
    tracks = pd.read_csv(made_tracks / "tracks.csv").merge(pd.read_csv(made_tracks / "grains.csv"), on="id")
    arguments = {"walls": pd.read_csv(made_tracks / "walls.csv"), "pressure": {"top": 5e4}} | given
    with pytest.raises(rodsight.InputError) as refused:
        rodsight.solve(tracks, **arguments)
    assert named in str(refused.value)


@pytest.mark.parametrize(
    ("given", "named"),
    [
        ({"forbid": [0, 1]}, "what_if: forbid = [0, 1]: 0 is no pair of bodies"),
        ({"force": [(0, 1, 2)]}, "force = [(0, 1, 2)]: (0, 1, 2) is no pair"),
        ({"forbid": 3}, "forbid = 3: is no list of pairs"),
        ({"forbid": [(0, [1])]}, "[1] is neither a grain's id nor a wall's name"),
        ({"move": [(0, 1.0)]}, "move: [(0, 1.0)]: is no mapping of ids to displacements"),
        ({"move": {0: 1e-5}}, "move = {0: 1e-05}"),
        ({"friction": "rough"}, "friction = 'rough': is not a coefficient"),
    ],
)
def test_bodies_that_are_none_are_refused_with_their_value(run, given, named):
    with pytest.raises(rodsight.InputError) as refused:
        rodsight.what_if(run, 1, local="move" in given, **given)
    assert named in str(refused.value)


@pytest.mark.thorough
def test_a_table_of_verdicts_in_memory_has_its_own_name_and_the_user_as_reviewer(made_tracks, tmp_path, monkeypatch):
    made = rodsight.run(made_tracks, out=tmp_path / "run", settings=FEW)
    pair = made.contacts(1).query("j >= 0")[["frame", "i", "j"]].head(1)
    for wrong, named in (
        (pair.assign(i=999), "verdicts: row 0, i = '999'"),
        (pair.drop(columns="j"), "verdicts: column j"),
    ):
        with pytest.raises(rodsight.InputError, match=f"^{re.escape(named)}"):
            rodsight.review(made, wrong)
    with pytest.raises(rodsight.InputError, match=r"^truth: row 0, i = '999'"):
        rodsight.score(made, pair.assign(i=999, fn=1.0, ft=0.0))
    monkeypatch.setattr("getpass.getuser", lambda: "ada")
    assert rodsight.review(made, pair)["reviewer"].tolist() == ["ada"]
