"""One run of a campaign, executed in this process, in another one or on another machine."""

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
from ..experiment.experiment import load_experiment
from ..process.errors import InputError, RunError
from ..run_folder import Run, hold_run
from ..run_truth import load_truth
from .plan import Case


@dataclass(frozen=True, slots=True)
class Outcome:
    """The outcome of a run."""

    name: str
    error: str = ""  # reason for missing results; empty: success
    seconds: float = 0.0
    reused: bool = False  # the results existed

    def as_plain(self) -> dict[str, Any]:
        return asdict(self)


def run_case(case: Case, folder: str) -> Outcome:
    """Execute one run in its folder below this one, reusing existing results; errors are returned in the outcome."""
    began = time.perf_counter()
    try:
        experiment = load_experiment(Path(case.experiment), case.settings)
        run = Run(experiment, Path(folder) / case.name, case.frames)
        with hold_run(run):
            results = pipeline.solve(run)
            truth = load_truth(run, results)
            if case.record:
                pipeline.record(run, results, truth)
            if run.timings.seconds:
                pipeline.conclude(run, results, truth, began)
    except (InputError, RunError, OSError, MemoryError) as error:
        return Outcome(case.name, " ".join(str(error).split()) or type(error).__name__, time.perf_counter() - began)
    return Outcome(case.name, "", time.perf_counter() - began, reused=not run.timings.seconds)


def main() -> None:
    """Execute one run given as JSON and print its outcome; the process ends with its parent."""
    request = json.loads(sys.argv[1])
    threading.Thread(target=_end_with_standard_input, daemon=True).start()
    outcome = run_case(Case.of_plain(request["case"]), request["folder"])
    print(json.dumps(outcome.as_plain()), flush=True)


def _end_with_standard_input() -> None:
    """Wait for the end of standard input, which the parent never writes and which closes when the parent ends."""
    sys.stdin.read()
    os._exit(1)
