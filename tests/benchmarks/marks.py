"""Where the time of a whole sequence goes, by marks inside one process, from tracks to results on disk.

python -m tests.benchmarks.marks EXPERIMENT [WORKERS] [A:B]

prints one line of JSON. Kernels are loaded before by the first photographs, and their time is given apart. With one
worker frames do not overlap, so that the processor time between two marks belongs to a frame.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rodsight.experiment.experiment import load_experiment
from rodsight.inference.corrected_sequence import CorrectedSequence
from rodsight.inference.diagnosis.diagnose import diagnose_solved
from rodsight.inference.frame_store import CheckpointStore, SolvedFrame
from rodsight.inference.infer_sequence import infer_sequence
from rodsight.inference.inference_settings import material_of, settings_of
from rodsight.inference.inputs import Inputs
from rodsight.inference.solve_frames import InferenceObserver
from rodsight.pipeline import track
from rodsight.process.frame_range import FrameRange
from rodsight.results.hdf5.store import Provenance, save_results
from rodsight.run_folder import Run
from rodsight.solver.detection.refinement import BLOCK

from tests.benchmarks.history import ROOT
from tests.benchmarks.job import peak_memory
from tests.benchmarks.timing import Duration, Row, time_once

FIRST = 8  # frames that also solve a third chain, until its start is forgotten
LOADING = 4  # photographs that load all kernels


class _Marks(InferenceObserver):
    """Notes processor and clock time when the sequence is corrected, and after every frame."""

    def __init__(self) -> None:
        super().__init__()
        self.undisturbed = False
        self.at = [_now()]

    def corrected(self, sequence: CorrectedSequence) -> None:
        self.undisturbed = sequence.undisturbed
        self.at.append(_now())

    def solved(self, frame: SolvedFrame) -> None:
        self.at.append(_now())


def measure(folder: Path, workers: int, frames: FrameRange) -> dict[str, Any]:
    """Measure the seconds (processor, clock) of every part of a sequence, the peak memory [MB] and its size."""
    with tempfile.TemporaryDirectory() as out:
        run = Run(load_experiment(folder), Path(out), frames)
        found: dict[str, Any] = {}
        reading = time_once(lambda: found.update(zip(("tracks", "walls"), track(run), strict=True)))
        settings = settings_of(run.experiment.config)
        settings = replace(settings, sequence=replace(settings.sequence, workers=workers))
        inputs = Inputs(found["tracks"], found["walls"], material_of(run.experiment.config), settings)
        few = replace(inputs, tracks=inputs.tracks.frames(0, LOADING), walls=inputs.walls.frames(0, LOADING))
        loading = time_once(lambda: infer_sequence(few))
        marks, store = _Marks(), CheckpointStore(lambda: run.checkpoint("solving", "marks"))
        results = infer_sequence(inputs, marks, store, diagnosis=())
        marks.at.append(_now())
        diagnosing = time_once(lambda: diagnose_solved(inputs, results, undisturbed=marks.undisturbed))
        origin = Provenance("marks", folder.name, frames, {})
        storing = time_once(lambda: save_results(Path(out) / "results.h5", results, origin))
        parts = np.diff(np.array(marks.at), axis=0)
        once = {"reading": reading, "correcting": Duration(*parts[0].tolist()),
                "first frame, friction, kinematics": Duration(*parts[-1].tolist()),
                "diagnosing": diagnosing, "storing": storing}  # fmt: skip
        return {
            "rods": inputs.tracks.grain_count, "frames": inputs.tracks.frame_count, "workers": workers,
            "loading": [loading.processor, loading.clock],
            "once": {name: [each.processor, each.clock] for name, each in once.items()},
            "each": parts[1:-1].tolist(), "peak": peak_memory(),
        }  # fmt: skip


def mark_rows(folder: Path, frames: str = ":", aim: str = "") -> Iterator[Row]:
    """Rows of one sequence: whole with one and two workers, then its parts with one."""
    one, two = (_in_own_process(folder, workers, frames) for workers in (1, 2))
    label = f"{one['frames']} frames of {one['rods']} rods"
    yield Row(f"{label}, a frame, all included", f"**{_whole(one)}**; two workers {_whole(two)}", aim)
    each = np.array(one["each"])
    k = np.arange(len(each))
    refines, early = k % BLOCK == 0, k < FIRST
    for name, chosen in (
        (f"a steady frame of {label}", ~early & ~refines), ("one of the first eight", early & (k > 0) & ~refines),
        ("one that refines its block", ~early & refines),
    ):  # fmt: skip
        if chosen.any():
            yield Row(name, str(Duration(*np.median(each[chosen], axis=0).tolist())))
    for name, seconds in one["once"].items():
        yield Row(f"once: {name}", str(Duration(*seconds)))
    yield Row("once: loading kernels", str(Duration(*one["loading"])))
    yield Row("peak of memory", f"{one['peak']:.0f} MB; two workers {two['peak']:.0f} MB")


def _whole(found: dict[str, Any]) -> Duration:
    parts: Sequence[Sequence[float]] = [*found["each"], *found["once"].values()]
    return Duration(*np.sum(parts, axis=0).tolist()) / found["frames"]


def _in_own_process(folder: Path, workers: int, frames: str) -> dict[str, Any]:
    command = [sys.executable, "-m", "tests.benchmarks.marks", str(folder), str(workers), frames]
    text = subprocess.run(command, check=True, capture_output=True, text=True, cwd=ROOT).stdout
    return json.loads(text.splitlines()[-1])


def _now() -> tuple[float, float]:
    return time.process_time(), time.perf_counter()


if __name__ == "__main__":
    start, _, stop = (sys.argv[3] if len(sys.argv) > 3 else ":").partition(":")
    given = FrameRange(int(start or 0), int(stop) if stop else None)
    print(json.dumps(measure(Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 1, given)))
