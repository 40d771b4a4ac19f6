"""Boundaries other than walls are read, found, refused where they are impossible, and reported where missing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rodsight.experiment.boundary import apply_boundary, free_surfaces
from rodsight.experiment.config.input_sections import PhotographsSection
from rodsight.experiment.experiment import load_experiment, read_tracks
from rodsight.experiment.walls import read_walls
from rodsight.solver.bodies.cell import Cell

from tests.app.experiment.tables import edit, swap_row
from tests.program import rodsight

R = 0.01
FRAMES = 3


def hexagonal(inner: float = -1.0, outer: float = 0.12) -> np.ndarray:
    rows, columns = np.mgrid[-20:21, -20:21]
    place = 2.0 * R * np.stack([columns + 0.5 * (rows % 2), np.sqrt(0.75) * rows], axis=-1).reshape(-1, 2)
    distance = np.hypot(*place.T)
    return place[(distance < outer) & (distance > inner)]


def write(folder: Path, place: np.ndarray, bounds: str, **files: str) -> Path:
    """Write an experiment of rods at rest with the given boundary."""
    poses = [f"{k},{i},{x},{y},0" for k in range(FRAMES) for i, (x, y) in enumerate(place.tolist())]
    (folder / "tracks.csv").write_text("frame,id,x,y,theta\n" + "\n".join(poses) + "\n")
    (folder / "grains.csv").write_text("id,radius\n" + "".join(f"{i},{R}\n" for i in range(len(place))))
    (folder / "times.csv").write_text("frame,time\n" + "".join(f"{k},{30 * k}\n" for k in range(FRAMES)))
    for name, text in files.items():
        (folder / f"{name}.csv").write_text(text)
    (folder / "experiment.toml").write_text(f"""name = "rods"
[tracks]
positions = "tracks.csv"
grains = "grains.csv"
times = "times.csv"
{bounds}
""")
    return folder


def in_cell(folder: Path, size: float = 0.12, more: str = "") -> Path:
    side = 2.0 * R * np.arange(6)
    place = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2) + R
    cell = "frame,ax,ay,bx,by\n" + "".join(f"{k},{size},0,{0.01 * k},{size}\n" for k in range(FRAMES))
    return write(folder, place, f'[boundary]\nperiodic = "cell.csv"\n{more}', cell=cell)


def bound(folder: Path):
    experiment = load_experiment(folder)
    tracks = read_tracks(experiment)
    walls = read_walls(experiment, tracks.frame_count)
    return experiment, apply_boundary(experiment, tracks, walls), walls


def error_of_check(folder: Path, capsys: pytest.CaptureFixture) -> str:
    assert rodsight("check", folder) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    return message


def test_the_grains_of_a_table_are_the_boundary(tmp_path):
    _, tracks, walls = bound(write(tmp_path, hexagonal(), '[boundary]\ngrains = "b.csv"', b="id\n7\n3\n"))
    assert np.flatnonzero(tracks.boundary).tolist() == [3, 7]
    assert walls.count == 0


def test_the_outermost_grains_of_a_ring_are_those_of_both_rims(tmp_path):
    place = hexagonal(0.05, 0.16)
    _, tracks, _ = bound(write(tmp_path, place, '[boundary]\ngrains = "outer"'))
    distance = np.hypot(*place[tracks.boundary].T)
    assert (distance < 0.08).sum() > 10
    assert (distance > 0.13).sum() > 30
    assert not ((distance > 0.085) & (distance < 0.12)).any()


def test_positions_wrapped_into_the_cell_are_unwrapped(tmp_path):
    folder = in_cell(tmp_path)
    swap_row(folder / "tracks.csv", 2 + 36, {2: "0.13"})  # grain 0 in frame 1, one vector on
    _, tracks, walls = bound(folder)
    assert tracks.position[1, 0] == pytest.approx([0.01, 0.01])
    assert Cell.at_rest(walls.cell[2]).area == pytest.approx(0.12**2)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda at: in_cell(at, size=0.03), "must be higher than two of the largest diameters"),
        (lambda at: in_cell(at, more="[material]\ngravity = [0, -9.8]"), "no boundary carries the weight"),
        (lambda at: in_cell(at, more='[walls]\nfile = "walls.csv"'), "is given instead of [walls]"),
        (lambda at: in_cell(at, more='grains = "outer"'), "give either grains or periodic"),
        (lambda at: swap_row(in_cell(at) / "cell.csv", 3, {3: "0.24", 4: "0"}), "the cell has no area"),
        (lambda at: edit(in_cell(at) / "cell.csv", "2,0.12", "3,0.12"), "frame"),
        (lambda at: write(at, hexagonal(), '[boundary]\ngrains = "b.csv"', b="id\n7\n7\n"), "id"),
        (lambda at: write(at, hexagonal(), '[boundary]\ngrains = "b.csv"', b="id\n999\n"), "is not the id of a grain"),
        (lambda at: write(at, hexagonal(), '[boundary]\ngrains = "b.csv"'), "there is no such file"),
    ],
)
def test_an_impossible_boundary_is_refused_with_one_line(tmp_path, capsys, change, message):
    change(tmp_path)
    assert message in error_of_check(tmp_path, capsys)


def floor(left: float, right: float, bottom: float) -> str:
    return "frame,wall,x1,y1,x2,y2\n" + "".join(f"{k},floor,{left},{bottom},{right},{bottom}\n" for k in range(FRAMES))


def heap() -> np.ndarray:
    place = hexagonal(outer=0.2)
    return place[(place[:, 1] > -0.01) & (place[:, 1] < 0.12 - np.abs(place[:, 0]))]


def test_an_open_boundary_is_reported_with_its_place_and_cure(tmp_path):
    place = hexagonal(0.05, 0.16)
    bottom = float(place[:, 1].min()) - R
    folder = write(tmp_path, place, '[walls]\nfile = "walls.csv"', walls=floor(-0.2, 0.2, bottom))
    warnings = free_surfaces(*bound(folder))
    assert any("around a hole inside" in each for each in warnings)
    assert any("at the left" in each for each in warnings)
    assert all('[boundary] grains = "outer"' in each for each in warnings)
    assert not any("photograph" in each for each in warnings)  # these are tracks


def test_a_hole_may_be_of_rods_that_the_first_photograph_hides(tmp_path):
    place = hexagonal(0.05, 0.16)
    walls = floor(-0.2, 0.2, float(place[:, 1].min()) - R)
    experiment, *bounds = bound(write(tmp_path, place, '[walls]\nfile = "walls.csv"', walls=walls))
    photographs = PhotographsSection.model_validate({"files": "*.png", "interval": 1.0, "pixel_size": 1e-4})
    config = experiment.config.model_copy(update={"photographs": photographs})
    stated = free_surfaces(replace(experiment, config=config), *bounds)
    assert [each.endswith("--frames 1:") for each in stated] == ["hole inside" in each for each in stated]
    assert any("hole inside" in each for each in stated)


@pytest.mark.thorough
def test_a_free_surface_of_a_heap_is_not_reported(tmp_path):
    gravity = "\n[material]\ngravity = [0.0, -9.81]"
    folder = write(tmp_path, heap(), f'[walls]\nfile = "walls.csv"{gravity}', walls=floor(-0.3, 0.3, -R))
    assert free_surfaces(*bound(folder)) == []
    edit(folder / "experiment.toml", "-9.81", "9.81")
    assert free_surfaces(*bound(folder))


@pytest.mark.thorough
def test_outermost_grains_as_boundary_close_the_packing(tmp_path):
    assert free_surfaces(*bound(write(tmp_path, hexagonal(0.05, 0.16), '[boundary]\ngrains = "outer"'))) == []


def test_check_reports_the_boundary_of_a_packing_without_walls(tmp_path, capsys):
    assert rodsight("check", in_cell(tmp_path)) == 0
    assert "periodic cell" in capsys.readouterr().out
