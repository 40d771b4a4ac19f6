"""Every form of another program's files by its name: how it is read, and how it counts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from solver.bodies.grains import Array

from ...errors import InputError
from ...experiment.reading.tables import Table
from ..dic_files import read_sequence
from .columns import read_by_columns, read_rodtracker, read_trackpy
from .form_names import Form
from .lammps_dump import read_lammps
from .observations import Convention, Observations
from .pegs import Side, read_pegs
from .proposed_walls import Walls, bars_of_cell, periodic_cell
from .trackmate import read_trackmate
from .yade_text import read_yade

FORMS_IN_PIXELS = frozenset({"trackpy", "rodtracker", "dic", "pegs"})
PIXEL = 1e-4  # [m], assumed of photoelastic tests that do not tell
COARSE = 1e-3  # of a mean diameter: the precision of tracks of which nothing is told
FINE = 1e-4  # of those that were simulated, and rounded
PHOTOELASTIC = {
    "material": 'stiffness = "estimate"  # discs that show fringes are soft: overlaps are forces',
    "contacts": 'unseen = "ignore"  # nearly jammed discs leave room for some that are not there',
}
PRECISION = {"pegs": 0.3, "dic": 0.05}  # [px] that such trackers usually reach


@dataclass(frozen=True, slots=True)
class Foreign:
    """What a form's files told."""

    seen: Observations
    convention: Convention
    truth: Side | None = None  # forces that go with it
    walls: Walls | None = None  # that the file itself tells
    cell: Array | None = None  # (f, 2, 2) [m], vectors of the periodic cell that it tells
    precision: float | None = None  # in its unit; None: a share of the diameter
    share: float = COARSE
    known: Mapping[str, str] = field(default_factory=dict)  # lines of sections of experiment.toml

    def precision_of(self, told: float | None) -> float:
        """Standard deviation of a position [m]: as told, or what such files usually reach."""
        unit, told = self.convention.unit, self.precision if told is None else told
        if told is not None:
            return told * unit
        known = self.seen.radius[np.isfinite(self.seen.radius)]
        radius = float(np.median(known)) if len(known) else self.convention.radius or 1.0
        return self.share * 2.0 * radius * unit


def read_form(
    form: Form, source: Path, columns: Mapping[str, str], convention: Convention, *, unit: float | None, degrees: bool
) -> Foreign:
    """Read files of a form; unit [m] of their lengths, None: not told. Raises InputError."""
    if form in FORMS_IN_PIXELS and form != "pegs" and unit is None:
        raise InputError("--pixel-size", "", f"is missing: {form} counts in pixels")
    counted = replace(convention, unit=1.0 if unit is None else unit)
    down = replace(counted, y_down=True)
    if form == "table":
        return Foreign(read_by_columns(source, columns, degrees=degrees), counted)
    if form == "trackpy":
        return Foreign(read_trackpy(source, columns, degrees=degrees), down)
    if form == "rodtracker":
        return Foreign(read_rodtracker(source, columns), down)
    if form == "trackmate":
        spots = read_trackmate(source, columns)
        own = spots.unit if unit is None else unit
        if own is None:
            raise InputError("--pixel-size", "", "is missing: the file does not tell what its unit is in metres")
        return Foreign(spots.seen, replace(down, unit=own))
    if form == "lammps":
        dump = read_lammps(source, columns, convention.interval)
        bars, cell = bars_of_cell(dump, counted.unit), periodic_cell(dump, counted.unit)
        return Foreign(dump.seen, counted, walls=bars, cell=cell, share=FINE)
    if form == "yade":
        return Foreign(read_yade(source, columns), counted, share=FINE)
    if form == "dic":
        return Foreign(_read_dic(source), down, precision=PRECISION[form])
    seen, truth = read_pegs(source)
    if unit is None:
        seen = seen.with_remark(
            f"The pixel size is not told: {PIXEL:g} m is assumed. Lengths and stresses mean as much."
        )
    counted = replace(down, unit=PIXEL if unit is None else unit)
    return Foreign(seen, counted, truth, precision=PRECISION[form], known=PHOTOELASTIC)


def _read_dic(folder: Path) -> Observations:
    """A folder of dic_out_N.txt or CONFNNNN; grains are named by their rows."""
    sequence = read_sequence(folder)
    f, n = sequence.x.shape
    frame, row = np.nonzero(np.isfinite(sequence.x) & np.isfinite(sequence.rotation))
    name = tuple(str(each) for each in sequence.row[row].tolist())
    table = Table(folder, {"id": list(name)}, [*(sequence.row[row] + 2)])
    remarks = (f"{missing} poses lost.",) if (missing := f * n - len(frame)) else ()
    return Observations(
        table, "id", np.array(sequence.number, np.int64)[frame], name,
        np.column_stack([sequence.x[frame, row], sequence.y[frame, row]]),
        -sequence.rotation[frame, row],  # counter-clockwise as seen: against the axes of a picture
        sequence.radius[row], remarks=remarks,
    )  # fmt: skip
