"""The greatest memory of whole commands by the number of photographs, between their stages included.

python -m tests.fuzzing --peak 100 1000     run, record, review and workbench with 250 rods, and the growth
"""

from __future__ import annotations

import http.client
import json
import os
import subprocess
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from rodsight.synthetic.synthesis import SynthesisSettings, synthesize

from tests.program import RODSIGHT

from .long_runs import lengthen

GRAINS = 250
FRAMES_TO_WRITE = ("run", "record")


def peaks_of(
    counts: Sequence[int], work: Path, grains: int = GRAINS, settings: Sequence[str] = (),
    report: Callable[[str], object] = print,
) -> dict[str, list[float]]:  # fmt: skip
    """Measure and report the greatest memory of each command for these numbers of photographs [MB]."""
    base = work / "base"
    if not base.exists():
        synthesize(base, SynthesisSettings(grains=grains, frames=4, photographs=False, noise=1e-5, seed=1))
    peaks: dict[str, list[float]] = {name: [] for name in (*FRAMES_TO_WRITE, "review", "open")}
    for count in counts:
        root = work / f"{count}"
        root.mkdir(exist_ok=True)
        experiment, out = root / "experiment", root / "runs" / "base"
        if not experiment.exists():
            lengthen(base, experiment, count)
        for name in FRAMES_TO_WRITE:
            peaks[name].append(peak_of(name, experiment, "--out", out, "--quiet", *settings))
        for name, place in (("review", out), ("open", root)):
            peaks[name].append(peak_of_page(name, place, count))
        for name, found in peaks.items():
            report(f"{name}: {found[-1]:.0f} MB with {count} photographs of {grains} rods")
    for name, growth in growth_of(peaks, counts).items():
        report(f"{name}: {growth:.3f} MB a photograph from {counts[0]} to {counts[-1]}")
    return peaks


def growth_of(peaks: dict[str, list[float]], counts: Sequence[int]) -> dict[str, float]:
    """Return the growth of each command's memory [MB a photograph]."""
    return {name: (found[-1] - found[0]) / (counts[-1] - counts[0]) for name, found in peaks.items()}


def peak_of(*arguments: object) -> float:
    """Return the greatest memory of a command [MB]."""
    process = subprocess.Popen([*RODSIGHT, *map(str, arguments)], stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"{arguments[0]} ended with status {process.returncode}")
    return used.ru_maxrss / 1024.0


def peak_of_page(command: str, place: Path, count: int) -> float:
    """Return the greatest memory of the page's server while all photographs are looked at and reviewed [MB]."""
    process = subprocess.Popen([*RODSIGHT, command, str(place), "--no-browser"], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        at = "." if command == "review" else "experiment"
        with closing(_Visitor(process.stdout.readline().rpartition(" ")[2].strip())) as visitor:
            visitor.request("project", at=at)
            for frame in range(count):
                visitor.request("network", at=at, frame=frame)
                view = {"reviewer": "anna", "frame": frame, "blind": False}
                visitor.request("review_status", at=at, view=view)
                visitor.request("next_pair", at=at, view=view)
        status = Path(f"/proc/{process.pid}/status").read_text()
        return next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmHWM")) / 1024.0
    finally:
        process.kill()
        process.communicate()


class _Visitor:
    """The owner's browser."""

    def __init__(self, address: str) -> None:
        self._place = urlsplit(address)
        self._connection = http.client.HTTPConnection(self._place.netloc, timeout=120.0)
        self._connection.request("GET", f"/?{self._place.query}")
        answer = self._connection.getresponse()
        answer.read()
        self._cookie = (answer.headers["Set-Cookie"] or "").partition(";")[0]

    def close(self) -> None:
        self._connection.close()

    def request(self, endpoint: str, **values: Any) -> None:
        headers = {
            "Origin": f"http://{self._place.netloc}", "Content-Type": "application/json", "Cookie": self._cookie,
        }  # fmt: skip
        self._connection.request("POST", f"/api/{endpoint}", json.dumps(values), headers)
        answer = self._connection.getresponse()
        content = answer.read()
        if answer.status != http.HTTPStatus.OK:
            raise RuntimeError(f"{endpoint}: {content.decode(errors='replace')}")
