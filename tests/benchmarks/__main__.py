"""python -m tests.benchmarks: what the program takes, stage by stage, as tables in Markdown; ratios first.

--only: some of the tables. --tiles: packings that a whole run is timed on, a simulated periodic cell of 450 rods laid
beside itself so often each way; beside them some between walls. All are simulated once and kept in --folder.
--append: what was measured in several turns goes into tests/benchmarks/history.csv, what grows into growth.csv, and
their pictures are drawn anew.
Everything runs in one thread but where it is said; processor times hold while other work goes on, those of the clock
do not.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from datetime import date
from pathlib import Path

from tests.benchmarks import history
from tests.benchmarks.growth import TILES, growth, run_job
from tests.benchmarks.photograph_rows import detection_rows, tracking_rows
from tests.benchmarks.solver_rows import load_rows, member_rows, sweep_rows
from tests.benchmarks.timing import Row, Took, format_table, in_processor_time, processor_name

ROOT = Path(__file__).parents[2]
SAMPLE = ROOT / "sample_data" / "shear"


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


def sample() -> Iterator[tuple[str, list[Row]]]:
    found = run_job(SAMPLE)
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


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks", description=__doc__)
    parser.add_argument("--only", nargs="+", choices=["ratios", "start", "photographs", "growth", "sample"])
    parser.add_argument("--tiles", nargs="+", type=int, default=TILES)
    parser.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()) / "rodsight-benchmark")
    parser.add_argument("--append", action="store_true")
    asked = parser.parse_args()
    parts = {
        "ratios": ratios, "start": start, "photographs": photographs,
        "growth": lambda: growth(asked.folder, asked.tiles, keep=asked.append), "sample": sample,
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
