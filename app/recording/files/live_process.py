"""A live recording in a process of its own: the solve does not wait for its pictures.

What is solved goes there through a pipe. The process ends when the pipe does, be it that the run is over, interrupted
or killed: it closes the recording and ends its servers. Frames that wait for their turn do so in a file without a name,
so that waiting takes no memory; over there is one frame at a time.
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

from solver.sequence.frame_forces import FrameForces
from solver.statistics.frame_statistics import FrameStatistics

from ...results.results import Results
from .live import LiveRecording

NICENESS = 10  # added to that of the run; a system that weighs whole sessions (autogroup) pays no heed to it
CUT_SHORT = "The run ended before its last frame."
COMMAND = f"from {__name__} import serve; serve()"


class LiveProcess:
    """Hands a run to a LiveRecording elsewhere. Call start, frame for every frame in order, then close in any case.

    tell: is given sentences for the user as they come, from another thread: how to watch, what went wrong.
    options: of LiveRecording; they go through the pipe, as do the run and its frames.
    """

    def __init__(self, path: Path, tell: Callable[[str], None], **options: Any) -> None:
        self.path = path
        self.started = False
        self._tell, self._options = tell, options
        self._waiting = _Waiting()
        # It takes a second to get ready, which is over when there is something to solve.
        self._process = subprocess.Popen(
            [sys.executable, "-c", COMMAND],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            start_new_session=True,  # an interrupt is meant for the run
        )
        self._threads = tuple(threading.Thread(target=work, daemon=True) for work in (self._feed, self._listen))

    def start(self, run: Results) -> None:
        """Open server, file and viewer; `run` has bodies and motion, its frames are still to come."""
        self.started = True
        self.path.unlink(missing_ok=True)  # of a former run
        for thread in self._threads:
            thread.start()
        self._waiting.put(("start", (self.path, self._options, run)))

    def frame(self, forces: FrameForces, statistics: FrameStatistics) -> None:
        """Have one finished frame recorded, and do not wait for it; where there is no room for it, the view ends."""
        try:
            self._waiting.put(("frame", (forces, statistics)))
        except OSError as error:
            self._tell(f"The live view ends here, without harm to the run: {error.strerror}.")
            self._waiting.end()

    def close(self, *, whole: bool) -> None:
        """Wait for what is still to be recorded, and for the end of file, servers and page.

        whole: whether the run came to its end, which the summary says.
        """
        if not self.started:  # it has opened nothing yet
            self._waiting.close()
            self._process.kill()
            self._process.communicate()
            return
        if whole:
            self._waiting.put(("finish", ()))
        self._waiting.end()
        for thread in self._threads:
            thread.join()
        self._waiting.close()
        if self._process.wait():
            self._tell("The live view broke off, without harm to the run.")

    def _feed(self) -> None:
        assert self._process.stdin is not None
        with suppress(BrokenPipeError), self._process.stdin as pipe:  # who hears no more says so by how it ended
            while (message := self._waiting.get()) is not None:
                pipe.write(message)
                pipe.flush()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        with self._process.stdout as lines:
            for line in lines:
                self._tell(line.decode().rstrip())


class _Waiting:
    """Messages on their way, in order; those that wait are in a file."""

    def __init__(self) -> None:
        self._file = tempfile.TemporaryFile()  # noqa: SIM115 - until close
        self._places: queue.SimpleQueue[tuple[int, int] | None] = queue.SimpleQueue()
        self._lock, self._end = threading.Lock(), 0
        self._ended = False

    def put(self, message: tuple[str, Any]) -> None:
        """Raises OSError where the disk has no room."""
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
        """Nothing comes any more."""
        if not self._ended:
            self._ended = True
            self._places.put(None)

    def close(self) -> None:
        self._file.close()

    def get(self) -> bytes | None:
        """The next message, which is waited for; None: there is none any more."""
        place = self._places.get()
        if place is None:
            return None
        start, size = place
        with self._lock:
            self._file.seek(start)
            return self._file.read(size)


def serve() -> None:
    """What the process does: record what comes through standard input until it ends."""
    for number in (signal.SIGINT, signal.SIGTERM):
        # The pipe alone says when to end. Not SIG_IGN, which the page's server would inherit.
        signal.signal(number, lambda *_: None)
    if hasattr(os, "nice"):
        os.nice(NICENESS)
    live, whole = None, False
    try:
        while not whole:
            name, given = pickle.load(sys.stdin.buffer)
            if name == "start":
                path, options, run = given
                live = LiveRecording(path, **options)
                live.start(run)
                if live.hint:
                    print(live.hint, flush=True)
            elif live is not None and name == "frame":
                live.frame(*given)
            whole = name == "finish"
    except (EOFError, pickle.UnpicklingError):  # between two messages, or amidst one: the run is no more
        pass
    finally:
        if live is not None:
            try:
                live.finish(() if whole else (CUT_SHORT,))
            finally:
                live.close()
            # Nobody listens any more where the run was killed.
            with suppress(BrokenPipeError):
                print(*live.notes, sep="\n", end="\n" if live.notes else "", flush=True)
