"""Compilation of kernels in processes of their own, from the first second of a run on.

Photographs are read, detected and tracked meanwhile; a stage begins when its own kernels are compiled. Where kernels
exist, as those of a wheel or of an earlier run do, nothing is started.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from ..process.errors import RunError
from ..process.kernel_cache import has_shipped_kernels, kernel_folder
from ..process.lock import hold_folder
from ..process.progress import Progress, no_progress
from ..process.sources import APP
from .kernel_list import FILE, Kernel, critical_times, read_kernels
from .worker import COMPILED

COMMAND = (sys.executable, "-c", "from rodsight.compilation.worker import main; main()")
TRACKING_KERNELS, SOLVER_KERNELS = "tracking.", "solver."  # parts of the program whose kernels a stage needs
STAGE = "compiling"
POLL = 0.05  # [s] between looks at the number of compiled kernels


class KernelsAhead:
    """The kernels of a run, which processes compile while the run's own process does other work."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._waiting: list[int] = []  # places in the list of kernels that no process has begun, the most urgent first
        self._open: set[int] = set()  # those that are not compiled yet
        self._kernels: tuple[Kernel, ...] = ()
        self._total = 0
        self._workers: list[subprocess.Popen[str]] = []
        self._skipped = False
        self.is_complete = False  # whether all kernels are known to be there, after `compiling`

    @contextmanager
    def compiling(
        self, parts: Sequence[str], progress: Progress = no_progress, *, all_uses: bool = False
    ) -> Iterator[None]:
        """Compile the kernels of these parts inside the block, where they are missing.

        Parameters
        ----------
        parts : sequence of str
            Beginnings of the names of modules, such as TRACKING_KERNELS and SOLVER_KERNELS, in the order in which their
            stages begin.
        progress : callable
        all_uses : bool
            Also those that `rodsight run` on photographs does not need, whatever the number of cores.
        """
        from ..solver.parallel import available_cores

        count = available_cores()
        folder = kernel_folder()
        if folder is None or (count < 2 and not all_uses) or os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
            yield
            return
        done = folder / _name_of_mark([*parts, *(["all uses"] if all_uses else [])])
        if done.exists() or has_shipped_kernels():
            self.is_complete = True
            yield
            return
        with _alone(folder) as alone:
            if not alone:
                yield
                return
            kernels = read_kernels()
            chosen = [
                k
                for k, each in enumerate(kernels)
                if (each.of_run or all_uses) and each.module.startswith(tuple(parts))
            ]
            times = critical_times(kernels, chosen)
            chosen.sort(key=lambda k: (_stage_of(kernels[k], parts), -times[k]))
            threads = self._start(kernels, chosen, count, progress)
            try:
                yield
            finally:
                self._stop(threads)
                self.is_complete = not self._open and not self._skipped
                if self.is_complete:
                    with suppress(OSError):
                        done.touch()

    def wait(self, part: str) -> None:
        """Wait until the kernels of a part are compiled, or nobody compiles them any more."""
        with self._changed:
            while any(self._kernels[k].module.startswith(part) for k in self._open) and self._is_running():
                self._changed.wait(POLL)

    def _start(
        self, kernels: tuple[Kernel, ...], chosen: list[int], count: int, progress: Progress
    ) -> list[threading.Thread]:
        self._kernels, self._waiting, self._open, self._total = kernels, list(chosen), set(chosen), len(chosen)
        self._skipped = False
        for _ in range(count):
            with suppress(OSError):  # no further process: there are fewer
                self._workers.append(_begin_worker())
        threads = [
            threading.Thread(target=self._serve, args=(worker, progress), daemon=True) for worker in self._workers
        ]
        for thread in threads:
            thread.start()
        return threads

    def _serve(self, worker: subprocess.Popen[str], progress: Progress) -> None:
        """Give kernels to a worker until none is left, or the worker is lost."""
        assert worker.stdin is not None
        assert worker.stdout is not None
        while (place := self._next()) is not None:
            answer = ""
            with suppress(OSError, ValueError):  # the worker is lost, or was ended
                worker.stdin.write(f"{place}\n")
                worker.stdin.flush()
                answer = worker.stdout.readline()
            with self._changed:
                self._open.discard(place)  # also where it was not compiled: nobody waits for it
                self._skipped |= answer.strip() != COMPILED
                left = len(self._open)
                self._changed.notify_all()
            if not answer:
                break
            progress(STAGE, self._total - left, self._total)
        with suppress(OSError):
            worker.stdin.close()
        worker.wait()

    def _next(self) -> int | None:
        """Return the next kernel whose own calls are compiled, waiting for one if need be; None: there is no other."""
        with self._changed:
            while self._waiting:
                for place in self._waiting:
                    if self._open.isdisjoint(self._kernels[place].calls):
                        self._waiting.remove(place)
                        return place
                self._changed.wait()
            return None

    def _is_running(self) -> bool:
        return any(worker.poll() is None for worker in self._workers)

    def _stop(self, threads: Sequence[threading.Thread]) -> None:
        with self._changed:
            unfinished = bool(self._open)
            self._waiting.clear()
            self._changed.notify_all()
        for worker in self._workers:
            if unfinished:
                worker.terminate()
        for thread in threads:
            thread.join()
        for worker in self._workers:
            assert worker.stdout is not None
            worker.stdout.close()
        self._workers.clear()


def _stage_of(kernel: Kernel, parts: Sequence[str]) -> int:
    """Return the place of the part that a kernel belongs to: parts are needed in their order."""
    return next(n for n, part in enumerate(parts) if kernel.module.startswith(part))


def _begin_worker() -> subprocess.Popen[str]:
    """Start a process that compiles, in a new session, since this process handles interrupts and ends the others."""
    paths = os.pathsep.join(filter(None, map(os.path.abspath, sys.path)))
    return subprocess.Popen(
        COMMAND, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        env={**os.environ, "PYTHONPATH": paths}, start_new_session=True,
    )  # fmt: skip


@contextmanager
def _alone(folder: Path) -> Iterator[bool]:
    """Yield whether no other process compiles into a folder of kernels; if so, keep others out inside the block."""
    alone = True
    with ExitStack() as stack:
        try:
            stack.enter_context(hold_folder(folder, lambda note: None))
        except (RunError, OSError):
            alone = False
        yield alone


def _name_of_mark(parts: Sequence[str]) -> str:
    """Return the name of the file that states that the listed kernels of this installation are compiled."""
    facts = [str(APP), FILE.read_text(encoding="utf-8"), *sorted(parts)]
    return "compiled-" + hashlib.sha256("\n".join(facts).encode()).hexdigest()[:16]
