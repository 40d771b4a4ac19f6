"""One experiment from its tracks or photographs to the recording, stage by stage, in a process of its own.

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
from rodsight import pipeline
from rodsight.experiment.experiment import load_experiment
from rodsight.inference.inference import Inputs, correct_sequence, solve_frames
from rodsight.inference.settings import material_of, settings_of
from rodsight.results.results import Results

from solver.statistics.removal import remove_contact
from tests.benchmarks.timing import once

ASKED = 15  # contacts taken away, one at a time
LARGEST_AGAIN = 20_000  # rods: beyond, all that leads to one frame solved again takes many minutes


def run_job(folder: Path, out: Path) -> dict[str, object]:
    """Seconds of every stage (processor, clock), frames, rods, peak memory [MB], and of two answers."""
    run = pipeline.Run(load_experiment(folder), out)
    kept: dict[str, Results] = {}
    stages = {
        "tracking": once(lambda: pipeline.track(run)),
        "solving": once(lambda: kept.setdefault("results", pipeline.solve(run))),
        "recording": once(lambda: pipeline.record(run, kept["results"], None)),
    }
    peak = peak_of_memory()
    results = kept["results"]
    frames = results.tracks.frame_count
    return {
        "stages": {name: [took.processor, took.clock] for name, took in stages.items()},
        "frames": frames,
        "rods": results.grains.count,
        "peak": peak,
        "megabytes": [round((out / name).stat().st_size / 1e6, 1) for name in ("results.h5", "recording.rrd")],
        "without": without_a_contact(results),
        "again": again(run) if results.grains.count <= LARGEST_AGAIN else [],
    }


def peak_of_memory() -> float:
    """Most memory that this process had [MB]: on Linux its own, for what getrusage tells is also that of its parent."""
    told = Path("/proc/self/status")
    for line in told.read_text(encoding="ascii").splitlines() if told.exists() else ():
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) / 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def without_a_contact(results: Results) -> list[float]:
    """Median seconds (processor, clock) of the nearest forces without one of the strong contacts of a frame."""
    frame = results.frames[results.tracks.frame_count // 2]
    friction = results.friction
    removed = partial(remove_contact, results.grains, frame.contacts, frame.fn, frame.ft)
    friction = {"friction": results.friction, "wall_friction": results.friction}
    took = [once(partial(removed, row, **friction)) for row in np.argsort(-frame.fn)[: 4 * ASKED : 4].tolist()]
    return [float(np.median([each.processor for each in took])), float(np.median([each.clock for each in took]))]


def again(run: pipeline.Run) -> list[float]:
    """Seconds (processor, clock) of solving one more frame where those before it are known."""
    tracks, walls = pipeline.track(run)
    assert walls is not None
    config = run.experiment.config
    inputs = Inputs(tracks, walls, material_of(config), settings_of(config))
    sequence = correct_sequence(replace(inputs, settings=inputs.settings.without_sweeps()))
    frames = solve_frames(sequence)
    for _ in range(max(tracks.frame_count - 2, 0)):
        next(frames)
    took = once(lambda: next(frames))
    return [took.processor, took.clock]


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as room:
        target = Path(sys.argv[2]) if len(sys.argv) > 2 else Path(room)
        print(json.dumps(run_job(Path(sys.argv[1]), target)))
