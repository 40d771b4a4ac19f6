"""After a fault of the operating system a command ends with one line, and the next one loses nothing."""

from __future__ import annotations

import errno
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from .attempt import attempt, attempt_in_fork, run_in_fork
from .cases import FEW
from .faults import ERRORS, KINDS, FileFault, forces_of, install_fault, limit_files, refuse_stores
from .table import FAULTS, note

QUICK = 5


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault during a command."""

    command: str
    kind: str  # of KINDS, "input", "store" or "size"
    number: int
    error: int

    def __str__(self) -> str:
        return f"{self.command}, {self.kind} {self.number}, {errno.errorcode[self.error]}"


def all_faults() -> Iterator[Fault]:
    count = 0
    for command in ("solve", "track", "record", "export"):
        for kind in (*KINDS.values(), "input", "store"):
            for number in (0, 1, 3, 7):
                yield Fault(command, kind, number, ERRORS[count % len(ERRORS)])
                count += 1
        for size in (0, 400, 3000, 9000):
            yield Fault(command, "size", size, errno.EFBIG)


def arguments_of(command: str, originals, out: Path) -> list[str]:
    if command == "track":
        return ["track", str(originals.photographed), "--out", str(out), "--quiet"]
    if command == "export":
        return ["export", "tables", str(originals.solved), "--out", str(out)]
    return [command, str(originals.tracked), "--out", str(out), *FEW]


def run_with_fault(fault: Fault, originals, out: Path) -> dict:
    """Run the command with a fault in a forked process and return its outcome."""

    def work() -> dict:
        file_fault = None
        if fault.kind == "size":
            limit_files(fault.number)
        elif fault.kind == "store":
            refuse_stores(fault.number, fault.error)
        else:
            match = originals.tracked.parent if fault.kind == "input" else out
            file_fault = FileFault(match, "open" if fault.kind == "input" else fault.kind, fault.number, fault.error)
            install_fault(file_fault)
        ended = attempt(arguments_of(fault.command, originals, out))
        return {"status": ended.status, "errors": ended.errors, "refused": file_fault.refused if file_fault else "?"}

    return run_in_fork(work) or {"status": -9, "errors": "it ended without a message", "refused": "?"}


def collect_problems(faults: list[Fault], originals, work: Path) -> tuple[int, list[str]]:
    """Return the number of faults that occurred, and the problems."""
    met, problems = 0, []
    for fault in faults:
        shutil.rmtree(work, ignore_errors=True)
        out = work / "out"
        found = run_with_fault(fault, originals, out)
        if not found["refused"]:
            continue
        met += 1
        errors = found["errors"]
        one_line = errors.count("\n") == 1 and errors.startswith("rodsight: ")
        if found["status"] not in (0, 1, 2) or (found["status"] and not one_line) or "Traceback" in errors:
            problems.append(f"{fault}: {found}")
            continue
        again = attempt_in_fork(arguments_of(fault.command, originals, out))
        if again.status:
            problems.append(f"{fault}: the next command ended with: {again}")
        elif fault.command in ("solve", "record") and not np.array_equal(forces_of(out), forces_of(originals.solved)):
            problems.append(f"{fault}: the next command found other forces")
        elif left := [str(file) for file in work.rglob("*.part")]:
            problems.append(f"{fault}: left {left}")
    return met, problems


@pytest.mark.thorough
def test_some_faults_end_with_one_line_and_lose_nothing(originals, tmp_path):
    met, problems = collect_problems(
        list(all_faults())[:: len(list(all_faults())) // QUICK], originals, tmp_path / "work"
    )
    assert problems == []
    assert met >= QUICK // 2


@pytest.mark.slow
def test_all_faults_end_with_one_line_and_lose_nothing(originals, tmp_path):
    met, problems = collect_problems(list(all_faults()), originals, tmp_path / "work")
    note("faults", tried=met, wrong=len(problems))
    assert problems == []
    assert met >= FAULTS
