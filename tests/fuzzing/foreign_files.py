"""Small files in the formats of other programs, and experiments with other boundaries than four bars."""

from __future__ import annotations

import shutil
from pathlib import Path

TRACKPY = "y,x,mass,frame,particle\n50,10,1,0,0\n50,20,1,0,1\n50,10,1,1,0\n48,20,1,1,1\n"
TABLE = "t;rod;X;Y;turn;R\n5;a;10,0;20;350;4\n5;b;18;20;0;4\n7;a;11;22;5;4\n7;b;18;21,5;1;4\n"
SPOTS = """LABEL,ID,TRACK_ID,POSITION_X,POSITION_Y,POSITION_T,FRAME,RADIUS
Label,Spot ID,Track ID,X,Y,T,Frame,R
Label,Spot ID,Track ID,X,Y,T,Frame,R
,,,(micron),(micron),(sec),,(micron)
ID11,11,0,2000,9000,0,0,1000
ID12,12,1,4000,9000,0,0,1000
ID13,13,0,2000,9000,5,1,1000
ID14,14,1,4000,8600,5,1,1000
"""
TRACKS = """<?xml version="1.0" encoding="UTF-8"?>
<Tracks nTracks="2" spaceUnits="pixel" frameInterval="1.0" timeUnits="sec" from="TrackMate v7.11.1">
  <particle nSpots="2"><detection t="0" x="10.0" y="45.0" z="0.0" /><detection t="1" x="10.0" y="45.0" /></particle>
  <particle nSpots="2"><detection t="0" x="20.0" y="45.0" z="0.0" /><detection t="1" x="20.0" y="43.0" /></particle>
</Tracks>
"""
RODS = """x1_gp3,y1_gp3,x2_gp3,y2_gp3,frame,seen_gp3,color,particle
8,50,12,50,512,1,red,0
20,52,20,48,512,1,red,1
8,50,12,50,513,1,red,0
20,50,20,46,513,1,red,1
"""
DUMP = "".join(
    f"ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF ATOMS\n2\nITEM: BOX BOUNDS {box}\n0 6\n0 4\n-0.5 0.5\n"
    f"ITEM: ATOMS id type x y z radius omegaz fx\n1 1 1 1 0 1 0 7\n2 1 3 {y} 0 1 0.1 7\n"
    for step, y, box in ((0, 1.0, "ff ff pp"), (100, 1.4, "ff ff pp"))
)
YADE = "#format x_y_z_r_matId\n# a test\n1\t1\t0\t1\t0\n3\t1.4\t0\t1\t0\n"
VTK = (
    "# vtk DataFile Version 3.0.\ncomment\nASCII\n\nDATASET POLYDATA\nPOINTS 2 double\n3 1 0\n1 1 0\n\nPOINT_DATA 2\n"
    "SCALARS radius double 1\nLOOKUP_TABLE default\n1\n1\n\nSCALARS id int 1\nLOOKUP_TABLE default\n8\n4\n"
)
PEGS = {
    "one_ParticleData.dlm": "1,100,300,30,7.5\n2,160.5,300,30,0\n3,130,248,29,0\n",
    "one_NormWeightedAdjacencyMatrix.dlm": "0,0.5,0\n0.3,0,0.2\n0,0,0\n",
    "one_TanWeightedAdjacencyMatrix.dlm": "0,0.05,0\n0.03,0,0.02\n0,0,0\n",
    "one_bonds.txt": "1.0e+00 0.0e+00 0 3.0e-02 3.0e-01\n2 1 0 0 0.1\n",
}
COLUMNS = "frame=t,id=rod,x=X,y=Y,theta=turn,radius=R"

# Format, files, and options of the command, which reads a single file or the folder.
FORMS: tuple[tuple[str, dict[str, str], tuple[str, ...]], ...] = (
    ("table", {"spots.csv": TABLE}, ("--columns", COLUMNS, "--pixel-size", "1e-3", "--y-down", "--walls", "box")),
    ("trackpy", {"linked.csv": TRACKPY}, ("--pixel-size", "1e-3", "--radius", "5")),
    ("trackmate", {"spots.csv": SPOTS}, ()),
    ("trackmate", {"tracks.xml": TRACKS}, ("--pixel-size", "1e-3", "--radius", "5", "--walls", "outer")),
    ("rodtracker", {"rods.csv": RODS}, ("--pixel-size", "1e-3", "--radius", "5")),
    ("lammps", {"dump.all": DUMP}, ("--interval", "0.01", "--pixel-size", "1e-2")),
    ("yade", {"s0.txt": YADE, "s1.txt": YADE.replace("1.4", "1.5")}, ("--pixel-size", "1e-2")),
    ("yade", {"a-spheres-00000000.vtk": VTK, "a-spheres-00000001.vtk": VTK}, ("--pixel-size", "1e-2")),
    ("pegs", PEGS, ("--pixel-size", "1e-4")),
)


def write_forms(folder: Path) -> None:
    for number, (_, named, _) in enumerate(FORMS):
        (folder / str(number)).mkdir(parents=True)
        for name, text in named.items():
            (folder / str(number) / name).write_text(text)


def make_bounded(tracked: Path, folder: Path) -> dict[str, tuple[str, ...]]:
    """Write experiments with circles, measured loads, boundary grains and a cell; return the tables of each by name."""
    frames = range(3)
    poses = [line.split(",") for line in (tracked / "tracks.csv").read_text().splitlines()[1:]]
    grains = sorted({int(line[1]) for line in poses})
    text = (tracked / "experiment.toml").read_text()
    for name in ("round", "ringed", "periodic"):
        shutil.copytree(tracked, folder / name)
    arcs = "frame,wall,x,y,radius,side,theta\n" + "".join(f"{k},drum,0.1,0.1,5.0,in,{0.1 * k}\n" for k in frames)
    (folder / "round" / "arcs.csv").write_text(arcs)
    loads = "".join(f"{k},top,{100 + 10 * k}\n" for k in frames)
    (folder / "round" / "load.csv").write_text(f"frame,wall,force\n{loads}")
    plain = "\n".join(line for line in text.splitlines() if not line.startswith("pressure")) + "\n"
    plain = plain.replace("[walls]\n", '[walls]\narcs = "arcs.csv"\nload = "load.csv"\n')
    (folder / "round" / "experiment.toml").write_text(plain)
    (folder / "ringed" / "boundary.csv").write_text("id\n" + "".join(f"{each}\n" for each in grains[:5]))
    (folder / "ringed" / "experiment.toml").write_text(text + '\n[boundary]\ngrains = "boundary.csv"\n')
    _write_cell(folder / "periodic")
    return {"round": ("arcs.csv", "load.csv"), "ringed": ("boundary.csv",), "periodic": ("cell.csv", "tracks.csv")}


def _write_cell(folder: Path) -> None:
    match = [(0.01 + 0.02 * a, 0.01 + 0.02 * b) for a in range(5) for b in range(5)]
    rows = [f"{k},{i},{x + 1e-4 * k * y},{y},0\n" for k in range(3) for i, (x, y) in enumerate(match)]
    (folder / "tracks.csv").write_text("frame,id,x,y,theta\n" + "".join(rows))
    (folder / "grains.csv").write_text("id,radius\n" + "".join(f"{i},0.01\n" for i in range(len(match))))
    cell = "".join(f"{k},0.1,0,{1e-5 * k},0.1\n" for k in range(3))
    (folder / "cell.csv").write_text(f"frame,ax,ay,bx,by\n{cell}")
    (folder / "experiment.toml").write_text(
        'name = "cell"\n[tracks]\npositions = "tracks.csv"\ngrains = "grains.csv"\ntimes = "times.csv"\n'
        '[boundary]\nperiodic = "cell.csv"\n'
    )
