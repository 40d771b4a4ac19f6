"""Kernels are compiled ahead by processes that may be lost, and never awaited in vain."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from rodsight.compilation import ahead
from rodsight.compilation.ahead import SOLVER_KERNELS, TRACKING_KERNELS, KernelsAhead
from rodsight.compilation.kernel_list import Kernel

# Workers that answer in place of the compiler, and write down the kernels that they were given.
WORKER = """
import sys
for line in sys.stdin:
    with open({log!r}, "a") as log:
        log.write(line)
    {act}
"""
COMPILES = "print('compiled', flush=True)"
SKIPS = "print('skipped: AttributeError', flush=True)"
ENDS = "sys.exit(1)"
KERNELS = (
    Kernel("tracking.a", "leaf", (), 0.1),
    Kernel("tracking.a", "root", (), 0.1, (0,)),
    Kernel("solver.b", "other", (), 0.1, (1,)),
    Kernel("solver.b", "rare", (), 0.1, of_run=False),
)


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    monkeypatch.setattr(ahead, "kernel_folder", lambda: tmp_path)
    monkeypatch.setattr(ahead, "read_kernels", lambda: KERNELS)
    monkeypatch.setattr(ahead, "FILE", Path(__file__))
    monkeypatch.setattr("rodsight.solver.parallel.available_cores", lambda: 2)
    monkeypatch.delenv("NUMBA_DISABLE_JIT", raising=False)
    return tmp_path


def use(monkeypatch: pytest.MonkeyPatch, folder: Path, act: str) -> Path:
    log = folder / "given.txt"
    monkeypatch.setattr(ahead, "COMMAND", (sys.executable, "-c", WORKER.format(log=str(log), act=act)))
    return log


def compile_all(progress=lambda *_: None, **options) -> KernelsAhead:
    kernels = KernelsAhead()
    with kernels.compiling((TRACKING_KERNELS, SOLVER_KERNELS), progress, **options):
        kernels.wait(TRACKING_KERNELS)
        kernels.wait(SOLVER_KERNELS)
    return kernels


def given(log: Path) -> list[int]:
    return list(map(int, log.read_text().split())) if log.exists() else []


def test_kernels_of_a_run_are_compiled_after_those_they_call_and_once(folder, monkeypatch):
    log, shown = use(monkeypatch, folder, COMPILES), []
    assert compile_all(lambda *progress: shown.append(progress)).is_complete
    assert given(log) == [0, 1, 2]
    assert sorted(shown) == [("compiling", 1, 3), ("compiling", 2, 3), ("compiling", 3, 3)]
    assert compile_all().is_complete
    assert given(log) == [0, 1, 2]  # no process is started again


def test_long_chains_of_a_stage_begin_first_and_earlier_stages_before_later_ones(folder, monkeypatch):
    listed = (
        Kernel("solver.b", "small", (), 0.2),
        Kernel("solver.b", "large", (), 2.0),
        Kernel("solver.b", "called", (), 0.1),
        Kernel("solver.b", "calling", (), 3.0, (2,)),
        Kernel("solver.b", "rare", (), 9.0, (0,), of_run=False),
        Kernel("tracking.a", "leaf", (), 0.1),
    )
    monkeypatch.setattr(ahead, "read_kernels", lambda: listed)
    log = use(monkeypatch, folder, COMPILES)
    monkeypatch.setattr(ahead, "_begin_worker", one_worker())
    assert compile_all().is_complete
    assert given(log) == [5, 2, 3, 1, 0]


def one_worker():
    """Start the first process only, so that the order is certain."""
    begin, begun = ahead._begin_worker, []

    def first():
        if begun:
            raise OSError("no further process")
        begun.append(True)
        return begin()

    return first


def test_no_process_is_started_where_a_wheel_brought_the_kernels(folder, monkeypatch):
    log = use(monkeypatch, folder, COMPILES)
    monkeypatch.setattr(ahead, "has_shipped_kernels", lambda: True)
    assert compile_all().is_complete
    assert given(log) == []


def test_a_wheel_gets_the_kernels_of_all_uses(folder, monkeypatch):
    log = use(monkeypatch, folder, COMPILES)
    assert compile_all(all_uses=True).is_complete
    assert sorted(given(log)) == [0, 1, 2, 3]


@pytest.mark.parametrize("act", [SKIPS, ENDS])
def test_a_run_goes_on_where_kernels_are_skipped_or_processes_lost_and_the_next_one_tries_again(
    folder, monkeypatch, act
):
    log = use(monkeypatch, folder, act)
    assert not compile_all().is_complete
    tried = len(given(log))
    assert not compile_all().is_complete
    assert len(given(log)) == 2 * tried


def test_only_one_process_compiles_into_a_folder(folder, monkeypatch):
    log = use(monkeypatch, folder, COMPILES)
    first = KernelsAhead()
    with first.compiling((SOLVER_KERNELS,)):
        assert not compile_all().is_complete
        first.wait(SOLVER_KERNELS)
    assert given(log) == [2]  # of the first alone


def test_no_process_is_left_of_an_interrupted_run(folder, monkeypatch):
    use(monkeypatch, folder, "import time; time.sleep(600)")
    kernels, workers = KernelsAhead(), []

    def interrupted() -> None:
        with kernels.compiling((TRACKING_KERNELS,)):
            workers.extend(kernels._workers)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert workers
    assert all(worker.poll() is not None for worker in workers)
    assert not kernels.is_complete
