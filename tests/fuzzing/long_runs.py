"""Memory of a long run by stage, read from the operating system while it runs.

python -m tests.fuzzing --long 1000     a run, its recording and its review with this number of photographs
"""

from __future__ import annotations

import json
import os
import random
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

from rodsight.experiment.units import Scale
from rodsight.recording.viewing.recording_server import RecordingServer
from rodsight.reviewing.reviewed_run import open_reviewed_run
from rodsight.reviewing.session import ReviewSession, View

from tests.program import RODSIGHT

from .attempt import run_in_fork

Memory = dict[str, dict[int, int]]  # [bytes] by stage and frames done
EARLY, WIDTH = 50, 10  # frames after which one-time allocations are done, and window of the maximum
FEW = ("--set", "solver.estimator=nlgs", "--set", "solver.sweeps=20")


def lengthen(tracked: Path, folder: Path, count: int) -> Path:
    """Write an experiment of `count` photographs: those of a shorter one back and forth, with independent noise."""
    rng = random.Random(count)
    folder.mkdir()
    poses = _by_frame(tracked / "tracks.csv")
    there_and_back = [*range(len(poses)), *range(len(poses) - 2, 0, -1)]
    order = [there_and_back[k % len(there_and_back)] for k in range(count)]

    def moved(row: list[str]) -> list[str]:
        return [row[0], *(repr(float(cell) + rng.gauss(0.0, 1e-6)) for cell in row[1:3]), *row[3:]]

    walls = _by_frame(tracked / "walls.csv")
    _write(folder / "tracks.csv", "frame,id,x,y,theta", ((k, map(moved, poses[at])) for k, at in enumerate(order)))
    _write(folder / "walls.csv", "frame,wall,x1,y1,x2,y2", ((k, walls[at]) for k, at in enumerate(order)))
    _write(folder / "times.csv", "frame,time", ((k, [[str(30.0 * k)]]) for k in range(count)))
    (folder / "grains.csv").write_text((tracked / "grains.csv").read_text())
    text = (tracked / "experiment.toml").read_text().splitlines()
    (folder / "experiment.toml").write_text(
        "\n".join(line for line in text if not line.startswith(("truth", "forces"))) + "\n"
    )
    return folder


def memory_of_run(experiment: Path, out: Path) -> Memory:
    """Measure the memory of a run after every reported frame, by stage."""
    command = [*RODSIGHT, "run", str(experiment), "--out", str(out), "--progress", "lines", *FEW]
    found: Memory = {}
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as run:
        assert run.stderr is not None
        for line in run.stderr:
            if line.startswith("{"):
                event = json.loads(line)
                found.setdefault(event["stage"], {})[event["done"]] = resident(run.pid)
        status = run.wait()
    if status:
        raise RuntimeError(f"the run ended with status {status}")
    return found


def memory_of_review(out: Path, count: int) -> Memory:
    """Measure the memory of a review that shows the pairs of all photographs."""

    def review() -> dict[str, int]:
        session, memory = ReviewSession(open_reviewed_run(out), Scale(1e-4, 1000)), {}
        for frame in range(count):
            session.status(View("anna", frame))
            session.next_pair(View("anna", frame))
            memory[str(frame + 1)] = resident(os.getpid())
        return memory

    return {"review": {int(frame): size for frame, size in (run_in_fork(review) or {}).items()}}


def memory_of_view(out: Path, count: int) -> Memory:
    """Measure the memory of serving the recording, by the fraction sent."""

    def serve() -> dict[str, int]:
        file, sent, memory = out / "recording.rrd", 0, {}
        server = RecordingServer([file])
        for piece in server.read_pieces(file):
            sent += len(piece)
            held = resident(os.getpid())
            memory |= {str(k): held for k in range(len(memory) + 1, 1 + count * sent // file.stat().st_size)}
        return memory

    return {"view": {int(frame): size for frame, size in (run_in_fork(serve) or {}).items()}}


def growth(memory: dict[int, int]) -> tuple[int, int, float]:
    """Return the maximum around frame EARLY and of the last frames [bytes], and its relative growth."""
    last = max(memory)
    early = max(size for frame, size in memory.items() if abs(frame - EARLY) <= WIDTH)
    late = max(size for frame, size in memory.items() if frame > last - 2 * WIDTH)
    return early, late, late / early - 1.0


def describe(found: Memory) -> Iterator[str]:
    for stage, memory in found.items():
        if max(memory) > EARLY:
            early, late, increase = growth(memory)
            first, last = f"{early / 1e6:.0f} MB at frame {EARLY}", f"{late / 1e6:.0f} MB at {max(memory)}"
            yield f"{stage}: {first}, {last}, {increase:+.1%}"


def resident(process: int) -> int:
    """Return the resident memory of a process [bytes]."""
    pages = Path(f"/proc/{process}/statm").read_text().split()[1]
    return int(pages) * os.sysconf("SC_PAGE_SIZE")


def measure(tracked: Path, work: Path, count: int, report: Callable[[str], object] = print) -> Memory:
    """Run, record and review this number of photographs; return and report the memory."""
    experiment, out = lengthen(tracked, work / "long", count), work / "out"
    found = memory_of_run(experiment, out) | memory_of_review(out, count) | memory_of_view(out, count)
    for line in describe(found):
        report(line)
    return found


def _by_frame(table: Path) -> list[list[list[str]]]:
    rows: dict[int, list[list[str]]] = {}
    for line in table.read_text().splitlines()[1:]:
        frame, *cells = line.split(",")
        rows.setdefault(int(frame), []).append(cells)
    return [rows[frame] for frame in sorted(rows)]


def _write(file: Path, header: str, frames) -> None:
    lines = (",".join((str(frame), *row)) for frame, rows in frames for row in rows)
    file.write_text("\n".join((header, *lines)) + "\n")
