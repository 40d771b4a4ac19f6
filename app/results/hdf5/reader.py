"""The columns of a stored file, of any version of the schema, and the objects that they were.

What a file lacks is absent: the value that its field declares. What it cannot do without, and what has another shape
than the rest, is an InputError that names the dataset.
"""

from __future__ import annotations

import threading
import weakref
from collections import OrderedDict
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from ...errors import InputError
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
from .lazy import Lazily

MOST_KEPT = 4  # frames that were read last
KEPT = ("kept_sweep", "kept_force")  # dimensions of sweeps whose forces are kept
CACHE = 1 << 16  # [bytes] of decompressed values that are kept of each dataset


class Stored:
    """A file that is being read."""

    def __init__(self, file: Path, store: h5py.File) -> None:
        self.file, self._store = file, store
        self._forgotten: set[str] = set()
        self._found: dict[str, h5py.Dataset | None] | None = None  # once nothing changes any more
        self._sizes = self._find_sizes()

    def part(self, part: str) -> Any:
        """One of PARTS of which there is one in the file, None if nothing of it is there."""
        here = entries(part)
        if all(self._find(each) is None for each in here if each.path.startswith(part)):
            return None
        return restore(PARTS[part], {each.attribute: self.read(each) for each in here}, "")

    def need(self, part: str) -> Any:
        """Likewise, but it has to be there."""
        whole = self.part(part)
        if whole is None:
            raise InputError(self.file, f"group {part}", "is missing")
        return whole

    def frames(self, grain_count: int, wall_count: int) -> StoredFrames:
        """The forces of every frame, each read when it is asked for; all columns are checked now."""
        rows = self._rows_of_frames()
        for each in entries("frames"):
            dataset = self._dataset(each)
            if dataset is not None and each.quantity.names is not None:
                self._renumbered(each, dataset, np.asarray(dataset[()]))
        bodies = {"contacts.grain_count": grain_count, "contacts.wall_count": wall_count}
        return StoredFrames(self._opened_again(), rows, bodies, self._sizes["frame"])

    def frame(self, k: int, rows: _Rows, bodies: dict[str, int]) -> Any:
        """The forces of one frame."""
        own = {each.attribute: rows.shaped(k, each, self._part(each, rows.of(k, each))) for each in entries("frames")}
        count = bodies["contacts.grain_count"]
        for name, known in (("i", count), ("j", count + bodies["contacts.wall_count"])):
            body = own[f"contacts.{name}"]
            if len(body) and not (body.min() >= 0 and body.max() < known):
                raise InputError(self.file, f"dataset contacts/{name}", f"names a body beyond {known} in frame {k}")
        return restore(PARTS["frames"], own | bodies | {"frame": k}, "")

    def statistics(self) -> Sequence[Any]:
        """The statistics of every frame, each made when it is asked for of columns that are read now."""
        columns = {each.attribute: self.read(each) for each in entries("statistics")}

        def statistics_of(k: int) -> Any:
            own = {name: None if values is None else values[k] for name, values in columns.items()}
            return restore(PARTS["statistics"], own, "")

        return Lazily(self._sizes["frame"], statistics_of)

    def read(self, entry: Entry) -> Any:
        """All values of a dataset; where there is none, what stands for absent ones."""
        return self._part(entry, slice(None))

    def _part(self, entry: Entry, rows: slice) -> Any:
        """Some rows of a dataset; where there is none, what stands for absent ones."""
        dataset = self._dataset(entry)
        if dataset is None:
            return self._absent(entry, rows)
        part = rows if entry.dims else ()
        if entry.dtype.kind == "O":
            return self._texts(entry, dataset, part)
        values = np.asarray(dataset[part])
        if entry.quantity.names is not None:
            values = self._renumbered(entry, dataset, values)
        return values.astype(entry.dtype, copy=False)[()]

    def _dataset(self, entry: Entry) -> h5py.Dataset | None:
        """What the file has of it, of the right shape and kind; None: nothing. Raises InputError."""
        if self._found is not None and entry.path in self._found:
            return self._found[entry.path]
        dataset = self._checked(entry)
        if self._found is not None:
            self._found[entry.path] = dataset
        return dataset

    def _checked(self, entry: Entry) -> h5py.Dataset | None:
        dataset = self._find(entry)
        if dataset is None or self._forgotten.intersection(entry.dims):
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

    def _opened_again(self) -> Stored:
        """The same by a handle of its own, which is closed once nobody holds it; a file put in its place is another."""
        again = copy(self)
        stream = self.file.open("rb")
        again._store = store = h5py.File(stream, "r", rdcc_nbytes=CACHE)
        again._found = {}

        def close() -> None:
            store.close()
            stream.close()

        weakref.finalize(again, close)
        return again

    def _rows_of_frames(self) -> _Rows:
        """Without all that says which sweep is which, no sweep was measured; likewise of those that are kept."""
        contact, count, sweep, number, kept = (self._ascending(each) for each in ROWS)
        nothing = np.zeros_like(contact)
        if count is None or sweep is None or number is None:
            count, sweep, number = nothing[1:], nothing, nothing[:0]
            self._forget("sweep")
        if kept is None or any(self._find(each) is None for each in entries("frames") if each.dims[0] in KEPT):
            kept = nothing
            self._forget(*KEPT)
        if np.any(number >= np.repeat(count, np.diff(sweep))):
            raise self._error(SWEEP_NUMBER, f"names a sweep beyond those of {SWEEP_COUNT.path}")
        force = np.concatenate([[0], np.cumsum(np.diff(kept) * np.diff(contact))])
        self._sizes["kept_force"] = int(force[-1])
        return _Rows(contact, count, sweep, number, kept, force)

    def _ascending(self, entry: Entry) -> Any:
        values = self.read(entry)
        if values is None or entry.dims != ("frame_edge",):
            return values
        if values[0] != 0 or np.any(np.diff(values) < 0):
            raise self._error(entry, "does not ascend from 0")
        return values

    def _forget(self, *dims: str) -> None:
        """Take what has these dimensions for absent, and empty."""
        self._sizes |= dict.fromkeys(dims, 0)
        self._forgotten |= set(dims)

    def _find_sizes(self) -> dict[str, int]:
        """Of every dimension: of frames, grains, walls and contacts by what names them, of others by what is there."""
        sizes = {name: len(told.labels) for name, told in DIMENSIONS.items() if told.labels is not None}
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
            if path is not None and self._lies_in_the_file(path):
                dataset = self._store.get(path)
                if isinstance(dataset, h5py.Dataset):
                    if dataset.external or dataset.is_virtual:
                        raise self._error(entry, "keeps its values in another file, which is not opened")
                    return dataset
        return None

    def _lies_in_the_file(self, path: str) -> bool:
        """Whether there is something by this name; raises InputError where it is a link, which may lead anywhere."""
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
        unknown = value.dtype.kind == "f" and entry.dtype.kind in "iu"  # NaN in place of whole numbers
        first, *rest = (self._sizes.get(name, 0) for name in entry.dims)
        shape = (len(range(*rows.indices(first))), *rest)
        return np.full(shape, value, value.dtype if unknown else entry.dtype)

    def _texts(self, entry: Entry, dataset: h5py.Dataset, part: Any) -> Any:
        return dataset.asstr()[part]

    def _renumbered(self, entry: Entry, dataset: h5py.Dataset, values: np.ndarray) -> np.ndarray:
        """The numbers that we use for the names that the file has."""
        ours = {member.name.lower(): member.value for member in entry.quantity.names or ()}
        theirs: dict[str, int] = h5py.check_enum_dtype(dataset.dtype) or ours
        named = {number: name for name, number in theirs.items()}
        found = np.unique(values).tolist()
        unknown = [named.get(number, number) for number in found if named.get(number) not in ours]
        if unknown:
            raise self._error(entry, f"holds {unknown[0]}, which this version does not know")
        renumbered = values.copy()
        for number in found:
            renumbered[values == number] = ours[named[number]]
        return renumbered

    def _error(self, entry: Entry, problem: str) -> InputError:
        return InputError(self.file, f"dataset {entry.path}", problem)


def _by_path(*paths: str) -> list[Entry]:
    return [each for each in entries() if each.path in paths]


@dataclass(frozen=True, slots=True)
class _Rows:
    """Which rows of what lies end to end are a frame's."""

    contact: np.ndarray  # (f + 1,)
    sweep_count: np.ndarray  # (f,) sweeps done
    sweep: np.ndarray  # (f + 1,) rows of those that were measured
    number: np.ndarray  # which they are, from 0
    kept: np.ndarray  # (f + 1,) rows of sweeps whose forces are kept
    force: np.ndarray  # (f + 1,) rows of their forces

    def of(self, k: int, entry: Entry) -> slice:
        """Which rows of a column are frame k's."""
        edges = {
            "contact": self.contact, "sweep": self.sweep, "kept_sweep": self.kept, "kept_force": self.force,
        }.get(entry.dims[0])  # fmt: skip
        return slice(k, k + 1) if edges is None else slice(int(edges[k]), int(edges[k + 1]))

    def shaped(self, k: int, entry: Entry, values: Any) -> Any:
        """Those rows as a frame has them: one for every sweep, NaN where nothing was measured."""
        if values is None:
            return None
        if entry.dims[0] == "sweep":
            every = np.full(self.sweep_count[k], np.nan)
            every[self.number[self.sweep[k] : self.sweep[k + 1]]] = values
            return every
        if entry.dims[0] == "kept_force":
            return values.reshape(self.kept[k + 1] - self.kept[k], self.contact[k + 1] - self.contact[k])
        return values if entry.dims[0] in ("contact", "kept_sweep") else values[0]


class StoredFrames(Lazily[Any]):
    """The forces of every frame of a file; a few that were read last are kept."""

    def __init__(self, stored: Stored, rows: _Rows, bodies: dict[str, int], count: int) -> None:
        super().__init__(count, self._find)
        self._stored, self._rows, self._bodies = stored, rows, bodies
        self._kept: OrderedDict[int, Any] = OrderedDict()
        self._lock = threading.Lock()

    def _find(self, k: int) -> Any:
        with self._lock:
            if k not in self._kept:
                self._kept[k] = self._read(k)
            self._kept.move_to_end(k)
            while len(self._kept) > MOST_KEPT:
                self._kept.popitem(last=False)
            return self._kept[k]

    def _read(self, k: int) -> Any:
        try:
            return self._stored.frame(k, self._rows, self._bodies)
        except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:
            raise InputError(self._stored.file, f"frame {k}", f"is damaged: {error}") from None
