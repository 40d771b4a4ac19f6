"""python -m tests.benchmarks: what the program takes, stage by stage, as tables in Markdown; ratios first.

--only: some of the tables. --tiles: packings that a whole run is timed on, a simulated periodic cell of 450 rods laid
beside itself so often each way; beside them one of 1172 rods between walls. Both are simulated once, kept in --folder.
--append: what was measured in several turns goes into tests/benchmarks/history.csv, and its picture is drawn anew.
Everything runs in one thread but where it is said; processor times hold while other work goes on, those of the clock
do not.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from datetime import date
from pathlib import Path

import numpy as np
from rodsight.synthetic.synthesis import synthesize

from tests.benchmarks import history
from tests.benchmarks.photograph_rows import detection_rows, tracking_rows
from tests.benchmarks.solver_rows import load_rows, member_rows, sweep_rows
from tests.benchmarks.tiled_packing import NOISE, tiled_packing
from tests.benchmarks.timing import Row, Took, format_table, in_processor_time, processor_name

ROOT = Path(__file__).parents[2]
SAMPLE = ROOT / "sample_data" / "shear"
TILES = (1, 2, 3, 5)  # of a cell, each way
WALLED, PHOTOGRAPHS = 1172, 24  # rods between walls, as many frames as a short test has
AIMS = {WALLED: "≤ .20 s", 4050: "≤ 1 s", 11_250: "≤ 2.5 s"}  # of processor, solving one frame


def ratios() -> Iterator[tuple[str, list[Row]]]:
    yield "Ratios", [*sweep_rows((1000, 10_000, 100_000)), *member_rows((1000, 5000)), *load_rows((1000, 10_000))]


def photographs() -> Iterator[tuple[str, list[Row]]]:
    yield "Photographs: tracking on one core", list(tracking_rows())
    yield "Photographs: detection", list(detection_rows())


def start() -> Iterator[tuple[str, list[Row]]]:
    call = "from rodsight.cli.main import main; main()"
    ready = "import rodsight.pipeline, rodsight.inference.inference"
    rows = [
        in_processor_time("`rodsight --help`", _of_process("-c", call, "--help"), "≤ .3 s"),
        in_processor_time("loading all that solving tracks needs", _of_process("-c", ready), "≤ 1.5 s"),
    ]
    yield "Start", rows


def growth(folder: Path, tiles: tuple[int, ...]) -> Iterator[tuple[str, list[Row]]]:
    stages, answers, former = [], [], None
    for place in (_walled(folder), *(tiled_packing(folder, each) for each in tiles)):
        found = _job(place)
        rods, frames = found["rods"], found["frames"]
        solving, recording = (
            Took(*(each / frames for each in found["stages"][name])) for name in ("solving", "recording")
        )
        power, kind = "", "rods between walls"
        if place.parent != folder / "walled":
            kind = "rods of a periodic cell"
            if former is not None:
                power = f"; growth n^{np.log(solving.processor / former[1]) / np.log(rods / former[0]):.2f}"
            former = rods, solving.processor
        stages += [
            Row(
                f"solving {rods} {kind}, a frame of {frames}, calibration included",
                f"{solving}{power}",
                AIMS.get(rods, ""),
            ),
            Row(
                f"recording {rods} rods, a frame of {frames}", f"{recording}; files {found['megabytes']} MB", "≤ .15 s"
            ),
            Row(f"peak of memory, {rods} rods", f"{found['peak']:.0f} MB"),
        ]
        answers += [
            Row(f"forces without one contact, locally, {rods} rods", str(Took(*found["without"])), "≤ 150 ms"),
            Row(f"one frame solved again, {rods} rods", str(Took(*found["again"])), "≤ .4 s"),
        ]
    yield "Answers while one looks", answers
    yield "Growth with the packing, on tracks", stages


def sample() -> Iterator[tuple[str, list[Row]]]:
    found = _job(SAMPLE)
    rows = []
    for name, seconds in found["stages"].items():
        what = f"{name}, {found['frames']} photographs of {found['rods']} rods"
        rows.append(in_processor_time(what, [Took(*seconds)]))
    rows.append(Row("peak of memory", f"{found['peak']:.0f} MB"))
    yield "The sample, from photographs to the recording", rows


def _of_process(*words: str, turns: int = 3) -> list[Took]:
    """Several starts of Python after a first one; the processor's time is the clock's where nothing else runs."""
    import resource

    def spent() -> float:
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        return used.ru_utime + used.ru_stime

    found = []
    for _ in range(turns + 1):
        processor, clock = spent(), time.perf_counter()
        subprocess.run([sys.executable, *words], check=True, capture_output=True, cwd=ROOT)
        found.append(Took(spent() - processor, time.perf_counter() - clock))
    return found[1:]


def _job(experiment: Path) -> dict:
    command = [sys.executable, "-m", "tests.benchmarks.job", str(experiment)]
    told = subprocess.run(command, check=True, capture_output=True, text=True, cwd=ROOT).stdout
    return json.loads(told.splitlines()[-1])


def _walled(folder: Path) -> Path:
    """The tracks of a packing sheared between walls, simulated where they are not there yet."""
    place = folder / "walled" / f"{WALLED} rods, {PHOTOGRAPHS} frames"
    if not (place / "experiment.toml").exists():
        print(f"simulating {WALLED} rods …", file=sys.stderr, flush=True)
        synthesize(place, preset="paper", frames=PHOTOGRAPHS, photographs=False, noise=NOISE, seed=1)
    return place


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks", description=__doc__)
    parser.add_argument("--only", nargs="+", choices=["ratios", "start", "photographs", "growth", "sample"])
    parser.add_argument("--tiles", nargs="+", type=int, default=TILES)
    parser.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()) / "rodsight-benchmark")
    parser.add_argument("--append", action="store_true")
    asked = parser.parse_args()
    parts = {
        "ratios": ratios, "start": start, "photographs": photographs,
        "growth": lambda: growth(asked.folder, tuple(asked.tiles)), "sample": sample,
    }  # fmt: skip
    print(f"{processor_name()}; {date.today().isoformat()}\n", flush=True)
    measured: list[Row] = []
    commit = history.present_commit() if asked.append else ""
    for name in asked.only or parts:
        for title, rows in parts[name]():
            print(format_table(title, rows), flush=True)
            measured += rows
    if asked.append:
        print(f"{history.append(measured, commit)} figures added to {history.HISTORY.relative_to(ROOT)}")
        history.draw(history.read())


if __name__ == "__main__":
    main()
