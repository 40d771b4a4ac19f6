"""Coverage of error bars on simulated truth, from the formula and from an ensemble.

Windows of simulated truths are solved with the settings of `rodsight run --ensemble K`. The constants of the ensemble's
error bars are fitted on some packings and judged on others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.optimize import minimize

from ...inference.infer_sequence import infer_sequence
from ...process.progress import Progress, no_progress
from ...robustness.ensemble_sd import (
    SD_WEIGHTS,
    calibrated_inputs,
    combine_sd,
    measure_ensemble_sd,
    solve_members,
)
from ...solver.bodies.grains import Array
from ...solver.contacts.pairs import match_values
from ...solver.dem.dem_truth import DemTruth
from ...solver.parallel import available_cores
from ..fitting.coverage import coverage_scale
from ..scenarios.interval_coverage import coverage
from ..truths import NEGLIGIBLE, NOISES, WINDOW, observe, simulate, true_forces, window_starts


@dataclass(frozen=True, slots=True)
class ErrorBars:
    """Contacts of all photographs with a preceding motion; forces over the mean f_n of their photograph."""

    noise: Array  # (c,) [m]
    error: Array  # (c, 2) of f_n and f_t
    ensemble_sd: Array  # (c, 2) standard deviation of the ensemble
    formula_sd: Array  # (c, 2) standard deviation without an ensemble


def study_uncertainty(
    seeds: tuple[Sequence[int], Sequence[int]],
    *,
    members: int,
    grains: int,
    estimator: str,
    folder: Path,
    console: Console,
    progress: Progress = no_progress,
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Fit on some packings, judge on others, and print coverages and the constants of f_n and f_t.

    Parameters
    ----------
    seeds : tuple of sequence of int
        Of the packings of the fit, and of those held out.
    members : int
        Ensemble members of each window.
    grains : int
    estimator : {'ensemble', 'nlgs'}
    folder : Path
        Cache of simulated truths.
    console : rich.console.Console
    progress : Progress

    Returns
    -------
    tuple of tuple of float
        a and b of σ² = (a S)² + (b s)² for f_n and f_t.
    """
    samples = []
    for some in seeds:
        truths = [simulate(seed, grains=grains, folder=folder, progress=progress) for seed in some]
        samples.append(measure_error_bars(truths, members, estimator, progress=progress))
    fit = (fit_sd_weights(samples[0], 0), fit_sd_weights(samples[0], 1))
    for name, new, old in zip(("f_n", "f_t"), fit, SD_WEIGHTS[estimator], strict=True):
        line = f"{name}: σ² = (a S)² + (b s)², fitted a = {new[0]:.2f}, b = {new[1]:.2f}; in use {old[0]}, {old[1]}"
        console.print(line, highlight=False)
    for name, sample in zip(("packings of the fit", "packings held out"), samples, strict=True):
        title = f"{estimator}, {name}, {members} members: fraction of contacts within one and two σ, %"
        console.print(_coverage_table(title, sample, SD_WEIGHTS[estimator]))
    return fit


def measure_error_bars(
    truths: Sequence[DemTruth],
    members: int,
    estimator: str,
    *,
    noises: Sequence[float] | None = None,
    progress: Progress = no_progress,
) -> ErrorBars:
    """Solve loading and unloading windows of all truths at every noise [m] with an ensemble."""
    noises = NOISES[1:] if noises is None else noises
    jobs = [
        (t, start, noise) for t in range(len(truths)) for start in window_starts(truths[t], WINDOW) for noise in noises
    ]
    parts = []
    for done, (t, start, noise) in enumerate(jobs):
        progress("uncertainty", done, len(jobs))
        rng = np.random.default_rng([t, start, round(noise * 1e9)])
        parts.append(_measure_window(truths[t], range(start, start + WINDOW), noise, members, estimator, rng))
    progress("uncertainty", len(jobs), len(jobs))
    return ErrorBars(
        *(
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("noise", "error", "ensemble_sd", "formula_sd")
        )
    )


def fit_sd_weights(sample: ErrorBars, component: int) -> tuple[float, float]:
    """Fit a and b of σ² = (a S)² + (b s)² by maximum likelihood for Student's t, then scale to the coverages."""
    size, ensemble_sd, formula_sd = (
        np.abs(each[:, component]) for each in (sample.error, sample.ensemble_sd, sample.formula_sd)
    )

    def loss(x: Array) -> float:  # four degrees of freedom, for the heavy tails of force errors
        sigma = np.hypot(np.exp(x[0]) * ensemble_sd, np.exp(x[1]) * formula_sd)
        return float(np.mean(np.log(sigma) + 2.5 * np.log1p((size / sigma) ** 2 / 4.0)))

    x = minimize(loss, np.log([0.5, 0.8]), method="Nelder-Mead").x
    ratio = size / np.hypot(np.exp(x[0]) * ensemble_sd, np.exp(x[1]) * formula_sd)
    scale = coverage_scale(ratio)
    a, b = (float(each) for each in np.exp(x) * scale)
    return a, b


def _measure_window(
    truth: DemTruth, photographs: range, noise: float, members: int, estimator: str, rng: np.random.Generator
) -> ErrorBars:
    inputs = calibrated_inputs(observe(truth, photographs, noise, rng, estimator=estimator))
    nominal = list(infer_sequence(inputs, diagnosis=()).frames)
    others = solve_members(inputs, members, workers=available_cores())
    errors, ensemble_sds, formula_sds = [], [], []
    for k, frame in enumerate(nominal[1:], start=1):
        key, force = frame.contacts.key, np.column_stack([frame.fn, frame.ft])
        true_key, true_force = true_forces(truth, photographs[k])
        true = match_values(key, true_key, true_force)
        ensemble_sd = measure_ensemble_sd(key, force, [each.at(k) for each in others])
        mean = float(frame.fn[frame.fn > 0].mean())
        bearing = np.maximum(frame.fn, true[:, 0]) > NEGLIGIBLE * mean
        errors.append((force - true)[bearing] / mean)
        ensemble_sds.append(np.column_stack([ensemble_sd.fn, ensemble_sd.ft])[bearing] / mean)
        formula_sds.append(np.column_stack([frame.fn_sd, frame.ft_sd])[bearing] / mean)
    error = np.concatenate(errors)
    return ErrorBars(np.full(len(error), noise), error, np.concatenate(ensemble_sds), np.concatenate(formula_sds))


def _coverage_table(title: str, sample: ErrorBars, in_use: Sequence[tuple[float, float]]) -> Table:
    table = Table(title=title, box=None, pad_edge=False)
    for heading in ("noise [µm]", "contacts", *(f"{kind} {f} {t}σ" for f in ("f_n", "f_t") for kind in
                    ("ensemble", "formula") for t in (1, 2)), "rms σ / rms error: ensemble", "formula"):  # fmt: skip
        table.add_column(heading, justify="right")
    for noise in (*np.unique(sample.noise), None):
        here = np.ones(len(sample.noise), np.bool_) if noise is None else sample.noise == noise
        cells = ["all" if noise is None else f"{1e6 * noise:.0f}", str(int(here.sum()))]
        ratios = []
        for component, constants in enumerate(in_use):
            error = sample.error[here, component]
            formula_sd = sample.formula_sd[here, component]
            for sigma in (combine_sd(sample.ensemble_sd[here, component], formula_sd, constants), formula_sd):
                cells += [f"{100.0 * fraction:.0f}" for fraction in coverage(error, sigma)]
                ratios.append(float(np.sqrt(np.mean(sigma**2) / np.mean(error**2))))
        table.add_row(*cells, f"{ratios[0]:.2f}", f"{ratios[1]:.2f}")
    return table
