"""A machine that refuses something once: the command says so in one line, and the next loses nothing."""

from __future__ import annotations

import errno
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from .attempt import attempt, attempt_in_a_fork, in_a_fork
from .cases import FEW
from .faults import ERRORS, KINDS, Refusing, forces_of, limit_files, refuse_from_now_on, refuse_stores
from .table import FAULTS, note

QUICK = 8


@dataclass(frozen=True, slots=True)
class Fault:
    """What is refused to which command."""

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


def suffer(fault: Fault, originals, out: Path) -> dict:
    """Run the command in a forked process in which something is refused; gives how it ended."""

    def work() -> dict:
        refusing = None
        if fault.kind == "size":
            limit_files(fault.number)
        elif fault.kind == "store":
            refuse_stores(fault.number, fault.error)
        else:
            place = originals.tracked.parent if fault.kind == "input" else out
            refusing = Refusing(place, "open" if fault.kind == "input" else fault.kind, fault.number, fault.error)
            refuse_from_now_on(refusing)
        ended = attempt(arguments_of(fault.command, originals, out))
        return {"status": ended.status, "said": ended.said, "refused": refusing.refused if refusing else "?"}

    return in_a_fork(work) or {"status": -9, "said": "it ended without a word", "refused": "?"}


def wrongs(faults: list[Fault], originals, work: Path) -> tuple[int, list[str]]:
    """What went wrong, of how many faults that were met."""
    met, wrong = 0, []
    for fault in faults:
        shutil.rmtree(work, ignore_errors=True)
        out = work / "out"
        told = suffer(fault, originals, out)
        if not told["refused"]:
            continue
        met += 1
        said = told["said"]
        one_line = said.count("\n") == 1 and said.startswith("rodsight: ")
        if told["status"] not in (0, 1, 2) or (told["status"] and not one_line) or "Traceback" in said:
            wrong.append(f"{fault}: {told}")
            continue
        again = attempt_in_a_fork(arguments_of(fault.command, originals, out))
        if again.status:
            wrong.append(f"{fault}: the next one ended so: {again}")
        elif fault.command in ("solve", "record") and not np.array_equal(forces_of(out), forces_of(originals.solved)):
            wrong.append(f"{fault}: the next one found other forces")
        elif left := [str(file) for file in work.rglob("*.part")]:
            wrong.append(f"{fault}: left {left}")
    return met, wrong


def test_some_refusals_are_one_line_and_lose_nothing(originals, tmp_path):
    met, wrong = wrongs(list(all_faults())[:: len(list(all_faults())) // QUICK], originals, tmp_path / "work")
    assert wrong == []
    assert met >= QUICK // 2


@pytest.mark.slow
def test_all_refusals_are_one_line_and_lose_nothing(originals, tmp_path):
    met, wrong = wrongs(list(all_faults()), originals, tmp_path / "work")
    note("faults", tried=met, wrong=len(wrong))
    assert wrong == []
    assert met >= FAULTS
