"""Results as tidy tables, one row per observation, CSV or Parquet: contacts, grains, frames, walls, strain windows.

SI units.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import Literal, get_args

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from ..drawing.accumulated_strain import accumulated_strains
from ..process.atomic import replacing
from ..results.hdf5.writer import columns_of_results
from ..results.results import Results
from ..results.schema import DIMENSIONS, entries
from ..solver.frame_forces import FrameStatus
from .data_package import write_description
from .grain_quantities import GRAIN_COLUMNS, measure_grains

Kind = Literal["csv", "parquet"]
TableName = Literal["contacts", "grains", "frames", "walls"]

# Units and meanings of the first columns of the tables.
IDENTITY = {
    "frame": ("", "frame, from 0"),
    "time": ("s", "time of the photograph"),
    "id": ("", "name of the grain"),
    "i": ("", "name of the first grain"),
    "j": ("", "name of the second grain; -1 at a wall"),
    "wall": ("", "name of the wall; empty between grains"),
    "x": ("m", "position of the contact point or the grain centre, to the right"),
    "y": ("m", "position of the contact point or the grain centre, upward"),
    "nx": ("", "normal from i to j"),
    "ny": ("", "normal from i to j"),
    "theta": ("rad", "rotation since frame 0, counter-clockwise"),
    "radius": ("m", "radius"),
    **{name: ("m", f"vector {name[0]} of the periodic cell") for name in ("ax", "ay", "bx", "by")},
    **{f"{axis}{end}": ("m", f"end {end} of the wall; of a circle, of a diameter") for end in "12" for axis in "xy"},
}
OF_WALLS = {"wall": ("", "name of the wall"), "pressure": ("Pa", "pressure on the wall")}
EVENT_COLUMNS = {
    "frame": ("", "first frame of the event, from 0"),
    "last": ("", "last frame of the event"),
    "time": ("s", "time of the first frame"),
    "accumulated_strain": ("", "strain accumulated until then"),
    "status": ("", "status of the frames"),
    "reason": ("", "reason of the first frame"),
}
STEADY = (FrameStatus.SETTLING, FrameStatus.SETTLED)
AT_WALL = -1  # j of a contact with a wall
IDENTIFIED = ("time", "i", "j", "point", "normal", "position", "rotation")  # quantities in the columns of IDENTITY
SPLIT_DIMENSIONS = ("xy", "axis", "wall", "anisotropy", "member", "component", "error_part")  # these become columns


@dataclass(frozen=True, slots=True)
class Column:
    values: object
    unit: str = ""
    meaning: str = ""


def make_tables(results: Results) -> dict[TableName, pa.Table]:
    """Return the tables by name. Unknown values are null; columns have unit and meaning as metadata, for Parquet."""
    return {name: make_table(results, name) for name in get_args(TableName)}


def make_table(results: Results, name: TableName) -> pa.Table:
    """Return one of the tables."""
    identity, rows = {
        "contacts": (_contacts, ("contact",)),
        "grains": (_grains, ("frame", "grain")),
        "frames": (_frames, ("frame",)),
        "walls": (_walls, ("frame", "wall")),
    }[name]
    return _table(identity(results) | _stored_columns(results, columns_of_results(results), rows))


def make_events(results: Results) -> pa.Table:
    """Return the frames at which a status other than settling or settled begins, with the reason."""
    frames, rows = list(results.frames), []
    strain = accumulated_strains([each.strain for each in frames])
    for k, each in enumerate(frames):
        if each.status not in STEADY and (k == 0 or frames[k - 1].status is not each.status):
            until = next((n for n in range(k, len(frames)) if frames[n].status is not each.status), len(frames))
            time = results.tracks.time[k]
            rows.append((k, until - 1, time, strain[k], each.status.name.lower(), each.failed_reason or each.reason))
    columns = list(zip(*rows, strict=True)) or [()] * len(EVENT_COLUMNS)
    kinds = (np.int64, np.int64, np.float64, np.float64, object, object)
    return _table({
        name: Column(np.array(values, kind), *described)
        for (name, described), values, kind in zip(EVENT_COLUMNS.items(), columns, kinds, strict=True)
    })  # fmt: skip


def make_strain_windows(results: Results) -> pa.Table | None:
    """Return size, shape and correlation length of fluctuations over windows of strain; None without kinematics."""
    if results.kinematics is None:
        return None
    return _table(_stored_columns(results, columns_of_results(results), ("strain_window",)))


def write_tables(results: Results, folder: Path, kind: Kind = "csv") -> list[Path]:
    """Write contacts, grains, frames, walls, events and strain_windows with a description; return the files.

    columns.csv is the dictionary of all columns, datapackage.json the same as a Frictionless data package.
    """
    folder.mkdir(parents=True, exist_ok=True)
    files, tables = [], {str(name): table for name, table in make_tables(results).items()}
    tables["events"] = make_events(results)
    windows = make_strain_windows(results)
    if windows is not None:
        tables["strain_windows"] = windows
    for name, table in tables.items():
        file = folder / f"{name}.{kind}"
        with replacing(file) as part:
            if kind == "csv":
                pyarrow.csv.write_csv(table, part)
            else:
                pyarrow.parquet.write_table(table, part)
        files.append(file)
    described = {file.name: table for file, table in zip(files, tables.values(), strict=True)}
    return [*files, *write_description(folder, described, name=results.name, configuration=results.configuration)]


def _contacts(results: Results) -> dict[str, Column]:
    frames, time = results.frames, results.tracks.time
    counts = [forces.contacts.count for forces in frames]
    # Grains come first among the bodies; unseen ones, which are inferred, have ids, too.
    ids = np.append(results.tracks.id, np.full(len(results.walls.name), AT_WALL))
    names = [*[""] * len(results.tracks.id), *results.walls.name]
    point, normal = (np.concatenate([getattr(f.contacts, name) for f in frames]) for name in ("point", "normal"))
    return _identity(
        frame=np.repeat(np.arange(len(frames)), counts),
        time=np.repeat(time, counts),
        i=np.concatenate([results.tracks.id[f.contacts.i] for f in frames]),
        j=np.concatenate([ids[f.contacts.j] for f in frames]),
        wall=[names[body] for f in frames for body in f.contacts.j.tolist()],
        x=point[:, 0], y=point[:, 1], nx=normal[:, 0], ny=normal[:, 1],
    )  # fmt: skip


def _grains(results: Results) -> dict[str, Column]:
    tracks = results.tracks
    f, n = tracks.frame_count, tracks.grain_count
    return _identity(
        frame=np.repeat(np.arange(f), n),
        time=np.repeat(tracks.time, n),
        id=np.tile(tracks.id, f),
        radius=np.tile(tracks.radius, f),
        x=tracks.position[:, :, 0].ravel(),
        y=tracks.position[:, :, 1].ravel(),
        theta=tracks.rotation.ravel(),
    ) | {name: Column(values, *GRAIN_COLUMNS[name]) for name, values in measure_grains(results).items()}


def _frames(results: Results) -> dict[str, Column]:
    cell = results.walls.cell
    vectors = {} if cell is None else dict(zip(("ax", "ay", "bx", "by"), cell.reshape(-1, 4).T, strict=True))
    return _identity(frame=np.arange(len(results.frames)), time=results.tracks.time, **vectors)


def _walls(results: Results) -> dict[str, Column]:
    walls = results.walls
    f, w = walls.endpoints.shape[:2]
    ends = walls.endpoints.reshape(f * w, 4)
    known = _identity(
        frame=np.repeat(np.arange(f), w),
        time=np.repeat(results.tracks.time, w),
        x1=ends[:, 0], y1=ends[:, 1], x2=ends[:, 2], y2=ends[:, 3],
    )  # fmt: skip
    of_walls = {"wall": list(walls.name) * f, "pressure": np.tile(walls.pressure, f)}
    named = {name: Column(values, *OF_WALLS[name]) for name, values in of_walls.items()}
    return {"frame": known.pop("frame"), "time": known.pop("time"), "wall": named["wall"], **known, **named}


def _identity(**values: object) -> dict[str, Column]:
    return {name: Column(each, *IDENTITY[name]) for name, each in values.items()}


def _stored_columns(results: Results, stored: Mapping[str, np.ndarray], rows: tuple[str, ...]) -> dict[str, Column]:
    """Return all quantities of results.h5 with one value, or several named ones, for each of these rows."""
    labels = {name: tuple(map(str, DIMENSIONS[name].labels or ())) for name in SPLIT_DIMENSIONS}
    labels["wall"] = results.walls.name
    columns: dict[str, Column] = {}
    # Recorded wall forces belong to the table of walls; in that of frames they would look like inferred ones.
    for each in entries("tracks", *(["walls"] if "wall" in rows else []), "frames", "statistics", "kinematics"):
        rest = each.dims[len(rows) :]
        fits = each.dims == rows + rest and set(rest) <= set(SPLIT_DIMENSIONS)
        if (each.name in IDENTIFIED and each.part != "kinematics") or each.path not in stored or not fits:
            continue
        stored_values = stored[each.path]
        values = stored_values.reshape(
            int(np.prod(stored_values.shape[: len(rows)])), int(np.prod(stored_values.shape[len(rows) :]))
        )
        for k, named in enumerate(itertools.product(*(labels[name] for name in rest))):
            column = values[:, k]
            if each.quantity.names is not None:
                column = _names(each.quantity.names, column)
            parts = ("".join(named),) if rest == ("xy", "axis") else named  # stress_xy, but wall_force_top_x
            # Of the window of the maps, as distinct from those since the frame before.
            name = f"window_{each.name}" if each.part == "kinematics" and "frame" in rows else each.name
            columns["_".join((name, *parts))] = Column(column, each.quantity.unit, each.quantity.meaning)
    return columns


def _table(columns: Mapping[str, Column]) -> pa.Table:
    arrays = [_array(column.values) for column in columns.values()]
    schema = [
        pa.field(name, array.type, metadata=_metadata(column))
        for (name, column), array in zip(columns.items(), arrays, strict=True)
    ]
    return pa.Table.from_arrays(arrays, schema=pa.schema(schema))


def _metadata(column: Column) -> dict[str, str]:
    texts = {"unit": column.unit, "meaning": column.meaning}
    return {key: text for key, text in texts.items() if text}


def _array(values: object) -> pa.Array:
    data = np.asarray(values)
    if data.dtype.kind == "f":
        return pa.array(data, mask=~np.isfinite(data))
    return pa.array(data.tolist() if data.dtype.kind in "OU" else data)


def _names(kind: type[IntEnum], values: np.ndarray) -> list[str]:
    names = {member.value: member.name.lower() for member in kind}
    return [names[value] for value in values.tolist()]
