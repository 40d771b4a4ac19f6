"""Finished frames of an unfinished run, one file each, so that an interruption costs one frame at most.

A file is written beside its final name and then renamed: it is there whole or not at all. The folder carries the
fingerprint of what the frames were computed from; another fingerprint finds it empty.
"""

from __future__ import annotations

import io
import shutil
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import MISSING, fields, is_dataclass
from enum import IntEnum
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, get_origin, get_type_hints

import numpy as np

from ..atomic import write_atomically

T = TypeVar("T")


class Checkpoint:
    """Frames of one stage of one run."""

    def __init__(self, folder: Path, fingerprint: str) -> None:
        self.folder = folder
        mark = folder / "fingerprint"
        if folder.exists() and (not mark.exists() or mark.read_text() != fingerprint):
            shutil.rmtree(folder)
        folder.mkdir(parents=True, exist_ok=True)
        if not mark.exists():
            write_atomically(mark, fingerprint.encode())

    def finished(self) -> int:
        """How many frames from the first on are there."""
        count = 0
        while self._file(count).exists():
            count += 1
        return count

    def save(self, frame: int, *values: Any) -> None:
        """Keep dataclasses of arrays and numbers."""
        stream = io.BytesIO()
        named = {f"{k}.{name}": array for k, value in enumerate(values) for name, array in flatten(value)}
        np.savez(stream, allow_pickle=False, **named)
        write_atomically(self._file(frame), stream.getvalue())

    def load(self, frame: int, *kinds: type) -> list[Any]:
        with np.load(self._file(frame), allow_pickle=False) as arrays:
            return [restore(kind, arrays, f"{k}.") for k, kind in enumerate(kinds)]

    def clear(self) -> None:
        """Remove the frames, and the folder above once no stage is left in it."""
        shutil.rmtree(self.folder, ignore_errors=True)
        with suppress(OSError):
            self.folder.parent.rmdir()

    def _file(self, frame: int) -> Path:
        return self.folder / f"{frame:06d}.npz"


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
