"""Times of the stages of one experiment, from tracks or photographs to the recording, in a process of its own.

python -m tests.benchmarks.job EXPERIMENT OUT
"""

from __future__ import annotations

import json
import resource
import sys
import tempfile
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import rodsight
from rodsight import pipeline
from rodsight.experiment.experiment import load_experiment
from rodsight.inference.correction.correct_sequence import correct_sequence
from rodsight.inference.inference_settings import material_of, settings_of
from rodsight.inference.inputs import Inputs
from rodsight.results.results import Results
from rodsight.solver.bodies.grains import Array
from rodsight.solver.redistribution.contact_removal import remove_contact
from rodsight.solver.sequence.frames import solve_sequence

from tests.benchmarks.timing import Duration, time_once

REMOVED_CONTACTS = 15  # one at a time
MAX_RODS_SOLVED_AGAIN = 20_000  # beyond, the frames before it take many minutes


def run_benchmark_job(folder: Path, out: Path) -> dict[str, object]:
    """Measure the seconds of every stage (processor, clock), frames, rods, peak memory [MB] and two response times."""
    run = pipeline.Run(load_experiment(folder), out)
    solved: dict[str, Results] = {}
    stages = {
        "tracking": time_once(lambda: pipeline.track(run)),
        "solving": time_once(lambda: solved.setdefault("results", pipeline.solve(run))),
        "recording": time_once(lambda: pipeline.record(run, solved["results"], None)),
    }
    peak = peak_memory()
    results = solved["results"]
    frames = results.tracks.frame_count
    return {
        "stages": {name: [duration.processor, duration.clock] for name, duration in stages.items()},
        "frames": frames,
        "rods": results.grains.count,
        "peak": peak,
        "megabytes": [round((out / name).stat().st_size / 1e6, 1) for name in ("results.h5", "recording.rrd")],
        "without": without_a_contact(results),
        "what_if": forbid_a_contact(out),
        "again": solve_again(run) if results.grains.count <= MAX_RODS_SOLVED_AGAIN else [],
    }


def peak_memory(process: int | str = "self") -> float:
    """Peak memory of a process [MB]; on Linux from /proc, because getrusage includes the parent's; else of this one."""
    status = Path(f"/proc/{process}/status")
    for line in status.read_text(encoding="ascii").splitlines() if status.exists() else ():
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) / 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def without_a_contact(results: Results) -> list[float]:
    """Median seconds (processor, clock) of the local solution without one of the strong contacts of a frame."""
    k = results.tracks.frame_count // 2
    frame, friction = results.frames[k], results.contact_friction(k)
    removed = partial(remove_contact, results.grains, frame.contacts, frame.fn, frame.ft, friction=friction)
    return _median([time_once(partial(removed, row)) for row in _strong_contacts(frame.fn)])


def forbid_a_contact(out: Path) -> list[float]:
    """Median seconds (processor, clock) of the same in Python, on a stored run."""
    run = rodsight.open(out)
    k = run.results.tracks.frame_count // 2
    pairs = run.contacts(frame=k).query("j >= 0")
    strong = pairs[["i", "j"]].to_numpy()[_strong_contacts(pairs["fn"].to_numpy())].tolist()
    return _median([time_once(partial(rodsight.what_if, run, k, forbid=[pair], local=True)) for pair in strong])


def _strong_contacts(fn: Array) -> list[int]:
    return np.argsort(-fn)[: 4 * REMOVED_CONTACTS : 4].tolist()


def _median(durations: list[Duration]) -> list[float]:
    return [
        float(np.median([each.processor for each in durations])), float(np.median([each.clock for each in durations]))
    ]  # fmt: skip


def solve_again(run: pipeline.Run) -> list[float]:
    """Seconds (processor, clock) of solving one more frame after the frames before it."""
    tracks, walls = pipeline.track(run)
    assert walls is not None
    config = run.experiment.config
    inputs = Inputs(tracks, walls, material_of(config), settings_of(config))
    sequence = correct_sequence(replace(inputs, settings=inputs.settings.without_sweeps()))
    frames = solve_sequence(
        sequence.packing, sequence.snapshots, sequence.settings, verdicts=sequence.verdicts, failed=sequence.failed
    )
    for _ in range(max(tracks.frame_count - 2, 0)):
        next(frames)
    duration = time_once(lambda: next(frames))
    return [duration.processor, duration.clock]


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        target = Path(sys.argv[2]) if len(sys.argv) > 2 else Path(folder)
        print(json.dumps(run_benchmark_job(Path(sys.argv[1]), target)))
