"""Read the columns of a stored file, of any version of the schema, back into objects.

A missing dataset gets the value that its field declares for it. A missing essential dataset, or one of a wrong shape,
raises an InputError that names the dataset.
"""

from __future__ import annotations

import threading
import weakref
from collections import OrderedDict
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from ...process.errors import InputError
from ...tracks import held_once
from ..checkpoint import restore
from ..schema import (
    CONTACT_OFFSET,
    DIMENSIONS,
    KEPT_OFFSET,
    PARTS,
    ROWS,
    SWEEP_COUNT,
    SWEEP_NUMBER,
    SWEEP_OFFSET,
    Entry,
    entries,
)
from .file_creation import CACHED_BLOCKS
from .lazy_sequences import LazySequence

CACHED_FRAMES = 4  # most recent frames
EVERY = slice(None)  # row
BLOCK = 64  # frames whose statistics are read, or whose numbers of sweeps are checked, at once
OF_POSES = ("frame", "grain")  # dimensions of columns that are often one value, such as a given precision
KEPT = ("kept_sweep", "kept_force")  # dimensions of sweeps with stored forces
CACHE = 1 << 15  # [bytes] of cached decompressed values per dataset: one block, as they are written
INDEX = 1 << 16  # [bytes] of cached places of blocks, as the library counts them


class StoredRun:
    """An open file of a run."""

    def __init__(self, file: Path, store: h5py.File) -> None:
        self.file, self._store = file, store
        self._absent_dims: set[str] = set()
        self._found: dict[str, h5py.Dataset | None] | None = None  # filled once the file is checked
        self._sizes = self._find_sizes()

    def part(self, part: str, frames: slice = EVERY) -> Any:
        """Return one of PARTS that occurs once in the file, None if the file has no dataset of it.

        frames: rows of the columns of frames that are read.
        """
        here = entries(part)
        if all(self._find(each) is None for each in here if each.path.startswith(part)):
            return None
        rows = {each: frames if each.dims[:1] == ("frame",) else EVERY for each in here}
        return restore(PARTS[part], {each.attribute: self.part_of(each, rows[each]) for each in here}, "")

    def require(self, part: str) -> Any:
        """Return one of PARTS. Raises InputError where it is missing."""
        whole = self.part(part)
        if whole is None:
            raise InputError(self.file, f"group {part}", "is missing")
        return whole

    def deferred(self, part: str) -> StoredPart:
        """Check one of PARTS, and return its reader."""
        for each in entries(part):
            self._dataset(each)
        return StoredPart(self._reopened(), part)

    def frames(self, grain_count: int, wall_count: int) -> StoredFrames:
        """Return the forces of every frame, read on access; all columns are checked at once."""
        rows = self._rows_of_frames()
        for each in entries("frames"):
            dataset = self._dataset(each)
            if dataset is not None and each.quantity.names is not None:
                self._map_enumeration(each, dataset, np.asarray(dataset[()]))
        bodies = {"contacts.grain_count": grain_count, "contacts.wall_count": wall_count}
        return StoredFrames(self._reopened(), rows, bodies, self._sizes["frame"])

    def frame(self, k: int, rows: _FrameRows, bodies: dict[str, int]) -> Any:
        """Read the forces of one frame."""
        number = self.part_of(SWEEP_NUMBER, rows.of(k, SWEEP_NUMBER))
        own = {
            each.attribute: rows.shaped(k, each, self.part_of(each, rows.of(k, each)), number)
            for each in entries("frames")
        }  # fmt: skip
        count = bodies["contacts.grain_count"]
        for name, known in (("i", count), ("j", count + bodies["contacts.wall_count"])):
            body = own[f"contacts.{name}"]
            if len(body) and not (body.min() >= 0 and body.max() < known):
                raise InputError(self.file, f"dataset contacts/{name}", f"names a body beyond {known} in frame {k}")
        return restore(PARTS["frames"], own | bodies | {"frame": k}, "")

    def statistics(self) -> Sequence[Any]:
        """Return the statistics of every frame, read a block at a time on access; all columns are checked at once."""
        for each in entries("statistics"):
            self._dataset(each)
        return StoredStatistics(self._reopened(cache=0), self._sizes["frame"])  # its blocks are read once each

    def read(self, entry: Entry) -> Any:
        """Read all values of a dataset, or its declared value where the dataset is absent."""
        return self.part_of(entry, EVERY)

    def part_of(self, entry: Entry, rows: slice) -> Any:
        """Read some rows of a dataset, or its declared value where the dataset is absent."""
        dataset = self._dataset(entry)
        if dataset is None:
            return self._absent(entry, rows)
        part = rows if entry.dims else ()
        if entry.dtype.kind == "O":
            return self._texts(entry, dataset, part)
        values = np.asarray(dataset[part])
        if entry.quantity.names is not None:
            values = self._map_enumeration(entry, dataset, values)
        values = values.astype(entry.dtype, copy=False)
        return held_once(values) if entry.dims == OF_POSES else values[()]

    def _dataset(self, entry: Entry) -> h5py.Dataset | None:
        """Return the dataset after checking shape and type; None where it is absent. Raises InputError."""
        if self._found is not None and entry.path in self._found:
            return self._found[entry.path]
        dataset = self._checked(entry)
        if self._found is not None:
            self._found[entry.path] = dataset
        return dataset

    def _checked(self, entry: Entry) -> h5py.Dataset | None:
        dataset = self._find(entry)
        if dataset is None or self._absent_dims.intersection(entry.dims):
            if entry.quantity.essential:
                raise self._error(entry, "is missing")
            return None
        shape = tuple(self._sizes.get(name, 0) for name in entry.dims)
        if dataset.shape != shape:
            raise self._error(entry, f"has shape {dataset.shape}, not {shape} ({', '.join(entry.dims)})")
        if entry.dtype.kind != "O" and not np.can_cast(dataset.dtype, entry.dtype, "same_kind"):
            raise self._error(entry, f"holds {dataset.dtype}, not {entry.dtype}")
        if entry.dtype.kind == "O" and h5py.check_string_dtype(dataset.dtype) is None:
            raise self._error(entry, f"holds {dataset.dtype}, not text")
        return dataset

    def _reopened(self, cache: int = CACHE) -> StoredRun:
        """Return a copy with its own file handle, closed with the last reference; a replaced file is not read.

        cache: bytes of decompressed values that are kept per dataset.
        """
        again = copy(self)
        stream = self.file.open("rb")
        again._store = store = h5py.File(stream, "r", rdcc_nbytes=cache, rdcc_nslots=CACHED_BLOCKS)
        _limit_index(store)
        again._found = {}

        def close() -> None:
            store.close()
            stream.close()

        weakref.finalize(again, close)
        return again

    def _rows_of_frames(self) -> _FrameRows:
        """Return the rows of each frame; sweeps are absent where one of their offsets is missing."""
        contact, count, sweep, kept = (self._ascending(each) for each in ROWS if each is not SWEEP_NUMBER)
        empty = np.zeros_like(contact)
        if count is None or sweep is None or self._dataset(SWEEP_NUMBER) is None:
            count, sweep = empty[1:], empty
            self._treat_as_absent("sweep")
        for k in range(0, len(count), BLOCK):  # together they are longer than all tracks
            edges = sweep[k : k + BLOCK + 1]
            number = self.part_of(SWEEP_NUMBER, slice(int(edges[0]), int(edges[-1])))
            if number is not None and np.any(number >= np.repeat(count[k : k + BLOCK], np.diff(edges))):
                raise self._error(SWEEP_NUMBER, f"names a sweep beyond those of {SWEEP_COUNT.path}")
        if kept is None or any(self._find(each) is None for each in entries("frames") if each.dims[0] in KEPT):
            kept = empty
            self._treat_as_absent(*KEPT)
        force = np.concatenate([[0], np.cumsum(np.diff(kept) * np.diff(contact))])
        self._sizes["kept_force"] = int(force[-1])
        return _FrameRows(contact, count, sweep, kept, force)

    def _ascending(self, entry: Entry) -> Any:
        values = self.read(entry)
        if values is None or entry.dims != ("frame_edge",):
            return values
        if values[0] != 0 or np.any(np.diff(values) < 0):
            raise self._error(entry, "does not ascend from 0")
        return values

    def _treat_as_absent(self, *dims: str) -> None:
        """Treat datasets with these dimensions as absent and empty."""
        self._sizes |= dict.fromkeys(dims, 0)
        self._absent_dims |= set(dims)

    def _find_sizes(self) -> dict[str, int]:
        """Return the size of every dimension, of frames, grains, walls and contacts by the dataset that labels them."""
        sizes = {name: len(each.labels) for name, each in DIMENSIONS.items() if each.labels is not None}
        for each in (*_by_path("frames/time", "grains/id", "walls/name"), *ROWS, *entries()):
            dataset = self._find(each)
            if dataset is not None and len(dataset.shape) == len(each.dims):
                for name, size in zip(each.dims, dataset.shape, strict=True):
                    sizes.setdefault(name, size)
        if "frame" in sizes:
            sizes["frame_edge"] = sizes["frame"] + 1
        for edges, rows in ((CONTACT_OFFSET, "contact"), (SWEEP_OFFSET, "sweep"), (KEPT_OFFSET, "kept_sweep")):
            dataset = self._find(edges)
            if dataset is not None and dataset.shape == (sizes.get("frame_edge"),):
                sizes[rows] = int(dataset[-1])
        return sizes

    def _find(self, entry: Entry) -> h5py.Dataset | None:
        for path in (entry.path, entry.quantity.formerly):
            if path is not None and self._has_object(path):
                dataset = self._store.get(path)
                if isinstance(dataset, h5py.Dataset):
                    if dataset.external or dataset.is_virtual:
                        raise self._error(entry, "keeps its values in another file, which is not opened")
                    return dataset
        return None

    def _has_object(self, path: str) -> bool:
        """Whether the file has an object of this name. Raises InputError for a link, which may point to any file."""
        place = ""
        for part in path.split("/"):
            place = f"{place}/{part}"
            link = self._store.get(place, getlink=True)
            if link is None:
                return False
            if not isinstance(link, h5py.HardLink):
                raise InputError(self.file, place.removeprefix("/"), "is a link, which is not followed")
        return True

    def _absent(self, entry: Entry, rows: slice) -> Any:
        if entry.absent is None or not entry.dims:
            return entry.absent
        value = np.asarray(entry.absent)
        unknown = value.dtype.kind == "f" and entry.dtype.kind in "iu"  # NaN instead of whole numbers
        first, *rest = (self._sizes.get(name, 0) for name in entry.dims)
        shape = (len(range(*rows.indices(first))), *rest)
        return np.full(shape, value, value.dtype if unknown else entry.dtype)

    def _texts(self, entry: Entry, dataset: h5py.Dataset, part: Any) -> Any:
        return dataset.asstr()[part]

    def _map_enumeration(self, entry: Entry, dataset: h5py.Dataset, values: np.ndarray) -> np.ndarray:
        """Convert the file's enumeration to ours by the names of its values."""
        own = {member.name.lower(): member.value for member in entry.quantity.names or ()}
        stored: dict[str, int] = h5py.check_enum_dtype(dataset.dtype) or own
        named = {number: name for name, number in stored.items()}
        found = np.unique(values).tolist()
        unknown = [named.get(number, number) for number in found if named.get(number) not in own]
        if unknown:
            raise self._error(entry, f"holds {unknown[0]}, which is unknown to this version")
        converted = values.copy()
        for number in found:
            converted[values == number] = own[named[number]]
        return converted

    def _error(self, entry: Entry, problem: str) -> InputError:
        return InputError(self.file, f"dataset {entry.path}", problem)


def _limit_index(store: h5py.File) -> None:
    """Limit what the library keeps of the places of blocks, which takes ten times the memory that it counts."""
    settings = store.id.get_mdc_config()
    settings.set_initial_size = True
    settings.initial_size = settings.min_size = settings.max_size = INDEX
    store.id.set_mdc_config(settings)


def _by_path(*paths: str) -> list[Entry]:
    return [each for each in entries() if each.path in paths]


@dataclass(frozen=True, slots=True)
class _FrameRows:
    """The rows of each frame in the columns of a run."""

    contact: np.ndarray  # (f + 1,)
    sweep_count: np.ndarray  # (f,) number of sweeps
    sweep: np.ndarray  # (f + 1,) rows of measured sweeps
    kept: np.ndarray  # (f + 1,) rows of sweeps with stored forces
    force: np.ndarray  # (f + 1,) rows of their forces

    def of(self, k: int, entry: Entry) -> slice:
        """Return the rows of frame k in a column."""
        edges = {
            "contact": self.contact, "sweep": self.sweep, "kept_sweep": self.kept, "kept_force": self.force,
        }.get(entry.dims[0])  # fmt: skip
        return slice(k, k + 1) if edges is None else slice(int(edges[k]), int(edges[k + 1]))

    def shaped(self, k: int, entry: Entry, values: Any, number: np.ndarray) -> Any:
        """Return rows in the shape of a frame's field: one value per sweep, NaN where it was not measured.

        number: indices of the measured sweeps, from 0.
        """
        if values is None:
            return None
        if entry.dims[0] == "sweep":
            every = np.full(self.sweep_count[k], np.nan)
            every[number] = values
            return every
        if entry.dims[0] == "kept_force":
            return values.reshape(self.kept[k + 1] - self.kept[k], self.contact[k + 1] - self.contact[k])
        return values if entry.dims[0] in ("contact", "kept_sweep") else values[0]


class StoredPart:
    """Reads a part of a file on every call; None if the file has no dataset of it."""

    def __init__(self, stored: StoredRun, part: str) -> None:
        self._stored, self._part = stored, part

    def __call__(self) -> Any:
        return self.of_frames(EVERY)

    def of_frames(self, frames: slice) -> Any:
        try:
            return self._stored.part(self._part, frames)
        except (OSError, RuntimeError) as error:
            raise InputError(self._stored.file, f"group {self._part}", f"is damaged: {error}") from None

    def __reduce__(self) -> tuple[Any, ...]:
        return partial, (copy, self())  # another process cannot read it


class StoredFrames(LazySequence[Any]):
    """The forces of every frame of a file, with a cache of the most recent frames."""

    def __init__(self, stored: StoredRun, rows: _FrameRows, bodies: dict[str, int], count: int) -> None:
        super().__init__(count, partial(_read_frame, stored, rows, bodies))
        self._kept: OrderedDict[int, Any] = OrderedDict()
        self._lock = threading.Lock()

    def _item(self, k: int) -> Any:
        with self._lock:
            if k not in self._kept:
                self._kept[k] = self._make(k)
            self._kept.move_to_end(k)
            while len(self._kept) > CACHED_FRAMES:
                self._kept.popitem(last=False)
            return self._kept[k]


class StoredStatistics(LazySequence[Any]):
    """The statistics of every frame of a file, of which a block is in memory."""

    def __init__(self, stored: StoredRun, count: int) -> None:
        super().__init__(count, partial(_read_statistics, stored, count))
        self._block: tuple[int, dict[str, Any]] = (-1, {})  # its first frame, and its columns
        self._lock = threading.Lock()

    def _item(self, k: int) -> Any:
        with self._lock:
            first = k - k % BLOCK
            if first != self._block[0]:
                self._block = first, self._make(first)
            columns = self._block[1]
        own = {name: None if values is None else values[k - first] for name, values in columns.items()}
        return restore(PARTS["statistics"], own, "")


def _read_statistics(stored: StoredRun, count: int, first: int) -> dict[str, Any]:
    """Read the columns of a block."""
    try:
        rows = slice(first, min(first + BLOCK, count))
        return {each.attribute: stored.part_of(each, rows) for each in entries("statistics")}
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:
        raise InputError(stored.file, "group statistics", f"is damaged: {error}") from None


def _read_frame(stored: StoredRun, rows: _FrameRows, bodies: dict[str, int], k: int) -> Any:
    try:
        return stored.frame(k, rows, bodies)
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:
        raise InputError(stored.file, f"frame {k}", f"is damaged: {error}") from None
