"""Writes the bytes of a stream to a file, so that an error of the disk is raised in the calling thread.

The SDK writes in a thread of its own, which a full disk ends; a later flush of the stream may then wait for ever. The
stream writes to a pipe instead, which is read to its end even if the file fails. If the disk neither accepts nor
refuses bytes, an error is raised at a deadline.
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

DEADLINE = 60.0  # [s] without a byte written after which the disk has failed
PIECE_SIZE = 1 << 20  # [bytes] of one read


@contextmanager
def writing(stream: rr.RecordingStream, file: Path, blueprint: rrb.Blueprint | None = None) -> Iterator[WrittenFile]:
    """Write a stream to a file, which is complete at the end of the block; the stream is disconnected then.

    Parameters
    ----------
    stream : RecordingStream
        The stream.
    file : Path
        The file.
    blueprint : Blueprint, optional
        The blueprint stored in the file.

    Yields
    ------
    WrittenFile
        The file, to be flushed and checked.

    Raises
    ------
    OSError
        If the disk refuses a write, or nothing is written for DEADLINE seconds.
    """
    file.open("wb").close()  # a folder that cannot be written to raises here
    written = WrittenFile(file)
    if hasattr(os, "mkfifo"):
        with tempfile.TemporaryDirectory(prefix="rodsight-") as folder:
            pipe = Path(folder) / "recording.rrd"
            os.mkfifo(pipe)
            end = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)  # non-blocking, as there is no writer yet
            os.set_blocking(end, True)
            held = os.open(pipe, os.O_WRONLY)  # keeps the pipe open until the stream has opened it
            try:
                written.read_pipe(end)
                stream.save(pipe, default_blueprint=blueprint)
            finally:
                os.close(held)
    else:  # pragma: no cover - Windows
        stream.save(file, default_blueprint=blueprint)
    try:
        yield written
    finally:
        stream.disconnect()
        written.end()


class WrittenFile:
    """A file that is written by a thread."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self._error: OSError | None = None
        self._queue: queue.SimpleQueue[bytes] = queue.SimpleQueue()  # ends with an empty piece
        self._received = self._written = 0  # [bytes]
        self._progress_time = time.monotonic()  # when bytes were last written, or the queue was empty
        self._threads: tuple[threading.Thread, ...] = ()

    @property
    def size(self) -> int:
        """Bytes written to the file."""
        return self._written if self._threads else self.file.stat().st_size

    def check(self) -> None:
        """Raise OSError if a write has failed, or if nothing has been written for DEADLINE seconds."""
        if self._error is not None:
            raise self._error
        if self._received > self._written and time.monotonic() - self._progress_time > DEADLINE:
            raise OSError(errno.ETIMEDOUT, f"nothing could be written for {DEADLINE:g} s", str(self.file))

    def flush(self, stream: rr.RecordingStream) -> None:
        """Send all logged data to the file and check it."""
        stream.flush()
        self.check()

    def read_pipe(self, end: int) -> None:
        """Start to write the content of a pipe, up to its end; the pipe is closed then."""
        tasks = ((self._receive, (end,)), (self._write, ()))
        self._threads = tuple(threading.Thread(target=task, args=args, daemon=True) for task, args in tasks)
        for thread in self._threads:
            thread.start()

    def end(self) -> None:
        """Wait until all bytes are written; raise OSError at the deadline."""
        for thread in self._threads:
            while thread.is_alive():
                thread.join(0.05 * DEADLINE)
                self.check()
        self.check()

    def _receive(self, end: int) -> None:
        """Read a pipe to its end: the stream must not wait for the disk."""
        with open(end, "rb", buffering=0) as pipe:
            while piece := pipe.read(PIECE_SIZE):
                if self._received == self._written:
                    self._progress_time = time.monotonic()
                self._received += len(piece)
                self._queue.put(piece)
        self._queue.put(b"")

    def _write(self) -> None:
        try:
            with self.file.open("wb", buffering=0) as target:
                while piece := self._queue.get():
                    write_all(target.fileno(), piece)
                    self._written += len(piece)
                    self._progress_time = time.monotonic()
        except OSError as error:
            self._error = OSError(error.errno, error.strerror, str(self.file))


def write_all(file: int, content: bytes) -> None:
    """Write bytes to a file descriptor, in several writes where the system accepts fewer at once."""
    rest = memoryview(content)
    while rest:
        rest = rest[os.write(file, rest) :]
