"""The command import: other programs' tracks, simulations and photoelastic forces made experiments."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro
from rich.console import Console

from ...errors import InputError
from ...exchange.foreign.form_names import Form
from ..arguments import Quiet
from ..terminal import tell

if TYPE_CHECKING:
    from ...exchange.foreign.experiment_folder import Surroundings
    from ...exchange.foreign.forms import Foreign
    from ...exchange.foreign.observations import Arranged, Convention


def import_(
    form: Annotated[
        Form,
        tyro.conf.Positional,
        tyro.conf.arg(
            help="table: any tracker's, by --columns; trackpy, trackmate, rodtracker: trackers; lammps (and LIGGGHTS), "
            "yade: simulations; pegs: photoelastic discs with their forces; dic: dic_out_N.txt or CONFNNNN"
        ),
    ],
    source: Annotated[
        Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE", help="to read, or the folder, as the form is")
    ],
    out: Annotated[
        Path, tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER", help="of the experiment, which is made")
    ],
    /,
    columns: Annotated[
        str | None,
        tyro.conf.arg(
            metavar="frame=…,id=…,x=…,y=…[,theta=…,radius=…]",
            help="names of the columns, or their numbers from 1; also diameter=…, time=…; laid over the form's own",
        ),
    ] = None,
    pixel_size: Annotated[float | None, tyro.conf.arg(help="the file's unit of length [m]; default: metres")] = None,
    y_down: Annotated[bool, tyro.conf.FlagCreatePairsOff, tyro.conf.arg(help="y counts down, as in pictures")] = False,
    height: Annotated[
        float | None, tyro.conf.arg(help="of a photograph [px], from whose last row y counts up; default: highest y")
    ] = None,
    degrees: Annotated[bool, tyro.conf.FlagCreatePairsOff, tyro.conf.arg(help="theta is in degrees")] = False,
    radius: Annotated[float | None, tyro.conf.arg(help="of all grains that have none, in the file's unit")] = None,
    interval: Annotated[float, tyro.conf.arg(help="between photographs, or of a step [s]")] = 1.0,
    precision: Annotated[float | None, tyro.conf.arg(help="of a position, in the file's unit")] = None,
    walls: Annotated[
        str | None,
        tyro.conf.arg(
            metavar="box|outer|none|FILE",
            help="box: four bars proposed at the outermost grains; outer: those grains are the boundary themselves; "
            "FILE: frame,wall,x1,y1,x2,y2 in the file's unit",
        ),
    ] = None,
    pressure: Annotated[
        tuple[str, ...], tyro.conf.arg(metavar="WALL=PA", help="what presses on walls [Pa], such as top=50e3")
    ] = (),
    quiet: Quiet = False,
) -> int:
    """Make an experiment of another program's files: tracks.csv, grains.csv, times.csv, walls.csv, experiment.toml.

    What could not be carried over is said, and written into experiment.toml.

    A tracker's table in pixels: rodsight import table spots.csv my_test --columns frame=t,id=rod,x=x,y=y,radius=r
    --pixel-size 1.2e-4 --y-down --walls box --pressure top=50e3

    Photoelastic discs: rodsight import pegs solved/ my_test --pixel-size 1e-4

    Example: rodsight import table sample_data/shear/truth_tracks.csv my_test --radius 0.008 --walls box
    --columns frame=frame,id=id,x=x,y=y,theta=theta
    """
    from ...exchange.foreign.columns import parse_columns
    from ...exchange.foreign.experiment_folder import refuse_existing, write_folder
    from ...exchange.foreign.forms import read_form
    from ...exchange.foreign.observations import Convention, arrange

    for name, value in (
        ("--pixel-size", pixel_size), ("--interval", interval), ("--precision", precision), ("--height", height),
        ("--radius", radius),
    ):  # fmt: skip
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise InputError(name, str(value), "is not positive")
    refuse_existing(out)
    foreign = read_form(
        form, source, parse_columns(columns), Convention(y_down=y_down, interval=interval, radius=radius),
        unit=pixel_size, degrees=degrees,
    )  # fmt: skip
    convention = replace(
        foreign.convention, y_down=foreign.convention.y_down or y_down, height=None if height is None else height - 1.0
    )
    arranged = arrange(foreign.seen, convention, foreign.precision_of(precision))
    around = _surround(form, foreign, arranged, convention, walls, _pressures(pressure))
    write_folder(out, arranged, around, f"From {source.name}, by rodsight import {form}.")
    _say(Console(quiet=quiet), out, arranged, around)
    return 0


def _surround(
    form: str,
    foreign: Foreign,
    arranged: Arranged,
    convention: Convention,
    walls: str | None,
    pressure: dict[str, float],
) -> Surroundings:
    from ...exchange.foreign.experiment_folder import Surroundings
    from ...exchange.foreign.pegs import true_contacts
    from ...exchange.foreign.proposed_walls import propose_box, read_foreign_walls

    cell = None
    if walls is None:
        walls = "outer" if form == "pegs" else "none"
        bars, cell = foreign.walls, foreign.cell
    elif walls == "box":
        bars = propose_box(arranged.tracks)
    else:
        bars = None if walls in ("none", "outer") else read_foreign_walls(Path(walls), arranged, convention)
    told = foreign.truth
    truth = None if told is None or not len(told.fn) else true_contacts(told, arranged)
    return Surroundings(bars, pressure, outer_grains=walls == "outer", cell=cell, known=foreign.known, truth=truth)


def _pressures(given: tuple[str, ...]) -> dict[str, float]:
    found = {}
    for each in given:
        name, equals, text = each.partition("=")
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not (equals and name and math.isfinite(value)):
            raise InputError("--pressure", each, "is not WALL=PA, such as top=50e3")
        found[name] = value
    return found


def _say(console: Console, out: Path, arranged: Arranged, around: Surroundings) -> None:
    tracks = arranged.tracks
    for remark in arranged.remarks:
        tell(console, remark)
    if around.walls is not None:
        tell(console, f"Walls {', '.join(around.walls.name)}: {around.walls.remark}")
    elif around.cell is not None:
        tell(console, "The box is periodic both ways: [boundary] periodic, with its vectors in cell.csv.")
    elif around.outer_grains:
        tell(console, "The outermost grains are the boundary ([boundary] grains), for nothing is told of walls.")
    if around.truth is not None:
        tell(console, f"{len(around.truth['frame'])} forces are the truth: truth_contacts.csv.")  # type: ignore[arg-type]
    bounded = around.walls is not None or around.cell is not None or around.outer_grains
    add = "" if bounded else f"add [walls] to {out / 'experiment.toml'}, then "
    tell(
        console,
        f"{out}: {tracks.grain_count} grains in {tracks.frame_count} frames. Next: {add}rodsight check {out}, then "
        f"rodsight run {out}",
    )
