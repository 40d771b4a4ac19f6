"""A run that is killed repeatedly loses nothing: the same command finishes it with identical bits."""

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
from rodsight.recording.archive.readback import read_forces
from rodsight.run_folder import TRACKED

from .attempt import attempt, attempt_in_fork, run_in_fork
from .table import KILLS, note

QUICK, SEED = 3, 4
FEW = ("--set", "solver.sweeps=20", "--quiet")
LONGEST = 1.5  # [s] of processor time until a kill at random


@dataclass(frozen=True, slots=True)
class Kill:
    """The moment of a kill: before or after the n-th replacement of a file, or after a processor time."""

    number: int = -1
    after: bool = False
    seconds: float = 0.0


def run_killed(arguments: list[str], kill: Kill) -> bool:
    """Run a command in a forked process with a kill; return whether it was killed before its end."""
    child = os.fork()
    if child == 0:
        if kill.seconds:
            signal.signal(signal.SIGPROF, signal.SIG_DFL)  # its default action ends the process at any moment
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
    """Return hashes of all results of a run, without times."""
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
    summary = json.loads((out / "summary.json").read_text())
    found["summary"] = json.dumps({key: value for key, value in summary.items() if key != "timings"}).encode()
    forces = read_forces(out / "recording.rrd")
    found["recording"] = b"".join(forces[frame].fn.tobytes() for frame in sorted(forces))
    return {name: hashlib.sha256(content).hexdigest() for name, content in found.items()}


def left_in(out: Path) -> list[str]:
    """Return temporary files left by a finished run; finished tracks are kept for other corrections."""
    kept = out / TRACKED / "tracking"
    return [
        str(file.relative_to(out))
        for file in out.rglob("*")
        if (file.suffix in (".part", ".piece") and file.parent != kept) or file.name == ".lock"
    ]


def kill_and_resume(experiment: Path, out: Path, count: int, rng: random.Random) -> tuple[int, list[str]]:
    """Run chains of kills with a final run each; return the number of kills before the end, and the problems."""
    whole = out.with_name("whole")
    assert attempt_in_fork(["run", str(experiment), "--out", str(whole), *FEW]).status == 0
    expected, killed, problems, number = run_in_fork(lambda: content_of(whole)), 0, [], 0
    while killed < count:
        shutil.rmtree(out, ignore_errors=True)
        arguments, chain = ["run", str(experiment), "--out", str(out), *FEW], []
        for _ in range(rng.randint(1, 3)):
            if rng.random() < 0.6:
                chain.append(Kill(number % 24, rng.random() < 0.5))
                number += 1
            else:
                chain.append(Kill(seconds=rng.uniform(0.005, LONGEST)))
            killed += run_killed(arguments, chain[-1])
        ended = attempt_in_fork(arguments)
        if ended.status or ended.errors:
            problems.append(f"{chain}: {ended}")
        elif run_in_fork(lambda: content_of(out)) != expected:
            problems.append(f"{chain}: other bits")
        elif left := left_in(out):
            problems.append(f"{chain}: left {left}")
    return killed, problems


@pytest.mark.slow  # tests/app/cli/test_run.py kills one run
def test_a_few_kills_lose_nothing(originals, tmp_path):
    killed, problems = kill_and_resume(originals.tracked, tmp_path / "out", QUICK, random.Random(SEED))
    assert problems == []
    assert killed >= QUICK


@pytest.mark.slow
def test_many_kills_lose_nothing(originals, tmp_path):
    total, problems = 0, []
    for experiment in (originals.tracked, originals.photographed):
        work = tmp_path / experiment.name
        work.mkdir()
        killed, found = kill_and_resume(experiment, work / "out", KILLS // 2, random.Random(SEED + 1))
        total, problems = total + killed, problems + found
    note("kills", tried=total, wrong=len(problems))
    assert problems == []
    assert total >= KILLS
