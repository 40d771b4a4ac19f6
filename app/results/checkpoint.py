"""Finished frames of an unfinished run, one file each, so that an interruption costs one frame at most.

A file is written under a temporary name and then renamed, so that it is complete. The folder holds the fingerprint of
the input and settings of its frames; it is emptied for another fingerprint. Every file begins with a checksum of its
content, its number and the fingerprint: a damaged file, or one of another run, ends the sequence of finished frames.
"""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import MISSING, fields, is_dataclass
from enum import IntEnum
from functools import cache, partial
from operator import itemgetter
from pathlib import Path
from types import UnionType
from typing import Any, NamedTuple, TypeVar, get_args, get_origin, get_type_hints

import numpy as np

from ..process.atomic import write_atomically
from ..process.errors import RunError
from .hdf5.lazy_sequences import CachedSequence, LazySequence
from .packed_arrays import pack, unpack

T = TypeVar("T")
CHECKSUM = 32  # bytes at the beginning of a file
FORMAT = "packed arrays"  # part of the checksum: files of an earlier version in another format are ignored
CACHE_SIZE = 1 << 25  # [bytes] of recent frames: friction and penalties read each again


class Checkpoint:
    """The finished frames of one stage of one run."""

    def __init__(
        self, folder: Path, fingerprint: str, notes: list[str] | None = None, *, read_only: bool = False
    ) -> None:
        """Open a folder of frames.

        Parameters
        ----------
        folder
            Folder of the files.
        fingerprint
            Hash of the input and settings of the frames; frames of another fingerprint are removed.
        notes
            List that receives a sentence about each damaged frame.
        read_only
            Change nothing, because another process writes the frames.
        """
        self.folder, self._fingerprint = folder, fingerprint
        self._notes = notes if notes is not None else []
        self._sound: dict[int, tuple[int, int]] = {}  # size and time of files whose checksum was found right
        if read_only:
            return
        mark = folder / "fingerprint"
        if folder.exists() and (not mark.exists() or mark.read_bytes() != fingerprint.encode()):
            shutil.rmtree(folder)
        folder.mkdir(parents=True, exist_ok=True)
        if not mark.exists():
            write_atomically(mark, fingerprint.encode())

    def finished(self, seen: int = 0) -> int:
        """Return the number of complete frames from the first on; seen: number already known to be complete."""
        count = seen
        while self._file(count).exists():
            if self._content(count) is None:
                self._notes.append(
                    f"Frame {count} of the unfinished {self.folder.name} is damaged: it is computed again."
                )
                break
            count += 1
        return count

    def save(self, frame: int, *values: Any) -> None:
        """Store dataclasses of arrays and numbers as one frame."""
        content = pack({f"{k}.{name}": array for k, value in enumerate(values) for name, array in flatten(value)})
        write_atomically(self._file(frame), self._checksum(frame, content), *content)

    def load(self, frame: int, *kinds: type) -> list[Any]:
        """Return the dataclasses of a frame. Raises RunError where the frame is damaged."""
        content = self._content(frame)
        if content is None:
            raise RunError(f"{self._file(frame)}: was damaged during the run; run the same command again")
        arrays = unpack(content, tuple(f"{k}." for k in range(len(kinds))))
        return [restore(kind, arrays, f"{k}.") for k, kind in enumerate(kinds)]

    def has(self, frame: int) -> bool:
        """Whether a frame is stored."""
        return self._file(frame).exists()

    def find(self, frame: int, kind: type[T]) -> T | None:
        """Return the first dataclass of a frame; None where the frame is missing or damaged."""
        content = self._content(frame) if self.has(frame) else None
        return None if content is None else restore(kind, unpack(content, ("0.",)), "0.")

    def lazy_sequences(self, count: int, *kinds: type) -> tuple[LazySequence[Any], ...]:
        """Return the first `count` frames as one sequence per kind, read on access."""

        def make(frame: int) -> tuple[list[Any], int]:
            found = self.load(frame, *kinds)
            return found, sum(array.nbytes for each in found for _, array in flatten(each))

        loaded = CachedSequence(count, make, itemgetter(1), CACHE_SIZE)
        return tuple(LazySequence(count, lambda frame, at=at: loaded[frame][0][at]) for at in range(len(kinds)))

    def drop(self, first: int) -> None:
        """Remove the frames from this one on."""
        for piece in sorted(self.folder.glob("*.piece"), reverse=True):  # last first: an interruption leaves no gap
            if int(piece.stem) >= first:
                piece.unlink()

    def clear(self) -> None:
        """Remove the frames, and the parent folder if no stage is left in it."""
        shutil.rmtree(self.folder, ignore_errors=True)
        with suppress(OSError):
            self.folder.parent.rmdir()

    def _content(self, frame: int) -> memoryview | None:
        """Return the content of a frame; None if its checksum is wrong. An unchanged file is checked once."""
        path = self._file(frame)
        stat, whole = path.stat(), memoryview(path.read_bytes())
        content, state = whole[CHECKSUM:], (stat.st_size, stat.st_mtime_ns)
        if self._sound.get(frame) != state:
            if whole[:CHECKSUM] != self._checksum(frame, [content]):
                return None
            self._sound[frame] = state
        return content

    def _checksum(self, frame: int, content: Sequence[bytes | memoryview]) -> bytes:
        found = hashlib.sha256(f"{FORMAT} {self._fingerprint} {frame} ".encode())
        for part in content:
            found.update(part)
        return found.digest()

    def _file(self, frame: int) -> Path:
        return self.folder / f"{frame:06d}.piece"


def flatten(value: Any, prefix: str = "") -> list[tuple[str, np.ndarray]]:
    """Return every array of a dataclass with its name, nested ones as outer.inner."""
    result = []
    for name in type(value).__dataclass_fields__:
        part = getattr(value, name)
        if hasattr(type(part), "__dataclass_fields__"):
            result += flatten(part, f"{prefix}{name}.")
        elif part is not None:
            result.append((f"{prefix}{name}", np.asarray(part)))
    return result


def restore(kind: type[T], named: Mapping[str, Any], prefix: str) -> T:
    """Return the dataclass of the arrays that `flatten` named; missing fields get their default or None."""
    values: dict[str, Any] = {}
    for each in _fields_of(kind):
        name = f"{prefix}{each.name}"
        if each.nested is not None:
            values[each.name] = restore(each.nested, named, f"{name}.")
        elif name in named:
            value = named[name]
            values[each.name] = value if each.convert is None or value is None else each.convert(value)
        elif each.required:
            values[each.name] = None
    return kind(**values)


class _Field(NamedTuple):
    """One field of a dataclass, and how its stored array becomes its value."""

    name: str
    nested: type | None  # a dataclass
    convert: Callable[[Any], Any] | None  # None: an array stays one
    required: bool  # it has no default


@cache
def _fields_of(kind: type) -> tuple[_Field, ...]:
    hints = get_type_hints(kind)
    return tuple(
        _Field(
            each.name,
            hints[each.name] if is_dataclass(hints[each.name]) else None,
            _converter(hints[each.name]),
            each.default is MISSING and each.default_factory is MISSING,
        )
        for each in fields(kind)
    )


def _converter(hint: Any) -> Callable[[Any], Any] | None:
    """What makes a value of this type of its stored array; None: it is an array."""
    if isinstance(hint, UnionType):  # such as tuple[str, ...] | None
        hint = next((each for each in get_args(hint) if get_origin(each) is tuple), hint)
    if get_origin(hint) is tuple:
        return lambda value: tuple(np.asarray(value).tolist())
    if hint not in (int, float, bool, str) and not (isinstance(hint, type) and issubclass(hint, IntEnum)):
        return None
    return partial(_number_of, hint)


def _number_of(kind: type, value: Any) -> Any:
    value = np.asarray(value)[()]
    if kind is int and value != value:
        return float("nan")  # the number was not stored
    return kind(value)
