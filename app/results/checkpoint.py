"""Finished frames of an unfinished run, one file each, so that an interruption costs one frame at most.

A file is written beside its final name and then renamed: it is there whole or not at all. The folder carries the
fingerprint of what the frames were computed from; another fingerprint finds it empty. Every file begins with a checksum
of itself, its number and that fingerprint: one that is damaged, or of another run, is not there, nor is any after it.
"""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import MISSING, fields, is_dataclass
from enum import IntEnum
from functools import cache
from pathlib import Path
from types import UnionType
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

import numpy as np

from ..atomic import write_atomically
from ..errors import RunError
from .hdf5.lazy import Lazily, Remembered
from .packed_arrays import pack, unpack

T = TypeVar("T")
CHECKSUM = 32  # bytes at the beginning of a file
FORMAT = "packed arrays"  # part of the checksum: what an earlier version left in another form is not there
ROOM = 1 << 26  # [bytes] for frames that were read last: friction, doubts and two passes of storing ask for each again


class Checkpoint:
    """Frames of one stage of one run."""

    def __init__(
        self, folder: Path, fingerprint: str, notes: list[str] | None = None, *, looks_on: bool = False
    ) -> None:
        """notes: where a sentence goes about what is damaged; looks_on: another process fills it, none is changed."""
        self.folder, self._fingerprint = folder, fingerprint
        self._notes = notes if notes is not None else []
        if looks_on:
            return
        mark = folder / "fingerprint"
        if folder.exists() and (not mark.exists() or mark.read_bytes() != fingerprint.encode()):
            shutil.rmtree(folder)
        folder.mkdir(parents=True, exist_ok=True)
        if not mark.exists():
            write_atomically(mark, fingerprint.encode())

    def finished(self, seen: int = 0) -> int:
        """How many frames from the first on are there, whole; seen: so many are known to be."""
        count = seen
        while self._file(count).exists():
            if self._content(count) is None:
                self._notes.append(f"Frame {count} of the unfinished {self.folder.name} is damaged: it is done again.")
                break
            count += 1
        return count

    def save(self, frame: int, *values: Any) -> None:
        """Keep dataclasses of arrays and numbers."""
        content = pack({f"{k}.{name}": array for k, value in enumerate(values) for name, array in flatten(value)})
        write_atomically(self._file(frame), self._checksum(frame, content) + content)

    def load(self, frame: int, *kinds: type) -> list[Any]:
        content = self._content(frame)
        if content is None:
            raise RunError(f"{self._file(frame)}: was damaged meanwhile; the same command does it again")
        arrays = unpack(content)
        return [restore(kind, arrays, f"{k}.") for k, kind in enumerate(kinds)]

    def has(self, frame: int) -> bool:
        """Whether something was kept of a frame."""
        return self._file(frame).exists()

    def find(self, frame: int, kind: type[T]) -> T | None:
        """What was kept of one frame; None where nothing is, or nothing whole."""
        content = self._content(frame) if self.has(frame) else None
        return None if content is None else restore(kind, unpack(content), "0.")

    def lazily(self, count: int, *kinds: type) -> tuple[Lazily[Any], ...]:
        """The first frames, read whenever they are asked for: a sequence for each kind."""
        loaded = Remembered(count, lambda frame: self.load(frame, *kinds), _bytes_of, ROOM)
        return tuple(Lazily(count, lambda frame, at=at: loaded[frame][at]) for at in range(len(kinds)))

    def drop(self, first: int) -> None:
        """Remove the frames from this one on."""
        for piece in sorted(self.folder.glob("*.piece"), reverse=True):  # the last first: what is left has no hole
            if int(piece.stem) >= first:
                piece.unlink()

    def clear(self) -> None:
        """Remove the frames, and the folder above once no stage is left in it."""
        shutil.rmtree(self.folder, ignore_errors=True)
        with suppress(OSError):
            self.folder.parent.rmdir()

    def _content(self, frame: int) -> bytes | None:
        """What was kept of a frame; None if that is not what is there."""
        whole = self._file(frame).read_bytes()
        content = whole[CHECKSUM:]
        return content if whole[:CHECKSUM] == self._checksum(frame, content) else None

    def _checksum(self, frame: int, content: bytes) -> bytes:
        found = hashlib.sha256(f"{FORMAT} {self._fingerprint} {frame} ".encode())
        found.update(content)
        return found.digest()

    def _file(self, frame: int) -> Path:
        return self.folder / f"{frame:06d}.piece"


def flatten(value: Any, prefix: str = "") -> list[tuple[str, np.ndarray]]:
    """Name every array of a dataclass, nested ones as outer.inner."""
    result = []
    for each in fields(value):
        part = getattr(value, each.name)
        if is_dataclass(part):
            result += flatten(part, f"{prefix}{each.name}.")
        elif part is not None:
            result.append((f"{prefix}{each.name}", np.asarray(part)))
    return result


def _bytes_of(values: list[Any]) -> int:
    return sum(array.nbytes for value in values for _, array in flatten(value))


def restore(kind: type[T], named: Mapping[str, Any], prefix: str) -> T:
    """Make the dataclass again from what `flatten` named; what has no name gets its default, or None."""
    hints = _hints(kind)
    values: dict[str, Any] = {}
    for each in fields(kind):  # type: ignore[arg-type]
        hint, name = hints[each.name], f"{prefix}{each.name}"
        if is_dataclass(hint):
            values[each.name] = restore(hint, named, f"{name}.")  # type: ignore[arg-type]
        elif name in named:
            values[each.name] = _typed(hint, named[name])
        elif each.default is MISSING and each.default_factory is MISSING:
            values[each.name] = None
    return kind(**values)


def _typed(hint: Any, value: Any) -> Any:
    if value is None:
        return None
    if isinstance(hint, UnionType):  # such as tuple[str, ...] | None
        hint = next((each for each in get_args(hint) if get_origin(each) is tuple), hint)
    if get_origin(hint) is tuple:
        return tuple(np.asarray(value).tolist())
    if hint not in (int, float, bool, str) and not (isinstance(hint, type) and issubclass(hint, IntEnum)):
        return value
    value = np.asarray(value)[()]
    if hint is int and value != value:
        return float("nan")  # a number that was not stored
    return hint(value)


@cache
def _hints(kind: type) -> dict[str, Any]:
    return get_type_hints(kind)
