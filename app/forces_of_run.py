"""The forces of a run, inferred and stored."""

from __future__ import annotations

import time
from dataclasses import replace

from .compilation.ahead import SOLVER_KERNELS
from .experiment.config.experiment_file import as_toml
from .inference.corrected_sequence import CorrectedSequence
from .inference.frame_store import CheckpointStore, FrameStore, SolvedFrame
from .inference.infer_sequence import FIRST_FRAME, infer_sequence
from .inference.inputs import Inputs
from .inference.solve_frames import InferenceObserver
from .process.errors import InputError, RunError, UndeterminedError
from .process.machine.free_memory import keep_freed_blocks, release_free_memory
from .results.hdf5.store import Provenance, load_results, save_results
from .results.results import Results
from .run_folder import FAILURES, RESULTS, SUMMARY, Run
from .solver.frame_forces import FrameStatus
from .solver.posterior.candidate_gaps import forget_candidate_gaps
from .verdicts.log import VerdictLog


def infer_forces(run: Run, inputs: Inputs, origin: Provenance, log: VerdictLog) -> Results:
    """Infer the forces of the sequence as it was given, and store them with their provenance.

    Raises
    ------
    InputError
        A quantity that the experiment leaves open cannot be determined.
    RunError
        No frame could be solved.
    """
    since = time.perf_counter()
    store = CheckpointStore(lambda: run.checkpoint("solving", origin.fingerprint))
    run.kernels.wait(SOLVER_KERNELS)
    try:
        observer = _RunObserver(run, log)
        with keep_freed_blocks():
            results = infer_sequence(inputs, observer, store)
    except UndeterminedError as error:
        raise InputError(run.experiment.file, f"key {error.key}", str(error)) from None
    if all(frame.status is FrameStatus.FAILED for frame in results.frames):
        log_file = f"; see {run.file(FAILURES)}" if run.file(FAILURES).exists() else ""
        first = results.frames[0].reason
        raise RunError(f"{run.experiment.file}: no frame could be solved; the first one: {first}{log_file}")
    release_free_memory()
    results = store_results(run, _named(run, results), origin, log)
    store.checkpoint.clear()
    forget_candidate_gaps()
    run.timings.add("solving", since)
    return results


def _named(run: Run, results: Results) -> Results:
    """Results with the name and the resolved configuration of the experiment."""
    return replace(results, name=run.experiment.name, configuration=as_toml(run.experiment.config))


class _RunObserver(InferenceObserver):
    """Forwards events of the inference to progress, live recording, failure log and notes of a run."""

    def __init__(self, run: Run, log: VerdictLog) -> None:
        super().__init__(run.progress)
        self._run, self._log = run, log

    def corrected(self, sequence: CorrectedSequence) -> None:
        self._run.write_manifest(self._log)
        if self._run.watch is not None:
            self._run.watch.start(_named(self._run, sequence.unsolved_results()))

    def restored(self, store: FrameStore, count: int) -> None:
        if self._run.watch is not None:
            for k in range(count):
                frame = store.load(k)
                self._run.watch.frame(frame.forces, frame.statistics)

    def solved(self, frame: SolvedFrame) -> None:
        if self._run.watch is not None:
            self._run.watch.frame(frame.forces, frame.statistics)

    def failed(self, stage: str, frame: int, error: Exception) -> None:
        self._run.note_failure(stage, frame, error)
        if stage == FIRST_FRAME:
            self._run.notes.append(
                "The first photograph could not be estimated from all others (failures.log); it stays as solved first."
            )


def store_results(run: Run, results: Results, origin: Provenance, log: VerdictLog) -> Results:
    """Results as they are read back from their file: a frame at a time. A summary of earlier results is removed."""
    save_results(run.file(RESULTS), results, origin)
    run.file(SUMMARY).unlink(missing_ok=True)
    run.manifest.add(RESULTS, origin.fingerprint, origin.program | run.state_of_input(log))
    return load_results(run.file(RESULTS))
