"""`check` refuses impossible input with its likely cause, and warns of implausible input."""

from __future__ import annotations

import csv
import struct
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from rodsight.experiment.pictures.image_header import claimed_size, pages_alike
from rodsight.experiment.pictures.picture_file import read_photograph
from rodsight.process.errors import InputError

from tests.app.experiment.tables import edit
from tests.program import rodsight


def change(file: Path, **columns: Callable[[float], float]) -> None:
    """Change the numbers of some columns of a table."""
    with file.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    for row in rows:
        for name, work in columns.items():
            row[name] = repr(work(float(row[name])))
    with file.open("w", newline="") as stream:
        writer = csv.DictWriter(stream, rows[0])
        writer.writeheader()
        writer.writerows(rows)


def reverse(file: Path) -> None:
    file.write_text(file.read_text().replace("x1,y1,x2,y2", "x2,y2,x1,y1"))


def in_millimetres(x: float) -> float:
    return 1e3 * x


CAUSES = {
    "radii look like diameters": lambda at: change(at / "grains.csv", radius=lambda r: 2.0 * r),
    "coordinates look like millimetres": lambda at: change(at / "tracks.csv", x=in_millimetres, y=in_millimetres),
    "they look like millimetres": lambda at: change(at / "grains.csv", radius=in_millimetres),
    "walls look reversed": lambda at: reverse(at / "walls.csv"),
    "walls look like millimetres": lambda at: change(at / "walls.csv", **dict.fromkeys(WALL, in_millimetres)),
    "walls look y-down": lambda at: change(at / "walls.csv", y1=lambda y: 0.3 - y, y2=lambda y: 0.3 - y),
}
WALL = ("x1", "y1", "x2", "y2")


@pytest.mark.parametrize("cause", CAUSES)
def test_a_mistake_is_refused_with_its_likely_cause(tracked, capsys, cause):
    CAUSES[cause](tracked)
    assert rodsight("check", tracked) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert cause in message


@pytest.mark.slow
def test_a_very_small_pressure_gives_a_warning(tracked, capsys):
    edit(tracked / "experiment.toml", "pressure = 50000.0", "pressure = 50")
    assert rodsight("check", tracked) == 0
    assert "did you mean 50e3 Pa?" in capsys.readouterr().out


@pytest.mark.parametrize(("density", "warns"), [(11.34, True), (22.6, True), (23.5, False), (150.0, False)])
def test_a_density_that_may_be_in_other_units_gives_a_warning(tracked, capsys, density, warns):
    assert rodsight("check", tracked, "--no-budget", "--set", f"material.density={density}") == 0
    assert (f"if it is in g/cm³, write density = {1e3 * density:g}" in capsys.readouterr().out) == warns


@pytest.mark.slow
def test_an_open_side_is_reported_with_the_walls_beside_it(tracked, capsys):
    edit(tracked / "experiment.toml", 'truth = "truth_contacts.csv"', "")  # the truth refers to the wall
    file = tracked / "walls.csv"
    edit(tracked / "experiment.toml", 'forces = "wall_forces.csv"', "")
    file.write_text("\n".join(line for line in file.read_text().splitlines() if ",right," not in line) + "\n")
    assert rodsight("check", tracked) == 0
    output = capsys.readouterr().out
    assert "The boundary is open" in output
    assert "'bottom'" in output
    assert "'top'" in output


@pytest.mark.parametrize(
    ("setting", "named"),
    [
        ("material.friction=25", "material.friction is a number > 0, ≤ 2"),
        ("material.friction=true", "material.friction is a number"),
        ('material.friction="0.3"', "material.friction is a number"),
        ("material.density=1e308", "≤ 23000"),
        ("solver.substeps=1000000000000", "≤ 1000"),
        (f"solver.sweeps={10**40}", "≤ 1e+06"),
        ("calibration.enabled=1", "true or false"),
        ('walls.file="a\\u0000b"', "NUL"),
    ],
)
def test_an_impossible_setting_is_refused_with_its_range(tracked, capsys, setting, named):
    assert rodsight("check", tracked, "--set", setting) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert setting.partition("=")[0] in message
    assert named in message
    assert len(message) < 500


@pytest.mark.parametrize("table", ["grains.csv", "tracks.csv"])
def test_a_too_large_whole_number_is_named(tracked, capsys, table):
    file = tracked / table
    head, _, rest = file.read_text().partition("\n")
    cells = rest.split(",")
    cells[head.split(",").index("id")] = str(10**30)
    file.write_text(head + "\n" + ",".join(cells))
    assert rodsight("check", tracked) == 2
    assert f"id = '{10**30}'" in capsys.readouterr().err


@pytest.mark.parametrize("broken", ["missing.csv", "grains.csv"])
def test_a_truth_that_cannot_be_read_is_found_by_check(tracked, capsys, broken):
    edit(tracked / "experiment.toml", 'truth = "truth_contacts.csv"', f'truth = "{broken}"')
    assert rodsight("check", tracked) == 2
    assert broken in capsys.readouterr().err


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".tiff"])
def test_the_size_is_read_from_the_header(tmp_path, suffix):
    file = tmp_path / f"a{suffix}"
    cv2.imwrite(str(file), np.zeros((30, 70), np.uint8))
    assert claimed_size(file.read_bytes()) == (70, 30)
    assert claimed_size(file.read_bytes()[:10]) is None


def test_a_file_of_several_pictures_is_refused(tmp_path):
    page, small = np.full((30, 70), 9, np.uint8), np.full((3, 7), 9, np.uint8)
    for name, pages in (("stack.tif", [page] * 3), ("one.tif", [page]), ("with_preview.tif", [page, small])):
        assert cv2.imwritemulti(str(tmp_path / name), pages)
    with pytest.raises(InputError, match="holds 3 pictures: save each as its own file"):
        read_photograph(tmp_path / "stack.tif")
    assert read_photograph(tmp_path / "one.tif").shape == (30, 70)
    assert read_photograph(tmp_path / "with_preview.tif").shape == (30, 70)
    assert pages_alike((tmp_path / "stack.tif").read_bytes()[:60]) == 1


def test_a_small_file_that_states_a_huge_size_is_refused_undecoded(tmp_path, monkeypatch):
    file = tmp_path / "a.jpg"
    cv2.imwrite(str(file), np.zeros((30, 70), np.uint8))
    content = file.read_bytes().replace(struct.pack(">HH", 30, 70), struct.pack(">HH", 30_000, 30_000))
    file.write_bytes(content)
    monkeypatch.setattr(cv2, "imdecode", pytest.fail)
    with pytest.raises(InputError, match=r"30000 x 30000 pixels: is more than photographs\.max_pixels"):
        read_photograph(file)


def test_messages_of_image_libraries_are_not_shown(tmp_path, capfd):
    file = tmp_path / "a.png"
    cv2.imwrite(str(file), np.zeros((30, 70), np.uint8))
    content = file.read_bytes()
    chunk = b"iCCP" + b"x\0\0nonsense"  # a colour profile that makes libpng warn
    at = content.index(b"IDAT") - 4
    file.write_bytes(content[:at] + struct.pack(">I", len(chunk) - 4) + chunk + b"\0\0\0\0" + content[at:])
    assert read_photograph(file).shape == (30, 70)
    assert capfd.readouterr().err == ""
