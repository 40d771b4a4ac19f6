"""Fit of the constants of status, trust and error bars on simulated truth, and their performance.

Windows of simulated truths are solved with the settings of `rodsight run`, with several noise levels and with faults of
real experiments. The constants are fitted on some packings and judged on others.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from scipy.optimize import minimize

from ...process.progress import Progress, no_progress
from ...solver.assessment import mixture_trust, status
from ...solver.assessment.intervals import formula_sd
from ...solver.assessment.trust import motion_assessment
from ...solver.bodies.grains import Array
from ...solver.frame_forces import FrameStatus
from ..fitting.coverage import coverage_scale
from ..truths import NOISES, simulate
from .status_sample import FAULTS, StatusSample, observe_status

MAX_BELOW_TRUST = 0.06  # fraction of frames that may have r below their trust
FAULT_WEIGHT = 0.5  # of a faulty frame in the fit of the trust: most real sequences have no fault
CHANGED = 0.2  # 1 − correlation with the previous true forces, above which a packing has rearranged
RESTARTS = 3  # of the fit, each from the last result with a new simplex
POWERS = (0.5, 4.0)  # of D and ε


@dataclass(frozen=True, slots=True)
class StatusFit:
    """Constants in the form of `solver.assessment.status`."""

    disagreement: tuple[float, float]
    correction: tuple[float, float]
    normal: tuple[float, float, float]
    tangent: tuple[float, float, float]
    rearranging: float  # ū


def refit_status(
    seeds: Sequence[int],
    held_out: Sequence[int],
    *,
    grains: Sequence[int],
    folder: Path,
    console: Console,
    noises: Sequence[float] = NOISES,
    progress: Progress = no_progress,
) -> StatusFit:
    """Fit on the packings `seeds` of each size, judge on `held_out`, and print fitted constants beside those in use.

    Parameters
    ----------
    seeds, held_out : sequence of int
    grains : sequence of int
        Sizes of the packings.
    folder : Path
        Cache of simulated truths.
    console : rich.console.Console
    noises : sequence of float
        Standard deviations of a position component [m].
    progress : Progress
    """
    samples = []
    for some in (seeds, held_out):
        truths = [simulate(seed, grains=n, folder=folder, progress=progress) for n in grains for seed in some]
        samples.append(observe_status(truths, noises, progress=progress))
    fit = fit_status(samples[0])
    _print_constants(console, fit)
    for name, sample in zip(("packings of the fit", "packings held out"), samples, strict=True):
        _print_performance(console, name, sample, fit)
    return fit


def fit_status(sample: StatusSample) -> StatusFit:
    """Fit trust by quantile regression and the standard deviations by their coverage."""
    disagreement, correction = _predictors(sample)
    weight = np.where([bool(fault) for fault in sample.fault], FAULT_WEIGHT, 1.0)

    def loss(x: Array) -> float:
        p, q = np.clip(x[2:], *POWERS)
        bound = np.minimum(np.exp(x[0]) * disagreement**p + np.exp(x[1]) * correction**q, 1.0)
        over = np.log(np.maximum(1.0 - sample.r, 1e-6)) - np.log(np.maximum(bound, 1e-6))
        return float(
            np.average(np.where(over > 0, (1.0 - MAX_BELOW_TRUST) * over, -MAX_BELOW_TRUST * over), weights=weight)
        )

    x = np.array([0.0, 0.0, 1.5, 1.2])
    for _ in range(RESTARTS):
        x = _minimise(loss, x)
    p, q = np.clip(x[2:], *POWERS)
    return StatusFit(
        (float(np.exp(x[0])), float(p)),
        (float(np.exp(x[1])), float(q)),
        _fit_deviation(sample.error[:, 0], sample.force, sample.ensemble_sd[:, 0]),
        _fit_deviation(sample.error[:, 1], sample.force, sample.ensemble_sd[:, 1]),
        _fit_rearranging(sample),
    )


def _fit_deviation(error: Array, force: Array, ensemble_sd: Array) -> tuple[float, float, float]:
    """Fit a, b, c of σ² = a² + b² f + (c s)² by maximum likelihood for Student's t, then scale to the coverages."""
    size = np.abs(error)

    def sd(x: Array) -> Array:
        a, b, c = np.exp(x)
        return np.sqrt(a**2 + b**2 * force + (c * ensemble_sd) ** 2)

    def loss(x: Array) -> float:  # four degrees of freedom, for the heavy tails of force errors
        sigma = sd(x)
        return float(np.mean(np.log(sigma) + 2.5 * np.log1p((size / sigma) ** 2 / 4.0)))

    x = _minimise(loss, np.log([0.05, 0.1, 1.0]))
    ratio = size / sd(x)
    scale = coverage_scale(ratio)
    a, b, c = (float(each) for each in np.exp(x) * scale)
    return a, b, c


def _minimise(loss: Callable[[Array], float], start: Array) -> Array:
    """Minimise a non-smooth function from a start (x,)."""
    simplex = np.vstack([start, start + 0.5 * np.eye(len(start))])
    options = {"initial_simplex": simplex, "maxiter": 3000, "xatol": 1e-4, "fatol": 1e-7}
    return minimize(loss, start, method="Nelder-Mead", options=options).x


def _fit_rearranging(sample: StatusSample) -> float:
    """Return ū at which the true forces change by CHANGED, from the mean relation of both."""
    offset, slope = _change_relation(sample)
    return float(np.exp((math.log(CHANGED) - offset) / slope))


def _change_relation(sample: StatusSample) -> tuple[float, float]:
    """Fit ln(1 − rc) = offset + slope · ln ū over frames without fault."""
    unbalance = np.array([each.old_unbalance for each in sample.evidence])
    sound = np.array([not fault for fault in sample.fault])
    known = sound & np.isfinite(unbalance) & (unbalance > 0) & (sample.change > 0)
    slope, offset = np.polyfit(np.log(unbalance[known]), np.log(sample.change[known]), 1)
    return float(offset), float(slope)


def _predictors(sample: StatusSample) -> tuple[Array, Array]:
    return (
        np.array([e.disagreement for e in sample.evidence]),
        np.array([max(e.correction, 0.0) for e in sample.evidence]),
    )


def _print_constants(console: Console, fit: StatusFit) -> None:
    table = Table(title="Constants of solver.assessment", box=None)
    for heading in ("constant", "fitted", "in use"):
        table.add_column(heading)
    for name, fitted, used in (
        ("motion_reliability.disagreement", fit.disagreement, mixture_trust.RELIABILITY_DISAGREEMENT),
        ("motion_reliability.correction", fit.correction, mixture_trust.RELIABILITY_CORRECTION),
        ("formula_sd.normal", fit.normal, formula_sd.NORMAL_SD),
        ("formula_sd.tangential", fit.tangent, formula_sd.TANGENTIAL_SD),
        ("REARRANGING_UNBALANCE", (fit.rearranging,), (status.REARRANGING_UNBALANCE,)),
    ):
        table.add_row(name, *(", ".join(f"{each:.3f}" for each in values) for values in (fitted, used)))
    console.print(table)


def _print_performance(console: Console, name: str, sample: StatusSample, fit: StatusFit) -> None:
    """Print the performance of the constants in use and of the fitted ones on a sample."""
    fault = np.array([bool(each) for each in sample.fault])
    status = np.array([int(each) for each in sample.status])
    disagreement, correction = _predictors(sample)
    used = np.array([motion_assessment(each).trust for each in sample.evidence])
    (a, p), (b, q) = fit.disagreement, fit.correction
    fitted = np.clip(1.0 - a * disagreement**p - b * correction**q, 0.0, 1.0)
    table = Table(title=f"{name}: {np.sum(~fault)} frames without fault, {np.sum(fault)} with a fault", box=None)
    for heading in ("frames", "r", "T in use", "r < T", "r < T − .03", "R fitted", "r < R", "r < T − .03", "status"):
        table.add_column(heading, justify="right", overflow="fold")
    groups = [("no fault", ~fault)]
    groups += [(each, np.array([other == each for other in sample.fault])) for each in FAULTS]
    groups += [(f"no fault, {each.name.lower()}", ~fault & (status == each)) for each in FrameStatus]
    for label, rows in groups:
        if not rows.any():
            continue
        r = sample.r[rows]
        fractions = [
            text
            for t in (used[rows], fitted[rows])
            for text in (f"{t.mean():.3f}", f"{100 * np.mean(r < t):.1f} %", f"{100 * np.mean(r < t - 0.03):.1f} %")
        ]
        counts = ", ".join(
            f"{each.name.lower()} {n}" for each in FrameStatus if (n := int(np.sum(status[rows] == each)))
        )
        table.add_row(label, f"{r.mean():.3f}", *fractions, counts)
    console.print(table)
    _print_coverage(console, sample, fit)
    _print_rearrangement(console, sample, ~fault)


def _print_coverage(console: Console, sample: StatusSample, fit: StatusFit) -> None:
    for k, (label, constants) in enumerate((("f_n", formula_sd.NORMAL_SD), ("f_t", formula_sd.TANGENTIAL_SD))):
        for which, (a, b, c) in (("in use", constants), ("fitted", fit.normal if k == 0 else fit.tangent)):
            sigma = np.sqrt(a**2 + b**2 * sample.force + (c * sample.ensemble_sd[:, k]) ** 2)
            ratio = np.abs(sample.error[:, k]) / sigma
            console.print(
                f"  {label} {which}: 1 σ covers {100 * np.mean(ratio < 1):.1f} %, 2 σ {100 * np.mean(ratio < 2):.1f} % "
                f"of {len(ratio)} contacts; mean σ {sigma.mean():.3f} ⟨f⟩"
            )


def _print_rearrangement(console: Console, sample: StatusSample, sound: NDArray[np.bool_]) -> None:
    unbalance = np.array([each.old_unbalance for each in sample.evidence])
    known = sound & np.isfinite(unbalance) & (unbalance > 0) & (sample.change > 0)
    offset, slope = _change_relation(sample)
    rearranging = unbalance > status.REARRANGING_UNBALANCE
    console.print(
        f"  change of the true forces 1 − rc = {math.exp(offset):.2f} ū^{slope:.2f} "
        f"(correlation {np.corrcoef(np.log(unbalance[known]), np.log(sample.change[known]))[0, 1]:.2f}); "
        f"ū above {status.REARRANGING_UNBALANCE} in {np.sum(rearranging & known)} frames: mean 1 − rc "
        f"{sample.change[rearranging & known].mean() if np.any(rearranging & known) else float('nan'):.2f} there, "
        f"{sample.change[~rearranging & known].mean():.2f} elsewhere"
    )
    difference = np.array([each.start_difference for each in sample.evidence])
    apart = difference > status.SETTLED_DIFFERENCE
    for label, rows in (("above", sound & apart), ("at most", sound & ~apart)):
        if rows.any():
            mean = f"mean r {sample.r[rows].mean():.4f} in {np.sum(rows)} frames"
            console.print(f"  two starts differ by H {label} {status.SETTLED_DIFFERENCE}: {mean}")
    levels = {
        "H": difference,
        "ε": [each.correction for each in sample.evidence],
        "D": [each.disagreement for each in sample.evidence],
        "ū": unbalance,
        "greatest residual": [each.unbalance for each in sample.evidence],
        "load fraction": [each.load_fraction for each in sample.evidence],
        "pressure jump": [each.pressure_jump for each in sample.evidence],
    }
    for label, values in levels.items():
        low, middle, high, most = np.nanquantile(np.asarray(values)[sound], [0.01, 0.5, 0.95, 0.99])
        console.print(f"  {label}, no fault: 1 % {low:.3g}, median {middle:.3g}, 95 % {high:.3g}, 99 % {most:.3g}")
