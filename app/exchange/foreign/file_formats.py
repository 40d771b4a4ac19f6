"""Readers of all file formats by name, with their units and axes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ...experiment.reading.tables import Table
from ...process.counts import state_count
from ...process.errors import InputError
from ...solver.bodies.grains import Array
from ..dic_files import DicSequence, read_sequence
from .format_names import FileFormat
from .imported_corners import ImportedCorners
from .observations import Convention, Observations
from .pegs import ForceReadings, read_edge, read_pegs
from .proposed_walls import Walls, bars_of_cell, periodic_cell
from .simulations.lammps_dump import read_lammps
from .simulations.mercury_files import read_mercury
from .simulations.yade_text import read_yade
from .tracker_tables import read_by_columns, read_rodtracker, read_trackpy
from .trackmate import read_trackmate

PIXEL_FORMATS = frozenset({"trackpy", "rodtracker", "dic", "pegs"})
DEFAULT_PIXEL_SIZE = 1e-4  # [m], assumed for photoelastic tests without a scale
COARSE_PRECISION = 1e-3  # [mean diameter], precision of tracks without a stated one
FINE_PRECISION = 1e-4  # [mean diameter], of simulated, rounded positions
PHOTOELASTIC = {
    "material": 'stiffness = "estimate"  # photoelastic discs are soft: overlaps correspond to forces',
    "contacts": 'unseen = "ignore"  # gaps in a nearly jammed packing are not missing discs',
}
PRECISION = {"pegs": 0.3, "dic": 0.05}  # [px], typical of these trackers


@dataclass(frozen=True, slots=True)
class ImportedData:
    """The contents of imported files."""

    observed: Observations
    convention: Convention
    truth: ForceReadings | None = None  # measured forces
    walls: Walls | None = None  # given by the file
    cell: Array | None = None  # (f, 2, 2) [m], vectors of the periodic cell given by the file
    corners: ImportedCorners | None = None  # of the frame, given by the file
    edge: tuple[str, ...] = ()  # names of grains that the file puts at the edge of the packing
    precision: float | None = None  # in the unit of the file; None: `relative_precision`
    relative_precision: float = COARSE_PRECISION
    known: Mapping[str, str] = field(default_factory=dict)  # lines of sections of experiment.toml

    def precision_of(self, given: float | None) -> float:
        """Return the standard deviation of a position [m]: as given, or typical of the format."""
        unit, value = self.convention.unit, self.precision if given is None else given
        if value is not None:
            return value * unit
        known = self.observed.radius[np.isfinite(self.observed.radius)]
        radius = float(np.median(known)) if len(known) else self.convention.radius or 1.0
        return self.relative_precision * 2.0 * radius * unit


def read_format(
    form: FileFormat,
    source: Path,
    columns: Mapping[str, str],
    convention: Convention,
    *,
    unit: float | None,
    degrees: bool,
) -> ImportedData:
    """Read files of a format.

    Parameters
    ----------
    form : FileFormat
    source : Path
    columns : mapping of str to str
        Columns by role.
    convention : Convention
    unit : float, optional
        The file's unit of length [m].
    degrees : bool
        Angles are in degrees.

    Raises
    ------
    InputError
        If the files cannot be read or their unit is unknown.
    """
    if form == "dic":
        return _read_dic(source, columns, convention, unit)
    if form in PIXEL_FORMATS and form != "pegs" and unit is None:
        raise InputError("--pixel-size", "", f"is missing: lengths of {form} are in pixels")
    in_unit = replace(convention, unit=1.0 if unit is None else unit)
    down = replace(in_unit, y_down=True)
    if form == "table":
        return ImportedData(read_by_columns(source, columns, degrees=degrees), in_unit)
    if form == "trackpy":
        return ImportedData(read_trackpy(source, columns, degrees=degrees), down)
    if form == "rodtracker":
        return ImportedData(read_rodtracker(source, columns), down)
    if form == "trackmate":
        spots = read_trackmate(source, columns)
        own = spots.unit if unit is None else unit
        if own is None:
            raise InputError("--pixel-size", "", "is missing: the file does not give its unit in metres")
        return ImportedData(spots.observed, replace(down, unit=own))
    if form == "lammps":
        dump = read_lammps(source, columns, convention.interval)
        bars, cell = bars_of_cell(dump, in_unit.unit), periodic_cell(dump, in_unit.unit)
        return ImportedData(dump.observed, in_unit, walls=bars, cell=cell, relative_precision=FINE_PRECISION)
    if form == "yade":
        return ImportedData(read_yade(source, columns), in_unit, relative_precision=FINE_PRECISION)
    if form == "mercury":
        return ImportedData(read_mercury(source, columns), in_unit, relative_precision=FINE_PRECISION)
    observed, truth = read_pegs(source)
    if unit is None:
        observed = observed.with_remark(
            f"The pixel size is unknown: {DEFAULT_PIXEL_SIZE:g} m is assumed, on which lengths and stresses depend."
        )
    in_unit = replace(down, unit=DEFAULT_PIXEL_SIZE if unit is None else unit)
    return ImportedData(
        observed, in_unit, truth, precision=PRECISION[form], known=PHOTOELASTIC, edge=read_edge(source)
    )  # fmt: skip


def _read_dic(folder: Path, columns: Mapping[str, str], convention: Convention, unit: float | None) -> ImportedData:
    """Read a folder of dic_out_N.txt or CONFNNNN; grains are named by their rows."""
    sequence = read_sequence(folder, _radius_column(columns))
    if unit is None and not sequence.in_metres:
        raise InputError("--pixel-size", "", "is missing: lengths of dic are in pixels")
    f, n = sequence.x.shape
    frame, row = np.nonzero(np.isfinite(sequence.x) & np.isfinite(sequence.rotation))
    name = tuple(str(each) for each in sequence.row[row].tolist())
    table = Table(folder, {"id": list(name)}, [*(sequence.row[row] + 2)])
    turn = -1.0 if sequence.y_down else 1.0  # counter-clockwise as seen is opposite to the axes of a picture
    corners = sequence.corners
    observed = Observations(
        table, "id", np.array(sequence.number, np.int64)[frame], name,
        np.column_stack([sequence.x[frame, row], sequence.y[frame, row]]), turn * sequence.rotation[frame, row],
        sequence.radius[row], remarks=tuple(_dic_remarks(sequence, missing=f * n - len(frame), unit=unit)),
    )  # fmt: skip
    precision = PRECISION["dic"]
    if sequence.in_metres:
        precision = None if sequence.scale is None else precision * sequence.scale
    return ImportedData(
        observed,
        replace(convention, unit=unit if unit is not None and not sequence.in_metres else 1.0, y_down=sequence.y_down),
        corners=None if corners is None else ImportedCorners(corners.x, corners.y, turn * corners.rotation),
        precision=precision,
    )


def _radius_column(columns: Mapping[str, str]) -> int | None:
    """Return the column of the radius of CONF files, 3 or 4; None: not given."""
    for role, column in columns.items():
        if role != "radius" or column not in ("3", "4"):
            raise InputError("--columns", f"{role}={column}", "does not apply to dic: radius=3 or radius=4 does")
    return int(columns["radius"]) if columns else None


def _dic_remarks(sequence: DicSequence, *, missing: int, unit: float | None) -> Iterator[str]:
    """Name what is left out or assumed."""
    if missing:
        yield f"{state_count(missing, 'pose')} lost."
    if sequence.markers:
        radii = " and ".join(f"{each:g}" for each in sorted(set(sequence.markers)))
        count = len(sequence.markers)
        verb = "are" if count > 1 else "is"
        yield f"{state_count(count, 'row')} of radius {radii} {verb} no rod but a marker: left out."
    if sequence.other_form:
        yield "CONF files in the same folder are not read, since dic_out files hold the same poses."
    if sequence.in_metres:
        ignored = "" if unit is None else ": --pixel-size is not used"
        yield f"Lengths are in metres, y up, as the files state or their radii show{ignored}."
