"""A file under HDF5 that may refuse a write: its library breaks down where a disk refuses what it closes."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import h5py

CACHE = 1 << 16  # [bytes] of values that wait to be compressed, of each dataset


@contextmanager
def created(file: Path) -> Iterator[h5py.File]:
    """Make an HDF5 file; raises the OSError of the disk, with the file's name, where it refuses."""
    with file.open("w+b", buffering=0) as target:
        stream = _Refusable(target)
        try:
            with h5py.File(stream, "w", rdcc_nbytes=CACHE) as store:
                yield store
        except (OSError, RuntimeError, KeyError, ValueError):  # what the library makes of it
            stream.check(file)
            raise
        stream.check(file)


class _Refusable(io.RawIOBase):
    """Keeps what the disk says first, and swallows all that comes after it.

    Raised here, it would leave the library in the midst of its work, and come out of every object that it lets go.
    """

    def __init__(self, target: BinaryIO) -> None:
        self._target = target
        self._refused: OSError | None = None

    def check(self, file: Path) -> None:
        if self._refused is not None:
            raise OSError(self._refused.errno, self._refused.strerror, str(file)) from None

    def write(self, content: bytes | memoryview) -> int:  # type: ignore[override]
        rest = memoryview(content).cast("B")
        size = len(rest)
        try:
            while rest and self._refused is None:
                rest = rest[self._target.write(rest) :]
        except OSError as error:
            self._refused = error
        return size

    def readinto(self, buffer: bytearray | memoryview) -> int:  # type: ignore[override]
        wanted = memoryview(buffer).cast("B")
        content = self._target.read(len(wanted)) or b""
        wanted[:] = content.ljust(len(wanted), b"\0")  # of what was swallowed there is nothing
        return len(wanted)

    def seek(self, offset: int, whence: int = 0, /) -> int:
        return self._target.seek(offset, whence)

    def truncate(self, size: int | None = None, /) -> int:
        try:
            return self._target.truncate(size)
        except OSError as error:
            self._refused = self._refused or error
            return 0

    def flush(self) -> None:
        pass

    def readable(self) -> bool:
        return True

    def writable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True
