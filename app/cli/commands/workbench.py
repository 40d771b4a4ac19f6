"""Commands that set up an experiment: open, on a page; init, from flags."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import tyro

from ..arguments import Browser, Port, Quiet, parse_frames


def open_(
    folder: Annotated[
        Path,
        tyro.conf.Positional,
        tyro.conf.arg(metavar="FOLDER", help="of photographs, of an experiment or of several"),
    ] = Path(),
    /,
    port: Port = 0,
    browser: Browser = True,
) -> int:
    """Open the workbench: a local page to set up, correct, run, inspect and review experiments of a folder.

    Example: rodsight open sample_data
    """
    from ...workbench import command

    return command.open_workbench(folder, port=port, browser=browser)


def init(
    folder: Annotated[
        Path, tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER", help="of the experiment, with the photographs")
    ],
    /,
    photographs: Annotated[
        str, tyro.conf.arg(metavar="PATTERN", help="of the photographs, or a video, relative to FOLDER")
    ],
    pixel_size: Annotated[float | None, tyro.conf.arg(metavar="METRES", help="side of a pixel [m]")] = None,
    interval: Annotated[float | None, tyro.conf.arg(metavar="SECONDS", help="between photographs [s]")] = None,
    radii: Annotated[str | None, tyro.conf.arg(metavar="R,R,…", help="known radius classes [m]")] = None,
    walls: Annotated[
        str, tyro.conf.arg(metavar="auto|none|FILE", help="found around the rods, none, or a table of their ends [m]")
    ] = "auto",
    pressure: Annotated[
        tuple[str, ...],
        tyro.conf.UseAppendAction,
        tyro.conf.arg(metavar="WALL=PASCAL", help="pressure on a wall [Pa]; repeatable"),
    ] = (),
    density: Annotated[float | None, tyro.conf.arg(metavar="KG/M3", help="of the rods [kg/m³]")] = None,
    length: Annotated[float | None, tyro.conf.arg(metavar="METRES", help="of the rods [m]")] = None,
    friction: Annotated[
        str | None,
        tyro.conf.arg(
            metavar="MU|measured", help="coefficient of friction between rods; measured: found from the motion"
        ),
    ] = None,
    channel: Annotated[
        Literal["grey", "red", "green", "blue"] | None,
        tyro.conf.arg(help="of the photographs in which rods stand out best; default grey"),
    ] = None,
    region: Annotated[
        str | None, tyro.conf.arg(metavar="X0,Y0,X1,Y1", help="columns and rows [px] outside of which nothing is seen")
    ] = None,
    follow: Annotated[
        Literal["texture", "outline"] | None,
        tyro.conf.arg(help="by the texture of the rods, or by their outline where they are plain; default texture"),
    ] = None,
    radius_range: Annotated[
        str | None, tyro.conf.arg(metavar="A:B", help="of the radii to look for [px], where --radii are unknown")
    ] = None,
    frames: Annotated[
        str | None,
        tyro.conf.arg(
            metavar="A:B[:STEP]", help="of a video, by their numbers from 0; --interval chooses them by time as well"
        ),
    ] = None,
    lens: Annotated[
        Path | None, tyro.conf.arg(metavar="FILE", help="calibration of OpenCV: .yml, .xml, .json or .npz")
    ] = None,
    grains: Annotated[
        Path | None,
        tyro.conf.arg(
            metavar="FILE",
            help="the rods of the first photograph as another program has found them: a label image (StarDist, "
            "Cellpose, napari), a table of ImageJ, or a table id,x,y,radius [px]",
        ),
    ] = None,
    name: Annotated[str | None, tyro.conf.arg(help="of the experiment; default: of the folder")] = None,
    quiet: Quiet = False,
) -> int:
    """Set up an experiment from flags: experiment.toml, walls, rods, and understood.png, a picture of them.

    Example: rodsight init my_test --photographs '../sample_data/shear/photos/*.jpg' --pixel-size 2.5e-4 --interval 52
    --radii 0.007,0.008,0.011 --pressure top=50e3 --friction 0.25
    """
    from ...workbench import command
    from ...workbench.setup.initialise import (
        SetupFlags,
        parse_pressures,
        parse_radii,
        parse_radius_range,
        parse_region,
    )

    flags = SetupFlags(
        photographs, name, pixel_size, interval, parse_radii(radii), walls, parse_pressures(pressure),
        {"density": density, "length": length, "friction": _number_or_word(friction)},
        channel, parse_region(region), follow, parse_radius_range(radius_range),
        parse_frames(frames), lens, grains,
    )  # fmt: skip
    return command.initialise_experiment(folder, flags, quiet=quiet)


def _number_or_word(text: str | None) -> float | str | None:
    try:
        return None if text is None else float(text)
    except ValueError:
        return text  # validated with the experiment
