"""The command that converts tracks, simulations and photoelastic forces of other programs: import."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from rich.console import Console
from tyro.conf import Positional, arg

from ...exchange.foreign.format_names import FileFormat
from ...process.counts import state_count
from ...process.errors import InputError
from ..arguments import Flag, Quiet
from ..terminal import print_line

if TYPE_CHECKING:
    from ...exchange.foreign.experiment_folder import FolderContents
    from ...exchange.foreign.observations import ImportedTracks


def import_(
    form: Annotated[
        FileFormat,
        Positional,
        arg(
            help="table: of any tracker, by --columns; trackpy, trackmate, rodtracker: trackers; lammps (and "
            "LIGGGHTS), yade, mercury: simulations; pegs: photoelastic discs with their forces; dic: dic_out_N.txt "
            "or CONFNNNN"
        ),
    ],
    source: Annotated[Path, Positional, arg(metavar="FILE", help="to read, or a folder, depending on the form")],
    out: Annotated[Path, Positional, arg(metavar="FOLDER", help="of the new experiment")],
    /,
    columns: Annotated[
        str | None,
        arg(
            metavar="frame=…,id=…,x=…,y=…[,theta=…,radius=…]",
            help="names of the columns, or their numbers from 1; also diameter=…, time=…; overrides those of the form",
        ),
    ] = None,
    pixel_size: Annotated[float | None, arg(help="the file's unit of length [m]; default: metres")] = None,
    y_down: Annotated[Flag, arg(help="y points down, as in pictures")] = False,
    height: Annotated[
        float | None, arg(help="of a photograph [px]; y is measured up from its last row; default: from the highest y")
    ] = None,
    degrees: Annotated[Flag, arg(help="theta is in degrees")] = False,
    radius: Annotated[float | None, arg(help="of all grains without one, in the file's unit")] = None,
    interval: Annotated[float, arg(help="between photographs, or of a step [s]")] = 1.0,
    precision: Annotated[float | None, arg(help="of a position, in the file's unit")] = None,
    walls: Annotated[
        str | None,
        arg(
            metavar="box|outer|none|FILE",
            help="box: four bars proposed at the outermost grains; outer: those grains are the boundary; "
            "FILE: frame,wall,x1,y1,x2,y2 in the file's unit",
        ),
    ] = None,
    corner_radius: Annotated[
        float | None,
        arg(
            help="dic: of the discs at the frame's corners, in the file's unit; default: the largest that overlaps no "
            "rod"
        ),
    ] = None,
    pressure: Annotated[tuple[str, ...], arg(metavar="WALL=PA", help="pressure on walls [Pa], such as top=50e3")] = (),
    load: Annotated[
        tuple[str, ...],
        arg(metavar="WALL=N", help="measured load on walls [N], such as top=1438; load.csv, to be edited"),
    ] = (),
    pairs: Annotated[
        Path | None,
        arg(
            metavar="FILE",
            help="pair forces of a simulation [N] as truth: dump local, .fstat, or a table frame,i,j,fx,fy; names by "
            "--columns",
        ),
    ] = None,
    quiet: Quiet = False,
) -> int:
    """Convert files of another program to an experiment: tracks, grains, times, walls, experiment.toml.

    Data that cannot be converted are named, also in experiment.toml.

    A tracker's table in pixels: rodsight import table spots.csv my_test --columns frame=t,id=rod,x=x,y=y,radius=r
    --pixel-size 1.2e-4 --y-down --walls box --pressure top=50e3

    Photoelastic discs: rodsight import pegs solved/ my_test --pixel-size 1e-4

    Example: rodsight import table sample_data/shear/truth_tracks.csv my_test --radius 0.008 --walls box
    --columns frame=frame,id=id,x=x,y=y,theta=theta
    """
    from ...exchange.foreign.import_files import ImportRequest, import_files
    from ...exchange.foreign.tracker_tables import parse_columns

    request = ImportRequest(
        form, source, parse_columns(columns), pixel_size, y_down, height, degrees, radius, interval, precision, walls,
        _by_wall("--pressure", pressure, "WALL=PA, such as top=50e3"), corner_radius,
        _by_wall("--load", load, "WALL=N, such as top=1438"), pairs,
    )  # fmt: skip
    imported, contents = import_files(request, out)
    _report(Console(quiet=quiet), out, imported, contents)
    return 0


def _by_wall(option: str, given: tuple[str, ...], form: str) -> dict[str, float]:
    found = {}
    for each in given:
        name, equals, text = each.partition("=")
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not (equals and name and math.isfinite(value)):
            raise InputError(option, each, f"is not {form}")
        if option == "--load" and value < 0.0:
            raise InputError(option, each, "is negative: a positive force presses the wall against the packing")
        found[name] = value
    return found


def _report(console: Console, out: Path, imported: ImportedTracks, contents: FolderContents) -> None:
    from ...exchange.foreign.experiment_folder import bar_names

    tracks = imported.tracks
    for remark in imported.remarks:
        print_line(console, remark)
    if contents.walls is not None:
        print_line(console, f"Walls {', '.join(contents.walls.name)}: {contents.walls.remark}")
    if contents.corners is not None:
        names = bar_names(contents.corners) if contents.walls is None else contents.walls.name
        found = f"The corners of the frame are discs where the bars {', '.join(names)} meet."
        print_line(console, f"{found} {contents.corners.remark}")
    elif contents.cell is not None:
        print_line(console, "The box has two periodic directions: [boundary] periodic, with its vectors in cell.csv.")
    elif contents.outer_grains:
        which = (
            f"By the file, {state_count(len(contents.edge), 'grain')} at the edge"
            if contents.edge
            else "The outermost grains"
        )
        print_line(console, f"{which} form the boundary ([boundary] grains), since no walls are given.")
    if contents.truth is not None:
        print_line(console, f"In truth_contacts.csv: {state_count(len(contents.truth['frame']), 'measured force')}.")
    given = (contents.walls, contents.corners, contents.cell)
    bounded = any(each is not None for each in given) or contents.outer_grains
    add = "" if bounded else f"add [walls] to {out / 'experiment.toml'}, then "
    print_line(
        console,
        f"{out}: {state_count(tracks.grain_count, 'grain')} in {state_count(tracks.frame_count, 'frame')}. "
        f"Next: {add}rodsight check {out}, then rodsight run {out}",
    )
