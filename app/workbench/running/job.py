"""One run as a child process: its stage, the time left, its messages. A pause ends the process.

A run that is ended by a signal stores its finished frames, and the same command resumes there: a pause costs at most
one frame and no memory.
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
KEPT_LINES = 200  # of its messages
INTERRUPTED = (130, 143)  # exit statuses of a run that a signal ended
# Stages in order, as the page names them.
STAGES = {
    "detection": "rods found", "walls": "walls followed", "tracking": "rods followed", "solving": "forces found",
    "ensemble": "error bars", "recording": "recording written",
}  # fmt: skip


class JobState(StrEnum):
    IDLE = "idle"
    RUNNING = "running"
    PAUSING = "pausing"
    PAUSED = "paused"
    FINISHED = "finished"
    FAILED = "failed"


@dataclass(slots=True)
class Stage:
    """Progress of a stage."""

    done: int
    total: int
    first: int  # steps that were done at the first report
    since: float  # [s] of time.monotonic at the first report

    @property
    def left(self) -> float | None:
        """Predicted time left [s], None before a step is done."""
        steps, now = self.done - self.first, time.monotonic()
        return None if steps < 1 else (now - self.since) / steps * (self.total - self.done)


@dataclass(slots=True)
class Job:
    """The runs of one experiment, one at a time."""

    root: Path  # working directory of the command
    experiment: Path
    results: Path
    state: JobState = JobState.IDLE
    stages: dict[str, Stage] = field(default_factory=dict)
    messages: deque[str] = field(default_factory=lambda: deque(maxlen=KEPT_LINES))
    alarms: list[dict[str, Any]] = field(default_factory=list)
    version: int = 0  # increases with every report
    process: subprocess.Popen[str] | None = None
    _discard: bool = False
    _lock: threading.RLock = field(default_factory=threading.RLock)

    def start(self, *options: str) -> None:
        """Start the run, or resume it. While it runs this does nothing."""
        with self._lock:
            if self.process is not None:
                return
            self.stages, self.alarms, self._discard = {}, [], False
            self.messages.clear()
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
            self._set_state(JobState.RUNNING)
            threading.Thread(target=self._read_output, args=(self.process,), daemon=True).start()

    def pause(self, *, discard: bool = False) -> None:
        """End the process; discard: remove the unfinished stage.

        The signal is not SIGINT, which a background process of a shell ignores.
        """
        with self._lock:
            self._discard = discard
            if self.process is None:
                self._clear()
                return
            self._set_state(JobState.PAUSING)
            self.process.send_signal(signal.SIGTERM)

    def close(self) -> None:
        """Pause the run, and wait until it has ended."""
        process = self.process
        if process is not None:
            self.pause()
            process.wait()

    def as_values(self) -> dict[str, Any]:
        """Describe the run as plain values."""
        with self._lock:
            return {
                "state": self.state.value, "version": self.version, "messages": list(self.messages),
                "alarms": self.alarms,
                "stages": [
                    {"name": name, "label": STAGES.get(name, name), "done": s.done, "total": s.total, "left": s.left}
                    for name, s in self.stages.items()
                ],
            }  # fmt: skip

    def read_line(self, line: str) -> None:
        """Read one line of the output: progress, an alarm, or a message for the user."""
        with self._lock:
            self.version += 1
            try:
                report = json.loads(line) if line.startswith("{") else None
            except ValueError:
                report = None
            if not isinstance(report, dict):
                if line.strip():
                    self.messages.append(line.rstrip())
            elif "stage" in report:
                name, done, total = str(report["stage"]), int(report["done"]), int(report["total"])
                known = self.stages.get(name)
                if known is None:
                    self.stages[name] = Stage(done, total, done, time.monotonic())
                else:
                    known.done, known.total = done, total
            elif "alarm" in report:
                self.alarms.append(report)

    def _read_output(self, process: subprocess.Popen[str]) -> None:
        assert process.stdout is not None
        with process.stdout as lines:
            for line in lines:
                self.read_line(line)
        status = process.wait()
        with self._lock:
            self.process = None
            if self._discard:
                self._clear()
            elif status == 0:
                self._set_state(JobState.FINISHED)
            else:
                paused = status in INTERRUPTED or self.state is JobState.PAUSING
                self._set_state(JobState.PAUSED if paused else JobState.FAILED)

    def _clear(self) -> None:
        if self._discard:
            shutil.rmtree(self.results / UNFINISHED, ignore_errors=True)
        self.stages = {}
        self._set_state(JobState.IDLE)

    def _set_state(self, state: JobState) -> None:
        self.state = state
        self.version += 1
