"""Parallel execution of runs: each in its own process on this machine, or as a task of a dask scheduler.

The run of a lost process or worker is repeated and resumes where it stopped, since finished frames are stored in the
run's folder; other runs are not affected.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from collections.abc import Generator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import suppress
from pathlib import Path

from ..robustness.execution import SCHEDULER_TIMEOUT, reach_scheduler
from .plan import Case
from .task import Outcome, run_case

COMMAND = (sys.executable, "-c", "from rodsight.campaigns.task import main; main()")
ATTEMPTS = 3  # for a run whose process is lost


def run_cases(
    cases: Sequence[Case], folder: Path, *, workers: int, scheduler: str | None = None
) -> Generator[Outcome, None, None]:
    """Execute all runs and yield the outcome of each as it ends; closing the iterator ends running ones.

    Parameters
    ----------
    cases : sequence of Case
    folder : Path
        Folder of the campaign.
    workers : int
        Processes on this machine.
    scheduler : str, optional
        Address of a dask scheduler to use instead, whose workers must see the same folders.

    Raises
    ------
    InputError
        If the scheduler does not answer.
    """
    if scheduler is None:
        yield from run_in_processes(cases, folder, workers=workers)
    else:
        yield from _on_scheduler(cases, folder, scheduler)


def run_in_processes(
    cases: Sequence[Case], folder: Path, *, workers: int, command: Sequence[str] = COMMAND
) -> Generator[Outcome, None, None]:
    """Execute every run in its own process, `workers` at a time."""
    processes = _Processes(folder, tuple(command))
    pool = ThreadPoolExecutor(max(1, min(workers, len(cases))))
    try:
        for each in as_completed([pool.submit(processes.run, case) for case in cases]):
            yield each.result()
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        processes.terminate()


class _Processes:
    """The running processes."""

    def __init__(self, folder: Path, command: tuple[str, ...]) -> None:
        self._folder, self._command = folder, command
        self._lock = threading.Lock()
        self._running: set[subprocess.Popen[str]] = set()
        self._terminated = False

    def run(self, case: Case) -> Outcome:
        """Execute one run, repeated if its process is lost."""
        status = 0
        for _ in range(ATTEMPTS):
            output, status = self._try(case)
            if self._terminated:
                break
            with suppress(ValueError, IndexError, TypeError):
                return Outcome(**json.loads(output.splitlines()[-1]))
        return Outcome(case.name, f"its process ended with status {status}, {ATTEMPTS} times; see {self._log(case)}")

    def _try(self, case: Case) -> tuple[str, int]:
        log = self._log(case)
        log.parent.mkdir(parents=True, exist_ok=True)
        message = json.dumps({"case": case.as_plain(), "folder": str(self._folder)})
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, map(os.path.abspath, sys.path)))}
        with log.open("w", encoding="utf-8") as errors:
            with self._lock:
                if self._terminated:
                    return "", 0
                # In a new session, since this process handles interrupts and ends the others.
                process = subprocess.Popen(
                    [*self._command, message], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, text=True,
                    env=environment, start_new_session=True,
                )  # fmt: skip
                self._running.add(process)
            assert process.stdout is not None
            assert process.stdin is not None
            with process.stdin, process.stdout:
                output = process.stdout.read()
            status = process.wait()
        with self._lock:
            self._running.discard(process)
        return output, status

    def _log(self, case: Case) -> Path:
        return self._folder / case.name / "campaign.log"

    def terminate(self) -> None:
        """End all running processes; finished frames are stored."""
        with self._lock:
            self._terminated = True
            for process in self._running:
                process.terminate()


def _on_scheduler(cases: Sequence[Case], folder: Path, address: str) -> Generator[Outcome, None, None]:
    reach_scheduler(address)
    from dask import distributed  # pyright: ignore[reportMissingImports]

    with distributed.Client(address, timeout=SCHEDULER_TIMEOUT, set_as_default=False) as client:
        target = str(folder.resolve())
        tasks = {client.submit(run_case, case, target, pure=False, retries=ATTEMPTS - 1): case for case in cases}
        try:
            for each in distributed.as_completed(list(tasks), loop=client.loop):
                if each.status == "finished":
                    yield each.result()
                else:
                    yield Outcome(tasks[each].name, f"its worker was lost ({type(each.exception()).__name__})")
        finally:
            client.cancel(list(tasks))
