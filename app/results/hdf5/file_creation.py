"""Create HDF5 files and report disk errors: the HDF5 library fails badly on an error while it closes a file."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import h5py

CACHE = 1 << 16  # [bytes] of uncompressed values per dataset
CACHED_BLOCKS = 7  # slots of that cache per dataset; HDF5 2 makes 8191 of them, which take 64 kB, whatever it holds


@contextmanager
def create_file(file: Path) -> Iterator[h5py.File]:
    """Create an HDF5 file. Raises the OSError of a failed write, with the file's name."""
    with file.open("w+b", buffering=0) as target:
        stream = _ErrorKeepingStream(target)
        try:
            with h5py.File(stream, "w", rdcc_nbytes=CACHE, rdcc_nslots=CACHED_BLOCKS) as store:
                yield store
        except (OSError, RuntimeError, KeyError, ValueError):  # errors of the library that follow a failed write
            stream.check(file)
            raise
        stream.check(file)


class _ErrorKeepingStream(io.RawIOBase):
    """Stream that keeps the first write error and ignores all later writes.

    An error raised inside a write would leave the library in an inconsistent state and be raised again by every object
    it closes.
    """

    def __init__(self, target: BinaryIO) -> None:
        self._target = target
        self._error: OSError | None = None

    def check(self, file: Path) -> None:
        if self._error is not None:
            raise OSError(self._error.errno, self._error.strerror, str(file)) from None

    def write(self, content: bytes | memoryview) -> int:  # type: ignore[override]
        rest = memoryview(content).cast("B")
        size = len(rest)
        try:
            while rest and self._error is None:
                rest = rest[self._target.write(rest) :]
        except OSError as error:
            self._error = error
        return size

    def readinto(self, buffer: bytearray | memoryview) -> int:  # type: ignore[override]
        wanted = memoryview(buffer).cast("B")
        content = self._target.read(len(wanted)) or b""
        wanted[:] = content.ljust(len(wanted), b"\0")  # ignored writes read as zeros
        return len(wanted)

    def seek(self, offset: int, whence: int = 0, /) -> int:
        return self._target.seek(offset, whence)

    def truncate(self, size: int | None = None, /) -> int:
        try:
            return self._target.truncate(size)
        except OSError as error:
            self._error = self._error or error
            return 0

    def flush(self) -> None:
        pass

    def readable(self) -> bool:
        return True

    def writable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True
