"""Commands that set up an experiment: open, on a page; init, from flags."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, UseAppendAction, arg

from ...process.errors import InputError
from ..arguments import Browser, Port, Quiet, parse_frames


def open_(
    folder: Annotated[
        Path, Positional, arg(metavar="FOLDER", help="of photographs, of an experiment or of several")
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
    folder: Annotated[Path, Positional, arg(metavar="FOLDER", help="of the experiment, with the photographs")],
    /,
    photographs: Annotated[str, arg(metavar="PATTERN", help="of the photographs, or a video, relative to FOLDER")],
    pixel_size: Annotated[float | None, arg(metavar="METRES", help="side of a pixel [m]")] = None,
    interval: Annotated[float | None, arg(metavar="SECONDS", help="between photographs [s]")] = None,
    radii: Annotated[str | None, arg(metavar="R,R,…", help="known radius classes [m]")] = None,
    walls: Annotated[
        str, arg(metavar="auto|none|FILE", help="found around the rods, none, or a table of their ends [m]")
    ] = "auto",
    pressure: Annotated[
        tuple[str, ...], UseAppendAction, arg(metavar="WALL=PASCAL", help="pressure on a wall [Pa]; repeatable")
    ] = (),
    density: Annotated[float | None, arg(metavar="KG/M3", help="of the rods [kg/m³]")] = None,
    length: Annotated[float | None, arg(metavar="METRES", help="of the rods [m]")] = None,
    friction: Annotated[
        str | None,
        arg(metavar="MU|measured", help="coefficient of friction between rods; measured: found from the motion"),
    ] = None,
    channel: Annotated[
        Literal["grey", "red", "green", "blue"] | None,
        arg(help="of the photographs; default: the one in which the rods stand out best, by trial"),
    ] = None,
    region: Annotated[
        str | None, arg(metavar="X0,Y0,X1,Y1", help="columns and rows [px] outside of which nothing is seen")
    ] = None,
    follow: Annotated[
        Literal["texture", "outline"] | None,
        arg(help="by the texture of the rods, or by their outline where they are plain; default: by trying both"),
    ] = None,
    radius_range: Annotated[
        str | None, arg(metavar="A:B", help="of the radii to look for [px], where --radii are unknown")
    ] = None,
    frames: Annotated[
        str | None,
        arg(metavar="A:B[:STEP]", help="of a video, by their numbers from 0; --interval chooses them by time as well"),
    ] = None,
    lens: Annotated[Path | None, arg(metavar="FILE", help="calibration of OpenCV: .yml, .xml, .json or .npz")] = None,
    grains: Annotated[
        Path | None,
        arg(
            metavar="FILE",
            help="the rods of the first photograph as another program has found them: a label image (StarDist, "
            "Cellpose, napari), a table of ImageJ, or a table id,x,y,radius [px]",
        ),
    ] = None,
    name: Annotated[str | None, arg(help="of the experiment; default: of the folder")] = None,
    quiet: Quiet = False,
) -> int:
    """Set up an experiment from flags: experiment.toml, walls, rods, and understood.png, a picture of them.

    Example: rodsight init my_test --photographs '../sample_data/shear/photos/*.jpg' --pixel-size 2.5e-4 --interval 52
    --radii 0.007,0.008,0.011 --pressure top=50e3 --friction 0.25
    """
    from ...workbench import command
    from ...workbench.setup.initialise import SetupFlags

    flags = SetupFlags(
        photographs, name, pixel_size, interval, _parse_radii(radii), walls, _parse_pressures(pressure),
        {"density": density, "length": length, "friction": _number_or_word(friction)},
        channel, _parse_region(region), follow, _parse_radius_range(radius_range),
        parse_frames(frames), lens, grains,
    )  # fmt: skip
    return command.initialise_experiment(folder, flags, quiet=quiet)


def _number_or_word(text: str | None) -> float | str | None:
    try:
        return None if text is None else float(text)
    except ValueError:
        return text  # validated with the experiment


def _parse_pressures(texts: Sequence[str]) -> dict[str, float]:
    """Parse pressures [Pa] of walls from WALL=PASCAL; raise InputError for other text."""
    found: dict[str, float] = {}
    for text in texts:
        wall, equals, value = text.partition("=")
        try:
            if not equals or not wall.strip():
                raise ValueError
            found[wall.strip()] = float(value)
        except ValueError:
            from ...experiment.config.corrections import read_quantity

            pressure = read_quantity(value, "Pa")
            hint = f": write {wall}={pressure!r}" if wall and pressure is not None else ", such as top=50e3"
            raise InputError("--pressure", text, f"is not WALL=PASCAL{hint}") from None
    return found


def _parse_region(text: str | None) -> tuple[int, ...]:
    """Parse a region from four whole numbers between commas; raise InputError for other text."""
    try:
        region = tuple(int(each) for each in text.split(",")) if text is not None else ()
        if len(region) not in (0, 4):
            raise ValueError
    except ValueError:
        raise InputError("--region", str(text), "is not X0,Y0,X1,Y1 in pixels, such as 100,50,3900,2700") from None
    return region


def _parse_radius_range(text: str | None) -> tuple[float, float] | None:
    """Parse a range of radii [px] A:B; raise InputError for other text."""
    if text is None:
        return None
    try:
        least, most = (float(each) for each in text.split(":"))
        if not 3.0 < least < most < 1e5:
            raise ValueError
    except ValueError:
        raise InputError("--radius-range", text, "is not A:B in pixels, with 3 < A < B, such as 40:60") from None
    return least, most


def _parse_radii(text: str | None) -> tuple[float, ...]:
    """Parse radii [m] from numbers between commas; raise InputError for other text."""
    try:
        radii = tuple(float(each) for each in (text or "").split(",") if each.strip())
    except ValueError:
        radii = (-1.0,)
    if any(not 0.0 < radius < 1e3 for radius in radii):
        raise InputError("--radii", str(text), "must be lengths in metres between commas, such as 0.007,0.008,0.011")
    return radii
