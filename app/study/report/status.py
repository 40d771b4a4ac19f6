"""Status, trust and error bars against the truth: fits the constants of solver.judgement anew and says how they do.

Windows of simulated truths are solved as `rodsight run` would, with several noises and with the faults that an
experiment may have. The constants are fitted on some packings and judged on others.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from scipy.optimize import minimize

from solver.bodies.grains import Array
from solver.contacts.pairs import Keys, recall
from solver.dem.simulation import DemTruth
from solver.sequence.frame_forces import FrameForces, FrameStatus
from solver.sequence.judging import judgement
from solver.sequence.judging.intervals import FLOOR, formula_deviations
from solver.sequence.judging.judgement import Evidence, trust
from solver.statistics.agreement import compare_forces

from ...inference.inference import Inputs, infer_frames
from ...progress import Progress, silent
from ..truths import agreement_of, observe, simulate, starts_of, true_forces, truth_keys

WINDOW = 12  # photographs of one sequence
FAULTY_WINDOW = 6
NOISES = (0.0, 1e-5, 2e-5, 4e-5)  # [m]
FAULT_NOISE = 1e-5  # [m]
PASSED = 0.06  # share of frames that may be worse than their trust
FAULT_WEIGHT = 0.5  # of a faulty frame in the fit of the trust: real sequences are mostly sound
WEAK = 1e-3  # of the mean force: contacts below it, inferred and true, have no error worth a bar
CHANGED = 0.2  # 1 − correlation with the true forces before, from which on a packing has rearranged
RESTARTS = 3  # of the fit: each goes on from the last with a fresh simplex
COVERED = (0.683, 0.954)  # of one and of two standard deviations
POWERS = (0.5, 4.0)  # of D and ε
FAULTS = (
    "friction 20 % low",
    "friction 40 % low",
    "friction 40 % high",
    "radii 1 % wrong",
    "grains unseen",
    "tracks off",
)


@dataclass(frozen=True, slots=True)
class StatusSample:
    """What was inferred and what is true, over all frames that a motion leads to."""

    evidence: list[Evidence]  # f of them
    status: list[FrameStatus]
    r: Array  # (f,) true correlation of the normal forces
    change: Array  # (f,) 1 − correlation of the true normal forces with those of the photograph before
    fault: list[str]  # of each frame, empty: none
    error: Array  # (c, 2) of f_n and f_t on the contacts of sound frames, over the mean f_n
    force: Array  # (c,) f_n over the mean
    spread: Array  # (c, 2) of the members' f_n and f_t over the mean f_n
    stated: Array  # (c, 2) deviations of f_n and f_t that are stated, over the mean f_n


@dataclass(frozen=True, slots=True)
class StatusFit:
    """Constants in the form of solver.judgement."""

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
    progress: Progress = silent,
) -> StatusFit:
    """Fit on the packings `seeds` of each size, judge on `held_out`; print fitted constants beside those in use."""
    samples = []
    for some in (seeds, held_out):
        truths = [simulate(seed, grains=n, folder=folder, progress=progress) for n in grains for seed in some]
        samples.append(observe_status(truths, noises, progress=progress))
    fit = fit_status(samples[0])
    _print_constants(console, fit)
    for name, sample in zip(("packings of the fit", "packings held out"), samples, strict=True):
        _print_performance(console, name, sample, fit)
    return fit


def observe_status(truths: Sequence[DemTruth], noises: Sequence[float], *, progress: Progress = silent) -> StatusSample:
    """Solve windows of all truths, up and down, with each noise [m], and once with each fault."""
    parts: list[StatusSample] = []
    jobs = [
        (t, start, noise, "") for t in range(len(truths)) for start in starts_of(truths[t], WINDOW) for noise in noises
    ]
    jobs += [(t, starts_of(truths[t], WINDOW)[0], FAULT_NOISE, fault) for t in range(len(truths)) for fault in FAULTS]
    for done, (t, start, noise, fault) in enumerate(jobs):
        progress("status", done, len(jobs))
        parts.append(
            _observe_window(truths[t], start, noise, fault, np.random.default_rng([t, start, round(noise * 1e9)]))
        )
    progress("status", len(jobs), len(jobs))
    return StatusSample(
        [e for part in parts for e in part.evidence],
        [s for part in parts for s in part.status],
        np.concatenate([part.r for part in parts]),
        np.concatenate([part.change for part in parts]),
        [f for part in parts for f in part.fault],
        np.concatenate([part.error for part in parts if not any(part.fault)]),
        np.concatenate([part.force for part in parts if not any(part.fault)]),
        np.concatenate([part.spread for part in parts if not any(part.fault)]),
        np.concatenate([part.stated for part in parts if not any(part.fault)]),
    )


def fit_status(sample: StatusSample) -> StatusFit:
    """Fit trust by quantile regression and the standard deviations by their coverage."""
    disagreement, correction = _predictors(sample)
    weight = np.where([bool(fault) for fault in sample.fault], FAULT_WEIGHT, 1.0)

    def loss(x: Array) -> float:
        p, q = np.clip(x[2:], *POWERS)
        bound = np.minimum(np.exp(x[0]) * disagreement**p + np.exp(x[1]) * correction**q, 1.0)
        over = np.log(np.maximum(1.0 - sample.r, 1e-6)) - np.log(np.maximum(bound, 1e-6))
        return float(np.average(np.where(over > 0, (1.0 - PASSED) * over, -PASSED * over), weights=weight))

    x = np.array([0.0, 0.0, 1.5, 1.2])
    for _ in range(RESTARTS):
        x = _least(loss, x)
    p, q = np.clip(x[2:], *POWERS)
    return StatusFit(
        (float(np.exp(x[0])), float(p)),
        (float(np.exp(x[1])), float(q)),
        _fit_deviation(sample.error[:, 0], sample.force, sample.spread[:, 0]),
        _fit_deviation(sample.error[:, 1], sample.force, sample.spread[:, 1]),
        _fit_rearranging(sample),
    )


def _fit_deviation(error: Array, force: Array, spread: Array) -> tuple[float, float, float]:
    """a, b, c of σ² = a² + b² f + (c s)²: likeliest for Student's t, then scaled until both coverages are near."""
    size = np.abs(error)

    def deviation(x: Array) -> Array:
        a, b, c = np.exp(x)
        return np.sqrt(a**2 + b**2 * force + (c * spread) ** 2)

    def loss(x: Array) -> float:  # four degrees of freedom: contact forces err with heavy tails
        sigma = deviation(x)
        return float(np.mean(np.log(sigma) + 2.5 * np.log1p((size / sigma) ** 2 / 4.0)))

    x = _least(loss, np.log([0.05, 0.1, 1.0]))
    ratio = size / deviation(x)
    scale = math.sqrt(float(np.quantile(ratio, COVERED[0])) * float(np.quantile(ratio, COVERED[1])) / 2.0)
    a, b, c = (float(each) for each in np.exp(x) * scale)
    return a, b, c


def _least(loss: Callable[[Array], float], start: Array) -> Array:
    """Where a rough function is least, near a start (x,)."""
    simplex = np.vstack([start, start + 0.5 * np.eye(len(start))])
    options = {"initial_simplex": simplex, "maxiter": 3000, "xatol": 1e-4, "fatol": 1e-7}
    return minimize(loss, start, method="Nelder-Mead", options=options).x


def _fit_rearranging(sample: StatusSample) -> float:
    """ū at which CHANGED of the true forces is new, from the mean relation between both."""
    offset, slope = _change_relation(sample)
    return float(np.exp((math.log(CHANGED) - offset) / slope))


def _change_relation(sample: StatusSample) -> tuple[float, float]:
    """ln(1 − rc) = offset + slope · ln ū over sound frames."""
    unbalance = np.array([each.old_unbalance for each in sample.evidence])
    sound = np.array([not fault for fault in sample.fault])
    known = sound & np.isfinite(unbalance) & (unbalance > 0) & (sample.change > 0)
    slope, offset = np.polyfit(np.log(unbalance[known]), np.log(sample.change[known]), 1)
    return float(offset), float(slope)


def _observe_window(truth: DemTruth, start: int, noise: float, fault: str, rng: np.random.Generator) -> StatusSample:
    window = FAULTY_WINDOW if fault else WINDOW
    inputs = observe(truth, range(start, start + window), noise, rng)
    if fault:
        inputs = _spoil(inputs, fault, rng)
    rows, errors, forces, spreads, stated = [], [], [], [], []
    for solved in infer_frames(inputs):
        frame, state = solved.forces, solved.state
        if frame.frame == 0:
            continue
        k = start + frame.frame
        key, force = true_forces(truth, k)
        before, former = true_forces(truth, k - 1)
        rows.append(
            (state.evidence, frame.status, agreement_of(frame, truth, k).r_fn, _change(key, force, before, former))
        )
        error, relative, spread, told = _contact_errors(frame, *truth_keys(frame.contacts, truth), key, force)
        errors.append(error)
        forces.append(relative)
        spreads.append(spread)
        stated.append(told)
    evidence, status, r, change = zip(*rows, strict=True)
    return StatusSample(
        list(evidence), list(status), np.array(r), np.array(change), [fault] * len(rows),
        np.concatenate(errors), np.concatenate(forces), np.concatenate(spreads), np.concatenate(stated),
    )  # fmt: skip


def _spoil(inputs: Inputs, fault: str, rng: np.random.Generator) -> Inputs:
    """Do to the inputs what goes wrong with real ones."""
    tracks, material = inputs.tracks, inputs.material
    n = tracks.grain_count
    some = rng.choice(n, max(n // 100, 2), replace=False)
    if fault.startswith("friction"):
        factor = {"friction 20 % low": 0.8, "friction 40 % low": 0.6, "friction 40 % high": 1.4}[fault]
        wrong = replace(material, friction=factor * material.friction, wall_friction=factor * material.at_walls())
        return replace(inputs, material=wrong)
    if fault == "radii 1 % wrong":  # of one grain in a hundred, too small
        radius = tracks.radius.copy()
        radius[some] *= 0.99
        return replace(inputs, tracks=replace(tracks, radius=radius))
    position, rotation = tracks.position.copy(), tracks.rotation.copy()
    if fault == "grains unseen":
        unseen = some[: max(len(some) // 2, 1)]
        position[:, unseen], rotation[:, unseen] = np.nan, np.nan
        return replace(inputs, tracks=replace(tracks, position=position, rotation=rotation))
    if fault == "tracks off":  # in one photograph, by a fifth of a millimetre
        position[tracks.frame_count // 2, some] += 2e-4 * rng.standard_normal((len(some), 2))
        return replace(inputs, tracks=replace(tracks, position=position))
    raise ValueError(f"no fault is called {fault!r}")


def _change(key: Keys, force: Array, before: Keys, former: Array) -> float:
    return 1.0 - compare_forces(key, force, before, former).r_fn


def _contact_errors(
    frame: FrameForces, own: Keys, seen: NDArray[np.bool_], key: Keys, force: Array
) -> tuple[Array, Array, Array, Array]:
    """Error (c, 2), f_n (c,), spread and stated deviations (c, 2) over the mean f_n, of contacts that bear force.

    Here or in truth; own: the keys of the frame's `seen` contacts as the truth's are counted.
    """
    true = recall(own, key, force)
    mean = float(frame.fn[frame.fn > 0].mean())
    found = np.column_stack([frame.fn, frame.ft])[seen]
    bearing = np.maximum(found[:, 0], true[:, 0]) > WEAK * mean
    error, relative = (found - true) / mean, found[:, 0] / mean
    formula = formula_deviations(frame)[seen]
    spread = np.column_stack([
        _spread_behind(formula[:, c], relative, (np.hypot(constants[0], FLOOR[c]), *constants[1:]))
        for c, constants in enumerate((judgement.NORMAL_DEVIATION, judgement.TANGENT_DEVIATION))
    ])  # fmt: skip
    stated = np.column_stack([frame.fn_sd, frame.ft_sd])[seen] / mean
    return error[bearing], relative[bearing], spread[bearing], stated[bearing]


def _spread_behind(deviation: Array, force: Array, constants: tuple[float, float, float]) -> Array:
    """The members' spread from which the formula's deviation was made: a frame keeps only what that became."""
    a, b, c = constants
    return np.sqrt(np.maximum(deviation**2 - a**2 - b**2 * force, 0.0)) / c


def _predictors(sample: StatusSample) -> tuple[Array, Array]:
    return (
        np.array([e.disagreement for e in sample.evidence]),
        np.array([max(e.correction, 0.0) for e in sample.evidence]),
    )


def _print_constants(console: Console, fit: StatusFit) -> None:
    table = Table(title="Constants of solver.judgement", box=None)
    for heading in ("constant", "fitted", "in use"):
        table.add_column(heading)
    for name, fitted, used in (
        ("TRUST_DISAGREEMENT", fit.disagreement, judgement.TRUST_DISAGREEMENT),
        ("TRUST_CORRECTION", fit.correction, judgement.TRUST_CORRECTION),
        ("NORMAL_DEVIATION", fit.normal, judgement.NORMAL_DEVIATION),
        ("TANGENT_DEVIATION", fit.tangent, judgement.TANGENT_DEVIATION),
        ("REARRANGING_UNBALANCE", (fit.rearranging,), (judgement.REARRANGING_UNBALANCE,)),
    ):
        table.add_row(name, *(", ".join(f"{each:.3f}" for each in values) for values in (fitted, used)))
    console.print(table)


def _print_performance(console: Console, name: str, sample: StatusSample, fit: StatusFit) -> None:
    """How the constants in use, and those fitted, do on a sample."""
    fault = np.array([bool(each) for each in sample.fault])
    status = np.array([int(each) for each in sample.status])
    disagreement, correction = _predictors(sample)
    used = np.array([trust(each) for each in sample.evidence])
    (a, p), (b, q) = fit.disagreement, fit.correction
    seen = np.array([1.0 - judgement.HOLE_DOUBT * e.holes / max(e.grains, 1) for e in sample.evidence])
    fitted = np.clip(1.0 - a * disagreement**p - b * correction**q, 0.0, 1.0) * np.maximum(seen, 0.0)
    table = Table(title=f"{name}: {np.sum(~fault)} sound frames, {np.sum(fault)} faulty ones", box=None)
    for heading in ("frames", "r", "T in use", "r < T", "r < T − .03", "T fitted", "r < T", "r < T − .03", "status"):
        table.add_column(heading, justify="right", overflow="fold")
    groups = [("sound", ~fault)]
    groups += [(each, np.array([other == each for other in sample.fault])) for each in FAULTS]
    groups += [(f"sound, {each.name.lower()}", ~fault & (status == each)) for each in FrameStatus]
    for label, rows in groups:
        if not rows.any():
            continue
        r = sample.r[rows]
        shares = [
            text
            for t in (used[rows], fitted[rows])
            for text in (f"{t.mean():.3f}", f"{100 * np.mean(r < t):.1f} %", f"{100 * np.mean(r < t - 0.03):.1f} %")
        ]
        counts = ", ".join(
            f"{each.name.lower()} {n}" for each in FrameStatus if (n := int(np.sum(status[rows] == each)))
        )
        table.add_row(label, f"{r.mean():.3f}", *shares, counts)
    console.print(table)
    _print_coverage(console, sample, fit)
    _print_rearrangement(console, sample, ~fault)


def _print_coverage(console: Console, sample: StatusSample, fit: StatusFit) -> None:
    for k, (label, constants) in enumerate((("f_n", judgement.NORMAL_DEVIATION), ("f_t", judgement.TANGENT_DEVIATION))):
        for which, (a, b, c) in (("in use", constants), ("fitted", fit.normal if k == 0 else fit.tangent)):
            sigma = np.sqrt(a**2 + b**2 * sample.force + (c * sample.spread[:, k]) ** 2)
            ratio = np.abs(sample.error[:, k]) / sigma
            console.print(
                f"  {label} {which}: 1 σ covers {100 * np.mean(ratio < 1):.1f} %, 2 σ {100 * np.mean(ratio < 2):.1f} % "
                f"of {len(ratio)} contacts; mean σ {sigma.mean():.3f} ⟨f⟩"
            )


def _print_rearrangement(console: Console, sample: StatusSample, sound: NDArray[np.bool_]) -> None:
    unbalance = np.array([each.old_unbalance for each in sample.evidence])
    known = sound & np.isfinite(unbalance) & (unbalance > 0) & (sample.change > 0)
    offset, slope = _change_relation(sample)
    told = unbalance > judgement.REARRANGING_UNBALANCE
    console.print(
        f"  change of the true forces 1 − rc = {math.exp(offset):.2f} ū^{slope:.2f} "
        f"(correlation {np.corrcoef(np.log(unbalance[known]), np.log(sample.change[known]))[0, 1]:.2f}); "
        f"ū above {judgement.REARRANGING_UNBALANCE} in {np.sum(told & known)} frames: mean 1 − rc "
        f"{sample.change[told & known].mean() if np.any(told & known) else float('nan'):.2f} there, "
        f"{sample.change[~told & known].mean():.2f} elsewhere"
    )
    difference = np.array([each.start_difference for each in sample.evidence])
    apart = difference > judgement.SETTLED_DIFFERENCE
    for label, rows in (("above", sound & apart), ("at most", sound & ~apart)):
        if rows.any():
            mean = f"mean r {sample.r[rows].mean():.4f} in {np.sum(rows)} frames"
            console.print(f"  two starts differ by H {label} {judgement.SETTLED_DIFFERENCE}: {mean}")
    levels = {
        "H": difference,
        "ε": [each.correction for each in sample.evidence],
        "D": [each.disagreement for each in sample.evidence],
        "ū": unbalance,
        "worst unbalance": [each.unbalance for each in sample.evidence],
        "load share": [each.load_share for each in sample.evidence],
        "pressure jump": [each.pressure_jump for each in sample.evidence],
    }
    for label, values in levels.items():
        low, middle, high, most = np.nanquantile(np.asarray(values)[sound], [0.01, 0.5, 0.95, 0.99])
        console.print(f"  {label}, sound: 1 % {low:.3g}, median {middle:.3g}, 95 % {high:.3g}, 99 % {most:.3g}")
