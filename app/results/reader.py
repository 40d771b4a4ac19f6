"""The columns of a stored file, of any version of the schema, and the objects that they were.

What a file lacks is absent: the value that its field declares. What it cannot do without, and what has another shape
than the rest, is an InputError that names the dataset.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from ..errors import InputError
from .checkpoint import restore
from .schema import (
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

KEPT = ("kept_sweep", "kept_force")  # dimensions of sweeps whose forces are kept


class Stored:
    """A file that is being read."""

    def __init__(self, file: Path, store: h5py.File) -> None:
        self.file, self._store = file, store
        self._forgotten: set[str] = set()
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

    def frames(self, grain_count: int, wall_count: int) -> list[Any]:
        """The forces of every frame."""
        rows = self._rows_of_frames()
        columns = {each.attribute: (each, self.read(each)) for each in entries("frames")}
        bodies = {"contacts.grain_count": grain_count, "contacts.wall_count": wall_count}
        frames = []
        for k in range(self._sizes["frame"]):
            own = {name: rows.take(k, each.dims, values) for name, (each, values) in columns.items()}
            frames.append(restore(PARTS["frames"], own | bodies | {"frame": k}, ""))
        return frames

    def statistics(self) -> list[Any]:
        """The statistics of every frame."""
        columns = {each.attribute: self.read(each) for each in entries("statistics")}
        return [
            restore(PARTS["statistics"], {name: values[k] for name, values in columns.items()}, "")
            for k in range(self._sizes["frame"])
        ]

    def read(self, entry: Entry) -> Any:
        """All values of a dataset; where there is none, what stands for absent ones."""
        dataset = self._find(entry)
        if dataset is None or self._forgotten.intersection(entry.dims):
            if entry.quantity.essential:
                raise self._error(entry, "is missing")
            return self._absent(entry)
        shape = tuple(self._sizes.get(name, 0) for name in entry.dims)
        if dataset.shape != shape:
            raise self._error(entry, f"has shape {dataset.shape}, not {shape} ({', '.join(entry.dims)})")
        if entry.dtype.kind == "O":
            return self._texts(entry, dataset)
        if not np.can_cast(dataset.dtype, entry.dtype, "same_kind"):
            raise self._error(entry, f"holds {dataset.dtype}, not {entry.dtype}")
        values = np.asarray(dataset[()])
        if entry.quantity.names is not None:
            values = self._renumbered(entry, dataset, values)
        return values.astype(entry.dtype, copy=False)[()]

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
            if path is not None and isinstance(dataset := self._store.get(path), h5py.Dataset):
                return dataset
        return None

    def _absent(self, entry: Entry) -> Any:
        if entry.absent is None or not entry.dims:
            return entry.absent
        value = np.asarray(entry.absent)
        unknown = value.dtype.kind == "f" and entry.dtype.kind in "iu"  # NaN in place of whole numbers
        shape = tuple(self._sizes.get(name, 0) for name in entry.dims)
        return np.full(shape, value, value.dtype if unknown else entry.dtype)

    def _texts(self, entry: Entry, dataset: h5py.Dataset) -> Any:
        if h5py.check_string_dtype(dataset.dtype) is None:
            raise self._error(entry, f"holds {dataset.dtype}, not text")
        return dataset.asstr()[()]

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

    def take(self, k: int, dims: tuple[str, ...], values: Any) -> Any:
        """What of a column is frame k's; a row for every sweep, NaN where nothing was measured."""
        if values is None:
            return None
        if dims[0] == "contact":
            return values[self.contact[k] : self.contact[k + 1]]
        if dims[0] == "sweep":
            rows = slice(self.sweep[k], self.sweep[k + 1])
            every = np.full(self.sweep_count[k], np.nan)
            every[self.number[rows]] = values[rows]
            return every
        if dims[0] == "kept_sweep":
            return values[self.kept[k] : self.kept[k + 1]]
        if dims[0] == "kept_force":
            shape = (self.kept[k + 1] - self.kept[k], self.contact[k + 1] - self.contact[k])
            return values[self.force[k] : self.force[k + 1]].reshape(shape)
        return values[k]
