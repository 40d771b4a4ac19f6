"""Circular walls and measured loads from tables; every mistake is named with its row."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rodsight.experiment.experiment import load_experiment
from rodsight.experiment.walls import read_walls
from rodsight.process.errors import InputError
from rodsight.solver.bodies.wall_shapes import IN, OUT, STRAIGHT, circle_parameters
from rodsight.tracks import WallTracks

from tests.app.experiment.test_unknown_inputs import edit

FRAMES = 5
HEADER = "frame,wall,x,y,radius,side"


def with_arcs(folder: Path, *rows: str, header: str = HEADER) -> Path:
    (folder / "arcs.csv").write_text("\n".join((header, *rows)) + "\n")
    edit(folder, "experiment.toml", "[walls]\n", '[walls]\narcs = "arcs.csv"\n')
    return folder


def with_loads(folder: Path, *rows: str, pressed: bool = False) -> Path:
    (folder / "load.csv").write_text("\n".join(("frame,wall,force", *rows)) + "\n")
    edit(folder, "experiment.toml", "[walls]\n", '[walls]\nload = "load.csv"\n')
    if not pressed:
        text = (folder / "experiment.toml").read_text().splitlines()
        (folder / "experiment.toml").write_text("\n".join(t for t in text if not t.startswith("pressure")) + "\n")
    return folder


def walls_of(folder: Path) -> WallTracks:
    walls = read_walls(load_experiment(folder), FRAMES)
    assert walls is not None
    return walls


def test_circles_are_read_beside_straight_walls_and_may_change(tracked) -> None:
    rows = [f"{k},drum,0.1,{0.1 + 0.01 * k},{0.5 - 0.01 * k},in" for k in range(FRAMES)]
    walls = walls_of(with_arcs(tracked, *rows, "0,pin,0.1,0.1,1e-4,out"))
    assert walls.name[-2:] == ("drum", "pin")
    assert walls.sides.tolist() == [STRAIGHT] * 4 + [IN, OUT]
    centre, radius, angle = circle_parameters(walls.endpoints[:, 4])
    assert centre[:, 1] == pytest.approx(0.1 + 0.01 * np.arange(FRAMES))
    assert radius == pytest.approx(0.5 - 0.01 * np.arange(FRAMES))
    assert angle == pytest.approx(np.zeros(FRAMES))
    assert (walls.endpoints[:, 5] == walls.endpoints[0, 5]).all()
    assert walls.radius is not None
    assert walls.radius[:, 4] == pytest.approx(radius)
    assert np.isnan(walls.radius[:, :4]).all()
    assert walls.centre is not None
    assert walls.centre[2, 4] == pytest.approx([0.1, 0.12])


def test_circles_suffice_as_walls_and_rotate_with_the_column_theta(tracked) -> None:
    rows = [f"{k},drum,0.1,0.1,0.5,in,{0.1 * k}" for k in range(FRAMES)]
    with_arcs(tracked, *rows, header=HEADER + ",theta")
    edit(tracked, "experiment.toml", 'file = "walls.csv"\n', "")
    edit(tracked, "experiment.toml", 'forces = "wall_forces.csv"\n', "")
    edit(tracked, "experiment.toml", "[walls.top]", "[walls.drum]")
    walls = walls_of(tracked)
    assert walls.name == ("drum",)
    assert circle_parameters(walls.endpoints[:, 0])[2] == pytest.approx(0.1 * np.arange(FRAMES))


@pytest.mark.parametrize(("row", "message"), [
    ("0,drum,0.1,0.1,0.5,inside", "row 2, side = 'inside': is neither in"),
    ("0,drum,0.1,0.1,0,in", "row 2, radius = '0': is not positive"),
    ("0,drum,0.1,0.1,-0.5,in", "row 2, radius = '-0.5': is not positive"),
    ("0,top,0.1,0.1,0.5,in", "row 2, wall = 'top': is the name of a straight wall, too"),
    ("9,drum,0.1,0.1,0.5,in", "row 2, frame = '9': is not one of the 5 frames"),
    ("-1,drum,0.1,0.1,0.5,in", "row 2, frame = '-1'"),
    ("1,drum,0.1,0.1,0.5,in", "frame 0: has no row of wall 'drum'"),
    ("0,drum,0.1,nan,0.5,in", "row 2, y = 'nan'"),
    ("0,drum,0.1,0.1,0.5,in\n1,drum,0.1,0.1,0.5,in", "frame 2: has no row of wall 'drum'"),
    ("0,drum,0.1,0.1,0.5,in\n0,drum,0.1,0.1,0.5,in", "row 3, wall = 'drum': stands twice"),
    ("0,drum,0.1,0.1,0.5,in\n1,drum,0.1,0.1,0.5,out", "row 3, side = 'out': differs from an earlier row"),
])  # fmt: skip
def test_a_wrong_circle_is_refused_with_its_row(tracked, row, message) -> None:
    with pytest.raises(InputError, match=message):
        walls_of(with_arcs(tracked, row))


def test_walls_without_any_table_are_refused(tracked) -> None:
    edit(tracked, "experiment.toml", 'file = "walls.csv"\n', "")
    with pytest.raises(InputError, match="file is missing"):
        load_experiment(tracked)


def test_loads_vary_in_time_and_give_their_mean_pressure(tracked) -> None:
    rows = [f"{k},{wall},{force * (k + 1)}" for k in range(FRAMES) for wall, force in (("top", 100), ("right", 40))]
    walls = walls_of(with_loads(tracked, *rows))
    named = dict(zip(walls.name, range(4), strict=True))
    assert walls.load is not None
    assert walls.load[:, named["top"]].tolist() == [100, 200, 300, 400, 500]
    assert np.isnan(walls.load[:, named["left"]]).all()
    assert walls.loaded.tolist() == [name in ("top", "right") for name in walls.name]
    length = np.linalg.norm(walls.endpoints[:, named["top"], 1] - walls.endpoints[:, named["top"], 0], axis=1)
    expected = np.mean(np.array([100, 200, 300, 400, 500]) / (0.06 * length))
    assert walls.usual_pressure(0.06)[named["top"]] == pytest.approx(expected)
    assert np.isnan(walls.pressure).all()


@pytest.mark.parametrize(("row", "message"), [
    ("0,lid,5", "row 2, wall = 'lid': is not the name of a wall"),
    ("0,top,-5", "row 2, force = '-5': is negative"),
    ("7,top,5", "row 2, frame = '7': is not one of the 5 frames"),
    ("0,top,5\n0,top,6", "row 3, wall = 'top': stands twice"),
    ("0,top,5\n1,top,5\n3,top,5\n4,top,5", "frame 2: has no row of wall 'top'"),
    ("0,top,5\n1,top,0\n2,top,5\n3,top,5\n4,top,5", "frame 1: has loads of 0 N alone"),
])  # fmt: skip
def test_a_wrong_load_is_refused_with_its_row(tracked, row, message) -> None:
    with pytest.raises(InputError, match=message):
        walls_of(with_loads(tracked, row))


def test_a_wall_has_a_pressure_or_a_load_not_both(tracked) -> None:
    with pytest.raises(InputError, match="wall = 'top': has a pressure of"):
        walls_of(with_loads(tracked, "0,top,5", pressed=True))
