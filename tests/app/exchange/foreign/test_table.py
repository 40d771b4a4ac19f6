"""The table of any tracker is imported, or refused with a message that names the row."""

from __future__ import annotations

import codecs
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow
import pyarrow.parquet
import pytest
import rodsight

from .command import import_files, refuse, tracks_in, walls_in

COLUMNS = "frame=t,id=rod,x=X,y=Y,theta=turn,radius=R"
ROWS = [(5, "a", 10.0, 20.0, 350.0, 4.0), (5, "b", 18.0, 20.0, 0.0, 4.0), (7, "a", 11.0, 22.0, 5.0, 4.0)]
COLUMN_NAMES = ["t", "rod", "X", "Y", "turn", "R"]
PIXEL = 1e-3


def write(file: Path, separator: str = ",", *, start: str = "", end: str = "\n", decimal: str = ".") -> Path:
    rows = [separator.join(str(cell).replace(".", decimal) for cell in row) for row in ROWS]
    file.write_bytes((start + end.join([separator.join(COLUMN_NAMES), *rows, ""])).encode())
    return file


def expect_rows(folder: Path) -> None:
    """Grain a moves by (1, −2) px and rotates by −15° as seen; b is lost in the second frame."""
    tracks = tracks_in(folder)
    assert tracks.id.tolist() == [0, 1]
    assert tracks.radius == pytest.approx([4.0 * PIXEL, 4.0 * PIXEL])
    assert tracks.position[0] == pytest.approx(np.array([[10.0, 2.0], [18.0, 2.0]]) * PIXEL)
    assert tracks.position[1, 0] == pytest.approx(np.array([11.0, 0.0]) * PIXEL)
    assert not tracks.present[1, 1]
    assert np.rad2deg(tracks.rotation[1, 0] - tracks.rotation[0, 0]) == pytest.approx(-15.0)
    assert tracks.time.tolist() == [0.0, 60.0]
    assert (folder / "ids.csv").read_text() == "id,name\n0,a\n1,b\n"


def test_ids_that_number_the_rows_are_refused_and_an_assumed_precision_is_stated(tmp_path, capsys):
    table = tmp_path / "any.csv"
    places = [(k // 3, 8 * (k % 3)) for k in range(6)]  # of three grains in two frames
    numbered = [f"{frame},{k},{x},20,0,4" for k, (frame, x) in enumerate(places)]
    table.write_text("\n".join([",".join(COLUMN_NAMES), *numbered]))
    given = ("table", table, tmp_path / "out", "--columns", COLUMNS, "--pixel-size", PIXEL, "--interval", 30)
    assert "every id occurs in one frame only: they number the rows" in refuse(capsys, *given)
    linked = [f"{frame},{x},{x},20,0,4" for frame, x in places]
    table.write_text("\n".join([",".join(COLUMN_NAMES), *linked]))
    assert "No precision is given: 8e-06 m is assumed, 0.001 of a mean diameter" in import_files(capsys, *given)
    given = (*given[:2], tmp_path / "stated", *given[3:])
    assert "No precision is given" not in import_files(capsys, *given, "--precision", 0.01)


@pytest.mark.parametrize(
    ("separator", "start", "end", "decimal"),
    [(",", "", "\n", "."), (";", "\ufeff", "\r\n", "."), ("\t", "", "\r\n", "."), (" ", "", "\n", "."),
     (";", "", "\r\n", ","), ("\t", "", "\n", ","), ("  ", "# made by hand\n", "\n", ",")],
)  # fmt: skip
def test_every_separator_and_decimal_mark_is_read(tmp_path, capsys, separator, start, end, decimal):
    file = write(tmp_path / "any.txt", separator, start=start, end=end, decimal=decimal)
    printed = import_files(
        capsys, "table", file, tmp_path / "out", "--columns", COLUMNS, "--pixel-size", PIXEL, "--y-down", "--degrees",
        "--interval", 30,
    )  # fmt: skip
    expect_rows(tmp_path / "out")
    assert "they were 5 … 7" in printed
    assert "1 pose lost" in printed
    assert "ids.csv" in printed
    assert "Jumps by 2π were removed" in printed
    assert "add [walls]" in printed


def test_the_separator_that_excel_states_is_used(tmp_path, capsys):
    file = write(tmp_path / "any.txt", ";", start="sep=;\n", decimal=",")
    import_files(
        capsys, "table", file, tmp_path / "out", "--columns", COLUMNS, "--pixel-size", PIXEL, "--y-down", "--degrees",
        "--interval", 30,
    )  # fmt: skip
    expect_rows(tmp_path / "out")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"PK\x03\x04more", "is a workbook or an archive, and no text: save the table as CSV"),
        (b"Run 3, June\nt,rod,X,Y\n0,1,2,3\n0,2,4,5\n", "row 1: is no header: it names 2 columns, and the rows below"),
        (b"tracks\n\nt rod X Y\n0 1 2 3\n", "row 1: is no header: it names 1 column, and the rows below have 4"),
    ],
)
def test_a_workbook_and_a_title_are_refused_with_their_cure(tmp_path, capsys, content, words):
    (tmp_path / "any.csv").write_bytes(content)
    assert words in refuse(
        capsys, "table", tmp_path / "any.csv", tmp_path / "out", "--columns", "frame=t,id=rod,x=X,y=Y"
    )


@pytest.mark.parametrize(
    ("named", "radius"),
    [({}, 0.01), ({"diameter": "diameter"}, 0.02), ({"diameter": "D"}, 0.015), ({"radius": "R"}, 0.03)],
)
def test_the_size_that_is_named_is_used_and_else_the_radius(tmp_path, named, radius):
    places = {"frame": [0, 0], "id": [1, 2], "x": [0.1, 0.1 + 2.0 * radius], "y": [0.1, 0.1]}
    sizes = {"radius": 0.01, "diameter": 0.04, "D": 0.03, "R": 0.03}
    table = rodsight.import_table(pd.DataFrame(places | sizes), tmp_path / "out", named, walls="none")
    assert table["radius"].tolist() == [radius] * 2


def test_separators_of_thousands_are_not_taken_for_decimals(tmp_path, capsys):
    rows = '0,1,270,"1,131",0,4\n0,2,278,"1,131",0,4\n1,1,270,999,0,4\n1,2,278,999,0,4\n'
    (tmp_path / "a.csv").write_text("t,rod,X,Y,turn,R\n" + rows)
    line = refuse(capsys, "table", tmp_path / "a.csv", tmp_path / "out", "--columns", COLUMNS, "--pixel-size", PIXEL)
    assert "row 2, Y = '1,131': has a comma before three digits, and other rows have none" in line


@pytest.mark.parametrize(
    ("bars", "problem"),
    [
        ("5,low,0,24,30,24\n5,low,0,25,30,25\n7,low,0,24,30,24\n", "row 3, wall = 'low': stands twice in its frame"),
        ("5,low,0,.024,.03,.024\n", "makes the walls 3e-05 m wide, and the grains are 0.008 m apart: give"),
    ],
)
def test_walls_that_stand_twice_or_in_another_unit_are_refused(tmp_path, capsys, bars, problem):
    (tmp_path / "bars.csv").write_text("frame,wall,x1,y1,x2,y2\n" + bars)
    file = write(tmp_path / "any.txt")
    arguments = ("--columns", COLUMNS, "--pixel-size", PIXEL, "--y-down", "--walls", tmp_path / "bars.csv")
    assert problem in refuse(capsys, "table", file, tmp_path / "out", *arguments)


def test_parquet_and_utf_16(tmp_path, capsys):
    names = COLUMN_NAMES
    table = pyarrow.table({name: [row[k] for row in ROWS] for k, name in enumerate(names)})
    pyarrow.parquet.write_table(table, tmp_path / "any.parquet")
    text = write(tmp_path / "any.csv").read_text()
    (tmp_path / "wide.csv").write_bytes(codecs.BOM_UTF16_LE + text.encode("utf-16-le"))
    for name in ("any.parquet", "wide.csv"):
        out = tmp_path / f"out {name}"
        import_files(
            capsys, "table", tmp_path / name, out, "--columns", COLUMNS, "--pixel-size", PIXEL, "--y-down",
            "--degrees", "--interval", 30,
        )  # fmt: skip
        expect_rows(out)


def test_a_table_without_a_header_has_numbered_columns(tmp_path, capsys):
    (tmp_path / "bare.txt").write_text("0 3 .1 .2\n0 4 .3 .2\n")
    printed = import_files(
        capsys, "table", tmp_path / "bare.txt", tmp_path / "out", "--columns", "frame=1,id=2,x=3,y=4", "--radius", 0.1
    )
    tracks = tracks_in(tmp_path / "out")
    assert tracks.id.tolist() == [3, 4]
    assert tracks.radius.tolist() == [0.1, 0.1]
    assert np.isnan(tracks.rotation).all()
    assert "rotation is unknown" in printed


@pytest.mark.parametrize("unit", [1.0, PIXEL])
def test_lengths_in_millimetres_are_refused_as_the_check_refuses_them(tmp_path, capsys, unit):
    file, out = write(tmp_path / "any.csv"), tmp_path / "out"
    words = "makes the median radius 4 m: lengths are in metres; they look like millimetres"
    if unit == 1.0:
        line = refuse(capsys, "table", file, out, "--columns", COLUMNS, "--walls", "box", "--pressure", "top=50e3")
        assert line.endswith(f"any.csv: column R: {words}\n")
    else:  # radii alone: positions are in metres
        table = pd.read_csv(file)
        table[["X", "Y"]] *= unit
        with pytest.raises(rodsight.InputError, match=f"^data frame: column R: {words}$"):
            rodsight.import_table(table, out, dict(each.split("=") for each in COLUMNS.split(",")), walls="box")
    assert [each.name for each in tmp_path.iterdir()] == ["any.csv"]


@pytest.mark.parametrize("pressure", ["-50e3", "0", "1e300"])
def test_a_pressure_is_refused_by_the_rule_of_the_experiment_file(tmp_path, capsys, pressure):
    file = write(tmp_path / "any.csv")
    arguments = ("--columns", COLUMNS, "--pixel-size", PIXEL, "--walls", "box")
    line = refuse(capsys, "table", file, tmp_path / "out", *arguments, "--pressure", f"top={pressure}")
    assert f"--pressure: top: value {float(pressure)!r}; walls.top.pressure is a number ≥ 0.001, ≤ 1e+11" in line
    line = refuse(capsys, "table", file, tmp_path / "out", *arguments, "--load", "top=0")
    assert "--load: top: is 0 N alone" in line
    assert [each.name for each in tmp_path.iterdir()] == ["any.csv"]


def test_an_import_that_makes_no_valid_experiment_leaves_nothing(tmp_path, capsys):
    file = write(tmp_path / "any.csv")
    arguments = ("table", file, tmp_path / "out", "--columns", COLUMNS, "--pixel-size", PIXEL)
    assert "--precision: 10 m: is more than the rods' radius, 0.004 m" in refuse(capsys, *arguments, "--precision", 1e4)
    (tmp_path / "bars.csv").write_text("frame,wall,x1,y1,x2,y2\n5,file,0,0,30,0\n")  # a name that is a key of [walls]
    line = refuse(capsys, *arguments, "--walls", tmp_path / "bars.csv", "--pressure", "file=50e3")
    assert line.startswith(f"rodsight: {tmp_path}/out/experiment.toml: is not TOML: ")
    assert sorted(each.name for each in tmp_path.iterdir()) == ["any.csv", "bars.csv"]


def test_columns_are_given_by_number_where_there_is_a_header(tmp_path, capsys):
    numbers = "frame=1,id=2,x=3,y=4,theta=5,radius=6"
    arguments = ("--pixel-size", PIXEL, "--y-down", "--degrees", "--interval", 30)
    file = write(tmp_path / "any.csv")
    import_files(capsys, "table", file, tmp_path / "out", "--columns", numbers, *arguments)
    expect_rows(tmp_path / "out")
    line = refuse(capsys, "table", file, tmp_path / "no", "--columns", numbers.replace("6", "7"))
    assert "column 7: there is no such column (columns: t, rod, X, Y, turn, R)" in line


def test_the_check_of_an_imported_table_names_no_column_of_the_importer(tmp_path, capsys):
    import_files(
        capsys, "table", write(tmp_path / "any.csv"), tmp_path / "out", "--columns", COLUMNS, "--pixel-size", PIXEL,
        "--y-down", "--degrees", "--walls", "box",
    )  # fmt: skip
    assert "number" in (tmp_path / "out/times.csv").read_text()
    assert rodsight.check(tmp_path / "out", predict=False)["unused"] == ()


def test_the_faces_of_a_footing_have_their_grains_outside(tmp_path, capsys):
    """Its left face stands in the right half of a packing, of which most grains lie to the left of both faces."""
    at = [(x, y) for x in range(0, 100, 10) for y in range(0, 50, 10) if x not in (60, 70) or y < 20]
    grains = pd.DataFrame([(5, k, x, y, 0.0, 5.0) for k, (x, y) in enumerate(at)], columns=COLUMN_NAMES)
    grains.to_csv(tmp_path / "any.csv", index=False)
    bars = {"left_face": (55, 20, 55, 45), "right_face": (75, 45, 75, 20), "base": (75, 15, 55, 15)}
    rows = [f"5,{name},{','.join(map(str, ends))}" for name, ends in bars.items()]
    (tmp_path / "bars.csv").write_text("\n".join(["frame,wall,x1,y1,x2,y2", *rows]))
    import_files(
        capsys, "table", tmp_path / "any.csv", tmp_path / "out", "--columns", COLUMNS, "--pixel-size", PIXEL,
        "--walls", tmp_path / "bars.csv",
    )  # fmt: skip
    walls = walls_in(tmp_path / "out")
    assert walls is not None
    along = walls.endpoints[0, :, 1] - walls.endpoints[0, :, 0]
    inward = {name: (-y, x) for name, (x, y) in zip(walls.name, np.sign(along), strict=True)}
    assert inward == {"left_face": (-1.0, 0.0), "right_face": (1.0, 0.0), "base": (0.0, -1.0)}


def test_y_is_measured_from_the_last_row_with_a_given_height(tmp_path, capsys):
    file = write(tmp_path / "any.csv")
    import_files(
        capsys, "table", file, tmp_path / "out", "--columns", COLUMNS, "--pixel-size", PIXEL, "--y-down",
        "--height", 100,
    )  # fmt: skip
    assert tracks_in(tmp_path / "out").position[0, 0, 1] == pytest.approx(79.0 * PIXEL)


def test_a_proposed_box_contains_every_grain_and_is_marked_as_proposed(tmp_path, capsys):
    file = write(tmp_path / "any.csv")
    printed = import_files(
        capsys, "table", file, tmp_path / "out", "--columns", COLUMNS, "--pixel-size", PIXEL, "--walls", "box",
        "--pressure", "top=5e4", "left=2e4",
    )  # fmt: skip
    assert "PROPOSED, NOT MEASURED" in printed
    assert "PROPOSED, NOT MEASURED" in (tmp_path / "out" / "experiment.toml").read_text()
    tracks, walls = tracks_in(tmp_path / "out"), walls_in(tmp_path / "out")
    assert walls is not None
    assert dict(zip(walls.name, walls.pressure, strict=True))["top"] == 5e4
    assert walls.pressure[walls.name.index("left")] == 2e4
    along = walls.endpoints[:, :, 1] - walls.endpoints[:, :, 0]
    inward = np.stack([-along[..., 1], along[..., 0]], axis=-1) / np.linalg.norm(along, axis=-1, keepdims=True)
    inside = np.einsum("fwnk,fwk->fwn", tracks.position[:, None] - walls.endpoints[:, :, None, 0], inward)
    gap = inside - tracks.radius
    assert np.nanmin(gap, axis=2) == pytest.approx(np.zeros((2, 4)), abs=1e-12)


def test_walls_of_a_file_are_oriented_with_the_packing_to_their_left(tmp_path, capsys):
    file = write(tmp_path / "any.csv")
    rows = ["frame,wall,x1,y1,x2,y2", "5,floor,0,26,30,26", "7,floor,0,27,30,27"]
    (tmp_path / "bars.csv").write_text("\n".join(rows))
    arguments = ("--columns", COLUMNS, "--pixel-size", PIXEL, "--y-down", "--walls", tmp_path / "bars.csv")
    import_files(capsys, "table", file, tmp_path / "out", *arguments)
    walls = walls_in(tmp_path / "out")
    assert walls is not None
    assert walls.endpoints[0, 0] == pytest.approx(np.array([[0.0, -4.0], [30.0, -4.0]]) * PIXEL)
    assert walls.endpoints[1, 0, :, 1] == pytest.approx(np.full(2, -5.0) * PIXEL)
    (tmp_path / "bars.csv").write_text("\n".join(rows[:2]))
    import_files(capsys, "table", file, tmp_path / "fixed", *arguments)
    walls = walls_in(tmp_path / "fixed")
    assert walls is not None
    assert np.ptp(walls.endpoints, axis=0).max() == 0.0


@pytest.mark.parametrize(
    ("text", "columns", "problem"),
    [
        ("t,rod,X,Y\n0,1,2,3\n", "frame=t,id=rod,x=X", "has no column for y: give --columns y=…"),
        ("t,rod,X,Y\n0,1,2,3\n", "frame=t,id=rod,x=X,y=Z", "column Z: there is no such column"),
        ("t,rod,X,Y\n0,1,2,3\n", "frame=t,id=rod,x=X,z=Y", "z: is not known"),
        ("t,rod,X,Y\n0,1,2,3\n", "frame", "is not ROLE=COLUMN"),
        ("t,rod,X,Y\n0,1,2\n", "frame=t,id=rod,x=X,y=Y", "row 2: has 3 cells"),
        ("t,rod,X,Y\n0,1,two,3\n", "frame=t,id=rod,x=X,y=Y", "row 2, X = 'two': is not a number"),
        ("t,rod,X,Y\n0.5,1,2,3\n", "frame=t,id=rod,x=X,y=Y", "row 2, t = '0.5'"),
        ("t,rod,X,Y\n1e30,1,2,3\n", "frame=t,id=rod,x=X,y=Y", "row 2, t = '1e30'"),
        ("t,rod,X,Y\n0,1,2,3\n0,1.0,4,3\n", "frame=t,id=rod,x=X,y=Y", "row 3, rod = '1.0': occurs twice in frame 0"),
        ("t;rod;X;Y\n0;1;2,5;3\n0;2;1.234,5;3\n0;3;1,5;3.5\n", "frame=t,id=rod,x=X,y=Y", "row 2, X = '2,5'"),
        ("t,rod,X,Y\n0,,2,3\n", "frame=t,id=rod,x=X,y=Y", "is empty: no row belongs to a grain"),
        ("t,rod,X,Y\n0,1,2,3\n", "frame=t,id=rod,x=X,y=Y", "--radius"),
        ("t,rod,X,Y\n", "frame=t,id=rod,x=X,y=Y", "has no rows"),
        ("", "frame=t,id=rod,x=X,y=Y", "is empty"),
    ],
)
def test_errors_are_named_and_nothing_is_written(tmp_path, capsys, text, columns, problem):
    (tmp_path / "bad.csv").write_text(text)
    assert problem in refuse(capsys, "table", tmp_path / "bad.csv", tmp_path / "out", "--columns", columns)
    assert not (tmp_path / "out").exists()


def test_inconsistent_options_are_refused(tmp_path, capsys):
    file = write(tmp_path / "any.csv")
    arguments = ("table", file, tmp_path / "out", "--columns", COLUMNS, "--y-down")
    assert "is not positive" in refuse(capsys, *arguments, "--pixel-size", -1)
    arguments = (*arguments, "--pixel-size", PIXEL)
    assert "is not a wall" in refuse(capsys, *arguments, "--pressure", "top=5e4")
    assert "is not WALL=PA" in refuse(capsys, *arguments, "--walls", "box", "--pressure", "top")
    assert "there is no such file" in refuse(capsys, *arguments, "--walls", tmp_path / "none.csv")
    import_files(capsys, *arguments)
    assert "already exists" in refuse(capsys, *arguments)


def test_grains_without_a_boundary_need_not_touch(tmp_path, capsys):
    file = tmp_path / "gas.csv"
    file.write_text("frame,id,x,y,r\n" + "".join(f"0,{k},{0.1 * k},{0.07 * k * k},0.004\n" for k in range(9)))
    columns = ("--columns", "frame=frame,id=id,x=x,y=y,radius=r")
    assert "stand apart" in refuse(capsys, "table", file, tmp_path / "out", *columns, "--walls", "box")
    import_files(capsys, "table", file, tmp_path / "out", *columns)
    assert tracks_in(tmp_path / "out").id.tolist() == list(range(9))
