"""Growth of the time and memory of a run with the size of packing and sequence.

Tracks are simulated, or periodic copies of a simulated cell. python -m tests.benchmarks.growth draws the stored table.
"""

from __future__ import annotations

import csv
import io
import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from rodsight.process.atomic import write_atomically
from rodsight.synthetic.synthesis import SynthesisSettings, synthesize

from tests.benchmarks.history import PICTURE, ROOT
from tests.benchmarks.tiled_packing import NOISE, tiled_packing
from tests.benchmarks.timing import Duration, Row, processor_name

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TABLE = Path(__file__).parent / "growth.csv"
DRAWN = PICTURE.with_name("speed_growth.svg")
BETWEEN_WALLS, IN_A_CELL = "rods between walls", "rods of a periodic cell"
# Colour and line, by which curves differ in grey and for colour-blind readers, too.
STYLES = {
    BETWEEN_WALLS: {"color": "#0072b2", "marker": "o"},
    IN_A_CELL: {"color": "#d55e00", "marker": "s", "ls": "--"},
}
SOLVING, RECORDING = {"color": "#009e73", "marker": "o"}, {"color": "#cc79a7", "marker": "s", "ls": "--"}
WALLED = ((250, 24), (1172, 24), (5000, 8), (10_000, 6))  # rods, frames
LONG = (250, (24, 150, 600))  # rods, frames of as many sequences
STEP = 0.05  # [°] of shear between two frames of those, small for a limited total shear
TILES = (1, 3, 5)  # of a cell of 450 rods, each way; 15 are 101 250
AIMS = {1172: "≤ .20 s", 4050: "≤ 1 s", 5000: "≤ 1 s", 10_000: "≤ 2.5 s", 11_250: "≤ 2.5 s", 101_250: "≤ 60 s"}
SEED = 1


class Job(NamedTuple):
    """One run on tracks, from reading to recording."""

    date: str
    machine: str
    kind: str
    rods: int
    frames: int
    solving: float  # [s] processor time of all frames
    solving_clock: float  # [s]
    recording: float  # [s] processor time
    recording_clock: float  # [s]
    peak: float  # [MB]


def growth(folder: Path, tiles: Sequence[int], *, keep: bool) -> Iterator[tuple[str, list[Row]]]:
    """Measure response times and growth with size and length; keep: store the table and draw it."""
    jobs: list[Job] = []
    responses, sizes, lengths = [], [], []
    for kind, path in _packings(folder, tiles):
        result = run_benchmark_job(path)
        jobs.append(_job_of(kind, result))
        sizes += _rows_of(jobs[-1], _power([each for each in jobs if each.kind == kind]))
        label = f"{result['rods']} {kind}"
        responses.append(
            Row(f"forces without one contact, locally, {label}", str(Duration(*result["without"])), "≤ 10 ms")
        )
        responses.append(Row(f"the same by `rodsight.what_if`, {label}", str(Duration(*result["what_if"])), "≤ 10 ms"))
        if result["again"]:
            responses.append(Row(f"one frame solved again, {label}", str(Duration(*result["again"])), "≤ .06 s"))
    yield "Response times", responses
    yield "Growth with the packing, on tracks", sizes
    for path in _sequences(folder):
        jobs.append(_job_of(BETWEEN_WALLS, run_benchmark_job(path)))
        lengths += _rows_of(jobs[-1], "")
    yield "Growth with the sequence, on tracks", lengths
    if keep:
        _write([*(each for each in read() if each.machine != processor_name()), *jobs])
        draw(read())


def run_benchmark_job(experiment: Path) -> dict:
    """Run `tests.benchmarks.job` on an experiment in a process of its own, and return its result."""
    command = [sys.executable, "-m", "tests.benchmarks.job", str(experiment)]
    text = subprocess.run(command, check=True, capture_output=True, text=True, cwd=ROOT).stdout
    return json.loads(text.splitlines()[-1])


def _packings(folder: Path, tiles: Sequence[int]) -> Iterator[tuple[str, Path]]:
    for rods, frames in WALLED:
        yield BETWEEN_WALLS, walled_packing(folder, rods, frames)
    for each in tiles:
        yield IN_A_CELL, tiled_packing(folder, each)


def _sequences(folder: Path) -> Iterator[Path]:
    rods, lengths = LONG
    for frames in lengths:
        yield walled_packing(folder, rods, frames, step_degrees=STEP)


def walled_packing(folder: Path, rods: int, frames: int, **options: float) -> Path:
    """Folder with the tracks of a packing sheared between walls; simulated if missing."""
    path = folder / "walled" / " ".join([f"{rods} rods, {frames} frames", *map(str, options.values())])
    if not (path / "experiment.toml").exists():
        print(f"simulating {path.name} …", file=sys.stderr, flush=True)
        synthesize(
            path,
            SynthesisSettings(
                preset="paper", grains=rods, frames=frames, photographs=False, noise=NOISE, seed=SEED, **options
            ),
        )
    return path


def _job_of(kind: str, result: dict) -> Job:
    stages = result["stages"]
    (solving, solving_clock), (recording, recording_clock) = stages["solving"], stages["recording"]
    return Job(
        date.today().isoformat(), processor_name(), kind, result["rods"], result["frames"], solving, solving_clock,
        recording, recording_clock, result["peak"],
    )  # fmt: skip


def _power(jobs: list[Job]) -> str:
    """Describe the growth of the time of a frame since the next smaller packing."""
    if len(jobs) < 2:
        return ""
    before, now = jobs[-2:]
    power = np.log(now.solving / now.frames * before.frames / before.solving) / np.log(now.rods / before.rods)
    return f"; growth n^{power:.2f}"


def _rows_of(job: Job, growth_note: str) -> list[Row]:
    solving = Duration(job.solving, job.solving_clock) / job.frames
    recording = Duration(job.recording, job.recording_clock) / job.frames
    label = f"{job.rods} {job.kind}, a frame of {job.frames}"
    return [
        Row(f"solving {label}, calibration included", f"{solving}{growth_note}", AIMS.get(job.rods, "")),
        Row(f"recording {label}", str(recording), "≤ .15 s"),
        Row(f"peak of memory, {label}", f"{job.peak:.0f} MB"),
    ]


def read(file: Path = TABLE) -> list[Job]:
    """The jobs of the stored table; none without a file."""
    if not file.exists():
        return []
    with file.open(encoding="utf-8", newline="") as stream:
        return [
            Job(
                row["date"], row["machine"], row["kind"], int(row["rods"]), int(row["frames"]), float(row["solving"]),
                float(row["solving_clock"]), float(row["recording"]), float(row["recording_clock"]), float(row["peak"]),
            )
            for row in csv.DictReader(stream)
        ]  # fmt: skip


def _write(jobs: list[Job], file: Path = TABLE) -> None:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(Job._fields)
    writer.writerows([f"{value:.6g}" if isinstance(value, float) else value for value in job] for job in jobs)
    write_atomically(file, text.getvalue().encode())


def draw(jobs: list[Job], picture: Path = DRAWN) -> None:
    """Seconds of a frame over the rods, seconds of a run over the frames; the machine measured last."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    own = [each for each in jobs if each.machine == jobs[-1].machine]
    # The later one where a packing of the sizes has as many frames.
    long = list({each.frames: each for each in own if each.rods == LONG[0] and each.frames in LONG[1]}.values())
    with mpl.rc_context({"svg.hashsalt": "rodsight", "svg.fonttype": "none", "font.size": 8}):
        page = Figure(figsize=(8.0, 3.2), layout="constrained")
        seconds, length = page.subplots(1, 2)
        for kind, style in STYLES.items():
            some = sorted((each for each in own if each.kind == kind and each not in long), key=lambda each: each.rods)
            rods = [each.rods for each in some]
            seconds.plot(rods, [each.solving / each.frames for each in some], ms=4, label=kind, **style)
        limits = {rods: float(aim.strip("≤ s")) for rods, aim in AIMS.items()}
        seconds.plot(list(limits), list(limits.values()), "_", color="black", ms=12, label="aim")
        _frame(
            seconds, "solving a frame, calibration included [s of the processor]", "rods", (250, 1172, 5000, 100_000)
        )
        seconds.set_yscale("log")
        seconds.legend(frameon=False)
        frames = [each.frames for each in long]
        length.plot(frames, [each.solving for each in long], ms=4, label="solving", **SOLVING)
        length.plot(frames, [each.recording for each in long], ms=4, label="recording", **RECORDING)
        _frame(length, f"a run of {LONG[0]} rods [s of the processor]", "frames", LONG[1])
        length.set_yscale("log")
        length.legend(frameon=False)
        text = io.BytesIO()
        page.savefig(text, format="svg", metadata={"Date": None})
    write_atomically(picture, text.getvalue())


def _frame(panel: Axes, title: str, over: str, ticks: Sequence[int]) -> None:
    panel.set_xscale("log")
    panel.set_xticks(ticks, [f"{each:,}".replace(",", " ") for each in ticks])
    panel.minorticks_off()
    panel.set_title(title, fontsize=8)
    panel.set_xlabel(over)
    panel.grid(lw=0.3)


if __name__ == "__main__":
    draw(read())
