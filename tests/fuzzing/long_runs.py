"""How much memory a long run takes, stage by stage, asked of the system while it works.

python -m tests.fuzzing --long 1000     the figures of a run, its recording and its review of so many photographs
"""

from __future__ import annotations

import json
import os
import random
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

from rodsight.recording.viewing.recording_server import RecordingServer
from rodsight.review.command import open_session
from rodsight.review.reviewed_run import open_reviewed
from rodsight.review.service.session import Viewpoint

from tests.program import RODSIGHT

from .attempt import in_a_fork

Memory = dict[str, dict[int, int]]  # [bytes] by stage and frames done
EARLY, WIDTH = 50, 10  # frames after which all that is made once is made, and around which the most is taken
FEW = ("--set", "solver.estimator=nlgs", "--set", "solver.sweeps=20")


def lengthen(tracked: Path, folder: Path, count: int) -> Path:
    """An experiment of `count` photographs: those of a shorter one to and fro, each with noise of its own."""
    chance = random.Random(count)
    folder.mkdir()
    poses = _by_frame(tracked / "tracks.csv")
    there_and_back = [*range(len(poses)), *range(len(poses) - 2, 0, -1)]
    order = [there_and_back[k % len(there_and_back)] for k in range(count)]

    def moved(row: list[str]) -> list[str]:
        return [row[0], *(repr(float(cell) + chance.gauss(0.0, 1e-6)) for cell in row[1:3]), *row[3:]]

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
    """What a run takes after every frame that it tells of, stage by stage."""
    command = [*RODSIGHT, "run", str(experiment), "--out", str(out), "--progress", "lines", *FEW]
    found: Memory = {}
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as run:
        assert run.stderr is not None
        for line in run.stderr:
            if line.startswith("{"):
                told = json.loads(line)
                found.setdefault(told["stage"], {})[told["done"]] = resident(run.pid)
        status = run.wait()
    if status:
        raise RuntimeError(f"the run ended with status {status}")
    return found


def memory_of_review(out: Path, count: int) -> Memory:
    """What somebody takes who looks at the pairs of every photograph, one after the other."""

    def review() -> dict[str, int]:
        session, taken = open_session(open_reviewed(out)), {}
        for frame in range(count):
            session.status(Viewpoint("anna", frame))
            session.following(Viewpoint("anna", frame))
            taken[str(frame + 1)] = resident(os.getpid())
        return taken

    return {"review": {int(frame): size for frame, size in (in_a_fork(review) or {}).items()}}


def memory_of_view(out: Path, count: int) -> Memory:
    """What serving the recording takes, by the share of it that a browser has got."""

    def serve() -> dict[str, int]:
        file, sent, taken = out / "recording.rrd", 0, {}
        server = RecordingServer([file])
        for piece in server.pieces(file):
            sent += len(piece)
            held = resident(os.getpid())
            taken |= {str(k): held for k in range(len(taken) + 1, 1 + count * sent // file.stat().st_size)}
        return taken

    return {"view": {int(frame): size for frame, size in (in_a_fork(serve) or {}).items()}}


def growth(taken: dict[int, int]) -> tuple[int, int, float]:
    """The most around frame EARLY and among the last frames [bytes], and by which share it grew."""
    last = max(taken)
    early = max(size for frame, size in taken.items() if abs(frame - EARLY) <= WIDTH)
    late = max(size for frame, size in taken.items() if frame > last - 2 * WIDTH)
    return early, late, late / early - 1.0


def describe(found: Memory) -> Iterator[str]:
    for stage, taken in found.items():
        if max(taken) > EARLY:
            early, late, share = growth(taken)
            yield f"{stage}: {early / 1e6:.0f} MB at frame {EARLY}, {late / 1e6:.0f} MB at {max(taken)}, {share:+.1%}"


def resident(process: int) -> int:
    """Bytes of memory that a process holds."""
    pages = Path(f"/proc/{process}/statm").read_text().split()[1]
    return int(pages) * os.sysconf("SC_PAGE_SIZE")


def measure(tracked: Path, work: Path, count: int, tell: Callable[[str], object] = print) -> Memory:
    """Run, record and review so many photographs; gives what that took."""
    experiment, out = lengthen(tracked, work / "long", count), work / "out"
    found = memory_of_run(experiment, out) | memory_of_review(out, count) | memory_of_view(out, count)
    for line in describe(found):
        tell(line)
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
