"""One command on spoiled input, and what is wrong with how it ended. Many of them share a forked process."""

from __future__ import annotations

import contextlib
import io
import json
import os
import resource
import signal
import time
import traceback
from collections.abc import Callable, Iterable
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

from rodsight.atomic import PART
from rodsight.cli import main as program

from .shortcut import begin

SECONDS = 10  # of processor time that a command may take
WAITING = 120  # [s] after which it hangs
ROOM = 1 << 30  # [bytes] that it may take beyond what the process has
PARSED = 10  # of so many cases one goes through the parser, which takes longer than all the rest

Case = tuple[str, Callable[[], tuple[list[str], Path | None]]]  # its name, and what makes its command and result folder


@dataclass(frozen=True, slots=True)
class Ended:
    """How a command ended."""

    status: int
    said: str  # on standard error
    seconds: float


def attempt(arguments: list[str], *, parsed: bool = True) -> Ended:
    """Run a command here; an exception that leaves it is status −1 with its traceback.

    parsed: by the command line's own parser, else by the shortcut.
    """
    out, said, since = io.StringIO(), io.StringIO(), time.process_time()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(said):
        try:
            with nullcontext() if parsed else patch.object(program, "_run", begin):
                program.main(arguments)
            status = 0
        except SystemExit as end:
            status = int(end.code or 0)
        except BaseException:
            return Ended(-1, traceback.format_exc(), time.process_time() - since)
    return Ended(status, said.getvalue(), time.process_time() - since)


def complaint(ended: Ended, out: Path | None, statuses: tuple[int, ...] = (0, 2)) -> str:
    """What is wrong with how a command ended; empty: nothing."""
    if ended.status not in statuses:
        return f"status {ended.status}: {ended.said[-2000:]}"
    if "Traceback" in ended.said:
        return f"traceback: {ended.said[-2000:]}"
    if ended.status and (ended.said.count("\n") != 1 or not ended.said.startswith("rodsight: ")):
        return f"status {ended.status} is not one line: {ended.said[:500]!r}"
    if ended.seconds > SECONDS:
        return f"took {ended.seconds:.1f} s"
    if out is not None and out.exists():
        if half := [str(file) for file in out.rglob(f"*{PART}")]:
            return f"left {half}"
        if ended.status == 2 and (whole := [file.name for file in out.iterdir() if file.suffix in (".h5", ".rrd")]):
            return f"wrote {whole} of what it refused"
    return ""


def try_all(cases: Iterable[Case], statuses: tuple[int, ...] = (0, 2), *, batch: int = 250) -> tuple[int, list[str]]:
    """Try cases in forked processes; gives how many there were, and what was wrong with which."""
    count, wrong, waiting = 0, [], list(cases)
    while waiting:
        done, found = _try_some(waiting[:batch], statuses)
        count, wrong, waiting = count + done, wrong + found, waiting[done:]
    return count, wrong


def _try_some(cases: list[Case], statuses: tuple[int, ...]) -> tuple[int, list[str]]:
    """Try cases in one forked process; gives how many it came through, the last of them perhaps its end."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(read)
        with os.fdopen(write, "w") as tell:
            _limit()
            for number, (name, make) in enumerate(cases):
                try:
                    signal.alarm(WAITING)  # which ends what hangs, inside a library, too
                    arguments, out = make()
                    ended = attempt(arguments, parsed=number % PARSED == 0)
                    problem = complaint(ended, out, statuses)
                except BaseException:
                    arguments, problem = [], f"the test itself: {traceback.format_exc()}"
                tell.write(json.dumps(f"{name}: {arguments}: {problem}" if problem else "") + "\n")
                tell.flush()
        os._exit(0)
    os.close(write)
    with os.fdopen(read) as told:
        lines = [json.loads(line) for line in told]
    _, status = os.waitpid(child, 0)
    wrong = [line for line in lines if line]
    if len(lines) < len(cases):
        wrong.append(f"{cases[len(lines)][0]}: the process ended with {os.waitstatus_to_exitcode(status)}")
        return len(lines) + 1, wrong
    return len(lines), wrong


def in_a_fork(work: Callable[[], Any]) -> Any:
    """What work gives (JSON), done in a process of its own; None where that process did not come to its end."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        status = 1
        try:
            os.close(read)
            with os.fdopen(write, "w") as tell:
                json.dump(work(), tell)
            status = 0
        finally:
            os._exit(status)
    os.close(write)
    with os.fdopen(read) as told:
        content = told.read()
    os.waitpid(child, 0)
    return json.loads(content) if content else None


def attempt_in_a_fork(arguments: list[str]) -> Ended:
    told = in_a_fork(lambda: [(ended := attempt(arguments)).status, ended.said, ended.seconds])
    return Ended(*told) if told else Ended(-9, "it ended without a word", 0.0)


def _limit() -> None:
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + ROOM
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
