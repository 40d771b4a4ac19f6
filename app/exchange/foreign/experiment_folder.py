"""An experiment folder of what another program saw: tables, and an experiment.toml that says where they came from."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from solver.bodies.grains import Array

from ...errors import InputError
from ...experiment.experiment import CELL_COLUMNS, CONFIG_NAME
from ...experiment.reading.tables import write_table
from .observations import Arranged
from .proposed_walls import Walls


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What the packing is kept by, and what is known beside its tracks."""

    walls: Walls | None = None
    pressure: Mapping[str, float] = field(default_factory=dict)  # [Pa] of walls by their names
    outer_grains: bool = False  # the outermost grains are the boundary
    cell: Array | None = None  # (f, 2, 2) [m], vectors of a periodic cell, instead of either
    known: Mapping[str, str] = field(default_factory=dict)  # lines of sections by their names
    truth: Mapping[str, Sequence[object]] | None = None  # columns of truth_contacts.csv


def refuse_existing(folder: Path) -> None:
    """Raise InputError where an experiment is already."""
    if (folder / CONFIG_NAME).exists():
        raise InputError(folder / CONFIG_NAME, "", "is there already: choose another folder")


def write_folder(folder: Path, arranged: Arranged, around: Surroundings, source: str) -> None:
    """Write the folder, experiment.toml last; source: what it was made from, in words. Raises InputError."""
    refuse_existing(folder)
    names = () if around.walls is None else around.walls.name
    for wall in around.pressure:
        if wall not in names:
            there = f"there are {', '.join(names)}" if names else "there are no walls: give --walls"
            raise InputError("--pressure", wall, f"is no wall ({there})")
    folder.mkdir(parents=True, exist_ok=True)
    tracks = arranged.tracks
    frame, grain = np.nonzero(tracks.present)
    poses: dict[str, Iterable[object]] = {
        "frame": frame.tolist(),
        "id": tracks.id[grain].tolist(),
        "x": tracks.position[frame, grain, 0].tolist(),
        "y": tracks.position[frame, grain, 1].tolist(),
    }
    angle = tracks.rotation[frame, grain]
    if np.isfinite(angle).any():
        poses["theta"] = ["" if np.isnan(value) else value for value in angle.tolist()]
    write_table(folder / "tracks.csv", poses)
    write_table(folder / "grains.csv", {"id": tracks.id.tolist(), "radius": tracks.radius.tolist()})
    number = arranged.number.tolist()
    write_table(folder / "times.csv", {"frame": range(len(number)), "time": tracks.time.tolist(), "number": number})
    if arranged.renamed:
        write_table(folder / "ids.csv", {"id": tracks.id.tolist(), "name": arranged.name})
    if around.walls is not None:
        _write_walls(folder / "walls.csv", around.walls)
    if around.cell is not None:
        vectors = around.cell.reshape(-1, 4).T.tolist()
        write_table(folder / "cell.csv", dict(zip(CELL_COLUMNS, (range(len(around.cell)), *vectors), strict=True)))
    if around.truth is not None:
        write_table(folder / "truth_contacts.csv", around.truth)
    (folder / CONFIG_NAME).write_text(_describe(folder, arranged, around, source), encoding="utf-8")


def _write_walls(file: Path, walls: Walls) -> None:
    f, w = walls.endpoints.shape[:2]
    ends = walls.endpoints.reshape(f * w, 4)
    write_table(
        file,
        {
            "frame": np.repeat(np.arange(f), w).tolist(),
            "wall": walls.name * f,
            **{name: ends[:, k].tolist() for k, name in enumerate(("x1", "y1", "x2", "y2"))},
        },
    )


def _describe(folder: Path, arranged: Arranged, around: Surroundings, source: str) -> str:
    sigma = arranged.tracks.sigma
    lines = [f"# {source}", *(f"# {remark}" for remark in arranged.remarks)]
    lines.append(f"name = {json.dumps(_name(folder), ensure_ascii=False)}")
    if around.truth is not None:
        lines.append('truth = "truth_contacts.csv"')
    lines += [
        "", "[tracks]", 'positions = "tracks.csv"', 'grains = "grains.csv"', 'times = "times.csv"',
        f"precision = {float(np.nanmax(sigma)):.6g}",
    ]  # fmt: skip
    if around.walls is not None:
        lines += ["", f"# {around.walls.remark}", "[walls]", 'file = "walls.csv"']
        for wall, pressure in around.pressure.items():
            lines += [f"[walls.{json.dumps(wall, ensure_ascii=False)}]", f"pressure = {pressure!r}"]
    elif around.cell is not None:
        lines += ["", "# The simulation's box is periodic both ways.", "[boundary]", 'periodic = "cell.csv"']
    elif around.outer_grains:
        lines += [
            "",
            "# Nothing is told of walls: the outermost grains are the boundary.",
            "[boundary]",
            'grains = "outer"',
        ]
    else:
        lines += ["", "# Add [walls] with the table frame,wall,x1,y1,x2,y2 [m] to solve for forces."]
    for section, text in around.known.items():
        lines += ["", f"[{section}]", text]
    if "material" not in around.known:
        lines += ["", "# [material] density, length, friction, gravity: what is not told here has its default."]
    return "\n".join(lines) + "\n"


def _name(folder: Path) -> str:
    name = "".join(c if c.isalnum() or c in "_ .+-" else "-" for c in folder.resolve().name)
    return name if name[:1].isalnum() else f"imported{name}"
