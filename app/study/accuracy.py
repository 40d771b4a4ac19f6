"""How well inferred forces agree with the truth: several packings, loading and unloading, several noises."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from solver.dem.simulation import DemTruth

from ..inference.inference import infer_frames
from ..progress import Progress, silent
from .truths import agreement_of, observe, simulate, starts_of

WINDOW = 12  # photographs of one sequence
SHOWN = (1, 3, 5, 10)  # frames of the table
NOISES = (0.0, 1e-5, 2e-5, 4e-5)  # [m]


@dataclass(frozen=True, slots=True)
class AccuracyRow:
    """One noise: means over packings and windows, except the least."""

    noise: float  # [m]
    r_fn: tuple[float, ...]  # at the frames SHOWN
    r_ft: tuple[float, ...]
    relative_l2: tuple[float, ...]
    late: float  # mean r(f_n) from frame 5 on
    least: float  # least r(f_n) of a frame from 5 on
    last: float  # mean r(f_n) of the last frame, which has no successor to look at
    scale: float  # mean from frame 5 on
    cpu: float  # [s] per frame


def measure_accuracy(
    truths: Sequence[DemTruth], noise: float, estimator: str, *, window: int = WINDOW, progress: Progress = silent
) -> AccuracyRow:
    """Solve windows of all truths at one noise [m]."""
    runs, began, done = [], time.process_time(), 0
    for number, truth in enumerate(truths):
        for start in starts_of(truth, window):
            rng = np.random.default_rng([number, start, round(noise * 1e9)])
            inputs = observe(truth, range(start, start + window), noise, rng, estimator=estimator)
            rows = []
            for solved in infer_frames(inputs):
                found = agreement_of(solved.forces, truth, start + solved.forces.frame)
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
    seeds: Sequence[int], *, grains: int, folder: Path, estimator: str, console: Console, progress: Progress = silent
) -> list[AccuracyRow]:
    """Print the table of accuracy against noise."""
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
