"""The conversion of files of another program to an experiment folder, for the command and for Python."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import get_args

import numpy as np

from ...experiment.plausibility import PackingSources, check_radii
from ...process.errors import InputError
from .experiment_folder import FolderContents, refuse_existing, write_folder
from .file_formats import ImportedData, read_format
from .format_names import FileFormat
from .imported_corners import make_corners
from .observations import Convention, ImportedTracks, Observations, make_tracks
from .pegs import ForceReadings, true_contacts, true_wall_forces, without_distant
from .proposed_walls import propose_box, read_foreign_walls
from .simulations.pair_forces import contacts_of_pairs, read_pair_forces

SIMULATIONS = ("lammps", "yade", "mercury", "table")
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
    load: Mapping[str, float] = field(default_factory=dict)  # [N] by wall
    pairs: Path | None = None  # pair forces of a simulation [N], as truth

    def __post_init__(self) -> None:
        if self.form not in get_args(FileFormat):
            raise InputError("import", repr(self.form), f"is not a form: there are {', '.join(get_args(FileFormat))}")
        for name in ("y_down", "degrees"):
            value, option = getattr(self, name), f"--{name.replace('_', '-')}"
            if not isinstance(value, bool | np.bool_):
                raise InputError(option, repr(value), "is neither true nor false")
        for name in ("pixel_size", "interval", "precision", "height", "radius", "corner_radius"):
            value, option = getattr(self, name), f"--{name.replace('_', '-')}"
            if value is None:
                continue
            if isinstance(value, bool) or not isinstance(value, int | float | np.number):
                raise InputError(option, repr(value), "is not a number")
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(option, str(value), "is not positive")


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
    precision = foreign.precision_of(request.precision)
    imported = make_tracks(foreign.observed, convention, precision)
    stated = None if request.precision is None else ("--precision", f"{precision:g} m")
    if request.precision is None and foreign.precision is None:
        assumed = (
            f"No precision is given: {precision:.3g} m is assumed, {foreign.relative_precision:g} of a mean diameter."
        )
        imported = replace(imported, remarks=(*imported.remarks, f"{assumed} Give --precision."))
    discs = None if corners is None else make_corners(corners, imported, convention, request.corner_radius)
    contents = replace(_folder_contents(request, foreign, imported, convention), corners=discs)
    boundaries = (contents.walls, contents.corners, contents.cell)
    bounded = contents.outer_grains or bool(contents.edge) or any(each is not None for each in boundaries)
    sources = PackingSources((request.source, _origin_of_radii(request)), stated, {})
    check_radii(sources, imported.tracks, packed=bounded)  # else no forces are solved
    if foreign.truth is not None:
        contents, imported = _with_measured_forces(foreign.truth, contents, imported)
    if request.pairs is not None:
        if request.form not in SIMULATIONS:
            raise InputError("--pairs", str(request.pairs), f"applies to {' and '.join(SIMULATIONS)} only")
        forces = read_pair_forces(request.pairs, request.columns, _times_of(foreign.observed))
        truth, remarks = contacts_of_pairs(
            forces, imported, contents.walls, contents.cell, upside_down=convention.y_down
        )
        contents = replace(contents, truth=truth)
        imported = replace(imported, remarks=(*imported.remarks, *remarks))
    write_folder(folder, imported, contents, f"From {request.source.name}, by rodsight import {request.form}.")
    return imported, contents


def _origin_of_radii(request: ImportRequest) -> str:
    """Return the column or the option that gives the radii, for messages."""
    column = request.columns.get("radius") or request.columns.get("diameter")
    if column is not None:
        return f"column {column}"
    return "column radius" if request.radius is None else "--radius"


def _times_of(observed: Observations) -> list[float]:
    """Return the times of the frames as the other program gives them [s]; empty where it gives none."""
    if observed.time is None:
        return []
    _, first = np.unique(observed.frame, return_index=True)
    return observed.time[first].tolist()


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
    return FolderContents(
        bars,
        pressure=request.pressure,
        load=request.load,
        outer_grains=walls == OUTER,
        edge=edge,
        cell=cell,
        known=foreign.known,
    )


def _with_measured_forces(
    readings: ForceReadings, contents: FolderContents, imported: ImportedTracks
) -> tuple[FolderContents, ImportedTracks]:
    """Add measured forces between discs and on walls to the folder, and a remark on what was left out."""
    readings, distant = without_distant(readings, imported)
    between = true_contacts(readings, imported)
    at_walls, remark = true_wall_forces(readings, imported, contents.walls)
    imported = replace(imported, remarks=(*imported.remarks, *filter(None, (distant, remark))))
    truth = {name: [*values, *at_walls[name]] for name, values in between.items()}
    return (replace(contents, truth=truth) if truth["frame"] else contents), imported
