"""Bad input in Python: what is wrong is named as the user gave it, and every mistake is an InputError."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import rodsight


def test_a_wrong_data_frame_is_called_a_data_frame(tmp_path):
    spots = pd.DataFrame({"t": [0, 0], "rod": [1, 2], "X": ["0.1", "wide"], "Y": [0.1, 0.1]})
    roles = {"frame": "t", "id": "rod", "x": "x", "y": "Y"}
    with pytest.raises(rodsight.InputError, match=r"^data frame: column x: there is no such column") as raised:
        rodsight.import_table(spots, tmp_path / "out", roles, radius=0.01)
    assert raised.value.problem.startswith("there is no such column")
    with pytest.raises(rodsight.InputError, match=r"^data frame: row 1, X = 'wide': is not a number$"):
        rodsight.import_table(spots, tmp_path / "out", roles | {"x": "X"}, radius=0.01)
    for option in ({"form": "tables"}, {"pixel_size": "wide"}):
        with pytest.raises(rodsight.InputError, match=r"is not a form: there are table, |'wide': is not a number$"):
            rodsight.import_table(spots, tmp_path / "out", roles, **option)  # type: ignore[arg-type]
    spots["X"] = [0.1, 0.12]
    rodsight.import_table(spots, tmp_path / "out", roles | {"x": "X"}, radius=0.01)
    assert (tmp_path / "out/experiment.toml").read_text().startswith("# From data frame, by rodsight import table.\n")


@pytest.fixture(scope="module")
def run(examples: Path) -> rodsight.Run:
    return rodsight.Run(examples / "runs/shear/results.h5")


@pytest.mark.parametrize(
    ("kind", "call"),
    [
        (FileNotFoundError, lambda run: rodsight.open("nosuch")),
        (FileNotFoundError, lambda run: rodsight.run("nosuch")),
        (FileNotFoundError, lambda run: rodsight.campaign("nosuch.csv")),
        (FileNotFoundError, lambda run: rodsight.score("nosuch")),
        (FileNotFoundError, lambda run: rodsight.compare(run, "nosuch")),
        (IndexError, lambda run: run.contacts(frame=99)),
        (IndexError, lambda run: rodsight.what_if(run, 99)),
        (ValueError, lambda run: run.figure("nosuch")),
        (ValueError, lambda run: run.figure("fringes")),
        (rodsight.InputError, lambda run: run.figure(width="triple")),
        (rodsight.InputError, lambda run: run.figure("difference", against="runs/shear")),
        (rodsight.InputError, lambda run: rodsight.run("my_test", frames=(3,))),  # type: ignore[arg-type]
        (rodsight.InputError, lambda run: rodsight.track("my_test", frames=("a", "b"))),  # type: ignore[arg-type]
        (rodsight.InputError, lambda run: rodsight.run("my_test", frames=(0, None, 0))),
        (rodsight.InputError, lambda run: next(rodsight.follow("my_test", idle="soon"))),  # type: ignore[arg-type]
    ],
)
def test_mistakes_are_input_errors_and_of_the_usual_kind(
    kind: type[Exception], call: Callable[[rodsight.Run], Any], run, examples, monkeypatch
):
    monkeypatch.chdir(examples)
    with pytest.raises(rodsight.InputError) as raised:
        call(run)
    assert isinstance(raised.value, kind)
    assert str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_run_in_memory_is_saved_and_opened_again(run, tmp_path):
    frame = run.checked_frame(2)
    solved = rodsight.what_if(run, frame, friction=0.2, local=True)
    file = solved.save(tmp_path / "changed.h5")
    pd.testing.assert_frame_equal(rodsight.open(file).contacts(), solved.contacts())
    assert rodsight.Run(file).save(tmp_path / "copy.h5").stat().st_size > 0
    with pytest.raises(rodsight.InputError, match=r"changed\.h5: this run was solved in memory"):
        rodsight.what_if(file, frame, friction=0.2)


def test_a_file_of_a_run_on_the_disk_is_not_overwritten(run, tmp_path):
    for file, words in (
        (run.file, "belongs to a run on the disk"), (tmp_path, "is a folder"),
        (tmp_path / "no/run.h5", "no such folder"),
    ):  # fmt: skip
        with pytest.raises(rodsight.InputError, match=words):
            run.save(file)


def test_a_run_without_a_recording_is_a_missing_file(run, tmp_path):
    with pytest.raises(rodsight.InputError, match=r"^there is no recording of this run: ") as raised:
        rodsight.Run(tmp_path / "results.h5").view()
    assert isinstance(raised.value, FileNotFoundError)


SPOTS = pd.DataFrame({"frame": [0, 0], "id": [1, 2], "x": [0.1, 0.12], "y": [0.1, 0.1], "radius": [0.01, 0.01]})


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"pressure": 5e4}, "^import_table: pressure: 50000.0: is no mapping of walls"),
        ({"pressure": {"top": "50e3"}}, "is not a number$"),
        ({"columns": "frame=t"}, "^columns: 'frame=t': is no mapping of roles"),
        ({"source": [1]}, "^import_table: source = list: is neither a path nor a data frame$"),
        ({"walls": 3}, "^import_table: walls = int: is neither a path nor a data frame$"),
        ({"y_down": "no"}, "^y_down: 'no': is neither true nor false$"),
        ({"pixel_size": True}, "^pixel_size: True: is not a number$"),
    ],
)
def test_wrong_arguments_of_an_import_are_named(tmp_path, options, words):
    with pytest.raises(rodsight.InputError, match=words):
        rodsight.import_table(**{"source": SPOTS, "folder": tmp_path / "out", "walls": "box", **options})


def test_a_column_with_the_name_of_its_role_need_not_be_named(tmp_path):
    walls = pd.DataFrame({"frame": [0], "wall": ["floor"], "x1": [0.0], "y1": [0.09], "x2": [0.2], "y2": [0.09]})
    table = rodsight.import_table(SPOTS, tmp_path / "out", walls=walls, pressure={"floor": np.float64(5e4)})
    assert table["radius"].tolist() == [0.01, 0.01]
    assert "pressure = 50000.0" in (tmp_path / "out" / "experiment.toml").read_text()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda table: table.assign(frame="one"), "^tracks: row 0, frame = 'one': is not a whole number$"),
        (lambda table: table.assign(frame=[0.0, 0.5]), "^tracks: row 1, frame = '0.5': is not a whole number$"),
        (lambda table: pd.concat([table, table[["id"]]], axis=1), "^tracks: column id: stands twice$"),
        (lambda table: table.to_xarray(), "^tracks: is no table: "),
    ],
)
def test_wrong_columns_of_tracks_are_named(change, words):
    with pytest.raises(rodsight.InputError, match=words):
        rodsight.solve(change(SPOTS), boundary="outer")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"factors": ["nosuch"]}, "^factors: nosuch: is not a factor"),
        ({"factors": ["friction"], "samples": 1}, "^samples: 1: is too few"),
    ],
)
def test_a_study_names_arguments_instead_of_options(made_tracks, tmp_path, options, words):
    with pytest.raises(rodsight.InputError, match=words):
        rodsight.sensitivity(made_tracks, out=tmp_path, **options)


@pytest.mark.parametrize(
    ("what", "options", "words"),
    [
        ("tables", {"kind": "xml"}, r"^export: kind 'xml': is not one of csv, parquet$"),
        ("tables", {"rate": 5.0}, r"^export: rate with tables: applies to video only$"),
        ("figures", {"formats": ("pdf", "xml")}, r"^export: formats 'xml': is not one of pdf, svg, png$"),
        ("figures", {"formats": "xml"}, r"^export: formats 'xml': is not one of pdf, svg, png$"),
        ("figures", {"width": "triple"}, r"^export: width 'triple': is not one of single, double$"),
        ("pictures", {"timeline": "year"}, r"^export: timeline 'year': is not one of frame, sweep$"),
        ("pictures", {"size": (1, 1)}, r"^size: 1x1: is not WIDTHxHEIGHT in pixels from 100 to 8192$"),
        ("pictures", {"step": 0}, r"^step: 0: is not a positive number$"),
    ],
)
def test_an_export_with_wrong_options_is_refused_before_anything_is_written(run, what, options, words, tmp_path):
    with pytest.raises(rodsight.InputError, match=words):
        rodsight.export(what, run, out=tmp_path / "out", **options)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("key", ["walls.top.pressure", "tracks.precision", "photographs.files", "name", "truth"])
def test_a_key_of_the_measurement_is_no_setting_of_tables(key):
    table = pd.DataFrame({"frame": [0], "id": [0], "x": [0.0], "y": [0.0], "radius": [0.01], "time": [0.0]})
    with pytest.raises(rodsight.InputError, match=r"is read from experiment\.toml alone: keys of material, ") as raised:
        rodsight.solve(table, settings={key: 3})
    assert f"key {key.partition('.')[0]}" in str(raised.value)
    assert "did you mean" not in str(raised.value)
