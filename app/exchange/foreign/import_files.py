"""The conversion of files of another program to an experiment folder, for the command and for Python."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ...process.errors import InputError
from ...solver.bodies.cell import Cell
from ...solver.bodies.grains import Array
from .experiment_folder import FolderContents, refuse_existing, write_folder
from .file_formats import ImportedData, read_format
from .format_names import FileFormat
from .imported_corners import make_corners
from .lammps_dump import PairForces, read_pair_forces
from .observations import Convention, ImportedTracks, make_tracks
from .pegs import true_contacts
from .proposed_walls import propose_box, read_foreign_walls

SIMULATIONS = ("lammps", "yade", "table")
BOX, OUTER, NONE = "box", "outer", "none"
OTHER_BOUNDARIES = (BOX, OUTER, NONE)  # they replace walls and corners of the files


@dataclass(frozen=True, slots=True)
class ImportRequest:
    """Files of another program, how to read them, and the boundary to add."""

    form: FileFormat
    source: Path
    columns: Mapping[str, str] = field(default_factory=dict)  # by role: frame, id, x, y, …
    pixel_size: float | None = None  # [m] the files' unit of length; None: metres
    y_down: bool = False
    height: float | None = None  # [px] of a photograph
    degrees: bool = False
    radius: float | None = None  # of all grains without one, in the files' unit
    interval: float = 1.0  # [s] between photographs
    precision: float | None = None  # of a position, in the files' unit
    walls: str | None = None  # box, outer, none, or a table of walls
    pressure: Mapping[str, float] = field(default_factory=dict)  # [Pa] by wall
    corner_radius: float | None = None  # of the frame's corner discs, in the files' unit
    pairs: Path | None = None  # pair forces of a simulation [N], as truth

    def __post_init__(self) -> None:
        for name in ("pixel_size", "interval", "precision", "height", "radius", "corner_radius"):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise InputError(f"--{name.replace('_', '-')}", str(value), "is not positive")


def import_files(request: ImportRequest, folder: Path) -> tuple[ImportedTracks, FolderContents]:
    """Write an experiment folder from files of another program.

    Raises
    ------
    InputError
        The files cannot be read, or the folder holds an experiment already.
    """
    refuse_existing(folder)
    given = Convention(y_down=request.y_down, interval=request.interval, radius=request.radius)
    foreign = read_format(
        request.form, request.source, request.columns, given, unit=request.pixel_size, degrees=request.degrees
    )
    corners = None if request.walls in OTHER_BOUNDARIES else foreign.corners
    if request.corner_radius is not None and corners is None:
        none = foreign.corners is None
        reason = "the files have no corners of a frame" if none else f"--walls {request.walls} replaces them"
        raise InputError("--corner-radius", str(request.corner_radius), f"does not apply: {reason}")
    height = None if request.height is None else request.height - 1.0
    convention = replace(foreign.convention, y_down=foreign.convention.y_down or request.y_down, height=height)
    imported = make_tracks(foreign.observed, convention, foreign.precision_of(request.precision))
    discs = None if corners is None else make_corners(corners, imported, convention, request.corner_radius)
    contents = replace(_folder_contents(request, foreign, imported, convention), corners=discs)
    if request.pairs is not None:
        if request.form not in SIMULATIONS:
            raise InputError("--pairs", str(request.pairs), f"applies to {' and '.join(SIMULATIONS)} only")
        forces = read_pair_forces(request.pairs, request.columns)
        truth, remark = contacts_of_pairs(forces, imported, contents.cell, upside_down=convention.y_down)
        contents = replace(contents, truth=truth)
        imported = replace(imported, remarks=(*imported.remarks, *([remark] if remark else [])))
    write_folder(folder, imported, contents, f"From {request.source.name}, by rodsight import {request.form}.")
    return imported, contents


def contacts_of_pairs(
    forces: PairForces, imported: ImportedTracks, cell: Array | None, *, upside_down: bool
) -> tuple[dict[str, list[object]], str]:
    """Return columns of a table of true forces from pair forces, and a remark on pairs that were left out.

    Notes
    -----
    With the unit normal n from i to j, n rotated by +90° as t, and the force F that j exerts on i: f_n = −F·n and
    f_t = −F·t.
    """
    tracks = imported.tracks
    frame_of = {int(number): k for k, number in enumerate(imported.number)}
    row_of = {name: row for row, name in enumerate(imported.name)}
    columns: dict[str, list[object]] = {name: [] for name in ("frame", "i", "j", "fn", "ft")}
    left_out = 0
    for step, first, second, force in zip(forces.step, forces.i, forces.j, forces.force, strict=True):
        if step not in frame_of or not force.any():
            continue
        i, j = row_of.get(first), row_of.get(second)
        if i is None or j is None or i == j:
            left_out += 1
            continue
        k = frame_of[step]
        branch = tracks.position[k, j] - tracks.position[k, i]
        if cell is not None:
            branch = branch + Cell.at_rest(cell[k]).shift(branch[None])[0]
        if not np.isfinite(branch).all():
            left_out += 1
            continue
        normal = branch / np.linalg.norm(branch)
        on_i = force * np.array([1.0, -1.0]) if upside_down else force
        tangent = np.array([-normal[1], normal[0]])
        values = (k, int(tracks.id[i]), int(tracks.id[j]), -float(on_i @ normal), -float(on_i @ tangent))
        for name, value in zip(columns, values, strict=True):
            columns[name].append(value)
    remark = f"{left_out} pair forces are left out: they name no grain of this frame." if left_out else ""
    return columns, remark


def _folder_contents(
    request: ImportRequest, foreign: ImportedData, imported: ImportedTracks, convention: Convention
) -> FolderContents:
    walls, cell, edge = request.walls, None, ()
    if walls is None:
        walls = OUTER if request.form == "pegs" else NONE
        bars, cell, edge = foreign.walls, foreign.cell, foreign.edge
    elif walls == BOX:
        bars = propose_box(imported.tracks)
    else:
        bars = None if walls in (NONE, OUTER) else read_foreign_walls(Path(walls), imported, convention)
    readings = foreign.truth
    truth = None if readings is None or not len(readings.fn) else true_contacts(readings, imported)
    return FolderContents(
        bars,
        pressure=request.pressure,
        outer_grains=walls == OUTER,
        edge=edge,
        cell=cell,
        known=foreign.known,
        truth=truth,
    )
