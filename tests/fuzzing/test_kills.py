"""Killed at any moment, again and again, a run loses nothing: the same command brings it to its end, bit for bit."""

from __future__ import annotations

import hashlib
import json
import os
import random
import shutil
import signal
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
import pytest
from rodsight.recording.files.readback import read_forces
from rodsight.run_folder import TRACKED

from .attempt import attempt, attempt_in_a_fork, in_a_fork
from .table import KILLS, note

QUICK, SEED = 10, 4
FEW = ("--set", "solver.sweeps=20", "--quiet")
LONGEST = 1.5  # [s] of processor time until a kill at random


@dataclass(frozen=True, slots=True)
class Kill:
    """When a process is killed: before or after its n-th replacement of a file, or after so much work."""

    number: int = -1
    after: bool = False
    seconds: float = 0.0


def run_killed(arguments: list[str], kill: Kill) -> bool:
    """Run a command in a forked process that is killed; gives whether it was, before its end."""
    child = os.fork()
    if child == 0:
        if kill.seconds:
            signal.signal(signal.SIGPROF, signal.SIG_DFL)  # which ends it as a kill does, in the midst of anything
            signal.setitimer(signal.ITIMER_PROF, kill.seconds)
        else:
            die_at(kill)
        attempt(arguments)
        os._exit(0)
    _, status = os.waitpid(child, 0)
    return os.WIFSIGNALED(status)


def die_at(kill: Kill) -> None:
    replace, done = os.replace, []

    def dying(source: os.PathLike, target: os.PathLike) -> None:
        if len(done) == kill.number and not kill.after:
            os.kill(os.getpid(), signal.SIGKILL)
        replace(source, target)
        if len(done) == kill.number:
            os.kill(os.getpid(), signal.SIGKILL)
        done.append(target)

    os.replace = dying  # type: ignore[assignment]


def content_of(out: Path) -> dict[str, str]:
    """All that a run found, without when and how fast."""
    found: dict[str, bytes] = {}
    for name in ("tracks.h5", "results.h5"):
        if (out / name).exists():
            with h5py.File(out / name) as store:
                datasets: list[str] = []
                store.visititems(lambda path, item: datasets.append(path) if isinstance(item, h5py.Dataset) else None)  # noqa: B023
                for path in datasets:
                    values = np.asarray(store[path][()])
                    found[f"{name}:{path}"] = (
                        repr(values.tolist()).encode() if values.dtype.hasobject else values.tobytes()
                    )
    told = json.loads((out / "summary.json").read_text())
    found["summary"] = json.dumps({key: value for key, value in told.items() if key != "timings"}).encode()
    forces = read_forces(out / "recording.rrd")
    found["recording"] = b"".join(forces[frame].fn.tobytes() for frame in sorted(forces))
    return {name: hashlib.sha256(content).hexdigest() for name, content in found.items()}


def left_in(out: Path) -> list[str]:
    """What a run that came to its end should have cleared away; finished tracks are kept for other corrections."""
    kept = out / TRACKED / "tracking"
    return [
        str(file.relative_to(out))
        for file in out.rglob("*")
        if (file.suffix in (".part", ".piece") and file.parent != kept) or file.name == ".lock"
    ]


def kill_and_resume(experiment: Path, out: Path, count: int, chance: random.Random) -> tuple[int, list[str]]:
    """Chains of kills, each brought to its end; gives kills that fell before an end, and what went wrong."""
    whole = out.with_name("whole")
    assert attempt_in_a_fork(["run", str(experiment), "--out", str(whole), *FEW]).status == 0
    expected, killed, wrong, number = in_a_fork(lambda: content_of(whole)), 0, [], 0
    while killed < count:
        shutil.rmtree(out, ignore_errors=True)
        arguments, chain = ["run", str(experiment), "--out", str(out), *FEW], []
        for _ in range(chance.randint(1, 3)):
            if chance.random() < 0.6:
                chain.append(Kill(number % 24, chance.random() < 0.5))
                number += 1
            else:
                chain.append(Kill(seconds=chance.uniform(0.005, LONGEST)))
            killed += run_killed(arguments, chain[-1])
        ended = attempt_in_a_fork(arguments)
        if ended.status or ended.said:
            wrong.append(f"{chain}: {ended}")
        elif in_a_fork(lambda: content_of(out)) != expected:
            wrong.append(f"{chain}: other bits")
        elif left := left_in(out):
            wrong.append(f"{chain}: left {left}")
    return killed, wrong


@pytest.mark.screen
def test_a_few_kills_lose_nothing(originals, tmp_path):
    killed, wrong = kill_and_resume(originals.tracked, tmp_path / "out", QUICK, random.Random(SEED))
    assert wrong == []
    assert killed >= QUICK


@pytest.mark.slow
def test_many_kills_lose_nothing(originals, tmp_path):
    total, wrong = 0, []
    for experiment in (originals.tracked, originals.photographed):
        work = tmp_path / experiment.name
        work.mkdir()
        killed, found = kill_and_resume(experiment, work / "out", KILLS // 2, random.Random(SEED + 1))
        total, wrong = total + killed, wrong + found
    note("kills", tried=total, wrong=len(wrong))
    assert wrong == []
    assert total >= KILLS
