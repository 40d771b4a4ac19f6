"""On a full disk every writer ends with one line, and leaves whole files only: those it had finished, or the former."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from rodsight.process.atomic import replacing_folder

from .attempt import Outcome, attempt, run_in_fork
from .cases import FEW
from .faults import limit_files

LIMITS = (0, 5000, 60_000)  # [bytes] of a file, of which the largest have several hundred thousand
LIMIT, SMALL = 5000, {"dic": 300, "import": 300}  # [bytes] one limit, and one where all files are smaller
SPACE = ("16k", "128k", "1m")  # of a disk
UNLIKE = 64  # bytes by which two files with the same content differ: dates, names of folders
SUMMARIES = (".csv", ".json", ".html")  # which also list what failed: whole, but not always the same
LOGS = ("worker", ".log", "verdicts", ".lock")  # files that grow line by line
SOLVED = {  # arguments after the command by name; {run}, {experiment} and {out} stand for places
    "tables": "export tables {run} --out {out}/tables",
    "parquet": "export tables {run} --kind parquet --out {out}/tables",
    "vtk": "export vtk {run} --out {out}/vtk",
    "ovito": "export ovito {run} --out {out}/ovito",
    "graph": "export graph {run} --out {out}/graph",
    "dic": "export dic {run} --pixel-size 1e-4 --out {out}/dic",
    "figures": "export figures {run} --formats pdf svg png --out {out}/figures",
    "pictures": "export pictures {run} --figure forces --size 400x300 --out {out}/pictures",
    "mp4": "export video {run} --figure forces --size 400x300 --out {out}/film.mp4",
    "webm": "export video {run} --figure forces --size 400x300 --out {out}/film.webm",
    "share": "share {run} --although-out-of-date --out {out}/small.rrd",
    "import": "import table {experiment}/tracks.csv {out}/new --radius 0.008 --walls box --quiet "
    "--columns frame=frame,id=id,x=x,y=y,theta=theta",
    "campaign": "campaign {table} --out {out}/campaign --workers 1 --no-recordings --quiet",
    "sensitivity": "sensitivity {experiment} --factors friction --workers 1 --quiet --out {out}/sensitivity",
    "real": "study real {run} --page {out}/real.html",
    "synth": "synth {out}/made --grains 12 --frames 2",
    "init": "init {photographs} --photographs *.*g --pixel-size 1e-4 --interval 30 --quiet",
}
# seconds each, left to the test with a full disk; html: the viewer is packed into the page
HEAVY = ("html", "synth", "campaign", "webm", "mp4", "figures", "init")
SLOW = ("sensitivity", "pictures", "real")  # a second each
SOLVED["html"] = "share {run} --html --although-out-of-date --out {out}/small.html"


@pytest.fixture(scope="module")
def places(originals, tmp_path_factory) -> dict[str, Path]:
    """The inputs of the commands: a run with its recording, its experiment, photographs, a table of a campaign."""
    folder = tmp_path_factory.mktemp("full disk")
    run = folder / "run"
    ended = attempt(["run", str(originals.tracked), "--out", str(run), *FEW])
    assert ended.status == 0, ended.errors
    table = folder / "campaign.csv"
    settings = "solver.estimator,solver.sweeps"
    table.write_text(f"experiment,{settings}\n{originals.tracked},nlgs,5\n")
    return {"run": run, "experiment": originals.tracked, "table": table, "source": originals.photographed}


def arguments_of(name: str, places: dict[str, Path], out: Path) -> list[str]:
    photographs = out / "photographs"
    if name == "init":
        shutil.copytree(places["source"] / "photos", photographs, dirs_exist_ok=True)
    given = {**places, "out": out, "photographs": photographs}
    return [part.format(**given) for part in SOLVED[name].split(" ")]


def files_of(out: Path) -> dict[str, int]:
    """Sizes of all files by their path."""
    return {file.relative_to(out).as_posix(): file.stat().st_size for file in out.rglob("*") if file.is_file()}


@pytest.fixture(scope="module")
def whole(places, tmp_path_factory) -> dict[str, dict[str, int]]:
    """What each command writes where the disk is not full, by name: filled at the first use."""
    return {}


def written_by(name: str, places, whole, out: Path) -> dict[str, int]:
    if name not in whole:
        out.mkdir()
        arguments = arguments_of(name, places, out)
        ended = attempt(arguments)
        assert ended.status in (0, 3), (arguments, ended.errors)
        whole[name] = files_of(out)
    return whole[name]


def is_whole(file: Path) -> bool:
    """Whether a table, a list or a page has its end."""
    content = file.read_text(encoding="utf-8")
    if file.suffix == ".json":
        json.loads(content)
    return content.endswith("\n") or content.rstrip().endswith("</html>")


def judge(name: str, ended: Outcome, out: Path, wanted: dict[str, int]) -> list[str]:
    """Return what is wrong after a command on a full disk."""
    found = files_of(out)
    problems = []
    lines = ended.errors.strip().splitlines()
    if ended.status not in (0, 1, 3) or "Traceback" in ended.errors:
        problems.append(f"ended with {ended.status}: {ended.errors[-600:]}")
    elif ended.status == 1 and (len(lines) != 1 or not lines[0].startswith("rodsight: ")):
        problems.append(f"is not one line: {ended.errors[-600:]}")
    for file, size in found.items():
        if Path(file).suffix in SUMMARIES and name in ("campaign", "sensitivity"):
            problems += [] if is_whole(out / file) else [f"{file} is cut off"]
            continue
        if any(log in file for log in LOGS):
            continue
        if ".part" in file or "loose" in file:
            problems.append(f"left {file}")
        elif file in wanted and abs(size - wanted[file]) > max(UNLIKE, 0.02 * wanted[file]):
            problems.append(f"{file} has {size} of {wanted[file]} bytes")
    if ended.status == 0 and set(wanted) - set(found):
        problems.append(f"ended well without {sorted(set(wanted) - set(found))}")
    return [f"{name}: {each}" for each in problems]


def limited(name: str, limit: int, places, out: Path) -> Outcome:
    """Run a command while no file may be larger than this; in a process of its own."""
    out.mkdir()
    arguments = arguments_of(name, places, out)

    def work() -> list:
        limit_files(limit)
        ended = attempt(arguments)
        return [ended.status, ended.errors, ended.seconds]

    found = run_in_fork(work)
    return Outcome(*found) if found else Outcome(-9, "it ended without a message", 0.0)


def problems_at(limits: Iterable[int], name: str, places, whole, folder: Path) -> list[str]:
    """Run a command under each limit, and return what is wrong; one limit at least must stop it."""
    wanted = written_by(name, places, whole, folder / "whole")
    problems, failed = [], 0
    for limit in limits:
        out = folder / f"{limit}"
        ended = limited(name, limit, places, out)
        failed += ended.status != 0
        problems += [f"{limit} bytes: {each}" for each in judge(name, ended, out, wanted)]
    return problems if failed else [*problems, f"{name}: no limit of {limits} stopped it"]


@pytest.mark.thorough
@pytest.mark.parametrize("name", [name for name in SOLVED if name not in HEAVY + SLOW])
def test_a_writer_leaves_whole_files_where_files_cannot_grow(name, places, whole, tmp_path):
    assert problems_at((SMALL.get(name, LIMIT),), name, places, whole, tmp_path) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in SOLVED if name not in HEAVY])
def test_every_writer_leaves_whole_files_at_every_limit(name, places, whole, tmp_path):
    assert problems_at(LIMITS[1:2] if name in SLOW else LIMITS, name, places, whole, tmp_path) == []


@contextmanager
def small_disk(place: Path, size: str) -> Iterator[Path]:
    """A disk of this size."""
    place.mkdir()
    done = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={size}", "none", str(place)], capture_output=True, text=True
    )
    if done.returncode:
        pytest.skip(f"no disk can be mounted here: {done.stderr.strip()}")
    try:
        yield place
    finally:
        subprocess.run(["umount", str(place)], check=True)


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root mounts disks")
@pytest.mark.parametrize("name", list(SOLVED))
def test_every_writer_leaves_whole_files_on_a_full_disk(name, places, whole, tmp_path):
    wanted = written_by(name, places, whole, tmp_path / "whole")
    problems = []
    for size in SPACE:
        with small_disk(tmp_path / size, size) as disk:
            out = disk / "out"
            out.mkdir()
            try:
                arguments = arguments_of(name, places, out)
            except OSError:  # the photographs themselves do not fit
                continue

            def work(arguments: list[str] = arguments) -> list:
                ended = attempt(arguments)
                return [ended.status, ended.errors, ended.seconds]

            found = run_in_fork(work)
            ended = Outcome(*found) if found else Outcome(-9, "it ended without a message", 0.0)
            problems += [f"{size}: {each}" for each in judge(name, ended, out, wanted)]
    assert problems == []


def fail_halfway(folder: Path) -> None:
    with replacing_folder(folder) as part:
        (part / "a").write_text("1")
        raise ZeroDivisionError


def test_a_folder_appears_whole_or_not_at_all(tmp_path):
    folder = tmp_path / "folder"
    with pytest.raises(ZeroDivisionError):
        fail_halfway(folder)
    assert list(tmp_path.iterdir()) == []
    for content in ("1", "2"):
        with replacing_folder(folder) as part:
            (part / "inner").mkdir()
            (part / "inner" / "a").write_text(content)
        (folder / "own").write_text("of somebody else")
    assert (folder / "inner" / "a").read_text() == "2"
    assert (folder / "own").exists()
    assert [each.name for each in tmp_path.iterdir()] == ["folder"]
