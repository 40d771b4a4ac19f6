"""Agreement of inferred forces with the truth over packings, loading directions and noise levels."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from ..inference.infer_sequence import infer_sequence
from ..process.progress import Progress, no_progress
from ..solver.dem.dem_truth import DemTruth
from .truths import NOISES, WINDOW, agreement_of, observe, simulate, window_starts

SHOWN = (1, 3, 5, 10)  # frames of the table


@dataclass(frozen=True, slots=True)
class AccuracyRow:
    """One noise level: means over packings and windows, except `least`."""

    noise: float  # [m]
    r_fn: tuple[float, ...]  # at the frames SHOWN
    r_ft: tuple[float, ...]
    relative_l2: tuple[float, ...]
    late: float  # mean r(f_n) from frame 5 on
    least: float  # least r(f_n) of a frame from 5 on
    last: float  # mean r(f_n) of the last frame, which has no successor
    scale: float  # mean from frame 5 on
    cpu: float  # [s] per frame


def measure_accuracy(
    truths: Sequence[DemTruth], noise: float, estimator: str, *, window: int = WINDOW, progress: Progress = no_progress
) -> AccuracyRow:
    """Solve windows of all truths at one noise [m]."""
    runs, began, done = [], time.process_time(), 0
    for number, truth in enumerate(truths):
        for start in window_starts(truth, window):
            rng = np.random.default_rng([number, start, round(noise * 1e9)])
            inputs = observe(truth, range(start, start + window), noise, rng, estimator=estimator)
            rows = []
            for frame in infer_sequence(inputs, diagnosis=()).frames:
                found = agreement_of(frame, truth, start + frame.frame)
                rows.append((found.r_fn, found.r_ft, found.relative_l2, found.scale))
                done += 1
                progress(f"{noise * 1e6:.0f} µm", done, 2 * window * len(truths))
            runs.append(rows)
    values = np.array(runs)  # (runs, frames, 4)
    mean = values.mean(axis=0)
    shown = [k for k in SHOWN if k < window]
    return AccuracyRow(
        noise,
        *(tuple(float(mean[k, q]) for k in shown) for q in range(3)),
        late=float(values[:, 5:, 0].mean()),
        least=float(values[:, 5:, 0].min()),
        last=float(mean[-1, 0]),
        scale=float(values[:, 5:, 3].mean()),
        cpu=(time.process_time() - began) / done,
    )


def study_accuracy(
    seeds: Sequence[int],
    *,
    grains: int,
    folder: Path,
    estimator: str,
    console: Console,
    progress: Progress = no_progress,
) -> list[AccuracyRow]:
    """Measure the accuracy at several noise levels and print the table."""
    truths = [simulate(seed, grains=grains, folder=folder, progress=progress) for seed in seeds]
    rows = [measure_accuracy(truths, noise, estimator, progress=progress) for noise in NOISES]
    title = f"{estimator}: {len(truths)} packings of {grains} rods, loading and unloading, 0.25° per photograph"
    table = Table(title=title, box=None, pad_edge=False)
    for heading in (
        "noise [µm]",
        *(f"r(f_n) {k}" for k in SHOWN),
        "from 5",
        "least",
        "last",
        "r(f_t) 5",
        "L2 5",
        "scale",
        "CPU [s]",
    ):
        table.add_column(heading, justify="right", no_wrap=True)
    for row in rows:
        table.add_row(
            f"{row.noise * 1e6:.0f}", *(f"{r:.3f}" for r in row.r_fn), f"{row.late:.3f}", f"{row.least:.3f}",
            f"{row.last:.3f}", f"{row.r_ft[2]:.3f}", f"{row.relative_l2[2]:.2f}", f"{row.scale:.2f}", f"{row.cpu:.2f}",
        )  # fmt: skip
    console.print(table)
    return rows
