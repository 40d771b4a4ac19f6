"""Results laid out as the columns of the schema, and written as HDF5 with labelled dimensions.

Every dimension is an HDF5 dimension scale at the root of the file, as netCDF has them: xarray opens the file with the
names and labels of its dimensions.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import h5py
import numpy as np

from solver.bodies.quantity import columns
from solver.nlgs.sweep_record import SweepHistory
from solver.sequence.frame_forces import FrameForces

from .checkpoint import flatten
from .results import Results
from .schema import (
    CONTACT_OFFSET,
    DIMENSIONS,
    KEPT_OFFSET,
    PER_FRAME,
    SWEEP_COUNT,
    SWEEP_NUMBER,
    SWEEP_OFFSET,
    Entry,
    entries,
)

Columns = dict[str, np.ndarray]  # by path

COMPRESSED = 1024  # [bytes] and more: an index of compressed blocks takes twice as much
NO_LABELS = "This is a netCDF dimension but not a netCDF variable. {:10d}"  # what netCDF calls such a dimension


def columns_of(part: str, whole: Any) -> Columns:
    """What one object holds; nothing if it is None."""
    if whole is None:
        return {}
    named = dict(flatten(whole))
    return {each.path: named[each.attribute] for each in entries(part) if each.attribute in named}


def columns_of_results(results: Results) -> Columns:
    """Everything that results hold."""
    columns = {}
    for part in ("tracks", "walls", "grains", "calibration", "boundary", "friction_check", "radius_tuning"):
        columns |= columns_of(part, getattr(results, part))
    for part in PER_FRAME:
        columns |= _over_frames(part, getattr(results, part))
    return columns | _rows(results.frames)


def _over_frames(part: str, frames: Sequence[Any]) -> Columns:
    """What every frame has (where one lacks it, none has it), laid end to end or stacked."""
    named = [dict(flatten(frame)) for frame in frames]
    laid: Columns = {}
    for each in entries(part):
        if not all(each.attribute in frame for frame in named):
            continue
        values = [frame[each.attribute] for frame in named]
        if each.dims == ("sweep",):
            values = [value[_measured(frame.history)] for value, frame in zip(values, frames, strict=True)]
        if each.dims == ("kept_force",):
            values = [value.ravel() for value in values]
        column = np.stack(values) if each.dims[0] == "frame" else np.concatenate(values)
        if column.dtype.kind != "f" or each.dtype.kind == "f":
            laid[each.path] = column
        elif np.isfinite(column).all():  # NaN in place of whole numbers: an earlier version did not store them
            laid[each.path] = column.astype(each.dtype)
    return laid


def _rows(frames: Sequence[FrameForces]) -> Columns:
    """Which rows belong to which frame, and which sweeps were measured."""
    histories = [frame.history for frame in frames]
    measured = [_measured(history) for history in histories]
    return {
        CONTACT_OFFSET.path: _offset(frame.contacts.count for frame in frames),
        SWEEP_COUNT.path: np.array([history.count for history in histories], np.int64),
        SWEEP_OFFSET.path: _offset(map(len, measured)),
        SWEEP_NUMBER.path: np.concatenate(measured).astype(np.int64),
        KEPT_OFFSET.path: _offset(len(history.recorded) for history in histories),
    }


def _measured(history: SweepHistory) -> np.ndarray:
    """Sweeps of a frame, from 0, whose residuals were measured."""
    rows = np.stack([getattr(history, name) for name in columns(SweepHistory, "sweep")])
    return np.flatnonzero(~np.isnan(rows).all(axis=0))


def _offset(counts: Iterable[int]) -> np.ndarray:
    return np.concatenate([[0], np.cumsum(list(counts))]).astype(np.int64)


def write_columns(store: h5py.File, columns: Columns) -> None:
    """Write the columns with their dimensions, units and meaning; raises ValueError where their sizes disagree."""
    written = [each for each in entries() if each.path in columns]
    sizes: dict[str, int] = {}
    for each in written:
        shape = columns[each.path].shape
        agreed = tuple(sizes.setdefault(name, size) for name, size in zip(each.dims, shape, strict=False))
        if len(shape) != len(each.dims) or shape != agreed:
            raise ValueError(f"{each.path} has shape {shape}; its dimensions are {each.dims} {agreed}")
    for name, size in sizes.items():
        _write_scale(store, name, size, columns)
    for each in written:
        dataset = _write_dataset(store, each, columns[each.path])
        for axis, name in enumerate(each.dims):
            dataset.dims[axis].label = name
            dataset.dims[axis].attach_scale(store[name])


def _write_scale(store: h5py.File, name: str, size: int, columns: Columns) -> None:
    dimension = DIMENSIONS[name]
    labels = columns.get(dimension.labelled_by, dimension.labels)
    if name == "frame":
        labels = np.arange(size)
    if labels is None:
        scale = store.create_dataset(name, (size,), np.float32)  # never filled: takes no room
        scale.make_scale(NO_LABELS.format(size))
    else:
        labels = np.asarray(labels)
        text = labels.dtype.kind in "OU"
        scale = store.create_dataset(name, data=labels.astype(object) if text else labels,
                                     dtype=h5py.string_dtype() if text else None)  # fmt: skip
        scale.make_scale(name)
    scale.attrs["long_name"] = dimension.meaning


def _write_dataset(store: h5py.File, entry: Entry, values: np.ndarray) -> h5py.Dataset:
    quantity = entry.quantity
    kind: Any = entry.dtype
    if quantity.names is not None:
        kind = h5py.enum_dtype({member.name.lower(): member.value for member in quantity.names}, basetype=np.uint8)
    elif entry.dtype.kind == "O":
        kind = h5py.string_dtype()
    data = values.astype(entry.dtype)  # an integer where an enumeration was given
    small = values.nbytes < COMPRESSED or entry.dtype.kind == "O"
    options: dict[str, Any] = {} if small else {"compression": "gzip", "compression_opts": 4, "shuffle": True}
    dataset = store.create_dataset(entry.path, data=data, dtype=kind, **options)
    dataset.attrs["long_name"] = quantity.meaning  # as netCDF's conventions and xarray call it
    if quantity.unit:
        dataset.attrs["unit"] = dataset.attrs["units"] = quantity.unit
    if quantity.names is not None:
        dataset.attrs["flag_values"] = np.array([member.value for member in quantity.names], np.uint8)
        dataset.attrs["flag_meanings"] = " ".join(member.name.lower() for member in quantity.names)
    return dataset
