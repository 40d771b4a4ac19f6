"""Commands that set an experiment up: open, on a page; init, from flags."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro

from ..arguments import Quiet


def open_(
    folder: Annotated[
        Path,
        tyro.conf.Positional,
        tyro.conf.arg(metavar="FOLDER", help="of photographs, of an experiment or of several"),
    ] = Path(),
    /,
    port: Annotated[int, tyro.conf.arg(help="of the page on 127.0.0.1; 0 takes a free one")] = 0,
    browser: Annotated[bool, tyro.conf.arg(help="open the page")] = True,
) -> int:
    """Open the workbench: a local page to set up, mend, run, inspect and review experiments of a folder.

    Example: rodsight open sample_data
    """
    from ...workbench import command

    return command.open_workbench(folder, port=port, browser=browser)


def init(
    folder: Annotated[
        Path, tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER", help="of the experiment, where the photographs are")
    ],
    /,
    photographs: Annotated[str, tyro.conf.arg(metavar="PATTERN", help="of the photographs, relative to FOLDER")],
    pixel_size: Annotated[float | None, tyro.conf.arg(metavar="METRES", help="side of a pixel [m]")] = None,
    interval: Annotated[float | None, tyro.conf.arg(metavar="SECONDS", help="between photographs [s]")] = None,
    radii: Annotated[str | None, tyro.conf.arg(metavar="R,R,…", help="known radius classes [m]")] = None,
    walls: Annotated[
        str, tyro.conf.arg(metavar="auto|none|FILE", help="found around the rods, none, or a table of their ends [m]")
    ] = "auto",
    pressure: Annotated[
        tuple[str, ...],
        tyro.conf.UseAppendAction,
        tyro.conf.arg(metavar="WALL=PASCAL", help="that loads a wall [Pa]; repeatable"),
    ] = (),
    density: Annotated[float | None, tyro.conf.arg(metavar="KG/M3", help="of the rods [kg/m³]")] = None,
    length: Annotated[float | None, tyro.conf.arg(metavar="METRES", help="of the rods [m]")] = None,
    friction: Annotated[
        str | None,
        tyro.conf.arg(
            metavar="MU|measured", help="coefficient of friction between rods; measured: found from the motion"
        ),
    ] = None,
    name: Annotated[str | None, tyro.conf.arg(help="of the experiment; default: of the folder")] = None,
    quiet: Quiet = False,
) -> int:
    """Set an experiment up from flags: experiment.toml, walls, rods, and understood.png, a picture to check them by.

    Example: rodsight init my_test --photographs '../sample_data/shear/photos/*.jpg' --pixel-size 2.5e-4 --interval 52
    --radii 0.007,0.008,0.011 --pressure top=50e3 --friction 0.25
    """
    from ...workbench import command
    from ...workbench.setup.initialise import Told, parse_pressures, parse_radii

    told = Told(
        photographs, name, pixel_size, interval, parse_radii(radii), walls, parse_pressures(pressure),
        {"density": density, "length": length, "friction": _number_or_word(friction)},
    )  # fmt: skip
    return command.initialise_experiment(folder, told, quiet=quiet)


def _number_or_word(text: str | None) -> float | str | None:
    try:
        return None if text is None else float(text)
    except ValueError:
        return text  # refused, where it is no word that means something, by the experiment's own check
