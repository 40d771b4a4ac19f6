"""python -m tests.benchmarks: times of the program by stage as tables in Markdown; ratios first.

--only: some of the tables. --tiles: packings to time a whole run on, as the number of periodic copies each way of a
simulated cell of 450 rods; packings between walls are added. All are simulated once and stored in --folder.
--append: figures of several rounds are added to tests/benchmarks/history.csv, growth to growth.csv, and both are drawn.
Everything runs in one thread unless stated; processor times are reliable beside other processes, clock times are not.
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
from tests.benchmarks.equal_error import equal_error_rows
from tests.benchmarks.first_minute import first_run_rows
from tests.benchmarks.growth import STEP, TILES, growth, run_benchmark_job, walled_packing
from tests.benchmarks.marks import mark_rows
from tests.benchmarks.photograph_rows import detection_rows, tracking_rows
from tests.benchmarks.solver_rows import load_rows, member_rows, sweep_rows
from tests.benchmarks.timing import Duration, Row, format_table, in_processor_time, processor_name

ROOT = Path(__file__).parents[2]
SAMPLE = ROOT / "sample_data" / "shear"


def ratios() -> Iterator[tuple[str, list[Row]]]:
    yield "Ratios", [*sweep_rows((1000, 10_000, 100_000)), *member_rows((1000, 5000)), *load_rows((1000, 10_000))]
    yield "Other solvers at equal error", list(equal_error_rows((1000,)))


def photographs() -> Iterator[tuple[str, list[Row]]]:
    yield "Photographs: tracking on one core", list(tracking_rows())
    yield "Photographs: detection", list(detection_rows())


def start() -> Iterator[tuple[str, list[Row]]]:
    call = "from rodsight.cli.main import main; main()"
    ready = "import rodsight.pipeline, rodsight.inference.infer_sequence"
    rows = [
        in_processor_time("`rodsight --help`", _time_process("-c", call, "--help"), "≤ .3 s"),
        in_processor_time("loading all that solving tracks needs", _time_process("-c", ready), "≤ 1.5 s"),
    ]
    yield "Start", rows


def first_minute() -> Iterator[tuple[str, list[Row]]]:
    yield "The first minute: no folder of kernels", list(first_run_rows())


def marks(folder: Path) -> Iterator[tuple[str, list[Row]]]:
    """Where the time of whole sequences goes, from tracks to results."""
    for rods, frames, aim in ((1172, 30, "≤ .22 s"), (250, 100, ""), (5000, 8, "≤ 1.0 s")):
        path = walled_packing(folder, rods, frames, **({"step_degrees": STEP} if frames > 30 else {}))
        yield f"A sequence of {frames} frames of {rods} rods, by marks", list(mark_rows(path, aim=aim))


def sample() -> Iterator[tuple[str, list[Row]]]:
    result = run_benchmark_job(SAMPLE)
    rows = []
    for name, seconds in result["stages"].items():
        label = f"{name}, {result['frames']} photographs of {result['rods']} rods"
        rows.append(in_processor_time(label, [Duration(*seconds)]))
    rows.append(Row("peak of memory", f"{result['peak']:.0f} MB"))
    yield "The sample, from photographs to the recording", rows


def _time_process(*arguments: str, rounds: int = 3) -> list[Duration]:
    """Time several starts of Python after a first one."""
    import resource

    def spent() -> float:
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        return used.ru_utime + used.ru_stime

    durations = []
    for _ in range(rounds + 1):
        processor, clock = spent(), time.perf_counter()
        subprocess.run([sys.executable, *arguments], check=True, capture_output=True, cwd=ROOT)
        durations.append(Duration(spent() - processor, time.perf_counter() - clock))
    return durations[1:]


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks", description=__doc__)
    parser.add_argument(
        "--only", nargs="+", choices=["ratios", "start", "first", "photographs", "marks", "growth", "sample"]
    )
    parser.add_argument("--tiles", nargs="+", type=int, default=TILES)
    parser.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()) / "rodsight-benchmark")
    parser.add_argument("--append", action="store_true")
    options = parser.parse_args()
    parts = {
        "ratios": ratios, "marks": lambda: marks(options.folder), "start": start, "first": first_minute,
        "photographs": photographs,
        "growth": lambda: growth(options.folder, options.tiles, keep=options.append), "sample": sample,
    }  # fmt: skip
    print(f"{processor_name()}; {date.today().isoformat()}\n", flush=True)
    measured: list[Row] = []
    commit = history.present_commit() if options.append else ""
    for name in options.only or parts:
        for title, rows in parts[name]():
            print(format_table(title, rows), flush=True)
            measured += rows
    if options.append:
        print(f"{history.append(measured, commit)} figures added to {history.HISTORY.relative_to(ROOT)}")
        history.draw(history.read())


if __name__ == "__main__":
    main()
