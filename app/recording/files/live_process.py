"""A live recording in a process of its own, for which the solve does not wait.

Solved frames are sent through a pipe. The process ends with the pipe, whether the run is complete, interrupted or
killed: it closes the recording and ends its servers. Frames that are not yet sent wait in an unnamed file, not in
memory; the process holds one frame at a time.
"""

from __future__ import annotations

import os
import pickle
import queue
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from ...results.results import Results
from ...solver.frame_forces import FrameForces
from ...solver.statistics.frame_statistics import FrameStatistics
from .live import LiveRecording

NICENESS = 10  # added to that of the run; without effect where the system schedules whole sessions (autogroup)
CUT_SHORT = "The run ended before its last frame."
COMMAND = f"from {__name__} import serve; serve()"


class LiveProcess:
    """Sends a run to a LiveRecording in another process.

    Call `start`, then `frame` for every frame in order, and `close` in any case.

    Parameters
    ----------
    path : Path
        The recording.
    report : callable
        Called from another thread with sentences for the user: how to watch the run, and errors of the live view.
    **options
        Options of LiveRecording; they are sent through the pipe, as are the run and its frames.
    """

    def __init__(self, path: Path, report: Callable[[str], None], **options: Any) -> None:
        self.path = path
        self.started = False
        self._report, self._options = report, options
        self._queue = _MessageQueue()
        # Started now, as it needs a second, which has passed when the first frame is solved.
        self._process = subprocess.Popen(
            [sys.executable, "-c", COMMAND],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            start_new_session=True,  # an interrupt must reach the run only
        )
        self._threads = tuple(threading.Thread(target=task, daemon=True) for task in (self._send, self._receive))

    def start(self, run: Results) -> None:
        """Open server, file and viewer; `run` has bodies and motion, but no solved frames yet."""
        self.started = True
        self.path.unlink(missing_ok=True)  # of an earlier run
        for thread in self._threads:
            thread.start()
        self._queue.put(("start", (self.path, self._options, run)))

    def frame(self, forces: FrameForces, statistics: FrameStatistics) -> None:
        """Send one finished frame without waiting for it; if the disk is full, the live view ends."""
        try:
            self._queue.put(("frame", (forces, statistics)))
        except OSError as error:
            self._report(f"The live view ends here, without harm to the run: {error.strerror}.")
            self._queue.end()

    def close(self, *, complete: bool) -> None:
        """Wait until all frames are recorded and file, servers and page are closed.

        Parameters
        ----------
        complete : bool
            The run came to its end; the summary of the recording reports it otherwise.
        """
        if not self.started:  # nothing was opened
            self._queue.close()
            self._process.kill()
            self._process.communicate()
            return
        if complete:
            self._queue.put(("finish", ()))
        self._queue.end()
        for thread in self._threads:
            thread.join()
        self._queue.close()
        if self._process.wait():
            self._report("The live view broke off, without harm to the run.")

    def _send(self) -> None:
        assert self._process.stdin is not None
        with suppress(BrokenPipeError), self._process.stdin as pipe:  # the exit status reports a process that has ended
            while (message := self._queue.get()) is not None:
                pipe.write(message)
                pipe.flush()

    def _receive(self) -> None:
        assert self._process.stdout is not None
        with self._process.stdout as lines:
            for line in lines:
                self._report(line.decode().rstrip())


class _MessageQueue:
    """A queue of messages; those not yet sent are stored in a file."""

    def __init__(self) -> None:
        self._file = tempfile.TemporaryFile()  # noqa: SIM115 - until close
        self._places: queue.SimpleQueue[tuple[int, int] | None] = queue.SimpleQueue()
        self._lock, self._end = threading.Lock(), 0
        self._ended = False

    def put(self, message: tuple[str, Any]) -> None:
        """Append a message; raise OSError if the disk is full."""
        if self._ended:
            return
        content = pickle.dumps(message, pickle.HIGHEST_PROTOCOL)
        with self._lock:
            self._file.seek(self._end)
            self._file.write(content)
            self._file.flush()
            self._places.put((self._end, len(content)))
            self._end += len(content)

    def end(self) -> None:
        """End the queue after the messages so far."""
        if not self._ended:
            self._ended = True
            self._places.put(None)

    def close(self) -> None:
        """Delete the file."""
        self._file.close()

    def get(self) -> bytes | None:
        """Wait for the next message and return it; None after the last."""
        place = self._places.get()
        if place is None:
            return None
        start, size = place
        with self._lock:
            self._file.seek(start)
            return self._file.read(size)


def serve() -> None:
    """Record the messages of standard input until it ends: the main function of the process."""
    for number in (signal.SIGINT, signal.SIGTERM):
        # Only the end of the pipe ends the process. Not SIG_IGN, which the server of the page would inherit.
        signal.signal(number, lambda *_: None)
    if hasattr(os, "nice"):
        os.nice(NICENESS)
    live, complete = None, False
    try:
        while not complete:
            name, content = pickle.load(sys.stdin.buffer)
            if name == "start":
                path, options, run = content
                live = LiveRecording(path, **options)
                live.start(run)
                if live.hint:
                    print(live.hint, flush=True)
            elif live is not None and name == "frame":
                live.frame(*content)
            complete = name == "finish"
    except (EOFError, pickle.UnpicklingError):  # the run has ended, between two messages or within one
        pass
    finally:
        if live is not None:
            try:
                live.finish(() if complete else (CUT_SHORT,))
            finally:
                live.close()
            # The pipe has no reader if the run was killed.
            with suppress(BrokenPipeError):
                print(*live.notes, sep="\n", end="\n" if live.notes else "", flush=True)
