"""Execution of commands on corrupted input in forked processes, and checks of their outcome."""

from __future__ import annotations

import contextlib
import gc
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

from rodsight.cli import main as program
from rodsight.process.atomic import PART

from .parser_shortcut import run_without_parser

MAX_SECONDS = 10  # of processor time of a command
TIMEOUT = 120  # [s]
EXTRA_MEMORY = 1 << 30  # [bytes] beyond the memory of the process
PARSED = 10  # one of this number of cases uses the parser, which takes most of the time

Case = tuple[
    str, Callable[[], tuple[list[str], Path | None]]
]  # name, and function that makes command and result folder


@dataclass(frozen=True, slots=True)
class Outcome:
    """The outcome of a command."""

    status: int
    errors: str  # text on standard error
    seconds: float


def attempt(arguments: list[str], *, parsed: bool = True) -> Outcome:
    """Run a command in this process; an uncaught exception gives status −1 with its traceback.

    parsed: use the parser of the command line, otherwise the shortcut.
    """
    out, errors, since = io.StringIO(), io.StringIO(), time.process_time()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(errors):
        try:
            with nullcontext() if parsed else patch.object(program, "_run", run_without_parser):
                program.main(arguments)
            status = 0
        except SystemExit as end:
            status = int(end.code or 0)
        except BaseException:
            return Outcome(-1, traceback.format_exc(), time.process_time() - since)
    return Outcome(status, errors.getvalue(), time.process_time() - since)


def find_problem(ended: Outcome, out: Path | None, statuses: tuple[int, ...] = (0, 2)) -> str:
    """Describe what is wrong with the outcome of a command; empty: nothing."""
    if ended.status not in statuses:
        return f"status {ended.status}: {ended.errors[-2000:]}"
    if "Traceback" in ended.errors:
        return f"traceback: {ended.errors[-2000:]}"
    if ended.status and (ended.errors.count("\n") != 1 or not ended.errors.startswith("rodsight: ")):
        return f"status {ended.status} is not one line: {ended.errors[:500]!r}"
    if ended.seconds > MAX_SECONDS:
        return f"took {ended.seconds:.1f} s"
    if out is not None and out.exists():
        if half := [str(file) for file in out.rglob(f"*{PART}")]:
            return f"left {half}"
        if ended.status == 2 and (whole := [file.name for file in out.iterdir() if file.suffix in (".h5", ".rrd")]):
            return f"wrote {whole} although it refused the input"
    return ""


def run_all(cases: Iterable[Case], statuses: tuple[int, ...] = (0, 2), *, batch: int = 250) -> tuple[int, list[str]]:
    """Run cases in forked processes; return their number and the problems."""
    count, problems, waiting = 0, [], list(cases)
    while waiting:
        done, found = _run_batch(waiting[:batch], statuses)
        count, problems, waiting = count + done, problems + found, waiting[done:]
    return count, problems


def _run_batch(cases: list[Case], statuses: tuple[int, ...]) -> tuple[int, list[str]]:
    """Run cases in one forked process; return the number it finished, including one that ended it, and the problems."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(read)
        gc.freeze()  # or a search for unreachable objects copies every page of this process
        with os.fdopen(write, "w") as stream:
            _limit()
            for number, (name, make) in enumerate(cases):
                try:
                    signal.alarm(TIMEOUT)  # also ends a command that hangs inside a library
                    arguments, out = make()
                    ended = attempt(arguments, parsed=number % PARSED == 0)
                    problem = find_problem(ended, out, statuses)
                except BaseException:
                    arguments, problem = [], f"the test itself: {traceback.format_exc()}"
                stream.write(json.dumps(f"{name}: {arguments}: {problem}" if problem else "") + "\n")
                stream.flush()
        os._exit(0)
    os.close(write)
    with os.fdopen(read) as stream:
        lines = [json.loads(line) for line in stream]
    _, status = os.waitpid(child, 0)
    problems = [line for line in lines if line]
    if len(lines) < len(cases):
        problems.append(f"{cases[len(lines)][0]}: the process ended with {os.waitstatus_to_exitcode(status)}")
        return len(lines) + 1, problems
    return len(lines), problems


def run_in_fork(work: Callable[[], Any]) -> Any:
    """Run a function in a forked process and return its JSON result; None if the process failed."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        status = 1
        try:
            os.close(read)
            gc.freeze()
            with os.fdopen(write, "w") as stream:
                json.dump(work(), stream)
            status = 0
        finally:
            os._exit(status)
    os.close(write)
    with os.fdopen(read) as stream:
        content = stream.read()
    os.waitpid(child, 0)
    return json.loads(content) if content else None


def attempt_in_fork(arguments: list[str]) -> Outcome:
    outcome = run_in_fork(lambda: [(ended := attempt(arguments)).status, ended.errors, ended.seconds])
    return Outcome(*outcome) if outcome else Outcome(-9, "it ended without a message", 0.0)


def _limit() -> None:
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + EXTRA_MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
