"""Convert results to the columns of the schema, and write them as HDF5 with labelled dimensions.

Every dimension is an HDF5 dimension scale at the root of the file, as in netCDF: xarray opens the file with the names
and labels of its dimensions. Columns of frames are written frame after frame, in blocks of one size.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import h5py
import numpy as np
from isal import isal_zlib

from ..checkpoint import flatten
from ..results import Results
from ..schema import DIMENSIONS, PARTS, PER_FRAME, Entry, entries
from .frame_pieces import Columns, Shapes, measure_extents, rows_of_frame

STRONGLY = ("kept_force",)  # dimensions of the largest datasets
STRONG, QUICK = 3, 1  # levels of compression
MIN_COMPRESSED = 1024  # [bytes]: smaller datasets would double by the index of their compressed blocks
BLOCK = 1 << 15  # [bytes] of a compressed block, and of the rows in memory before it is written
TEXTS = 256  # number of texts in memory before they are written
NO_LABELS = "This is a netCDF dimension but not a netCDF variable. {:10d}"  # netCDF's name of such a dimension


def columns_of(part: str, whole: Any) -> Columns:
    """Return the columns of one object; none if it is None."""
    if whole is None:
        return {}
    named = dict(flatten(whole))
    return {each.path: named[each.attribute] for each in entries(part) if each.attribute in named}


def columns_of_results(results: Results) -> Columns:
    """Return all columns of results in memory, for tables of all frames."""
    pieces = list(_pieces(results))
    extents = measure_extents(pieces)
    of_frames = {
        each.path: np.concatenate([_as_stored(each, piece[each.path]) for piece in pieces])
        for each in entries()
        if each.path in extents.shape
    }
    return _columns_of_run(results) | extents.rows | of_frames


def write_results(store: h5py.File, results: Results) -> None:
    """Write all results. Frames are read twice, one after the other, and are never all in memory.

    Raises ValueError where sizes disagree.
    """
    extents = measure_extents(_pieces(results, exact=True))
    whole = _columns_of_run(results) | extents.rows
    _write_scales(store, _shapes(whole) | extents.shape, whole)
    _write_whole(store, whole)
    shape = extents.shape
    writers = [_BlockWriter(store, each, shape[each.path]) for each in entries() if each.path in shape]
    for piece in _pieces(results):
        for writer in writers:
            writer.add(piece)
    for writer in writers:
        writer.end()


def write_columns(store: h5py.File, columns: Columns) -> None:
    """Write columns with their dimensions, units and meaning. Raises ValueError where their sizes disagree."""
    _write_scales(store, _shapes(columns), columns)
    _write_whole(store, columns)


class _BlockWriter:
    """Writer of a dataset from its first row on, in whole blocks."""

    def __init__(self, store: h5py.File, entry: Entry, shape: tuple[int, ...]) -> None:
        self._entry, self._dataset = entry, _make_dataset(store, entry, shape)
        self._block = self._dataset.chunks[0] if self._dataset.chunks else TEXTS
        self._pending: list[np.ndarray] = []
        self._count = self._written = 0  # pending and written rows

    def add(self, piece: Columns) -> None:
        rows = _as_stored(self._entry, piece[self._entry.path])
        self._pending.append(rows)
        self._count += len(rows)
        if self._count >= self._block:
            self._write(self._count - self._count % self._block)

    def end(self) -> None:
        if self._count:
            self._write(self._count)

    def _write(self, count: int) -> None:
        rows = np.concatenate(self._pending)
        _write_rows(self._entry, self._dataset, self._written, rows[:count])
        self._pending, self._count = [rows[count:].copy()], len(rows) - count
        self._written += count


def _columns_of_run(results: Results) -> Columns:
    """Return the columns of a run that are not per frame."""
    columns: Columns = {}
    for part in PARTS:
        if part not in PER_FRAME:
            columns |= columns_of(part, getattr(results, part))
    return columns


def _pieces(results: Results, *, exact: bool = False) -> Iterator[Columns]:
    for forces, statistics in zip(results.frames, results.statistics, strict=True):
        yield rows_of_frame(forces, statistics, exact=exact)


def _as_stored(entry: Entry, values: np.ndarray) -> np.ndarray:
    return values.astype(entry.dtype, copy=False)  # enumerations become integers


def _shapes(columns: Columns) -> Shapes:
    return {path: values.shape for path, values in columns.items()}


def _write_scales(store: h5py.File, shapes: Shapes, columns: Columns) -> None:
    """Write the dimensions of all columns, after checking that their sizes agree."""
    sizes: dict[str, int] = {}
    for each in entries():
        if each.path in shapes:
            shape = shapes[each.path]
            agreed = tuple(sizes.setdefault(name, size) for name, size in zip(each.dims, shape, strict=False))
            if len(shape) != len(each.dims) or shape != agreed:
                raise ValueError(f"{each.path} has shape {shape}; its dimensions are {each.dims} {agreed}")
    for name, size in sizes.items():
        _write_scale(store, name, size, columns)


def _write_whole(store: h5py.File, columns: Columns) -> None:
    for each in entries():
        if each.path in columns:
            rows = _as_stored(each, columns[each.path])
            _write_rows(each, _make_dataset(store, each, rows.shape), 0, rows)


def _write_rows(entry: Entry, dataset: h5py.Dataset, first: int, rows: np.ndarray) -> None:
    """Write rows from a number on, which is a multiple of the rows of a block where the dataset is compressed.

    A seventh of the time of HDF5's own deflate, whose form it has: blocks are shuffled and compressed before HDF5
    stores them.
    """
    chunks = dataset.chunks
    if chunks is None:
        dataset[slice(first, first + len(rows)) if rows.ndim else ()] = rows
        return
    level, size = STRONG if entry.dims == STRONGLY else QUICK, chunks[0]
    for start in range(0, len(rows), size):
        block = np.zeros(chunks, rows.dtype)  # the last one is stored whole, too
        block[: len(rows) - start] = rows[start : start + size]
        shuffled = block.reshape(-1).view(np.uint8).reshape(-1, block.itemsize).T.tobytes()
        dataset.id.write_direct_chunk((first + start,) + (0,) * (block.ndim - 1), isal_zlib.compress(shuffled, level))


def _write_scale(store: h5py.File, name: str, size: int, columns: Mapping[str, np.ndarray]) -> None:
    dimension = DIMENSIONS[name]
    labels = columns.get(dimension.labelled_by, dimension.labels)
    if name == "frame":
        labels = np.arange(size)
    if labels is None:
        scale = store.create_dataset(name, (size,), np.float32)  # never filled: takes no space
        scale.make_scale(NO_LABELS.format(size))
    else:
        labels = np.asarray(labels)
        text = labels.dtype.kind in "OU"
        scale = store.create_dataset(name, data=labels.astype(object) if text else labels,
                                     dtype=h5py.string_dtype() if text else None)  # fmt: skip
        scale.make_scale(name)
    scale.attrs["long_name"] = dimension.meaning


def _make_dataset(store: h5py.File, entry: Entry, shape: tuple[int, ...]) -> h5py.Dataset:
    """Create an empty dataset with its dimensions, unit and meaning."""
    quantity = entry.quantity
    kind: Any = entry.dtype
    if quantity.names is not None:
        kind = h5py.enum_dtype({member.name.lower(): member.value for member in quantity.names}, basetype=np.uint8)
    elif entry.dtype.kind == "O":
        kind = h5py.string_dtype()
    options: dict[str, Any] = {}
    size = int(np.prod(shape)) * entry.dtype.itemsize
    if size >= MIN_COMPRESSED and entry.dtype.kind != "O":
        rows = max(min(BLOCK * shape[0] // size, shape[0]), 1)
        options = {"chunks": (rows, *shape[1:]), "compression": "gzip", "compression_opts": QUICK, "shuffle": True}
    dataset = store.create_dataset(entry.path, shape, kind, **options)
    for axis, name in enumerate(entry.dims):
        dataset.dims[axis].label = name
        dataset.dims[axis].attach_scale(store[name])
    dataset.attrs["long_name"] = quantity.meaning  # the name in netCDF's conventions and xarray
    if quantity.unit:
        dataset.attrs["unit"] = dataset.attrs["units"] = quantity.unit
    if quantity.names is not None:
        dataset.attrs["flag_values"] = np.array([member.value for member in quantity.names], np.uint8)
        dataset.attrs["flag_meanings"] = " ".join(member.name.lower() for member in quantity.names)
    return dataset
