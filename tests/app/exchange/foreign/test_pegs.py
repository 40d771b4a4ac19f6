"""Photoelastic discs and their forces, in both formats of PeGS and the rigidity library."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from rodsight.experiment.experiment import load_experiment

from .command import import_files, refuse, tracks_in, walls_in

PIXEL = 1e-4
DISCS = "1,100,300,30,7.5\n2,160.5,300,30,0\n3,130,248,29,0\n"
READINGS = "0,0.5,0\n0.3,0,0.2\n0,0,0\n"  # row: disc that is read, column: other disc


def write_frame(folder: Path, stem: str, discs: str = DISCS, normal: str = READINGS) -> None:
    (folder / f"{stem}_ParticleData.dlm").write_text(discs)
    (folder / f"{stem}_NormWeightedAdjacencyMatrix.dlm").write_text(normal)
    (folder / f"{stem}_TanWeightedAdjacencyMatrix.dlm").write_text(normal.replace("0.", "0.0"))
    (folder / f"{stem}_bonds.txt").write_text("1.0e+00 0.0e+00 0 3.0e-02 3.0e-01\n2 1 0 0 0.1\n")


def truth_in(folder: Path) -> list[dict[str, str]]:
    with (folder / "truth_contacts.csv").open() as stream:
        return list(csv.DictReader(stream))


def test_both_readings_of_a_contact_are_stored_beside_their_mean(tmp_path, capsys):
    folder = tmp_path / "solved"
    folder.mkdir()
    for stem in ("DSC9_solved", "DSC10_solved"):
        write_frame(folder, stem, DISCS if stem == "DSC9_solved" else DISCS.replace("248", "247"))
    printed = import_files(capsys, "pegs", folder, tmp_path / "out")
    rows = truth_in(tmp_path / "out")
    assert [(row["frame"], row["i"], row["j"]) for row in rows[:2]] == [("0", "1", "2"), ("0", "2", "3")]
    assert [float(row["fn"]) for row in rows[:2]] == pytest.approx([0.4, 0.2])
    assert (rows[0]["fn_i"], rows[0]["fn_j"]) == ("0.5", "0.3")
    assert (rows[1]["fn_i"], rows[1]["fn_j"]) == ("0.2", "")
    assert float(rows[0]["ft"]) == pytest.approx(-0.04)
    tracks = tracks_in(tmp_path / "out")
    assert np.isnan(tracks.rotation).all()
    rise = tracks.position[1, 2] - tracks.position[0, 2]
    assert rise == pytest.approx([0.0, PIXEL])
    assert "pixel size is unknown" in printed
    assert "In truth_contacts.csv: 4 measured forces." in printed
    config = load_experiment(tmp_path / "out").config
    assert config.material.stiffness == "estimate"
    assert config.boundary is not None
    assert config.boundary.grains == "outer"
    import_files(capsys, "pegs", folder, tmp_path / "boxed", "--walls", "box")
    assert walls_in(tmp_path / "boxed") is not None


def test_bonds_without_matrices_give_one_reading(tmp_path, capsys):
    write_frame(tmp_path, "one")
    for file in tmp_path.glob("*Matrix.dlm"):
        file.unlink()
    import_files(capsys, "pegs", tmp_path, tmp_path / "out", "--pixel-size", 2 * PIXEL)
    rows = truth_in(tmp_path / "out")
    assert [(row["i"], row["j"], row["fn_i"], row["fn_j"]) for row in rows] == [
        ("1", "2", "", "0.3"), ("2", "3", "", "0.1"),
    ]  # fmt: skip
    assert tracks_in(tmp_path / "out").radius == pytest.approx(2 * PIXEL * np.array([30.0, 30.0, 29.0]))


def test_lists_of_all_photographs(tmp_path, capsys):
    positions = "".join(f"{frame},{row}\n" for frame in (3, 4) for row in DISCS.splitlines())
    (tmp_path / "particle_positions.txt").write_text(positions)
    (tmp_path / "Adjacency_list.txt").write_text(
        "3,1,2,.01,.5\n3,2,1,.01,.3\n3,1,-1,0,.9\n4,2,3,0,.2\n4,2,77,0,.2\n4,3,3,0,.8\n"
    )
    printed = import_files(capsys, "pegs", tmp_path, tmp_path / "out")
    rows = truth_in(tmp_path / "out")
    assert [(row["frame"], row["i"], row["j"]) for row in rows] == [("0", "1", "2"), ("1", "2", "3")]
    assert float(rows[0]["fn"]) == pytest.approx(0.4)
    assert "Left out, since no walls are given: 1 force on walls." in printed
    assert "Left out: 1 force of discs on themselves." in printed
    assert "Left out: 1 force of discs without a position." in printed


def test_forces_on_walls_belong_to_the_nearest_one(tmp_path, capsys):
    positions = "".join(f"{frame},{row}\n" for frame in (3, 4) for row in DISCS.splitlines())
    (tmp_path / "particle_positions.txt").write_text(positions)
    forces = "3,1,2,.01,.5\n3,3,-1,.02,.9\n4,2,-1,0,.2\n4,2,-1,0,.3\n4,3,-1,0,.7\n"
    (tmp_path / "Adjacency_list.txt").write_text(forces)
    printed = import_files(capsys, "pegs", tmp_path, tmp_path / "out", "--walls", "box")
    rows = truth_in(tmp_path / "out")
    assert [(row["frame"], row["i"], row["j"]) for row in rows] == [
        ("0", "1", "2"), ("0", "3", "top"), ("1", "3", "top"),
    ]  # fmt: skip
    assert [float(row["fn"]) for row in rows] == pytest.approx([0.5, 0.9, 0.7])
    assert float(rows[1]["ft"]) == pytest.approx(-0.02)
    assert "Left out: 2 forces on walls of discs that touch two." in printed
    load_experiment(tmp_path / "out")
    assert "5 forces" not in printed


def test_damaged_files_are_named(tmp_path, capsys):
    assert "contains neither" in refuse(capsys, "pegs", tmp_path, tmp_path / "out")
    write_frame(tmp_path, "one", discs=DISCS.replace("248", "x"))
    assert "row 3: '3,130,x,29,0' is not numbers" in refuse(capsys, "pegs", tmp_path, tmp_path / "out")
    write_frame(tmp_path, "one", normal="0,1\n1,0\n")
    assert "is 2 by 2, but there are 3 discs" in refuse(capsys, "pegs", tmp_path, tmp_path / "out")
    write_frame(tmp_path, "one", discs=DISCS.replace("3,130", "2.5,130"))
    assert "is not a whole number" in refuse(capsys, "pegs", tmp_path, tmp_path / "out")
    write_frame(tmp_path, "one")
    for file in tmp_path.glob("*Matrix.dlm"):
        file.unlink()
    (tmp_path / "one_bonds.txt").write_text("3 0 0 0 1\n")
    assert "names disc 3 of 3" in refuse(capsys, "pegs", tmp_path, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_forces_that_are_given_twice_are_one_reading(tmp_path, capsys):
    discs = "".join(f"{k},{100 + 60 * k},300,30,0\n" for k in range(1, 5))
    matrix = np.zeros((4, 4))
    for k, force in enumerate((0.5, 0.3, 0.7)):
        matrix[k, k + 1] = matrix[k + 1, k] = force
    text = "\n".join(",".join(map(str, row)) for row in matrix.tolist()) + "\n"
    write_frame(tmp_path, "one", discs, text)
    printed = import_files(capsys, "pegs", tmp_path, tmp_path / "out")
    assert "3 contacts are given twice and are equal: copies" in printed
    rows = truth_in(tmp_path / "out")
    assert [float(row["fn"]) for row in rows] == [0.5, 0.3, 0.7]
    assert {row["fn_j"] for row in rows} == {""}
    matrix[1, 0] = 0.4  # a reading of its own
    write_frame(tmp_path, "one", discs, "\n".join(",".join(map(str, row)) for row in matrix.tolist()) + "\n")
    assert "copies" not in import_files(capsys, "pegs", tmp_path, tmp_path / "two")
    assert truth_in(tmp_path / "two")[0]["fn_j"] == "0.4"


def test_discs_that_the_file_puts_at_the_edge_are_the_boundary(tmp_path, capsys):
    rows = [f"{frame},{k},{60 * (k % 4)},{60 * (k // 4)},30,{int(k % 4 == 0)}" for frame in (1, 2) for k in range(12)]
    (tmp_path / "particle_positions.txt").write_text("\n".join(rows) + "\n")
    printed = import_files(capsys, "pegs", tmp_path, tmp_path / "out")
    assert "By the file, 3 grains at the edge form the boundary" in printed
    assert (tmp_path / "out/boundary.csv").read_text().split() == ["id", "0", "4", "8"]
    assert load_experiment(tmp_path / "out").config.boundary.grains == "boundary.csv"
    import_files(capsys, "pegs", tmp_path, tmp_path / "outer", "--walls", "outer")
    assert load_experiment(tmp_path / "outer").config.boundary.grains == "outer"


def test_forces_between_discs_that_lie_apart_are_left_out_and_their_frames_named(tmp_path, capsys):
    discs = "".join(f"{k},{100 + 59 * k},300,30,0\n" for k in range(1, 5))
    (tmp_path / "particle_positions.txt").write_text(
        "".join(f"{frame},{row}\n" for frame in (3, 4) for row in discs.splitlines())
    )
    forces = "3,1,2,0,.5\n3,2,3,0,.4\n3,1,4,0,.9\n4,1,3,0,.2\n4,1,4,0,.3\n4,3,4,0,.7\n"
    (tmp_path / "Adjacency_list.txt").write_text(forces)
    printed = import_files(capsys, "pegs", tmp_path, tmp_path / "out")
    assert [(row["frame"], row["i"], row["j"]) for row in truth_in(tmp_path / "out")] == [
        ("0", "1", "2"), ("0", "2", "3"), ("1", "3", "4"),
    ]  # fmt: skip
    assert "Left out: 3 forces between discs that lie apart." in printed
    assert "Most of them are in frames 1: ids of positions and forces differ there" in printed
