"""A tracker's table by its columns: which one is the frame, the grain, x and y, and what else there may be."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...experiment.reading.tables import GREATEST, Table
from .foreign_table import column_names, read_foreign
from .observations import Observations

NEEDED, OPTIONAL = ("frame", "id", "x", "y"), ("theta", "radius", "diameter", "time")
TRACKPY = {"frame": "frame", "id": "particle", "x": "x", "y": "y"}
GYRATION = "trackpy's size is a radius of gyration of the brightness, no radius: it is not taken."
ENDS = re.compile(r"x1_(\w+)")  # RodTracker's column of one end of a rod, as one camera sees it


def parse_columns(text: str | None) -> dict[str, str]:
    """Roles and columns of frame=…,id=…; raises InputError for roles that are not known."""
    found = {}
    for part in (text or "").split(",") if text else ():
        role, equals, column = (each.strip() for each in part.partition("="))
        if not (equals and role and column):
            raise InputError("--columns", repr(part), "is not ROLE=COLUMN, such as frame=t,id=rod,x=x,y=y")
        if role not in (*NEEDED, *OPTIONAL):
            raise InputError("--columns", role, f"is not known: there are {', '.join((*NEEDED, *OPTIONAL))}")
        found[role] = column
    return found


def read_by_columns(file: Path, columns: Mapping[str, str], *, degrees: bool) -> Observations:
    """Read a table whose columns are named by role. Raises InputError for a role without a column."""
    lacking = [role for role in NEEDED if role not in columns]
    if lacking:
        there = ", ".join(column_names(file)[:12])
        raise InputError(
            file, "", f"which column is {', '.join(lacking)}? Say --columns {lacking[0]}=… (there are: {there})"
        )
    table = read_foreign(file, list(dict.fromkeys(columns.values())))
    return observe_table(table, columns, degrees=degrees)


def observe_table(
    table: Table, columns: Mapping[str, str], *, degrees: bool = False, remarks: tuple[str, ...] = ()
) -> Observations:
    """Observations of a table that was read; rows without an id are of no grain, and counted."""
    name = table.text(columns["id"])
    kept = np.array([each != "" for each in name])
    if not kept.any():
        raise InputError(table.file, f"column {columns['id']}", "is empty: no row belongs to a grain")
    if unnamed := int((~kept).sum()):
        remarks = (*remarks, f"{unnamed} rows belong to no grain ({columns['id']} is empty) and are left out.")
        table = table.select(kept)
    angle = table.numbers_if_told(columns.get("theta", ""))
    radius = table.numbers_if_told(columns.get("radius", ""))
    if "diameter" in columns and "radius" not in columns:
        radius = 0.5 * table.numbers_if_told(columns["diameter"])
    return Observations(
        table, columns["id"], whole_frames(table, columns["frame"]), tuple(table.text(columns["id"])),
        np.column_stack([table.numbers(columns["x"]), table.numbers(columns["y"])]),
        np.deg2rad(angle) if degrees else angle, radius,
        table.numbers(columns["time"]) if "time" in columns else None, remarks,
    )  # fmt: skip


def read_trackpy(file: Path, columns: Mapping[str, str], *, degrees: bool) -> Observations:
    """Read a DataFrame of trackpy.link, saved as CSV or Parquet: frame, particle, x, y [px], y down."""
    seen = read_by_columns(file, {**TRACKPY, **columns}, degrees=degrees)
    if "size" not in column_names(file) or "radius" in columns or "diameter" in columns:
        return seen
    return seen.with_remark(GYRATION)


def read_rodtracker(file: Path, columns: Mapping[str, str]) -> Observations:
    """Read RodTracker's two ends of every rod, as its first camera saw them: x1_gp1, y1_gp1, x2_gp1, y2_gp1 [px].

    A rod is named by its colour and number; where seen_gp1 is 0 it is lost.
    """
    header = column_names(file)
    camera = next((found[1] for each in header if (found := ENDS.fullmatch(each))), None)
    if camera is None:
        raise InputError(
            file, "", f"has no columns x1_…, as RodTracker names ends (there are: {', '.join(header[:12])})"
        )
    ends = [f"{axis}{end}_{camera}" for end in (1, 2) for axis in "xy"]
    number, seen = columns.get("id", "particle"), f"seen_{camera}"
    more = [columns[role] for role in ("radius", "diameter") if role in columns]
    table = read_foreign(file, ["frame", number, *ends, *more], ("color", seen))
    places = np.column_stack([table.numbers_if_told(each) for each in ends])
    kept = np.array([bool(np.isfinite(place).all()) for place in places])
    if seen in header:
        kept &= np.array([bool(value) for value in np.nan_to_num(table.numbers_if_told(seen))])
    if not kept.any():
        raise InputError(file, f"columns {', '.join(ends)}", "tell no rod's place")
    table, places = table.select(kept), places[kept]
    colours = table.text("color") if "color" in header else [""] * len(table)
    name = tuple(f"{c}-{k}" if c else k for c, k in zip(colours, table.text(number), strict=True))
    along = places[:, 2:] - places[:, :2]
    radius = table.numbers_if_told(columns.get("radius", ""))
    if "diameter" in columns:
        radius = 0.5 * table.numbers_if_told(columns["diameter"])
    remarks = [
        f"Camera {camera} is taken. Rods are taken for discs at their middles: their lengths are left out, and forces "
        "mean something only where rods are seen end on.",
    ]
    if missing := int((~kept).sum()):
        remarks.append(f"{missing} rows tell no place of a rod.")
    return Observations(
        table, number, whole_frames(table, "frame"), name, 0.5 * (places[:, :2] + places[:, 2:]),
        np.arctan2(along[:, 1], along[:, 0]), radius, remarks=tuple(remarks),
    )  # fmt: skip


def whole_frames(table: Table, column: str) -> np.ndarray:
    """Numbers of frames (m,), also where they are written as 3.0."""
    values = table.numbers(column)
    broken = np.flatnonzero((values != np.rint(values)) | (np.abs(values) > GREATEST))
    if len(broken):
        raise table.error(int(broken[0]), column, "is not the whole number of a frame")
    return values.astype(np.int64)
