"""Files that other programs wrote; written/README.md names the commands."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rodsight.experiment.boundary import apply_boundary
from rodsight.experiment.experiment import load_experiment, read_tracks

from .command import import_files, tracks_in, walls_in

WRITTEN = Path(__file__).parent / "written"
STEP = 2e-5  # [s] of the simulations


def test_a_periodic_cell_of_lammps_bounds_the_packing(tmp_path, capsys):
    printed = import_files(capsys, "lammps", WRITTEN / "sheared_cell.dump", tmp_path / "out", "--interval", STEP)
    assert "two periodic directions" in printed
    tracks, walls = tracks_in(tmp_path / "out"), walls_in(tmp_path / "out")
    assert walls is not None
    assert walls.cell is not None
    assert walls.endpoints.shape[1] == 0
    # LAMMPS has flipped the last cell by one vector; followed continuously, it shears by 30 % per second.
    assert walls.cell[:, 1, 0] == pytest.approx(0.3 * tracks.time * walls.cell[0, 1, 1])
    followed = apply_boundary(load_experiment(tmp_path / "out"), tracks, walls)
    step = np.linalg.norm(np.diff(followed.position, axis=0), axis=2)
    assert step.max() < 0.3 * walls.cell[0, 0, 0] < np.linalg.norm(np.diff(tracks.position, axis=0), axis=2).max()


def test_a_box_of_lammps_with_fixed_faces_is_four_walls(tmp_path, capsys):
    printed = import_files(capsys, "lammps", WRITTEN / "box_with_floor.dump", tmp_path / "out", "--interval", STEP)
    assert "Left out: vx, vy." in printed
    tracks, walls = tracks_in(tmp_path / "out"), walls_in(tmp_path / "out")
    assert walls is not None
    assert walls.name == ("bottom", "right", "top", "left")
    assert tracks.radius == pytest.approx(np.full(16, 0.0075))
    assert tracks.time.tolist() == pytest.approx([0.0, 0.2, 0.4])
    assert (np.diff(tracks.position[:, :, 1].mean(axis=1)) < 0.0).all()  # they fall
    assert tracks.position[:, :, 1].min() > 0.95 * 0.0075  # soft grains


def test_a_box_with_one_periodic_direction_gives_a_warning_of_lost_contacts(tmp_path, capsys):
    text = (WRITTEN / "box_with_floor.dump").read_text().replace("ff ff pp", "pp ff pp")
    (tmp_path / "half.dump").write_text(text)
    printed = import_files(capsys, "lammps", tmp_path / "half.dump", tmp_path / "out")
    assert "periodic across x only" in printed
    walls = walls_in(tmp_path / "out")
    assert walls is not None
    assert walls.name == ("bottom", "top")


def test_rotations_of_rolling_discs_beyond_2_pi_are_kept(tmp_path, capsys):
    import_files(capsys, "lammps", WRITTEN / "box_with_floor.dump", tmp_path / "slow", "--interval", STEP)
    import_files(capsys, "lammps", WRITTEN / "box_with_floor.dump", tmp_path / "fast", "--interval", 10 * STEP)
    slow, fast = tracks_in(tmp_path / "slow").rotation, tracks_in(tmp_path / "fast").rotation
    assert np.abs(fast).max() > 2.0 * np.pi
    assert fast == pytest.approx(10.0 * slow)


def test_trackpy_files_are_imported(tmp_path, capsys):
    import_files(
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


def test_rodtracker_files_are_imported(tmp_path, capsys):
    printed = import_files(
        capsys, "rodtracker", WRITTEN / "rodtracker_rods.csv", tmp_path / "out", "--pixel-size", 1e-4, "--radius", 15,
        "--walls", "box",
    )  # fmt: skip
    assert "Camera gp3" in printed
    assert "Without a position of a rod: 1 row." in printed
    assert "500 … 502" in printed
    tracks = tracks_in(tmp_path / "out")
    position = tracks.position / 1e-4
    assert position.shape == (3, 5, 2)
    assert position[0, 1:3] - position[0, 0] == pytest.approx(np.array([[30.0, 0.0], [60.0, 0.0]]))
    assert position[0, 3] - position[0, 0] == pytest.approx([15.0, 26.0])  # further up, where y of a picture is smaller
    assert position[1, 4] - position[0, 4] == pytest.approx([0.0, 1.5])
    assert np.isnan(position[2, 4]).all()  # hidden
    assert tracks.rotation[:, 0] == pytest.approx(np.full(3, np.arctan2(-2.0, 3.0)))


def test_edges_of_a_box_agree_with_bounds_and_tilts(tmp_path, capsys):
    lines = (WRITTEN / "sheared_cell.dump").read_text().splitlines()
    at = len(lines) - 36 - 4
    assert lines[at - 1].startswith("ITEM: BOX BOUNDS xy xz yz")
    lines[at - 1] = "ITEM: BOX BOUNDS abc origin pp pp pp"
    lines[at : at + 3] = ["0.092544 0 0 0.001728", "-0.040704 0.092544 0 0.001728", "0 0 0.016 -0.008"]
    (tmp_path / "edges.dump").write_text("\n".join(lines))
    import_files(capsys, "lammps", tmp_path / "edges.dump", tmp_path / "edges", "--interval", STEP)
    import_files(capsys, "lammps", WRITTEN / "sheared_cell.dump", tmp_path / "tilts", "--interval", STEP)
    edges, tilts = walls_in(tmp_path / "edges"), walls_in(tmp_path / "tilts")
    assert edges is not None
    assert tilts is not None
    assert edges.cell == pytest.approx(tilts.cell)


def test_ovito_dumps_are_imported(tmp_path, capsys):
    ovito = pytest.importorskip("ovito.io", reason="the ovito package is not installed")
    dump = tmp_path / "from_ovito.dump"
    pipeline = ovito.import_file(str(WRITTEN / "sheared_cell.dump"))
    columns = ["Particle Identifier", "Position.X", "Position.Y", "Radius"]
    ovito.export_file(pipeline, str(dump), "lammps/dump", columns=columns, multiple_frames=True)
    assert "abc origin" in dump.read_text()  # OVITO writes edges, LAMMPS bounds and tilts
    import_files(capsys, "lammps", dump, tmp_path / "ovito", "--interval", STEP)
    import_files(capsys, "lammps", WRITTEN / "sheared_cell.dump", tmp_path / "lammps", "--interval", STEP)
    lammps_walls, ovito_walls = walls_in(tmp_path / "lammps"), walls_in(tmp_path / "ovito")
    assert lammps_walls is not None
    assert ovito_walls is not None
    assert ovito_walls.cell == pytest.approx(lammps_walls.cell)
    for name in ("position", "radius", "time"):
        assert getattr(tracks_in(tmp_path / "ovito"), name) == pytest.approx(
            getattr(tracks_in(tmp_path / "lammps"), name)
        ), name
