"""Error bars against the truth: how often they cover it, from the free formula and from an ensemble.

Windows of simulated truths are solved as `rodsight run --ensemble K` would. The constants of the ensemble's error
bars are fitted on some packings and judged on others.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.optimize import minimize

from solver.bodies.grains import Array
from solver.contacts.pairs import recall
from solver.dem.simulation import DemTruth
from solver.together import available_cores

from ...inference.inference import infer_frames
from ...progress import Progress, silent
from ...sensitivity.spread import (
    DEVIATION,
    calibrated_inputs,
    deviation,
    solve_members,
    spread_around,
)
from ..truths import observe, simulate, starts_of, true_forces

WINDOW = 12  # photographs of one sequence
NOISES = (1e-5, 2e-5, 4e-5)  # [m]
WEAK = 1e-3  # of the mean force: contacts below it, inferred and true, have no error worth a bar
COVERED = (0.683, 0.954)  # of one and of two standard deviations


@dataclass(frozen=True, slots=True)
class ErrorBars:
    """Contacts of all photographs that a motion leads to; forces over the mean f_n of their photograph."""

    noise: Array  # (c,) [m]
    error: Array  # (c, 2) of f_n and f_t
    spread: Array  # (c, 2) of the members
    free: Array  # (c, 2) standard deviation by the free formula


def study_uncertainty(
    seeds: Sequence[int],
    held_out: Sequence[int],
    *,
    members: int,
    grains: int,
    estimator: str,
    folder: Path,
    console: Console,
    progress: Progress = silent,
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Fit on the packings `seeds`, judge on `held_out`; print coverages and the constants of f_n and f_t."""
    samples = []
    for some in (seeds, held_out):
        truths = [simulate(seed, grains=grains, folder=folder, progress=progress) for seed in some]
        samples.append(measure_error_bars(truths, members, estimator, progress=progress))
    fit = (fit_deviation(samples[0], 0), fit_deviation(samples[0], 1))
    for name, new, old in zip(("f_n", "f_t"), fit, DEVIATION[estimator], strict=True):
        told = f"{name}: σ² = (a S)² + (b s)², fitted a = {new[0]:.2f}, b = {new[1]:.2f}; in use {old[0]}, {old[1]}"
        console.print(told, highlight=False)
    for name, sample in zip(("packings of the fit", "packings held out"), samples, strict=True):
        title = f"{estimator}, {name}, {members} members: share of contacts within one and two σ, %"
        console.print(_coverage_table(title, sample, DEVIATION[estimator]))
    return fit


def measure_error_bars(
    truths: Sequence[DemTruth],
    members: int,
    estimator: str,
    *,
    noises: Sequence[float] | None = None,
    progress: Progress = silent,
) -> ErrorBars:
    """Solve windows of all truths, up and down, at every noise [m], with an ensemble."""
    noises = NOISES if noises is None else noises
    jobs = [(t, start, noise) for t in range(len(truths)) for start in starts_of(truths[t], WINDOW) for noise in noises]
    parts = []
    for done, (t, start, noise) in enumerate(jobs):
        progress("uncertainty", done, len(jobs))
        rng = np.random.default_rng([t, start, round(noise * 1e9)])
        parts.append(_measure_window(truths[t], range(start, start + WINDOW), noise, members, estimator, rng))
    progress("uncertainty", len(jobs), len(jobs))
    return ErrorBars(
        *(np.concatenate([getattr(part, name) for part in parts]) for name in ("noise", "error", "spread", "free"))
    )


def fit_deviation(sample: ErrorBars, component: int) -> tuple[float, float]:
    """a and b: likeliest for Student's t, then scaled until both coverages are near."""
    size, spread, free = (np.abs(each[:, component]) for each in (sample.error, sample.spread, sample.free))

    def loss(x: Array) -> float:  # four degrees of freedom: contact forces err with heavy tails
        sigma = np.hypot(np.exp(x[0]) * spread, np.exp(x[1]) * free)
        return float(np.mean(np.log(sigma) + 2.5 * np.log1p((size / sigma) ** 2 / 4.0)))

    x = minimize(loss, np.log([0.5, 0.8]), method="Nelder-Mead").x
    ratio = size / np.hypot(np.exp(x[0]) * spread, np.exp(x[1]) * free)
    scale = math.sqrt(float(np.quantile(ratio, COVERED[0])) * float(np.quantile(ratio, COVERED[1])) / 2.0)
    a, b = (float(each) for each in np.exp(x) * scale)
    return a, b


def coverage(error: Array, sigma: Array) -> tuple[float, float]:
    """Share of errors (c,) within one and within two of their standard deviations (c,)."""
    return tuple(float(np.mean(np.abs(error) <= times * sigma)) for times in (1.0, 2.0))  # type: ignore[return-value]


def _measure_window(
    truth: DemTruth, photographs: range, noise: float, members: int, estimator: str, rng: np.random.Generator
) -> ErrorBars:
    inputs = calibrated_inputs(observe(truth, photographs, noise, rng, estimator=estimator))
    nominal = [solved.forces for solved in infer_frames(inputs)]
    others = solve_members(inputs, members, workers=available_cores())
    errors, spreads, free = [], [], []
    for k, frame in enumerate(nominal[1:], start=1):
        key, force = frame.contacts.key, np.column_stack([frame.fn, frame.ft])
        true_key, true_force = true_forces(truth, photographs[k])
        true = recall(key, true_key, true_force)
        spread = spread_around(key, force, [each.at(k) for each in others])
        mean = float(frame.fn[frame.fn > 0].mean())
        told = np.maximum(frame.fn, true[:, 0]) > WEAK * mean
        errors.append((force - true)[told] / mean)
        spreads.append(np.column_stack([spread.fn, spread.ft])[told] / mean)
        free.append(np.column_stack([frame.fn_sd, frame.ft_sd])[told] / mean)
    error = np.concatenate(errors)
    return ErrorBars(np.full(len(error), noise), error, np.concatenate(spreads), np.concatenate(free))


def _coverage_table(title: str, sample: ErrorBars, in_use: Sequence[tuple[float, float]]) -> Table:
    table = Table(title=title, box=None, pad_edge=False)
    for heading in ("noise [µm]", "contacts", *(f"{kind} {f} {t}σ" for f in ("f_n", "f_t") for kind in
                    ("ensemble", "free") for t in (1, 2)), "rms σ / rms error: ensemble", "free"):  # fmt: skip
        table.add_column(heading, justify="right")
    for noise in (*np.unique(sample.noise), None):
        here = np.ones(len(sample.noise), np.bool_) if noise is None else sample.noise == noise
        cells = ["all" if noise is None else f"{1e6 * noise:.0f}", str(int(here.sum()))]
        ratios = []
        for component, constants in enumerate(in_use):
            error = sample.error[here, component]
            free = sample.free[here, component]
            for sigma in (deviation(sample.spread[here, component], free, constants), free):
                cells += [f"{100.0 * share:.0f}" for share in coverage(error, sigma)]
                ratios.append(float(np.sqrt(np.mean(sigma**2) / np.mean(error**2))))
        table.add_row(*cells, f"{ratios[0]:.2f}", f"{ratios[1]:.2f}")
    return table
