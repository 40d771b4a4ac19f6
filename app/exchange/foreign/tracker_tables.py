"""Tables of trackers, read by the roles of their columns: frame, grain, x, y and optional ones."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ...experiment.reading.tables import GREATEST, Table
from ...process.counts import state_count
from ...process.errors import InputError
from .foreign_table import column_names, read_foreign
from .observations import Observations

NEEDED, OPTIONAL = ("frame", "id", "x", "y"), ("theta", "radius", "diameter", "time")
OF_PAIRS = ("i", "j", "fx", "fy")  # roles in a file of pair forces
TRACKPY = {"frame": "frame", "id": "particle", "x": "x", "y": "y"}
GYRATION = "trackpy's size is the radius of gyration of the brightness, not a radius: it is ignored."
ENDS = re.compile(r"x1_(\w+)")  # RodTracker's column of one end of a rod, seen by one camera


def parse_columns(text: str | None) -> dict[str, str]:
    """Parse frame=…,id=… into roles and columns. Raises InputError for unknown roles."""
    found = {}
    for part in (text or "").split(",") if text else ():
        role, equals, column = (each.strip() for each in part.partition("="))
        if not (equals and role and column):
            raise InputError("--columns", repr(part), "is not ROLE=COLUMN, such as frame=t,id=rod,x=x,y=y")
        if role not in (*NEEDED, *OPTIONAL, *OF_PAIRS):
            known = ", ".join((*NEEDED, *OPTIONAL, *OF_PAIRS))
            raise InputError("--columns", role, f"is not known: the roles are {known}")
        found[role] = column
    return found


def read_by_columns(file: Path, columns: Mapping[str, str], *, degrees: bool) -> Observations:
    """Read a table whose columns are named by role; by default a role is the column of its own name.

    Raises InputError for a role without a column.
    """
    header = column_names(file)
    own = {role: role for role in (*NEEDED, *OPTIONAL) if role in header}
    if "radius" in own or columns.keys() & {"radius", "diameter"}:  # one of both: a named one, or the radius
        own.pop("diameter", None)
    if columns.keys() & {"radius", "diameter"}:
        own.pop("radius", None)
    columns = own | dict(columns)
    missing = [role for role in NEEDED if role not in columns]
    if missing:
        names = ", ".join(header[:12])
        raise InputError(
            file, "", f"has no column for {', '.join(missing)}: give --columns {missing[0]}=… (columns: {names})"
        )
    table = read_foreign(file, list(dict.fromkeys(columns.values())))
    return observe_table(table, columns, degrees=degrees)


def observe_table(table: Table, columns: Mapping[str, str], *, degrees: bool = False) -> Observations:
    """Make observations of a table; rows without an id are left out and counted."""
    name = table.text(columns["id"])
    kept = np.array([each != "" for each in name])
    if not kept.any():
        raise InputError(table.file, f"column {columns['id']}", "is empty: no row belongs to a grain")
    remarks: tuple[str, ...] = ()
    if unnamed := int((~kept).sum()):
        remarks = (f"Left out: {state_count(unnamed, 'row')} without a grain ({columns['id']} is empty).",)
        table = table.select(kept)
    angle = table.optional_numbers(columns.get("theta", ""))
    radius = table.optional_numbers(columns.get("radius", ""))
    if "diameter" in columns and "radius" not in columns:
        radius = 0.5 * table.optional_numbers(columns["diameter"])
    return Observations(
        table, columns["id"], frame_numbers(table, columns["frame"]), tuple(table.text(columns["id"])),
        np.column_stack([table.numbers(columns["x"]), table.numbers(columns["y"])]),
        np.deg2rad(angle) if degrees else angle, radius,
        table.numbers(columns["time"]) if "time" in columns else None, remarks,
    )  # fmt: skip


def read_trackpy(file: Path, columns: Mapping[str, str], *, degrees: bool) -> Observations:
    """Read a DataFrame of trackpy.link, saved as CSV or Parquet: frame, particle, x, y [px], y down."""
    observed = read_by_columns(file, {**TRACKPY, **columns}, degrees=degrees)
    if "size" not in column_names(file) or "radius" in columns or "diameter" in columns:
        return observed
    return observed.with_remark(GYRATION)


def read_rodtracker(file: Path, columns: Mapping[str, str]) -> Observations:
    """Read RodTracker's two ends of every rod in its first camera: x1_gp1, y1_gp1, x2_gp1, y2_gp1 [px].

    A rod is named by its colour and number; a rod with seen_gp1 = 0 is lost.
    """
    header = column_names(file)
    camera = next((found[1] for each in header if (found := ENDS.fullmatch(each))), None)
    if camera is None:
        raise InputError(
            file, "", f"has no columns x1_… of rod ends, as written by RodTracker (columns: {', '.join(header[:12])})"
        )
    ends = [f"{axis}{end}_{camera}" for end in (1, 2) for axis in "xy"]
    number, observed = columns.get("id", "particle"), f"seen_{camera}"
    more = [columns[role] for role in ("radius", "diameter") if role in columns]
    table = read_foreign(file, ["frame", number, *ends, *more], ("color", observed))
    ends_of_rods = np.column_stack([table.optional_numbers(each) for each in ends])
    kept = np.array([bool(np.isfinite(each).all()) for each in ends_of_rods])
    if observed in header:
        kept &= np.array([bool(value) for value in np.nan_to_num(table.optional_numbers(observed))])
    if not kept.any():
        raise InputError(file, f"columns {', '.join(ends)}", "give no position of a rod")
    table, ends_of_rods = table.select(kept), ends_of_rods[kept]
    colours = table.text("color") if "color" in header else [""] * len(table)
    name = tuple(f"{c}-{k}" if c else k for c, k in zip(colours, table.text(number), strict=True))
    along = ends_of_rods[:, 2:] - ends_of_rods[:, :2]
    radius = table.optional_numbers(columns.get("radius", ""))
    if "diameter" in columns:
        radius = 0.5 * table.optional_numbers(columns["diameter"])
    remarks = [
        f"Camera {camera} is used. Rods are treated as discs at their middles without their lengths; forces are "
        "meaningful only if rods are seen end on.",
    ]
    if missing := int((~kept).sum()):
        remarks.append(f"Without a position of a rod: {state_count(missing, 'row')}.")
    return Observations(
        table, number, frame_numbers(table, "frame"), name, 0.5 * (ends_of_rods[:, :2] + ends_of_rods[:, 2:]),
        np.arctan2(along[:, 1], along[:, 0]), radius, remarks=tuple(remarks),
    )  # fmt: skip


def frame_numbers(table: Table, column: str) -> np.ndarray:
    """Return the numbers of frames (m,), also those written as 3.0."""
    values = table.numbers(column)
    violations = np.flatnonzero((values != np.rint(values)) | (np.abs(values) > GREATEST))
    if len(violations):
        raise table.error(int(violations[0]), column, "is not an integer frame number")
    return values.astype(np.int64)
