"""Commands that make experiments: synth, import."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro
from rich.console import Console

from ..errors import InputError
from .arguments import Quiet
from .terminal import progress_of, tell

if TYPE_CHECKING:
    from ..exchange.dic_files import DicSequence
    from ..experiment.units import Scale


def synth(
    out: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="OUT", help="folder to make")],
    /,
    preset: Literal["small", "paper"] = "small",
    seed: int = 0,
    photographs: Annotated[bool, tyro.conf.arg(help="render photographs; otherwise write tracks")] = True,
    noise: Annotated[float, tyro.conf.arg(help="of a tracked position [m], with --no-photographs")] = 0.0,
    depth: Annotated[Literal[8, 16], tyro.conf.arg(help="bits of a photograph")] = 8,
    jpeg_quality: Annotated[int | None, tyro.conf.arg(help="of 8-bit photographs; default: the preset's")] = None,
    png: Annotated[bool, tyro.conf.FlagCreatePairsOff, tyro.conf.arg(help="write PNG, not JPEG")] = False,
    grains: Annotated[int | None, tyro.conf.arg(help="number of rods")] = None,
    frame_count: Annotated[int | None, tyro.conf.arg(name="frames", help="number of photographs")] = None,
    step_degrees: Annotated[float | None, tyro.conf.arg(help="shear between photographs")] = None,
    pixel_size: Annotated[float | None, tyro.conf.arg(help="[m]")] = None,
    reversal: Annotated[bool, tyro.conf.FlagCreatePairsOff, tyro.conf.arg(help="turn back half way")] = False,
    quiet: Quiet = False,
) -> int:
    """Make a synthetic experiment with its truth: explicit DEM, walls, speckle photographs.

    Example: rodsight synth my_test --preset small --seed 3
    """
    from ..synthetic.synthesis import synthesize

    with progress_of(quiet) as progress:
        made = synthesize(
            out, progress=progress, preset=preset, seed=seed, photographs=photographs, noise=noise, depth=depth,
            jpeg_quality=jpeg_quality, png=png, grains=grains, frames=frame_count, step_degrees=step_degrees,
            pixel_size=pixel_size, reversal=reversal,
        )  # fmt: skip
    if not quiet:
        told = f"{len(made.truth.radius)} rods, {made.truth.frame_count} frames"
        Console().print(f"{out}: {told}. Next: rodsight run {out}", highlight=False)
    return 0


def import_(
    form: Annotated[Literal["dic"], tyro.conf.Positional],
    source: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER", help="of dic_out_N.txt or CONFNNNN")],
    out: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="EXPERIMENT", help="folder to make")],
    /,
    pixel_size: Annotated[float, tyro.conf.arg(help="[m]")],
    interval: Annotated[float, tyro.conf.arg(help="[s] between photographs")] = 1.0,
    height: Annotated[int | None, tyro.conf.arg(help="of a photograph [px]; default: what holds all grains")] = None,
    precision: Annotated[float, tyro.conf.arg(help="of a tracked position [px]")] = 0.05,
    quiet: Quiet = False,
) -> int:
    """Make an experiment of another tracker's files.

    Example: rodsight import dic tracked/ my_test --pixel-size 1.2e-4
    """
    import numpy as np

    from ..exchange.dic_files import read_sequence
    from ..experiment.experiment import CONFIG_NAME
    from ..experiment.units import Scale

    for name, value in (("--pixel-size", pixel_size), ("--interval", interval), ("--precision", precision)):
        if not (math.isfinite(value) and value > 0.0):
            raise InputError(name, str(value), "is not positive")
    if (out / CONFIG_NAME).exists():
        raise InputError(out / CONFIG_NAME, "", "is there already: choose another folder")
    sequence = read_sequence(source)
    rows = int(np.ceil(np.nanmax(sequence.y + sequence.radius))) + 1 if height is None else height
    if rows < 1:
        raise InputError("--height", str(rows), "is not positive")
    scale = Scale(pixel_size, rows)
    out.mkdir(parents=True, exist_ok=True)
    seen = _write_tracks(sequence, scale, interval, out)
    text = f"""# From {len(sequence.number)} files of {source.name}; ids are the rows of the grains in them, from 0.
# Add [walls] with the table frame,wall,x1,y1,x2,y2 [m] to solve for forces. The origin is the centre of the bottom
# left pixel of a photograph of {rows} rows; x to the right, y up.
name = {json.dumps(_name(out))}

[tracks]
positions = "tracks.csv"
grains = "grains.csv"
times = "times.csv"
precision = {precision * pixel_size!r}
"""
    (out / CONFIG_NAME).write_text(text, encoding="utf-8")
    lost = sequence.x.size - seen
    tell(
        Console(quiet=quiet),
        f"{out}: {len(sequence.row)} grains in {len(sequence.number)} frames, {lost} poses lost. Next: add [walls] to "
        f"{out / CONFIG_NAME}, then rodsight run {out}",
    )
    return 0


def _write_tracks(sequence: DicSequence, scale: Scale, interval: float, out: Path) -> int:
    """Write the three tables; returns the poses written."""
    import numpy as np

    from ..experiment.tables import write_table

    place = scale.to_world(np.stack([sequence.x, sequence.y], axis=-1))
    frame, grain = np.nonzero(np.isfinite(sequence.x) & np.isfinite(sequence.rotation))
    write_table(
        out / "tracks.csv",
        {
            "frame": frame.tolist(),
            "id": sequence.row[grain].tolist(),
            "x": place[frame, grain, 0].tolist(),
            "y": place[frame, grain, 1].tolist(),
            "theta": sequence.rotation[frame, grain].tolist(),  # counter-clockwise as seen, like ours
        },
    )
    radius = (sequence.radius * scale.pixel_size).tolist()
    write_table(out / "grains.csv", {"id": sequence.row.tolist(), "radius": radius})
    time = [(number - sequence.number[0]) * interval for number in sequence.number]
    write_table(out / "times.csv", {"frame": list(range(len(time))), "time": time})
    return len(frame)


def _name(out: Path) -> str:
    name = "".join(c if c.isalnum() or c in "_ .+-" else "-" for c in out.resolve().name)
    return name if name[:1].isalnum() else f"imported{name}"
