"""Corner discs of a frame, in tables: bars through their centres, one plate of a bar and its discs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rodsight.experiment.experiment import load_experiment, read_tracks
from rodsight.experiment.plausibility import check_packing
from rodsight.experiment.reading.tables import write_table
from rodsight.experiment.walls import read_walls
from rodsight.inference.snapshots import make_snapshots
from rodsight.process.errors import InputError
from rodsight.solver.bodies.wall_shapes import OUT, STRAIGHT
from rodsight.tracks import CORNER

NAMES = ("se", "ne", "nw", "sw")
AT = np.array([[0.3, 0.0], [0.3, 0.2], [0.0, 0.2], [0.0, 0.0]])
SHEAR = np.array([[1.0, 0.0], [0.01, 1.0]])  # of the second frame: x += 0.01 y
RADIUS = 0.02


def make(folder: Path, walls: str = 'corners = "corners.csv"\n[walls.top]\npressure = 5e4', **columns) -> Path:
    """Two frames of a sheared frame of four corners, with one rod."""
    place = np.concatenate([AT, AT @ SHEAR])
    table = {
        "frame": [0] * 4 + [1] * 4, "corner": [*NAMES, *NAMES], "x": place[:, 0].tolist(), "y": place[:, 1].tolist(),
        "radius": [RADIUS] * 8,
    }  # fmt: skip
    write_table(folder / "corners.csv", table | columns)
    write_table(folder / "grains.csv", {"id": [5], "radius": [0.01]})
    rows = {"frame": [0, 1], "id": [5, 5], "x": [0.15, 0.151], "y": [0.1, 0.1], "theta": [0.0, 0.0]}
    write_table(folder / "tracks.csv", rows)
    write_table(folder / "times.csv", {"frame": [0, 1], "time": [0.0, 5.0]})
    (folder / "experiment.toml").write_text(
        'name = "frame"\n[tracks]\npositions = "tracks.csv"\ngrains = "grains.csv"\ntimes = "times.csv"\n'
        f"precision = 1e-5\n[walls]\n{walls}\n"
    )
    return folder


def walls_of(folder: Path):
    return read_walls(load_experiment(folder), 2)


def test_bars_run_through_the_centres_of_corners_with_the_packing_to_their_left(tmp_path):
    walls = walls_of(make(tmp_path))
    assert walls.name == ("bottom", "right", "top", "left", *NAMES)
    assert walls.sides.tolist() == [STRAIGHT] * 4 + [OUT] * 4
    assert walls.endpoints[1, 1] == pytest.approx(np.array([[0.3, 0.0], [0.302, 0.2]]))
    assert walls.endpoints[0, 2] == pytest.approx(np.array([[0.3, 0.2], [0.0, 0.2]]))
    assert walls.end_kinds[:4].tolist() == [CORNER] * 4
    assert walls.centre[1, 5] == pytest.approx([0.302, 0.2])
    assert walls.radius[:, 4:] == pytest.approx(RADIUS)
    experiment = load_experiment(tmp_path)
    assert check_packing(experiment, read_tracks(experiment), walls) == []
    assert tmp_path / "corners.csv" in experiment.input_files()


def test_a_loaded_bar_and_its_discs_are_one_plate(tmp_path):
    walls = walls_of(make(tmp_path))
    assert walls.plate.tolist() == [-1, -1, -1, -1, -1, 2, 2, -1]
    assert walls.frames(0, 1).plate.tolist() == walls.plate.tolist()
    assert walls.select(np.array([5, 2])).plate.tolist() == [1, -1]
    tracks = read_tracks(load_experiment(tmp_path))
    assert make_snapshots(tracks, walls)[1].plate.tolist() == walls.plate.tolist()
    unloaded = walls_of(make(tmp_path, 'corners = "corners.csv"'))
    assert unloaded.plate.tolist() == [-1] * 8


def test_a_measured_load_is_that_of_the_whole_plate(tmp_path):
    folder = make(tmp_path, 'corners = "corners.csv"\nload = "load.csv"')
    write_table(folder / "load.csv", {"frame": [0, 1], "wall": ["top", "top"], "force": [1438.0, 1440.0]})
    walls = walls_of(folder)
    assert walls.plate.tolist() == [-1, -1, -1, -1, -1, 2, 2, -1]
    assert walls.load[:, 2].tolist() == [1438.0, 1440.0]
    assert np.isnan(walls.load[:, 4:]).all()


def test_discs_turn_with_their_bar_unless_a_rotation_is_given(tmp_path):
    loaded = 'corners = "corners.csv"\n[walls.right]\npressure = 5e4'
    turned = walls_of(make(tmp_path, loaded)).endpoints[1, 4]  # at the foot of the bar that the shear turns
    assert turned[1] - turned[0] == pytest.approx(2 * RADIUS * np.array([100.0, -1.0]) / np.sqrt(10001.0))
    folder = make(tmp_path, theta=[0.0] * 4 + [0.02] * 4)
    given = walls_of(folder).endpoints[1, 4]
    assert given[1] - given[0] == pytest.approx(2 * RADIUS * np.array([np.cos(0.02), np.sin(0.02)]))


def test_bars_of_their_own_table_keep_their_place_and_names(tmp_path):
    folder = make(tmp_path, 'file = "walls.csv"\ncorners = "corners.csv"\n[walls.lid]\npressure = 5e4')
    rows = [(0.0, 0.0, 0.3, 0.0), (0.3, 0.201, 0.0, 0.201)]
    table = dict(zip(("x1", "y1", "x2", "y2"), map(list, zip(*(rows * 2), strict=True)), strict=True))
    write_table(folder / "walls.csv", {"frame": [0, 0, 1, 1], "wall": ["floor", "lid"] * 2, **table})
    walls = walls_of(folder)
    assert walls.name == ("floor", "lid", *NAMES)
    assert walls.plate.tolist() == [-1, -1, -1, 1, 1, -1]
    assert walls.endpoints[1, 1, 0].tolist() == [0.3, 0.201]


@pytest.mark.parametrize(
    ("columns", "walls", "problem"),
    [
        ({"radius": [0.02] * 7 + [0.03]}, None, "differs from an earlier row: corner 'sw' is a rigid disc"),
        ({"radius": [0.0] * 8}, None, "is not positive"),
        ({"corner": ["top", "ne", "nw", "sw"] * 2}, None, "is the name of a wall, too"),
        ({"corner": ["ne", "ne", "nw", "sw"] * 2}, None, "stands twice"),
        ({"frame": [0] * 4 + [2] * 4}, None, "is not one of the 2 frames"),
        ({"frame": [1] * 4 + [0] * 4, "corner": [*NAMES, "se", "ne", "nw", "x"]}, None, "no row of corner 'sw'"),
        ({}, 'corners = "corners.csv"\n[walls.ne]\npressure = 5e4', "there is no such wall in corners.csv"),
    ],
)
def test_wrong_corners_are_named(tmp_path, columns, walls, problem):
    folder = make(tmp_path, **({} if walls is None else {"walls": walls}), **columns)
    with pytest.raises(InputError, match=problem):
        walls_of(folder)


def test_two_corners_enclose_nothing(tmp_path):
    make(tmp_path, 'corners = "corners.csv"')
    table = {"frame": [0, 0], "corner": ["a", "b"], "x": [0.0, 1.0], "y": [0.0, 0.0], "radius": [0.02] * 2}
    write_table(tmp_path / "corners.csv", table)
    with pytest.raises(InputError, match="has 2 corners"):
        walls_of(tmp_path)
