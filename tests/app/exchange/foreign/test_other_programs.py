"""Small files in the formats of other programs: two grains side by side, the second of which moves up as seen."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from .command import import_files, refuse, tracks_in, walls_in

PIXEL = 2e-4


def test_trackpy_saved_as_csv_and_as_parquet(tmp_path, capsys):
    table = pd.DataFrame(
        {
            "y": [50.0, 50.0, 50.0, 48.0], "x": [10.0, 20.0, 10.0, 20.0], "mass": 1.0, "size": 2.5, "ecc": 0.1,
            "signal": 9.0, "raw_mass": 1.0, "ep": 0.01, "frame": [0, 0, 1, 1], "particle": [0, 1, 0, 1],
        }
    )  # fmt: skip
    table.to_csv(tmp_path / "linked.csv")
    table.to_parquet(tmp_path / "linked.parquet")
    for name in ("linked.csv", "linked.parquet"):
        out = tmp_path / f"out {name}"
        printed = import_files(capsys, "trackpy", tmp_path / name, out, "--pixel-size", PIXEL, "--radius", 5)
        expect_pair(out, np.array([10.0, 0.0, 2.0]) * PIXEL, 5 * PIXEL)
        assert "radius of gyration" in printed
    assert "--pixel-size" in refuse(capsys, "trackpy", tmp_path / "linked.csv", tmp_path / "no")


SPOTS = """LABEL,ID,TRACK_ID,QUALITY,POSITION_X,POSITION_Y,POSITION_Z,POSITION_T,FRAME,RADIUS,VISIBILITY
Label,Spot ID,Track ID,Quality,X,Y,Z,T,Frame,Radius,Visibility
Label,Spot ID,Track ID,Quality,X,Y,Z,T,Frame,R,Visibility
,,,(quality),(micron),(micron),(micron),(sec),,(micron),
ID11,11,0,3.1,2000,9000,0,0,0,1000,1
ID12,12,1,3.0,4000,9000,0,0,0,1000,1
ID13,13,0,3.1,2000,9000,0,5,1,1000,1
ID14,14,1,3.2,4000,8600,0,5,1,1000,1
ID15,15,,1.2,9000,9000,0,5,1,1000,1
"""
SESSION = """<?xml version="1.0" encoding="UTF-8"?>
<TrackMate version="7.11.1">
  <Model spatialunits="mm" timeunits="sec">
    <AllSpots nspots="5">
      <SpotsInFrame frame="0">
        <Spot ID="11" name="ID11" FRAME="0" POSITION_X="2" POSITION_Y="9" POSITION_Z="0" RADIUS="1" VISIBILITY="1" />
        <Spot ID="12" name="ID12" FRAME="0" POSITION_X="4" POSITION_Y="9" POSITION_Z="0" RADIUS="1" VISIBILITY="1" />
      </SpotsInFrame>
      <SpotsInFrame frame="1">
        <Spot ID="13" name="ID13" FRAME="1" POSITION_X="2" POSITION_Y="9" POSITION_Z="0" RADIUS="1" VISIBILITY="1" />
        <Spot ID="14" name="ID14" FRAME="1" POSITION_X="4" POSITION_Y="8.6" POSITION_Z="0" RADIUS="1" VISIBILITY="1" />
        <Spot ID="15" name="ID15" FRAME="1" POSITION_X="9" POSITION_Y="9" POSITION_Z="0" RADIUS="1" VISIBILITY="1" />
      </SpotsInFrame>
    </AllSpots>
    <AllTracks>
      <Track name="Track_0" TRACK_ID="0"><Edge SPOT_SOURCE_ID="11" SPOT_TARGET_ID="13" /></Track>
      <Track name="Track_1" TRACK_ID="1"><Edge SPOT_SOURCE_ID="12" SPOT_TARGET_ID="14" /></Track>
    </AllTracks>
    <FilteredTracks><TrackID TRACK_ID="0" /><TrackID TRACK_ID="1" /></FilteredTracks>
  </Model>
</TrackMate>
"""
SIMPLE = """<?xml version="1.0" encoding="UTF-8"?>
<Tracks nTracks="2" spaceUnits="pixel" frameInterval="1.0" timeUnits="sec" from="TrackMate v7.11.1">
  <particle nSpots="2">
    <detection t="0" x="10.0" y="45.0" z="0.0" /><detection t="1" x="10.0" y="45.0" z="0.0" />
  </particle>
  <particle nSpots="2">
    <detection t="0" x="20.0" y="45.0" z="0.0" /><detection t="1" x="20.0" y="43.0" z="0.0" />
  </particle>
</Tracks>
"""


def test_trackmate_spots_with_four_rows_of_header(tmp_path, capsys):
    (tmp_path / "spots.csv").write_text(SPOTS)
    printed = import_files(capsys, "trackmate", tmp_path / "spots.csv", tmp_path / "out")
    expect_pair(tmp_path / "out", np.array([2e-3, 0.0, 4e-4]), 1e-3)
    assert "1 row without a grain" in printed


def test_trackmate_session_and_simple_tracks(tmp_path, capsys):
    (tmp_path / "session.xml").write_text(SESSION)
    (tmp_path / "tracks.xml").write_text(SIMPLE)
    import_files(capsys, "trackmate", tmp_path / "session.xml", tmp_path / "one")
    expect_pair(tmp_path / "one", np.array([2e-3, 0.0, 4e-4]), 1e-3)
    arguments = ("trackmate", tmp_path / "tracks.xml", tmp_path / "two", "--radius", 5)
    assert "--pixel-size" in refuse(capsys, *arguments)
    import_files(capsys, *arguments, "--pixel-size", PIXEL)
    expect_pair(tmp_path / "two", np.array([10.0, 0.0, 2.0]) * PIXEL, 5 * PIXEL)
    (tmp_path / "bad.xml").write_text(SESSION[:300])
    assert "is not XML" in refuse(capsys, "trackmate", tmp_path / "bad.xml", tmp_path / "three")


def test_a_splitting_track_is_named(tmp_path, capsys):
    (tmp_path / "spots.csv").write_text(SPOTS.replace("ID15,15,,", "ID15,15,1,"))
    (tmp_path / "session.xml").write_text(
        SESSION.replace('TARGET_ID="14" />', 'TARGET_ID="14" /><Edge SPOT_SOURCE_ID="12" SPOT_TARGET_ID="15" />')
    )
    for name in ("spots.csv", "session.xml"):
        printed = refuse(capsys, "trackmate", tmp_path / name, tmp_path / "out")
        assert "track 1: has two spots in frame 1: it splits or merges" in printed
        assert not (tmp_path / "out").exists()


def test_trackmate_table_of_results_saved_by_imagej(tmp_path, capsys):
    """Before version 7: numbered rows, tabs, None for a spot without a track, one row of header and no units."""
    (tmp_path / "Spots in tracks statistics.txt").write_text(
        " \tLabel\tID\tTRACK_ID\tPOSITION_X\tPOSITION_Y\tFRAME\tRADIUS\n"
        "1\tID1\t1\t0\t10.000\t45.000\t0\t5.000\n2\tID2\t2\t1\t20.000\t45.000\t0\t5.000\n"
        "3\tID3\t3\t0\t10.000\t45.000\t1\t5.000\n4\tID4\t4\t1\t20.000\t43.000\t1\t5.000\n"
        "5\tID5\t5\tNone\t90.000\t90.000\t1\t5.000\n"
    )
    arguments = ("trackmate", tmp_path / "Spots in tracks statistics.txt", tmp_path / "out")
    assert "--pixel-size" in refuse(capsys, *arguments)
    printed = import_files(capsys, *arguments, "--pixel-size", PIXEL)
    expect_pair(tmp_path / "out", np.array([10.0, 0.0, 2.0]) * PIXEL, 5 * PIXEL)
    assert "1 row without a grain" in printed


def test_rodtracker_ends_of_the_first_camera(tmp_path, capsys):
    (tmp_path / "rods.csv").write_text(
        "x1,y1,z1,x2,y2,z2,x1_gp3,y1_gp3,x2_gp3,y2_gp3,x1_gp4,y1_gp4,frame,seen_gp3,seen_gp4,color,particle\n"
        "0,0,0,0,0,0,8,50,12,50,1,2,512,1,1,red,0\n"
        "0,0,0,0,0,0,20,52,20,48,1,2,512,1,1,red,1\n"
        "0,0,0,0,0,0,8,50,12,50,1,2,513,1,1,red,0\n"
        "0,0,0,0,0,0,20,50,20,46,1,2,513,1,1,red,1\n"
        "0,0,0,0,0,0,-1,-1,-1,-1,1,2,513,0,1,blue,0\n"
    )
    printed = import_files(
        capsys, "rodtracker", tmp_path / "rods.csv", tmp_path / "out", "--pixel-size", PIXEL, "--radius", 5
    )
    tracks = tracks_in(tmp_path / "out")
    assert tracks.position[0] / PIXEL == pytest.approx(np.array([[10.0, 0.0], [20.0, 0.0]]))
    assert tracks.position[1, 1] / PIXEL == pytest.approx([20.0, 2.0])
    assert tracks.rotation[0] == pytest.approx([0.0, 0.5 * np.pi])
    assert "Camera gp3" in printed
    assert "Without a position of a rod: 1 row." in printed
    assert "red-1" in (tmp_path / "out" / "ids.csv").read_text()


HALF = ("--pixel-size", 0.5)  # [m] the unit of length of simulations of rods with radius 1


def dump(step: int, rows: list[str], *, box: str = "ff ff pp", columns: str = "id type x y z radius omegaz fx") -> str:
    bounds = "0 6\n0 4\n-0.5 0.5"
    head = f"ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF ATOMS\n{len(rows)}\nITEM: BOX BOUNDS {box}\n{bounds}\n"
    return head + f"ITEM: ATOMS {columns}\n" + "".join(f"{row} \n" for row in rows)


def test_liggghts_dump_with_spins_and_a_fixed_box(tmp_path, capsys):
    one = dump(0, ["2 1 3 1 0 1 0.1 7", "1 1 1 1 0 1 0 7"])
    two = dump(100, ["1 1 1 1 0 1 0 7", "2 1 3 1.4 0 1 0.3 7"])
    (tmp_path / "dump.all").write_text(one + two)
    printed = import_files(capsys, "lammps", tmp_path / "dump.all", tmp_path / "out", "--interval", 0.01, *HALF)
    expect_pair(tmp_path / "out", np.array([1.0, 0.0, 0.2]), 0.5)
    tracks, walls = tracks_in(tmp_path / "out"), walls_in(tmp_path / "out")
    assert tracks.rotation[1] == pytest.approx([0.0, 0.2])
    assert tracks.time.tolist() == [0.0, 1.0]
    assert walls is not None
    assert walls.endpoints[1, walls.name.index("right")] == pytest.approx(np.array([[3.0, 0.0], [3.0, 2.0]]))
    assert "PROPOSED" not in printed
    assert "omegaz integrated" in printed
    assert "Left out: fx" in printed


def test_a_shrinking_box_gives_proposed_walls_and_an_empty_step_no_frame(tmp_path, capsys):
    """A box of meshes from LIGGGHTS, before and after the first grain is poured in."""
    folder = tmp_path / "post"
    folder.mkdir()
    for step, y in ((0, None), (800, 1.0), (1600, 1.4)):
        rows = [] if y is None else ["1 1 1 1 0 1 0 7", f"2 1 3 {y} 0 1 0 7"]
        (folder / f"dump{step}.liggghts").write_text(dump(step, rows, box="mm mm mm"))
    printed = import_files(capsys, "lammps", folder, tmp_path / "out", *HALF)
    expect_pair(tmp_path / "out", np.array([1.0, 0.0, 0.2]), 0.5)
    assert "PROPOSED, NOT MEASURED: the faces of the simulation's box" in printed
    assert "PROPOSED, NOT MEASURED" in (tmp_path / "out" / "experiment.toml").read_text()


def test_lammps_dumps_of_a_folder_with_scaled_coordinates_and_quaternions(tmp_path, capsys):
    folder = tmp_path / "post"
    folder.mkdir()
    columns = "id type diameter xs ys zs c_q[1] c_q[2] c_q[3] c_q[4]"
    half = f"{np.cos(0.15):.9f} 0 0 {np.sin(0.15):.9f}"
    for step, y in ((9, 0.25), (10, 0.35)):
        rows = ["1 1 2 0.1666666667 0.25 0.5 1 0 0 0", f"2 1 2 0.5 {y} 0.5 {half if step == 10 else '1 0 0 0'}"]
        (folder / f"dump.{step}").write_text(dump(step, rows, box="pp ff pp", columns=columns))
    (folder / "log.txt").write_text("no dump")
    import_files(capsys, "lammps", folder, tmp_path / "out", *HALF)
    expect_pair(tmp_path / "out", np.array([1.0, 0.0, 0.2]), 0.5)
    assert tracks_in(tmp_path / "out").rotation[1] == pytest.approx([0.0, 0.3])
    walls = walls_in(tmp_path / "out")
    assert walls is not None
    assert walls.name == ("bottom", "top")


def test_an_incomplete_dump_is_named(tmp_path, capsys):
    whole = dump(0, ["1 1 1 1 0 1 0 7", "2 1 3 1 0 1 0 7"])
    (tmp_path / "dump").write_text(whole[:-18])
    assert "row 11: does not have 8 cells" in refuse(capsys, "lammps", tmp_path / "dump", tmp_path / "out")
    (tmp_path / "dump").write_text("ITEM: TIMESTEP\nlate\n")
    assert "ITEM: TIMESTEP" in refuse(capsys, "lammps", tmp_path / "dump", tmp_path / "out")


def test_yade_text_of_two_steps(tmp_path, capsys):
    folder = tmp_path / "steps"
    folder.mkdir()
    for step, z in ((9, 1.0), (10, 1.4)):
        (folder / f"s{step}.txt").write_text(f"#format x_y_z_r_matId\n# a test\n1\t0\t1\t1\t0\n3\t0\t{z}\t1\t0\n")
    printed = import_files(capsys, "yade", folder, tmp_path / "out", "--columns", "y=z", *HALF)
    expect_pair(tmp_path / "out", np.array([1.0, 0.0, 0.2]), 0.5)
    assert "Left out: matId" in printed


def test_yade_vtk_with_ids(tmp_path, capsys):
    folder = tmp_path / "steps"
    folder.mkdir()
    for step, y in ((0, 1.0), (1, 1.4)):
        (folder / f"a-spheres-{step:08d}.vtk").write_text(
            "# vtk DataFile Version 3.0.\ncomment\nASCII\n\nDATASET POLYDATA\nPOINTS 2 double\n"
            f"3 {y} 0\n1 1 0\n\nPOINT_DATA 2\nSCALARS radius double 1\nLOOKUP_TABLE default\n1\n1\n\n"
            "SCALARS id int 1\nLOOKUP_TABLE default\n8\n4\n"
        )
    import_files(capsys, "yade", folder, tmp_path / "out", *HALF)
    expect_pair(tmp_path / "out", np.array([1.0, 0.0, 0.2]), 0.5)
    assert tracks_in(tmp_path / "out").id.tolist() == [4, 8]


def expect_pair(folder: Path, vector_and_rise: np.ndarray, radius: float) -> None:
    """Check the vector from the first grain to the second, and the rise of the second."""
    tracks = tracks_in(folder)
    between = tracks.position[0, 1] - tracks.position[0, 0]
    rise = tracks.position[1, 1] - tracks.position[0, 1]
    assert [*between, rise[1]] == pytest.approx(vector_and_rise, abs=1e-9)
    assert rise[0] == pytest.approx(0.0, abs=1e-12)
    assert tracks.radius == pytest.approx([radius, radius])
