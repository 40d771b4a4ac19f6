"""One run as a child process: what it is at, how long it will take, what it says; paused by asking it to end.

A run that is asked to end keeps its finished frames, and the same command goes on there: pausing costs a frame at most,
and holds no memory.
"""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any

from ...run_folder import UNFINISHED

PROGRAM = (sys.executable, "-c", "from rodsight.cli.main import main; main()")
LINES = 200  # that are kept of what it says
INTERRUPTED = (130, 143)  # exit statuses of a run that was asked to end
# Stages in order, as a person calls them.
STAGES = {
    "detection": "rods found", "walls": "walls followed", "tracking": "rods followed", "solving": "forces found",
    "ensemble": "error bars", "recording": "recording written",
}  # fmt: skip


class State(StrEnum):
    IDLE = "idle"
    RUNNING = "running"
    PAUSING = "pausing"
    PAUSED = "paused"
    FINISHED = "finished"
    FAILED = "failed"


@dataclass(slots=True)
class Stage:
    """How far a stage is."""

    done: int
    total: int
    first: int  # steps that were done when it was first heard of
    since: float  # [s] of time.monotonic, when it was

    @property
    def left(self) -> float | None:
        """Seconds that it will still take, None while nothing tells."""
        steps, now = self.done - self.first, time.monotonic()
        return None if steps < 1 else (now - self.since) / steps * (self.total - self.done)


@dataclass(slots=True)
class Job:
    """The runs of one experiment, one at a time."""

    root: Path  # where the command is typed
    experiment: Path
    results: Path
    state: State = State.IDLE
    stages: dict[str, Stage] = field(default_factory=dict)
    said: deque[str] = field(default_factory=lambda: deque(maxlen=LINES))
    alarms: list[dict[str, Any]] = field(default_factory=list)
    version: int = 0  # grows with everything that is heard
    process: subprocess.Popen[str] | None = None
    _forget: bool = False
    _lock: threading.RLock = field(default_factory=threading.RLock)

    def start(self, *options: str) -> None:
        """Begin, or go on where it stopped. Does nothing while it runs."""
        with self._lock:
            if self.process is not None:
                return
            self.stages, self.alarms, self._forget = {}, [], False
            self.said.clear()
            command = [
                *PROGRAM,
                "run",
                str(self.experiment),
                "--out",
                str(self.results),
                "--progress",
                "lines",
                *options,
            ]
            self.process = subprocess.Popen(
                command, cwd=self.root, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                text=True, errors="replace", start_new_session=True,
            )  # fmt: skip
            self._is(State.RUNNING)
            threading.Thread(target=self._listen, args=(self.process,), daemon=True).start()

    def pause(self, *, forget: bool = False) -> None:
        """Ask it to end; forget: and remove what is unfinished.

        Not by SIGINT, which what is started in the background of a shell is told to ignore.
        """
        with self._lock:
            self._forget = forget
            if self.process is None:
                self._clear()
                return
            self._is(State.PAUSING)
            self.process.send_signal(signal.SIGTERM)

    def close(self) -> None:
        """Pause, and wait until it is."""
        process = self.process
        if process is not None:
            self.pause()
            process.wait()

    def told(self) -> dict[str, Any]:
        """All of it as plain values."""
        with self._lock:
            return {
                "state": self.state.value, "version": self.version, "said": list(self.said), "alarms": self.alarms,
                "stages": [
                    {"name": name, "words": STAGES.get(name, name), "done": s.done, "total": s.total, "left": s.left}
                    for name, s in self.stages.items()
                ],
            }  # fmt: skip

    def hear(self, line: str) -> None:
        """Take in one line of what the process says: progress, an alarm, or words for a person."""
        with self._lock:
            self.version += 1
            try:
                told = json.loads(line) if line.startswith("{") else None
            except ValueError:
                told = None
            if not isinstance(told, dict):
                if line.strip():
                    self.said.append(line.rstrip())
            elif "stage" in told:
                name, done, total = str(told["stage"]), int(told["done"]), int(told["total"])
                known = self.stages.get(name)
                if known is None:
                    self.stages[name] = Stage(done, total, done, time.monotonic())
                else:
                    known.done, known.total = done, total
            elif "alarm" in told:
                self.alarms.append(told)

    def _listen(self, process: subprocess.Popen[str]) -> None:
        assert process.stdout is not None
        with process.stdout as lines:
            for line in lines:
                self.hear(line)
        status = process.wait()
        with self._lock:
            self.process = None
            if self._forget:
                self._clear()
            elif status == 0:
                self._is(State.FINISHED)
            else:
                paused = status in INTERRUPTED or self.state is State.PAUSING
                self._is(State.PAUSED if paused else State.FAILED)

    def _clear(self) -> None:
        if self._forget:
            shutil.rmtree(self.results / UNFINISHED, ignore_errors=True)
        self.stages = {}
        self._is(State.IDLE)

    def _is(self, state: State) -> None:
        self.state = state
        self.version += 1
