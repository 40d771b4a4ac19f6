"""Files that other programs wrote themselves; written/README.md says how."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rodsight.experiment.boundary import bound_tracks
from rodsight.experiment.experiment import load_experiment, read_tracks

from .command import take_in, tracks_in, walls_in

WRITTEN = Path(__file__).parent / "written"
STEP = 2e-5  # [s] of the simulations


def test_a_periodic_cell_of_lammps_bounds_the_packing(tmp_path, capsys):
    said = take_in(capsys, "lammps", WRITTEN / "sheared_cell.dump", tmp_path / "out", "--interval", STEP)
    assert "periodic both ways" in said
    tracks, walls = tracks_in(tmp_path / "out"), walls_in(tmp_path / "out")
    assert walls is not None
    assert walls.cell is not None
    assert walls.endpoints.shape[1] == 0
    # LAMMPS has made the last cell upright, by one vector: followed, it shears on by 30 % a second.
    assert walls.cell[:, 1, 0] == pytest.approx(0.3 * tracks.time * walls.cell[0, 1, 1])
    followed = bound_tracks(load_experiment(tmp_path / "out"), tracks, walls)
    step = np.linalg.norm(np.diff(followed.position, axis=0), axis=2)
    assert step.max() < 0.3 * walls.cell[0, 0, 0] < np.linalg.norm(np.diff(tracks.position, axis=0), axis=2).max()


def test_a_box_of_lammps_with_fixed_faces_is_four_walls(tmp_path, capsys):
    said = take_in(capsys, "lammps", WRITTEN / "box_with_floor.dump", tmp_path / "out", "--interval", STEP)
    assert "Left out: vx, vy." in said
    tracks, walls = tracks_in(tmp_path / "out"), walls_in(tmp_path / "out")
    assert walls is not None
    assert walls.name == ("bottom", "right", "top", "left")
    assert tracks.radius == pytest.approx(np.full(16, 0.0075))
    assert tracks.time.tolist() == pytest.approx([0.0, 0.2, 0.4])
    assert (np.diff(tracks.position[:, :, 1].mean(axis=1)) < 0.0).all()  # they fall
    assert tracks.position[:, :, 1].min() > 0.95 * 0.0075  # soft as they are


def test_a_box_that_is_periodic_one_way_alone_is_said_to_lose_contacts(tmp_path, capsys):
    text = (WRITTEN / "box_with_floor.dump").read_text().replace("ff ff pp", "pp ff pp")
    (tmp_path / "half.dump").write_text(text)
    said = take_in(capsys, "lammps", tmp_path / "half.dump", tmp_path / "out")
    assert "periodic across x alone" in said
    walls = walls_in(tmp_path / "out")
    assert walls is not None
    assert walls.name == ("bottom", "top")


def test_whole_turns_of_rolling_discs_are_kept(tmp_path, capsys):
    take_in(capsys, "lammps", WRITTEN / "box_with_floor.dump", tmp_path / "slow", "--interval", STEP)
    take_in(capsys, "lammps", WRITTEN / "box_with_floor.dump", tmp_path / "fast", "--interval", 10 * STEP)
    slow, fast = tracks_in(tmp_path / "slow").rotation, tracks_in(tmp_path / "fast").rotation
    assert np.abs(fast).max() > 2.0 * np.pi
    assert fast == pytest.approx(10.0 * slow)


def test_what_trackpy_found_and_linked_comes_in(tmp_path, capsys):
    take_in(
        capsys, "trackpy", WRITTEN / "trackpy_discs.csv", tmp_path / "out", "--pixel-size", 1e-4, "--radius", 15,
        "--walls", "box",
    )  # fmt: skip
    tracks = tracks_in(tmp_path / "out")
    assert tracks.position.shape == (3, 9, 2)
    moved = (tracks.position[2] - tracks.position[0]) / 1e-4
    riser = np.flatnonzero(moved[:, 1] > 1.0)
    assert len(riser) == 1
    assert moved[riser[0]] == pytest.approx([0.0, 3.0], abs=0.2)
    assert np.delete(moved, riser, axis=0) == pytest.approx(np.zeros((8, 2)), abs=0.05)
    assert read_tracks(load_experiment(tmp_path / "out")).radius == pytest.approx(np.full(9, 1.5e-3))


def test_what_rodtracker_saves_comes_in(tmp_path, capsys):
    said = take_in(
        capsys, "rodtracker", WRITTEN / "rodtracker_rods.csv", tmp_path / "out", "--pixel-size", 1e-4, "--radius", 15,
        "--walls", "box",
    )  # fmt: skip
    assert "Camera gp3" in said
    assert "1 rows tell no place of a rod" in said
    assert "500 … 502" in said
    tracks = tracks_in(tmp_path / "out")
    place = tracks.position / 1e-4
    assert place.shape == (3, 5, 2)
    assert place[0, 1:3] - place[0, 0] == pytest.approx(np.array([[30.0, 0.0], [60.0, 0.0]]))
    assert place[0, 3] - place[0, 0] == pytest.approx([15.0, 26.0])  # further up, where y of a picture is less
    assert place[1, 4] - place[0, 4] == pytest.approx([0.0, 1.5])
    assert np.isnan(place[2, 4]).all()  # hidden
    assert tracks.rotation[:, 0] == pytest.approx(np.full(3, np.arctan2(-2.0, 3.0)))


def test_edges_of_a_box_tell_what_bounds_and_tilts_do(tmp_path, capsys):
    lines = (WRITTEN / "sheared_cell.dump").read_text().splitlines()
    at = len(lines) - 36 - 4
    assert lines[at - 1].startswith("ITEM: BOX BOUNDS xy xz yz")
    lines[at - 1] = "ITEM: BOX BOUNDS abc origin pp pp pp"
    lines[at : at + 3] = ["0.092544 0 0 0.001728", "-0.040704 0.092544 0 0.001728", "0 0 0.016 -0.008"]
    (tmp_path / "edges.dump").write_text("\n".join(lines))
    take_in(capsys, "lammps", tmp_path / "edges.dump", tmp_path / "edges", "--interval", STEP)
    take_in(capsys, "lammps", WRITTEN / "sheared_cell.dump", tmp_path / "tilts", "--interval", STEP)
    edges, tilts = walls_in(tmp_path / "edges"), walls_in(tmp_path / "tilts")
    assert edges is not None
    assert tilts is not None
    assert edges.cell == pytest.approx(tilts.cell)


def test_a_dump_that_ovito_exports_comes_in(tmp_path, capsys):
    inside = pytest.importorskip("ovito.io", reason="the ovito package is not installed")
    dump = tmp_path / "from_ovito.dump"
    pipeline = inside.import_file(str(WRITTEN / "sheared_cell.dump"))
    columns = ["Particle Identifier", "Position.X", "Position.Y", "Radius"]
    inside.export_file(pipeline, str(dump), "lammps/dump", columns=columns, multiple_frames=True)
    assert "abc origin" in dump.read_text()  # it writes edges where LAMMPS writes bounds and tilts
    take_in(capsys, "lammps", dump, tmp_path / "ovito", "--interval", STEP)
    take_in(capsys, "lammps", WRITTEN / "sheared_cell.dump", tmp_path / "lammps", "--interval", STEP)
    ours, theirs = walls_in(tmp_path / "lammps"), walls_in(tmp_path / "ovito")
    assert ours is not None
    assert theirs is not None
    assert theirs.cell == pytest.approx(ours.cell)
    for name in ("position", "radius", "time"):
        assert getattr(tracks_in(tmp_path / "ovito"), name) == pytest.approx(
            getattr(tracks_in(tmp_path / "lammps"), name)
        ), name
