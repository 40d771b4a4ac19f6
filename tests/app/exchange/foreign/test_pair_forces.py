"""Pair forces of simulations as truth: signs, names of grains and columns, periodic cells."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest
import rodsight

BOX = "ITEM: BOX BOUNDS {ends} {ends} ff\n0 0.1\n0 0.1\n-1 1\n"


def dump(folder: Path, places: str, ends: str = "ff") -> Path:
    """Write a dump of two particles in two steps."""
    count = len(places.splitlines())
    body = f"ITEM: NUMBER OF ATOMS\n{count}\n{BOX.format(ends=ends)}ITEM: ATOMS id x y radius\n{places}\n"
    text = "".join(f"ITEM: TIMESTEP\n{step}\n{body}" for step in (0, 100))
    file = folder / "grains.dump"
    file.write_text(text)
    return file


def local(folder: Path, rows: str, names: str = "index c_pair[1] c_pair[2] c_force[1] c_force[2]") -> Path:
    count = len(rows.splitlines())
    file = folder / "pairs.dump"
    file.write_text(
        f"ITEM: TIMESTEP\n100\nITEM: NUMBER OF ENTRIES\n{count}\n{BOX.format(ends='ff')}ITEM: ENTRIES {names}\n{rows}\n"
    )
    return file


def test_a_dump_local_is_the_truth_in_the_sign_of_compression(tmp_path):
    grains = dump(tmp_path, "1 0.03 0.05 0.01\n2 0.05 0.05 0.01")
    pairs = local(tmp_path, "1 1.0 2.0 -5.0 -2.0\n2 2 9 1.0 1.0")  # 2 pushes 1 to the left, and drags it down
    roles = {"i": "c_pair[1]", "j": "c_pair[2]", "fx": "c_force[1]", "fy": "c_force[2]"}
    found = rodsight.import_table(grains, tmp_path / "out", roles, form="lammps", pairs=pairs, walls="box")
    truth = pd.read_csv(tmp_path / "out/truth_contacts.csv")
    assert truth.to_numpy().tolist() == [[1, 1, 2, 5.0, 2.0]]
    assert any("Left out: 1 pair force naming" in each for each in found.attrs["remarks"])
    assert 'truth = "truth_contacts.csv"' in (tmp_path / "out/experiment.toml").read_text()


def test_a_pair_across_a_periodic_edge_has_the_normal_of_the_nearest_image(tmp_path):
    grains = dump(tmp_path, "1 0.005 0.05 0.01\n2 0.095 0.05 0.01\n3 0.025 0.05 0.01\n4 0.075 0.05 0.01", "pp")
    pairs = tmp_path / "pairs.csv"
    pairs.write_text("frame,id1,id2,fx,fy\n100,1,2,3.0,0.0\n")  # 2 is on the left of 1 and pushes it to the right
    rodsight.import_table(grains, tmp_path / "out", form="lammps", pairs=pairs)
    assert pd.read_csv(tmp_path / "out/truth_contacts.csv")["fn"].tolist() == pytest.approx([3.0])


def test_missing_columns_and_other_formats_are_named(tmp_path):
    grains = dump(tmp_path, "1 0.03 0.05 0.01\n2 0.05 0.05 0.01")
    with pytest.raises(rodsight.InputError, match=r"has no column i \(columns: index"):
        rodsight.import_table(grains, tmp_path / "a", form="lammps", pairs=local(tmp_path, "1 1 2 0 0"))
    with pytest.raises(rodsight.InputError, match="holds ATOMS, where ITEM: ENTRIES is expected"):
        rodsight.import_table(grains, tmp_path / "b", form="lammps", pairs=grains)


DATA = """2 0.5 0 0 0.1 0.1
0.03 0.01 0 0 0.01 0.0 0.0 0
0.05 0.01 0 0 0.01 0.0 0.0 0
2 1.0 0 0 0.1 0.1
0.03 0.01 0 0 0.01 -0.1 0.2 0
0.05 0.01 0 0 0.01 0.1 -0.2 0
"""
# Grain 1 pushes grain 0 to the left with 5 N and up with 2 N; the floor pushes it up with 3 N, to the right with 1 N.
FSTAT = """# 0.25 1
# 0 0 0 0.1 0.1 0
# 0.01 0.01 0 0 0 0
0.25 0 1 0.04 0.01 0 1e-5 0 99 0 -1 0 0 0 1 0
# 1 1
# 0 0 0 0.1 0.1 0
# 0.01 0.01 0 0 0 0
1 0 1 0.04 0.01 0 1e-5 0 5 2 -1 0 0 0 1 0
1 1 0 0.04 0.01 0 1e-5 0 5 2 1 0 0 0 -1 0
1 0 -1 0.03 0 0 1e-5 0 3 1 0 -1 0 -1 0 0
"""


def test_forces_of_mercury_are_the_truth_at_grains_and_walls(tmp_path):
    (tmp_path / "run.data").write_text(DATA)
    (tmp_path / "run.fstat").write_text(FSTAT)
    found = rodsight.import_table(
        tmp_path / "run.data", tmp_path / "out", form="mercury", pairs=tmp_path / "run.fstat", walls="box"
    )
    truth = pd.read_csv(tmp_path / "out/truth_contacts.csv", dtype={"i": str, "j": str})
    between, floor = truth.to_dict("records")  # forces at times without particles are left out, pairs are there once
    assert (between["frame"], between["i"], between["j"]) == (1, "0", "1")
    assert (between["fn"], between["ft"]) == pytest.approx((5.0, -2.0))
    assert (floor["i"], floor["j"]) == ("0", "bottom")
    assert (floor["fn"], floor["ft"]) == pytest.approx((3.0, -1.0))
    # Angles are against the angular velocities in this file, and are reversed.
    assert found.sort_values(["frame", "id"])["theta"].tolist() == pytest.approx([0.0, 0.0, 0.1, -0.1])
    assert pd.read_csv(tmp_path / "out/times.csv")["time"].diff().iloc[1] == pytest.approx(0.5)


def test_wrong_files_of_mercury_are_named(tmp_path):
    (tmp_path / "run.data").write_text(DATA.replace("0.05 0.01 0 0 0.01 0.0 0.0 0", "0.05 0.01"))
    with pytest.raises(rodsight.InputError, match="row 3: does not have 8 numbers"):
        rodsight.import_table(tmp_path / "run.data", tmp_path / "a", form="mercury")
    (tmp_path / "run.data").write_text(DATA)
    (tmp_path / "late.fstat").write_text(FSTAT.replace("# 1 1", "# 7 1"))
    with pytest.raises(rodsight.InputError, match="has no forces at a time of the particles"):
        rodsight.import_table(tmp_path / "run.data", tmp_path / "b", form="mercury", pairs=tmp_path / "late.fstat")


def test_a_table_names_walls(tmp_path):
    grains = dump(tmp_path, "1 0.03 0.01 0.01\n2 0.05 0.01 0.01")
    pairs = tmp_path / "pairs.csv"
    pairs.write_text("frame,i,j,fx,fy\n100,bottom,1,0.0,-4.0\n100,2,-1,0.5,3.0\n100,2,roof,0.0,1.0\n")
    found = rodsight.import_table(grains, tmp_path / "out", form="lammps", pairs=pairs, walls="box")
    truth = pd.read_csv(tmp_path / "out/truth_contacts.csv", dtype={"i": str, "j": str})
    assert truth[["i", "j"]].to_numpy().tolist() == [["1", "bottom"], ["2", "bottom"]]
    assert truth["fn"].tolist() == pytest.approx([4.0, 3.0])
    assert truth["ft"].tolist() == pytest.approx([0.0, -0.5])
    assert any("Left out: 1 pair force naming" in each for each in found.attrs["remarks"])
