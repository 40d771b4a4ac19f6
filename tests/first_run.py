"""The first run of the sample after an installation, without a folder of kernels: compilations and times."""

from __future__ import annotations

import compileall
import json
import os
import subprocess
import sys
import time
import zipfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
SAMPLE = ROOT / "sample_data/shear"
CHECKOUT = ROOT / ".editable"
# A command whose compilations are counted, and which notes when its first photograph was read. Until then the compiler
# must not be loaded, and so nothing is compiled.
PROGRAM = """
import json, sys, time
from rodsight.cli.main import main
imported = time.process_time()
from rodsight.experiment import photographs

compiled, first = [], []
read = photographs.content_of
def read_noting(*args):
    if not first:
        first.append(time.process_time())
        assert "numba" not in sys.modules
        count_compilations()
    return read(*args)
def count_compilations():
    from numba.core import event

    class Counter(event.Listener):
        def on_start(self, event):
            compiled.append(event)
        def on_end(self, event):
            pass

    event.register("numba:compile", Counter())
photographs.content_of = read_noting
try:
    main()
finally:
    print(json.dumps({"compilations": len(compiled), "imported": imported, "first": first[0]}))
"""


@dataclass(frozen=True, slots=True)
class FirstRun:
    """One first run."""

    compilations: int  # in the process of the command itself
    processor: float  # [s], with all processes that it starts
    clock: float  # [s]
    imported: float  # [s] of processor time until the command is imported, Python's own start included
    first_photograph: float  # [s] of processor time until it is read
    results: Path


def build_wheel(folder: Path, *levels: str) -> Path:
    """Build the wheel with kernels for these levels (default: all) as a release does."""
    environment = {**os.environ, "PYTHON": sys.executable}
    command = [str(ROOT / ".ci/wheel"), str(folder), *levels]
    subprocess.run(command, check=True, capture_output=True, env=environment, cwd=ROOT)
    (file,) = folder.glob("*.whl")
    return file


def unpack_wheel(wheel: Path, folder: Path) -> Path:
    """Install a wheel into a folder that the search path can name, with byte code as pip writes it."""
    with zipfile.ZipFile(wheel) as content:
        content.extractall(folder)
    compileall.compile_dir(folder, quiet=2)
    return folder


def run_first(site: Path, folder: Path) -> FirstRun:
    """Run the sample with the program of a folder on the search path, and a home folder that is empty."""
    import resource

    home = folder / "home"
    home.mkdir(parents=True)
    hidden = ("NUMBA_CACHE_DIR", "NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES", "XDG_CACHE_HOME")
    environment = {name: value for name, value in os.environ.items() if name not in hidden}
    environment |= {"HOME": str(home), "PYTHONPATH": str(site)}
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, "run", str(SAMPLE), "--out", str(folder / "run"), "--quiet"],
        env=environment, check=False, capture_output=True, text=True, cwd=folder,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    clock, after = time.perf_counter() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
    processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    stated = json.loads(done.stdout.splitlines()[-1])
    return FirstRun(stated["compilations"], processor, clock, stated["imported"], stated["first"], folder / "run")
