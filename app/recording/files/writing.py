"""A stream's bytes on their way to a file, which are written here: a disk that refuses them is an error like any other.

The SDK writes in a thread of its own, which a full disk ends; whoever flushes the stream afterwards may wait for ever.
It is given a pipe instead, which is read to its end whatever becomes of the file. A disk that neither takes bytes nor
refuses them has until a deadline.
"""

from __future__ import annotations

import errno
import os
import queue
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

DEADLINE = 60.0  # [s] in which some byte must reach the disk
PIECE = 1 << 20  # [bytes] that are read at once


@contextmanager
def writing(
    stream: rr.RecordingStream, file: Path, blueprint: rrb.Blueprint | None = None, *, indexed: bool = True
) -> Iterator[WrittenFile]:
    """Have a stream written to a file, which is whole when the block has ended; the stream is ended with it.

    indexed: with an index at its end, by which viewers read parts of it, and which grows in memory until then.
    Raises OSError where the disk refuses, or does nothing for DEADLINE seconds.
    """
    file.open("wb").close()  # refused here, if at all
    written = WrittenFile(file)
    if hasattr(os, "mkfifo"):
        with tempfile.TemporaryDirectory(prefix="rodsight-") as folder:
            pipe = Path(folder) / "recording.rrd"
            os.mkfifo(pipe)
            end = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)  # there is nobody yet to wait for
            os.set_blocking(end, True)
            held = os.open(pipe, os.O_WRONLY)  # until the stream has it: it writes before it is there
            try:
                written.fill_from(end)
                stream.save(pipe, default_blueprint=blueprint, write_footer=indexed)
            finally:
                os.close(held)
    else:  # pragma: no cover - Windows
        stream.save(file, default_blueprint=blueprint, write_footer=indexed)
    try:
        yield written
    finally:
        stream.disconnect()
        written.end()


class WrittenFile:
    """A file that is being written."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self._error: OSError | None = None
        self._waiting: queue.SimpleQueue[bytes] = queue.SimpleQueue()  # an empty piece is the last one
        self._taken = self._written = 0  # bytes
        self._moved = time.monotonic()  # when bytes last reached the file, or none were waiting
        self._threads: tuple[threading.Thread, ...] = ()

    @property
    def size(self) -> int:
        """Bytes that have reached the file."""
        return self._written if self._threads else self.file.stat().st_size

    def check(self) -> None:
        """Raise what the disk has said so far, or that it says nothing."""
        if self._error is not None:
            raise self._error
        if self._taken > self._written and time.monotonic() - self._moved > DEADLINE:
            raise OSError(errno.ETIMEDOUT, f"nothing could be written for {DEADLINE:g} s", str(self.file))

    def flush(self, stream: rr.RecordingStream) -> None:
        """Have all that was logged on its way to the disk."""
        stream.flush()
        self.check()

    def fill_from(self, end: int) -> None:
        """Write what comes out of a pipe until it ends; it is closed then."""
        works = ((self._take, (end,)), (self._put, ()))
        self._threads = tuple(threading.Thread(target=work, args=given, daemon=True) for work, given in works)
        for thread in self._threads:
            thread.start()

    def end(self) -> None:
        """Wait until all is in the file; raises OSError at the deadline."""
        for thread in self._threads:
            while thread.is_alive():
                thread.join(0.05 * DEADLINE)
                self.check()
        self.check()

    def _take(self, end: int) -> None:
        """Read a pipe to its end: the stream must not wait for a disk."""
        with open(end, "rb", buffering=0) as pipe:
            while piece := pipe.read(PIECE):
                if self._taken == self._written:
                    self._moved = time.monotonic()
                self._taken += len(piece)
                self._waiting.put(piece)
        self._waiting.put(b"")

    def _put(self) -> None:
        try:
            with self.file.open("wb", buffering=0) as target:
                while piece := self._waiting.get():
                    put(target.fileno(), piece)
                    self._written += len(piece)
                    self._moved = time.monotonic()
        except OSError as error:
            self._error = OSError(error.errno, error.strerror, str(self.file))


def put(file: int, content: bytes) -> None:
    """Write all of it; a disk may take less at once."""
    rest = memoryview(content)
    while rest:
        rest = rest[os.write(file, rest) :]
