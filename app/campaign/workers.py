"""Runs done side by side: each in a process of its own on this machine, or as a task of a dask scheduler.

A process or a worker that is lost costs its own run alone, which is done again and goes on where it stopped: finished
frames are kept in the run's folder.
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

from ..sensitivity.execution import ANSWER, reach_scheduler
from .plan import Case
from .task import Outcome, run_case

COMMAND = (sys.executable, "-c", "from rodsight.campaign.task import main; main()")
ATTEMPTS = 3  # at a run whose process is lost


def run_cases(
    cases: Sequence[Case], folder: Path, *, workers: int, scheduler: str | None = None
) -> Generator[Outcome, None, None]:
    """Do all runs; yields what became of each as it ends. Closing the iterator ends those that still go on.

    workers: processes on this machine; scheduler: address of a dask scheduler, instead, whose workers must see the same
    folders. Raises InputError if it does not answer.
    """
    if scheduler is None:
        yield from run_in_processes(cases, folder, workers=workers)
    else:
        yield from _on_scheduler(cases, folder, scheduler)


def run_in_processes(
    cases: Sequence[Case], folder: Path, *, workers: int, command: Sequence[str] = COMMAND
) -> Generator[Outcome, None, None]:
    """Do every run in a process of its own, so many at a time."""
    crew = _Crew(folder, tuple(command))
    pool = ThreadPoolExecutor(max(1, min(workers, len(cases))))
    try:
        for each in as_completed([pool.submit(crew.run, case) for case in cases]):
            yield each.result()
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        crew.dismiss()


class _Crew:
    """The processes that are at work."""

    def __init__(self, folder: Path, command: tuple[str, ...]) -> None:
        self._folder, self._command = folder, command
        self._lock = threading.Lock()
        self._working: set[subprocess.Popen[str]] = set()
        self._dismissed = False

    def run(self, case: Case) -> Outcome:
        """One run; done again where its process is lost."""
        status = 0
        for _ in range(ATTEMPTS):
            told, status = self._try(case)
            if self._dismissed:
                break
            with suppress(ValueError, IndexError, TypeError):
                return Outcome(**json.loads(told.splitlines()[-1]))
        return Outcome(case.name, f"its process ended with status {status}, {ATTEMPTS} times; see {self._log(case)}")

    def _try(self, case: Case) -> tuple[str, int]:
        log = self._log(case)
        log.parent.mkdir(parents=True, exist_ok=True)
        message = json.dumps({"case": case.as_plain(), "folder": str(self._folder)})
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, map(os.path.abspath, sys.path)))}
        with log.open("w", encoding="utf-8") as errors:
            with self._lock:
                if self._dismissed:
                    return "", 0
                # In a session of its own: an interrupt is for this process, which then ends the others.
                process = subprocess.Popen(
                    [*self._command, message], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, text=True,
                    env=environment, start_new_session=True,
                )  # fmt: skip
                self._working.add(process)
            assert process.stdout is not None
            assert process.stdin is not None
            with process.stdin, process.stdout:
                told = process.stdout.read()
            status = process.wait()
        with self._lock:
            self._working.discard(process)
        return told, status

    def _log(self, case: Case) -> Path:
        return self._folder / case.name / "campaign.log"

    def dismiss(self) -> None:
        """End all that are at work; finished frames are kept."""
        with self._lock:
            self._dismissed = True
            for process in self._working:
                process.terminate()


def _on_scheduler(cases: Sequence[Case], folder: Path, address: str) -> Generator[Outcome, None, None]:
    reach_scheduler(address)
    from dask import distributed  # pyright: ignore[reportMissingImports]

    with distributed.Client(address, timeout=ANSWER, set_as_default=False) as client:
        place = str(folder.resolve())
        tasks = {client.submit(run_case, case, place, pure=False, retries=ATTEMPTS - 1): case for case in cases}
        try:
            for each in distributed.as_completed(list(tasks), loop=client.loop):
                if each.status == "finished":
                    yield each.result()
                else:
                    yield Outcome(tasks[each].name, f"its worker was lost ({type(each.exception()).__name__})")
        finally:
            client.cancel(list(tasks))
