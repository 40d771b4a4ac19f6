"""What `rodsight import` does: another tool's files become an experiment."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from rich.console import Console

from ..errors import InputError
from ..exchange.dic_files import DicSequence, read_sequence
from ..experiment.experiment import CONFIG_NAME
from ..experiment.tables import write_table
from ..experiment.units import Scale


def import_dic(
    source: Path,
    out: Path,
    *,
    pixel_size: float,
    interval: float,
    height: int | None,
    precision: float,
    console: Console,
) -> int:
    """Make an experiment with tracks of a folder of dic_out or CONF files. Exit status 0.

    pixel_size [m], interval [s] between photographs, height [px] of a photograph (default: what holds all grains),
    precision [px] of a tracked position. Raises InputError, also where the folder to be made has an experiment.
    """
    for name, value in (("--pixel-size", pixel_size), ("--interval", interval), ("--precision", precision)):
        if not (np.isfinite(value) and value > 0.0):
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
    console.print(
        f"{out}: {len(sequence.row)} grains in {len(sequence.number)} frames, {lost} poses lost. Next: add [walls] to "
        f"{out / CONFIG_NAME}, then rodsight run {out}",
        markup=False, highlight=False, soft_wrap=True,
    )  # fmt: skip
    return 0


def _write_tracks(sequence: DicSequence, scale: Scale, interval: float, out: Path) -> int:
    """Write the three tables; returns the poses written."""
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
