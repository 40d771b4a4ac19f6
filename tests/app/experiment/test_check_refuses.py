"""`check` refuses what `run` refuses, photographs included, and names columns that look like missing ones."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.app.experiment.tables import edit, swap_row
from tests.app.experiment.test_likely_causes import change, reverse
from tests.program import rodsight


@pytest.fixture
def photographed(made_photographs: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(made_photographs, tmp_path / "photographed"))


def y_down(file: Path) -> None:
    change(file, y1=lambda y: 0.3 - y, y2=lambda y: 0.3 - y)


@pytest.mark.slow
@pytest.mark.parametrize("mistake", [reverse, y_down])
def test_wrong_walls_of_photographs_are_refused(photographed, capsys, mistake):
    mistake(photographed / "walls.csv")
    assert rodsight("check", photographed, "--quiet") == 2
    printed = capsys.readouterr()
    assert printed.err.count("\n") == 1
    assert "wall" in printed.err
    assert "valid" not in printed.out


@pytest.mark.parametrize("name", ["angle", "Theta", "theta_deg", "rotation"])
def test_a_rotation_under_another_name_is_refused_with_its_likely_meaning(tracked, capsys, name):
    edit(tracked / "tracks.csv", "x,y,theta", f"x,y,{name}")
    assert rodsight("check", tracked, "--quiet") == 2
    message = capsys.readouterr().err
    assert f"column {name}: looks like theta, which is missing: rename it to theta (in rad" in message
    assert "add an empty column theta" in message


def test_an_empty_column_states_that_the_rotation_is_unknown(tracked):
    file = tracked / "tracks.csv"
    head, *rows = file.read_text().splitlines()
    assert head.endswith(",theta")
    rows = [f"{row.rpartition(',')[0]},,{row.rpartition(',')[2]}" for row in rows]
    file.write_text("\n".join([f"{head},angle", *rows]) + "\n")
    assert rodsight("check", tracked, "--quiet") == 0


def test_a_table_without_any_rotation_is_accepted(tracked):
    file = tracked / "tracks.csv"
    file.write_text("\n".join(row.rpartition(",")[0] for row in file.read_text().splitlines()) + "\n")
    assert rodsight("check", tracked, "--quiet") == 0


@pytest.mark.parametrize(("table", "old", "new"), [("tracks.csv", ",id,", ",particle,"), ("times.csv", "time", "t")])
def test_a_missing_column_is_refused_with_the_one_that_is_meant(tracked, capsys, table, old, new):
    edit(tracked / table, old, new)
    assert rodsight("check", tracked, "--quiet") == 2
    assert f"column {new.strip(',')}: looks like {old.strip(',')}" in capsys.readouterr().err


def test_columns_that_are_not_used_are_named(tracked, capsys):
    file = tracked / "tracks.csv"
    head, *rows = file.read_text().splitlines()
    file.write_text("\n".join([f"{head},brightness", *(f"{row},1.0" for row in rows)]) + "\n")
    assert rodsight("check", tracked, "--no-budget") == 0
    assert "columns that are not used: brightness" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize("command", ["check", "track"])
def test_without_walls_true_forces_on_walls_are_ignored(tracked, tmp_path, capsys, command):
    file = tracked / "experiment.toml"
    head, _, rest = file.read_text().partition("[walls]")
    file.write_text(head + rest.partition("\n[walls.top]\n")[2].partition("\n")[2])
    assert "walls" not in file.read_text()
    assert ",bottom," in (tracked / "truth_contacts.csv").read_text()
    out = ("--no-budget",) if command == "check" else ("--out", tmp_path / "out")
    assert rodsight(command, tracked, *out) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "truth_contacts.csv: contacts with walls are ignored, since no walls are given." in printed
    swap_row(tracked / "truth_contacts.csv", 2, {2: "999"})
    assert rodsight(command, tracked, *out) == 2
    assert "row 2, j = '999': is not the id of a grain" in capsys.readouterr().err


def test_a_wall_in_the_truth_of_a_packing_bounded_by_grains_is_explained(tracked, capsys):
    file = tracked / "experiment.toml"
    head, _, rest = file.read_text().partition("[walls]")
    rest = rest.partition("\n[walls.top]\n")[2].partition("\n")[2]
    file.write_text(f'{head}[boundary]\ngrains = "outer"\n{rest}')
    assert rodsight("check", tracked, "--no-budget") == 2
    assert "is neither a grain's id nor the name of a wall: no walls are given" in capsys.readouterr().err
