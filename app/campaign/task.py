"""One run of a campaign: what a worker does, here, in a process of its own or on another machine."""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from .. import pipeline
from ..errors import InputError, RunError
from ..experiment.experiment import load_experiment
from ..run_folder import Run, owned
from ..run_truth import load_truth
from .plan import Case


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a run."""

    name: str
    error: str = ""  # why there are no results; empty: there are
    seconds: float = 0.0
    kept: bool = False  # everything was there already

    def as_plain(self) -> dict[str, Any]:
        return asdict(self)


def run_case(case: Case, folder: str) -> Outcome:
    """Do one run in its folder below this one; what is there already is not done again, what fails is told."""
    began = time.perf_counter()
    try:
        experiment = load_experiment(Path(case.experiment), case.settings)
        run = Run(experiment, Path(folder) / case.name, case.frames)
        with owned(run):
            results = pipeline.solve(run)
            truth = load_truth(run, results)
            if case.record:
                pipeline.record(run, results, truth)
            if run.timings.seconds:
                pipeline.conclude(run, results, truth, began)
    except (InputError, RunError, OSError, MemoryError) as error:
        return Outcome(case.name, " ".join(str(error).split()) or type(error).__name__, time.perf_counter() - began)
    return Outcome(case.name, "", time.perf_counter() - began, kept=not run.timings.seconds)


def main() -> None:
    """The process of one run: told what to do as JSON, tells what became of it; ends with the one that started it."""
    told = json.loads(sys.argv[1])
    threading.Thread(target=_end_with_standard_input, daemon=True).start()
    outcome = run_case(Case.of_plain(told["case"]), told["folder"])
    print(json.dumps(outcome.as_plain()), flush=True)


def _end_with_standard_input() -> None:
    """Nobody writes to it: it ends with the process at its other end, however that ends."""
    sys.stdin.read()
    os._exit(1)
