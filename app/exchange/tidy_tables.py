"""Results as tidy tables, one row per observation, CSV or Parquet: contacts, grains and frames. SI units."""

from __future__ import annotations

from dataclasses import fields
from enum import IntEnum
from pathlib import Path
from typing import Literal

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from solver.contacts.contacts import ContactSource, ContactState
from solver.statistics.frame_statistics import FrameStatistics

from ..atomic import replacing
from ..results.results import Results
from ..tracks import TrackStatus

Kind = Literal["csv", "parquet"]

UNITS = {
    "time": "s", "x": "m", "y": "m", "theta": "rad", "radius": "m", "sigma": "m", "gap": "m", "un": "m/s",
    "ut": "m/s", "fn": "N", "ft": "N", "fn_sd": "N", "ft_sd": "N", "nlgs_fn": "N", "nlgs_ft": "N", "mean_fn": "N",
    "max_fn": "N", "pressure": "Pa", "sigma_1": "Pa", "sigma_2": "Pa", "stress_xx": "Pa", "stress_xy": "Pa",
    "stress_yx": "Pa", "stress_yy": "Pa", "area": "m2", "friction_angle": "rad", "wall_ratio_angle": "rad",
    "principal_direction": "rad", "friction_angle_of_anisotropies": "rad",
}  # fmt: skip
FRAME_COLUMNS = (
    "reason", "sweeps", "natural_map", "unbalance", "kappa", "correction", "old_unbalance", "trust",
    "frames_since_reset",
)  # fmt: skip
CONTACT_COLUMNS = ("un", "ut", "fn", "ft", "fn_sd", "ft_sd", "nlgs_fn", "nlgs_ft", "age", "probability")


def make_tables(results: Results) -> dict[str, pa.Table]:
    """The tables by name. What is not known is null; columns carry their unit as metadata (Parquet keeps it)."""
    columns = {
        "contacts": _contacts(results),
        "grains": _grains(results),
        "frames": _frames(results),
    }
    return {name: _table(each) for name, each in columns.items()}


def write_tables(results: Results, folder: Path, kind: Kind = "csv") -> list[Path]:
    """Write contacts, grains and frames to a folder; returns the files."""
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for name, table in make_tables(results).items():
        file = folder / f"{name}.{kind}"
        with replacing(file) as part:
            if kind == "csv":
                pyarrow.csv.write_csv(table, part)
            else:
                pyarrow.parquet.write_table(table, part)
        files.append(file)
    return files


def _contacts(results: Results) -> dict[str, object]:
    frames, time = results.frames, results.tracks.time
    counts = [forces.contacts.count for forces in frames]
    names = [*map(str, results.tracks.id.tolist()), *results.walls.name]
    columns: dict[str, object] = {
        "frame": np.repeat(np.arange(len(frames)), counts),
        "time": np.repeat(time, counts),
        "i": np.concatenate([results.tracks.id[f.contacts.i] for f in frames]),
        "j": [names[body] for f in frames for body in f.contacts.j.tolist()],
        "with_wall": np.concatenate([f.contacts.with_wall for f in frames]),
        "x": np.concatenate([f.contacts.point[:, 0] for f in frames]),
        "y": np.concatenate([f.contacts.point[:, 1] for f in frames]),
        "nx": np.concatenate([f.contacts.normal[:, 0] for f in frames]),
        "ny": np.concatenate([f.contacts.normal[:, 1] for f in frames]),
        "gap": np.concatenate([f.contacts.gap for f in frames]),
    }
    columns |= {name: np.concatenate([getattr(f, name) for f in frames]) for name in CONTACT_COLUMNS}
    columns["state"] = _names(ContactState, np.concatenate([f.state for f in frames]))
    columns["source"] = _names(ContactSource, np.concatenate([f.source for f in frames]))
    return columns


def _grains(results: Results) -> dict[str, object]:
    tracks = results.tracks
    f, n = tracks.frame_count, tracks.grain_count
    return {
        "frame": np.repeat(np.arange(f), n),
        "time": np.repeat(tracks.time, n),
        "id": np.tile(tracks.id, f),
        "radius": np.tile(tracks.radius, f),
        "x": tracks.position[:, :, 0].ravel(),
        "y": tracks.position[:, :, 1].ravel(),
        "theta": tracks.rotation.ravel(),
        "sigma": tracks.sigma.ravel(),
        "zncc": tracks.zncc.ravel(),
        "status": _names(TrackStatus, tracks.status.ravel()),
    }


def _frames(results: Results) -> dict[str, object]:
    frames, statistics = results.frames, results.statistics
    columns: dict[str, object] = {
        "frame": np.arange(len(frames)),
        "time": results.tracks.time,
        "status": [f.status.name.lower() for f in frames],
    }
    columns |= {name: [getattr(f, name) for f in frames] for name in FRAME_COLUMNS}
    for each in fields(FrameStatistics):
        values = np.array([getattr(s, each.name) for s in statistics])
        if values.ndim == 1:
            columns[each.name] = values
        elif each.name in ("stress", "fabric"):
            for row, a in enumerate("xy"):
                for column, b in enumerate("xy"):
                    columns[f"{each.name}_{a}{b}"] = values[:, row, column]
        elif each.name == "wall_force":
            for row, wall in enumerate(results.walls.name):
                for column, axis in enumerate("xy"):
                    columns[f"wall_force_{wall}_{axis}"] = values[:, row, column]
    return columns  # densities are not a value per frame: they can be made from the contacts


def _table(columns: dict[str, object]) -> pa.Table:
    arrays, schema = [], []
    for name, values in columns.items():
        array = _array(values)
        unit = "N" if name.startswith("wall_force_") else UNITS.get(name)
        arrays.append(array)
        schema.append(pa.field(name, array.type, metadata={"unit": unit} if unit else None))
    return pa.Table.from_arrays(arrays, schema=pa.schema(schema))


def _array(values: object) -> pa.Array:
    data = np.asarray(values)
    if data.dtype.kind == "f":
        return pa.array(data, mask=~np.isfinite(data))
    return pa.array(data.tolist() if data.dtype.kind in "OU" else data)


def _names(kind: type[IntEnum], values: np.ndarray) -> list[str]:
    names = {member.value: member.name.lower() for member in kind}
    return [names[value] for value in values.tolist()]
