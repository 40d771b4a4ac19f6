"""One run as a child process: its stage, the time left, its messages. A pause ends the process.

A run that is ended by a signal stores its finished frames, and the same command resumes there: a pause costs at most
one frame and no memory. It writes to a file, not to a pipe: it outlives this process, and is found again by the next.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any

from ...process.atomic import write_atomically
from ...process.lock import Holder
from ...run_folder import UNFINISHED

COMMAND = """
import json
from rodsight.cli.main import main
try:
    main()
except SystemExit as end:
    print(json.dumps({"exit": end.code or 0}), flush=True)
    raise
"""
PROGRAM = (sys.executable, "-c", COMMAND)
OUTPUT, PROCESS = "run.log", "run.json"  # in the folder of the journal: what the run writes; its process
POLLING = 0.1  # [s] between two reads of what the run writes
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
    place: Path  # folder of its output and of the number of its process
    state: JobState = JobState.IDLE
    stages: dict[str, Stage] = field(default_factory=dict)
    messages: deque[str] = field(default_factory=lambda: deque(maxlen=KEPT_LINES))
    alarms: list[dict[str, Any]] = field(default_factory=list)
    version: int = 0  # increases with every report
    process: subprocess.Popen[bytes] | None = None
    found: Holder | None = None  # the process of a run that another server started
    _status: int | None = None  # exit status that the run has written
    _discard: bool = False
    _lock: threading.RLock = field(default_factory=threading.RLock)

    def start(self, *options: str) -> None:
        """Start the run, or resume it. While it runs this does nothing."""
        with self._lock:
            if self.is_running:
                return
            self._forget_last()
            command = [*PROGRAM, *self._arguments, "--progress", "lines", *options]
            self.place.mkdir(exist_ok=True)
            (self.place / OUTPUT).unlink(missing_ok=True)  # another name of it, if any, keeps its content
            with (self.place / OUTPUT).open("xb") as output:
                self.process = subprocess.Popen(
                    command, cwd=self.root, stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT,
                    start_new_session=True,
                )  # fmt: skip
            values = asdict(Holder.of(self.process.pid)) | {"results": str(self.results)}
            write_atomically(self.place / PROCESS, json.dumps(values).encode())
            self._set_state(JobState.RUNNING)
            threading.Thread(target=self._read_output, args=(self.process,), daemon=True).start()

    @property
    def _arguments(self) -> tuple[str, ...]:
        return "run", str(self.experiment), "--out", str(self.results)

    @property
    def is_running(self) -> bool:
        """Whether the process of a run is there."""
        return self.process is not None or self.found is not None

    def find(self) -> None:
        """Find the run that a server started which is gone; where it has ended meanwhile this does nothing."""
        with self._lock:
            if self.is_running:
                return
            try:
                stored = json.loads((self.place / PROCESS).read_bytes())
                results = stored.pop("results")
                holder = Holder(**stored)
            except (OSError, ValueError, TypeError, AttributeError, KeyError):
                return
            if results != str(self.results) or not holder.is_near or not holder.is_alive:
                return
            if not _is_run(holder.process, self._arguments):  # the file may have come with the folder
                return
            self._forget_last()
            self.found = holder
            self._set_state(JobState.RUNNING)
            threading.Thread(target=self._read_output, args=(None,), daemon=True).start()

    def pause(self, *, discard: bool = False) -> None:
        """End the process; discard: remove the unfinished stage.

        The signal is not SIGINT, which a background process of a shell ignores.
        """
        with self._lock:
            self._discard = discard
            if not self.is_running:
                self._clear()
                return
            self._set_state(JobState.PAUSING)
            if self.process is not None:
                self.process.send_signal(signal.SIGTERM)
            elif self.found is not None and self.found.is_alive:
                os.kill(self.found.process, signal.SIGTERM)

    def close(self) -> None:
        """Pause the run, and wait until it has ended."""
        process, found = self.process, self.found
        if process is None and found is None:
            return
        self.pause()
        if process is not None:
            process.wait()
        while found is not None and found.is_alive:
            time.sleep(POLLING)

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
            elif isinstance(report.get("exit"), int):
                self._status = report["exit"]

    def _read_output(self, process: subprocess.Popen[bytes] | None) -> None:
        """Read what the run writes until it has ended; process: None for a run that another server started."""
        with suppress(OSError), (self.place / OUTPUT).open(encoding="utf-8", errors="replace") as lines:
            part = ""
            while True:
                ended = not self._is_alive(process)  # before the last lines are read
                while piece := lines.readline():
                    part += piece
                    if part.endswith("\n"):
                        self.read_line(part)
                        part = ""
                if ended:
                    break
                time.sleep(POLLING)
            self.read_line(part)
        while self._is_alive(process):  # its log is missing or cannot be read: that is not its end
            time.sleep(POLLING)
        status = self._status if process is None else process.wait()
        with self._lock:
            self.process = self.found = None
            (self.place / PROCESS).unlink(missing_ok=True)
            if self._discard:
                self._clear()
            elif status == 0:
                self._set_state(JobState.FINISHED)
            else:
                paused = status in INTERRUPTED or self.state is JobState.PAUSING
                self._set_state(JobState.PAUSED if paused else JobState.FAILED)

    def _is_alive(self, process: subprocess.Popen[bytes] | None) -> bool:
        if process is not None:
            return process.poll() is None
        return self.found is not None and self.found.is_alive

    def _forget_last(self) -> None:
        self.stages, self.alarms, self._discard, self._status = {}, [], False, None
        self.messages.clear()

    def _clear(self) -> None:
        if self._discard:
            shutil.rmtree(self.results / UNFINISHED, ignore_errors=True)
        self.stages = {}
        self._set_state(JobState.IDLE)

    def _set_state(self, state: JobState) -> None:
        self.state = state
        self.version += 1


def _is_run(process: int, arguments: tuple[str, ...]) -> bool:
    """Whether a process is a run of this user with these arguments: only such a one may be ended from here."""
    place = Path("/proc") / str(process)
    if (place.parent / "self").exists():
        try:
            mine = not hasattr(os, "geteuid") or place.stat().st_uid == os.geteuid()
            return mine and "\0".join(arguments).encode() in (place / "cmdline").read_bytes()
        except OSError:  # it has ended
            return False
    listed = subprocess.run(["ps", "-o", "command=", "-p", str(process)], capture_output=True, text=True, check=False)
    return " ".join(arguments) in listed.stdout
