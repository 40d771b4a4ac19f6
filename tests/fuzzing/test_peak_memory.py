"""The greatest memory of a whole command grows little with the number of photographs, between its stages included."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest
from rodsight.synthetic.synthesis import synthesize

from tests.program import RODSIGHT

from .long_runs import FEW, lengthen

SHORT, LONG, GRAINS = 100, 400, 60
# [MB] a photograph of 60 rods; before, .19 and .12. From 200 photographs on the index is made by another process.
MOST = {"run": 0.05, "record": 0.05}


def peak_of(*arguments: object) -> float:
    """Return the greatest memory of a command [MB]."""
    process = subprocess.Popen([*RODSIGHT, *map(str, arguments)], stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0
    return used.ru_maxrss / 1024.0


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "wait4"), reason="the system does not report the memory of a process")
def test_the_memory_of_whole_commands_grows_little_with_length(tmp_path: Path):
    base = tmp_path / "base"
    synthesize(base, grains=GRAINS, frames=4, photographs=False, noise=1e-5, seed=1)
    peaks: dict[str, list[float]] = {name: [] for name in MOST}
    for count in (SHORT, LONG):
        experiment, out = lengthen(base, tmp_path / f"{count}", count), tmp_path / f"out{count}"
        for name, found in peaks.items():
            found.append(peak_of(name, experiment, "--out", out, "--quiet", *FEW))
    growth = {name: (long - short) / (LONG - SHORT) for name, (short, long) in peaks.items()}
    assert {name: each for name, each in growth.items() if each > MOST[name]} == {}, (peaks, growth)
