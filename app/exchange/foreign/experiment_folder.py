"""Writer of an experiment folder from imported data: tables, and an experiment.toml that names their source."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ...experiment.config.experiment_file import find_config_errors, load_config
from ...experiment.experiment import CELL_COLUMNS, CONFIG_NAME
from ...experiment.reading.corners import FrameCorners, bars_of_corners
from ...experiment.reading.tables import write_table
from ...process.atomic import replacing_folder
from ...process.errors import InputError, naming
from ...solver.bodies.grains import Array
from .imported_corners import CornerDiscs
from .observations import ImportedTracks
from .proposed_walls import Walls


@dataclass(frozen=True, slots=True)
class FolderContents:
    """Inputs of an experiment besides its tracks: boundaries, loads, other settings and true forces."""

    walls: Walls | None = None
    corners: CornerDiscs | None = None  # of the frame; without walls, bars run through their centres
    pressure: Mapping[str, float] = field(default_factory=dict)  # [Pa] of walls by their names
    load: Mapping[str, float] = field(default_factory=dict)  # [N] on walls, the same in all photographs
    outer_grains: bool = False  # the outermost grains are the boundary
    edge: tuple[str, ...] = ()  # names of these grains, where the other program gives them; empty: they are found
    cell: Array | None = None  # (f, 2, 2) [m], vectors of a periodic cell, instead of either
    known: Mapping[str, str] = field(default_factory=dict)  # lines of sections by their names
    truth: Mapping[str, Sequence[object]] | None = None  # columns of truth_contacts.csv


def refuse_existing(folder: Path) -> None:
    """Raise InputError if the folder contains an experiment."""
    if (folder / CONFIG_NAME).exists():
        raise InputError(folder / CONFIG_NAME, "", "already exists: choose another folder")


def write_folder(folder: Path, imported: ImportedTracks, contents: FolderContents, source: str) -> None:
    """Write the folder, experiment.toml last; source: a sentence on its origin. Raises InputError."""
    refuse_existing(folder)
    names = () if contents.walls is None else contents.walls.name
    if contents.walls is None and contents.corners is not None:
        names = bar_names(contents.corners)
    for option, given in (("--pressure", contents.pressure), ("--load", contents.load)):
        for wall in given:
            if wall not in names:
                existing = f"the walls are {', '.join(names)}" if names else "there are no walls: give --walls"
                raise InputError(option, wall, f"is not a wall ({existing})")
    for wall in contents.load.keys() & contents.pressure.keys():
        raise InputError("--load", wall, "has a pressure, too: give one of them")
    if contents.load and not contents.pressure and not any(contents.load.values()):
        raise InputError("--load", ", ".join(contents.load), "is 0 N alone: the scale of the forces is undetermined")
    _refuse_pressures(contents.pressure)
    with replacing_folder(folder) as part, naming(part, str(folder)):
        _write_files(part, imported, contents)
        description = _describe(folder, imported, contents, source)
        (part / CONFIG_NAME).write_text(description, encoding="utf-8")
        load_config(part / CONFIG_NAME)


def _refuse_pressures(pressure: Mapping[str, float]) -> None:
    """Raise InputError for a pressure that the key [walls.NAME] pressure does not take."""
    for wall, value in pressure.items():
        walls = {"file": "walls.csv", wall: {"pressure": value}}
        for key, error in find_config_errors(Path(CONFIG_NAME), {"walls": walls}):
            if key == f"walls.{wall}.pressure":
                raise InputError("--pressure", wall, error.problem)


def _write_files(folder: Path, imported: ImportedTracks, contents: FolderContents) -> None:
    """Write the tables."""
    tracks = imported.tracks
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
    number = imported.number.tolist()
    write_table(folder / "times.csv", {"frame": range(len(number)), "time": tracks.time.tolist(), "number": number})
    if imported.renamed:
        write_table(folder / "ids.csv", {"id": tracks.id.tolist(), "name": imported.name})
    if contents.walls is not None:
        _write_walls(folder / "walls.csv", contents.walls)
    if contents.outer_grains and contents.edge:
        named = tracks.id[np.isin(imported.name, contents.edge)]
        write_table(folder / "boundary.csv", {"id": named.tolist()})
    if contents.corners is not None:
        _write_corners(folder / "corners.csv", contents.corners)
    if contents.load:
        rows = [(k, wall, force) for k in range(len(number)) for wall, force in contents.load.items()]
        frames, walls, forces = zip(*rows, strict=True)
        write_table(folder / "load.csv", {"frame": frames, "wall": walls, "force": forces})
    if contents.cell is not None:
        vectors = contents.cell.reshape(-1, 4).T.tolist()
        write_table(folder / "cell.csv", dict(zip(CELL_COLUMNS, (range(len(contents.cell)), *vectors), strict=True)))
    if contents.truth is not None:
        write_table(folder / "truth_contacts.csv", contents.truth)


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


def bar_names(corners: CornerDiscs) -> tuple[str, ...]:
    """Return the names of the bars between corners."""
    c = len(corners.name)
    discs = FrameCorners(corners.name, corners.centre, np.full(c, corners.radius), corners.angle)
    return bars_of_corners(Path("corners.csv"), discs)[0]


def _write_corners(file: Path, corners: CornerDiscs) -> None:
    f, c = corners.centre.shape[:2]
    columns: dict[str, Iterable[object]] = {
        "frame": np.repeat(np.arange(f), c).tolist(),
        "corner": corners.name * f,
        "x": corners.centre[..., 0].ravel().tolist(),
        "y": corners.centre[..., 1].ravel().tolist(),
        "radius": [corners.radius] * (f * c),
    }
    if np.isfinite(corners.angle).any():
        columns["theta"] = ["" if np.isnan(angle) else angle for angle in corners.angle.ravel().tolist()]
    write_table(file, columns)


def _describe(folder: Path, imported: ImportedTracks, contents: FolderContents, source: str) -> str:
    sigma = imported.tracks.sigma
    lines = [f"# {source}", *(f"# {remark}" for remark in imported.remarks)]
    lines.append(f"name = {json.dumps(_name(folder), ensure_ascii=False)}")
    if contents.truth is not None:
        lines.append('truth = "truth_contacts.csv"')
    lines += [
        "", "[tracks]", 'positions = "tracks.csv"', 'grains = "grains.csv"', 'times = "times.csv"',
        f"precision = {float(np.nanmax(sigma)):.6g}",
    ]  # fmt: skip
    if contents.walls is not None or contents.corners is not None:
        lines.append("")
        if contents.walls is not None:
            lines.append(f"# {contents.walls.remark}")
        if contents.corners is not None:
            lines.append(f"# Discs at the corners of the frame. {contents.corners.remark}")
        lines.append("[walls]")
        if contents.walls is not None:
            lines.append('file = "walls.csv"')
        if contents.corners is not None:
            lines.append('corners = "corners.csv"')
        if contents.load:
            lines.append('load = "load.csv"')
        for wall, pressure in contents.pressure.items():
            lines += [f"[walls.{json.dumps(wall, ensure_ascii=False)}]", f"pressure = {pressure!r}"]
    elif contents.cell is not None:
        lines += ["", "# The simulation's box is periodic both ways.", "[boundary]", 'periodic = "cell.csv"']
    elif contents.outer_grains:
        which = "those that the file puts at the edge" if contents.edge else "the outermost grains"
        grains = "boundary.csv" if contents.edge else "outer"
        lines += ["", f"# No walls are given: {which} are the boundary.", "[boundary]", f'grains = "{grains}"']
    else:
        lines += ["", "# Add [walls] with the table frame,wall,x1,y1,x2,y2 [m] to solve for forces."]
    for section, text in contents.known.items():
        lines += ["", f"[{section}]", text]
    if "material" not in contents.known:
        lines += ["", "# [material] density, length, friction, gravity: keys that are not given have their defaults."]
    return "\n".join(lines) + "\n"


def _name(folder: Path) -> str:
    name = "".join(c if c.isalnum() or c in "_ .+-" else "-" for c in folder.resolve().name)
    return name if name[:1].isalnum() else f"imported{name}"
