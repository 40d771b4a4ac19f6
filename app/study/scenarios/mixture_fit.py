"""Fit of the weight of the position-only estimate beside the motion estimate, on simulated packings.

Both estimates of a frame are mixed with all weights as in a run, and each mixture is compared with the truth. The
weight that is fitted is that of least loss against the best one; what a mixture loses against its better part counts
more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from scipy.optimize import minimize
from scipy.special import expit

from ...experiment.experiment import load_experiment
from ...inference.corrected_sequence import CorrectedSequence
from ...process.errors import InputError
from ...process.progress import Progress, no_progress
from ...solver.assessment.mixture_trust import (
    LEAST_WEIGHT,
    WEIGHT_TERMS,
    evident_position_weight,
    motion_reliability,
    position_weight_terms,
)
from ...solver.baselines.motion_free import overlap_balance
from ...solver.bodies.grains import Array
from ...solver.contacts.pairs import Keys
from ...solver.dem.dem_truth import UnbalancedError
from ...solver.frame_forces import FrameForces
from ...solver.mixture.equilibrium_mixture import FrameBalance, mix_in_equilibrium
from ...solver.mixture.estimate_agreement import correlate, with_agreements
from ...solver.mixture.frame_mixture import ForceEstimate
from ...solver.mixture.position_estimates import PositionEstimates
from ...solver.posterior.frame_posterior import FramePosterior
from ...solver.sequence.ensemble import assemble_frame_balance
from ...solver.sequence.frame import pose_frame
from ...solver.sequence.frame_problem import SequenceProblem
from ...solver.sequence.state import SequenceState
from ...synthetic.scenarios.preset_names import ScenarioName
from .scenario_score import ScenarioSolution, StudyPlan, correct_scenario, make_planned, solve_scenario, true_forces
from .trust_study import LEFT_OUT

ALONE = "solver.positions=never", "solver.keep_members=true"
FIRST, STRIDE = 1, 2  # of the frames that are read
WEIGHTS = np.array([0.0, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0])  # of the position-only estimate
TOLERATED, PRICE = 0.003, 6.0  # loss against the better part; its price beyond, over that of a loss against the best
TOLERATED_NEW, PRICE_NEW = 0.001, 6.0  # the same of a kind against the mixture of the present weights
RIDGE, STARTS, STEPS = 1e-3, 3, 4000  # of coefficients of terms in standard deviations
FOLDS = 5
EXCESS = 0.005  # loss against the better part that is counted


@dataclass(frozen=True, slots=True)
class MixtureSample:
    """Frames of hard grains; f frames."""

    kind: NDArray[np.str_]  # (f,)
    terms: Array  # (f, t) of the logarithm of w/(1 − w)
    r: Array  # (f, 7) correlation of the mixture of every weight with the truth; of weight 0 the motion estimate
    positions: Array  # (f,) correlation of the position-only estimate, on contacts of its own
    weight: Array  # (f,) of the position-only estimate in a run
    loaded: bool = True  # see `Packing.is_loaded`: coefficients differ

    def select(self, chosen: NDArray[np.bool_]) -> MixtureSample:
        """The chosen frames (f,)."""
        return replace(
            self, kind=self.kind[chosen], terms=self.terms[chosen], r=self.r[chosen], positions=self.positions[chosen],
            weight=self.weight[chosen],
        )  # fmt: skip

    def reached(self, weight: Array) -> Array:
        """Correlation (f,) of the mixtures of these weights (f,)."""
        return np.array([np.interp(w, WEIGHTS, r) for w, r in zip(weight, self.r, strict=True)])

    @property
    def better(self) -> Array:
        """Correlation (f,) of the better part."""
        return np.maximum(self.r[:, 0], self.positions)


def sample_mixtures(
    plan: StudyPlan, scenarios: Sequence[ScenarioName], seeds: Sequence[int], progress: Progress = no_progress
) -> list[MixtureSample]:
    """Solve scenarios by their motion alone, and mix every second frame with its position-only estimate.

    Returns the frames under a known load and those without, where there are any.
    """
    motion = replace(plan, settings=(*plan.settings, *ALONE))
    found: dict[bool, list[tuple[str, Array, Array, float, float]]] = {True: [], False: []}
    cases: list[tuple[ScenarioName, int]] = [(name, seed) for name in scenarios for seed in seeds]
    for done, (name, seed) in enumerate(cases):
        progress("mixtures", done, len(cases))
        with TemporaryDirectory() as folder:
            try:
                made = make_planned(plan, Path(folder), name, seed, progress)
                if correct_scenario(load_experiment(made.folder, plan.settings)).settings.soft:
                    continue  # a run takes overlaps for forces, and weighs them so
                experiment = load_experiment(made.folder, motion.settings)
                solution = solve_scenario(experiment, progress)
            except (InputError, UnbalancedError):
                continue
            rows = [(name, *each) for each in _mix_frames(solution, true_forces(experiment, solution.sequence))]
            found[solution.sequence.packing.is_loaded] += rows
    return [
        MixtureSample(*(np.array(column) for column in zip(*rows, strict=True)), loaded=loaded)
        for loaded, rows in found.items()
        if rows
    ]


def fit_weight(sample: MixtureSample) -> Array:
    """Coefficients (t,) of the terms; every kind counts the same, and none is to lose against the present weights."""
    _, index, count = np.unique(sample.kind, return_inverse=True, return_counts=True)
    weight, best, better = 1.0 / count[index], sample.r.max(axis=1), sample.better
    present = np.bincount(index, _mixed(sample)) / count
    middle, spread = sample.terms.mean(axis=0), sample.terms.std(axis=0)
    middle[0], spread[0] = 0.0, 1.0  # the constant
    terms = (sample.terms - middle) / spread

    def loss(coefficients: Array) -> float:
        r = sample.reached(expit(terms @ coefficients))
        lost = best - r + PRICE * np.maximum(better - r - TOLERATED, 0.0)
        worse = np.maximum(present - np.bincount(index, r) / count - TOLERATED_NEW, 0.0)
        return (
            float(np.average(lost, weights=weight))
            + PRICE_NEW * float(worse.mean())
            + RIDGE * float(coefficients[1:] @ coefficients[1:])
        )

    starts = np.random.default_rng(0).normal(0.0, 0.3, (STARTS, terms.shape[1]))
    options = {"maxiter": STEPS, "maxfev": STEPS, "fatol": 1e-7, "adaptive": True}
    trials = [minimize(loss, start, method="Nelder-Mead", options=options) for start in starts]
    found = np.asarray(min(trials, key=lambda trial: trial.fun).x) / spread
    found[0] -= found[1:] @ middle[1:]
    return found


def print_mixture(console: Console, sample: MixtureSample) -> None:
    """Print what the present weights reach of every kind, the fitted coefficients, and what they reach left out.

    Kinds on which the trust is judged are not read by the fit.
    """
    title = "[position_weight]" if sample.loaded else "[position_weight.unloaded]"
    _print_kinds(console, sample)
    read = ~np.isin(sample.kind, list(LEFT_OUT))
    coefficients = fit_weight(sample.select(read) if read.any() else sample)
    values = ", ".join(f"{name} = {x:.3f}" for name, x in zip(WEIGHT_TERMS, coefficients, strict=True))
    console.print(f"{title} {values}", markup=False, highlight=False, soft_wrap=True)
    weight, kinds = np.zeros(len(sample.r)), np.unique(sample.kind)
    for fold in range(FOLDS):
        away = np.isin(sample.kind, kinds[fold::FOLDS])
        if away.all() or not away.any():
            continue
        weight[away] = expit(sample.select(away).terms @ fit_weight(sample.select(~away)))
    rows = {
        "motion alone": sample.r[:, 0], "positions alone": sample.positions, "the better of both": sample.better,
        "the mixture of a run": _mixed(sample), "the best weight": sample.r.max(axis=1),
        "fitted anew": sample.reached(expit(sample.terms @ coefficients)), "fitted anew, kinds left out in turn":
        sample.reached(weight),
    }  # fmt: skip
    for name, r in rows.items():
        lost = sample.better - r
        console.print(
            f"{name}: mean r {np.mean([r[sample.kind == kind].mean() for kind in kinds]):.4f}, worse than the better "
            f"part by more than {EXCESS} in {100.0 * np.mean(lost > EXCESS):.1f} % of {len(r)} frames, at most by "
            f"{max(lost.max(), 0.0):.3f}", highlight=False, soft_wrap=True,
        )  # fmt: skip


def _mixed(sample: MixtureSample) -> Array:
    """Return the correlations (f,) of the mixtures of a run."""
    return sample.reached(np.where(sample.weight < LEAST_WEIGHT, 0.0, sample.weight))


def _print_kinds(console: Console, sample: MixtureSample) -> None:
    """Print the mean r of both parts and of their mixture in a run, of every kind."""
    mixed = _mixed(sample)
    rows, worse = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0)), []
    for heading in ("kind", "motion", "positions", "mixture", "loss against the better"):
        rows.add_column(heading, justify="left" if heading == "kind" else "right")
    for kind in np.unique(sample.kind):
        of_kind = sample.kind == kind
        motion, positions, both = (
            float(each[of_kind].mean()) for each in (sample.r[:, 0], sample.positions, mixed)
        )  # fmt: skip
        lost = max(motion, positions) - both
        worse += [str(kind)] if lost > EXCESS else []
        rows.add_row(str(kind), *(f"{each:.3f}" for each in (motion, positions, both, lost)))
    console.print(rows)
    console.print(
        f"The mean of a kind is worse than that of its better part by more than {EXCESS} in {len(worse)} of "
        f"{len(np.unique(sample.kind))} kinds" + (f": {', '.join(worse)}." if worse else "."),
        highlight=False, soft_wrap=True,
    )  # fmt: skip


def _mix_frames(
    solution: ScenarioSolution, true: Sequence[tuple[Keys, Array]]
) -> list[tuple[Array, Array, float, float]]:
    """Terms (t,) and correlations (7,) of frames of hard grains, that of positions alone, and their weight in a run."""
    sequence, found = solution.sequence, []
    estimates = PositionEstimates(sequence.packing, sequence.snapshots, sequence.settings.posterior, 1)
    for k in range(FIRST, len(solution.unchecked), STRIDE):
        frame, positions = solution.unchecked[k], estimates.at(k)
        if positions is None or not positions.fn.any() or not frame.fn.any():
            continue
        noise = float(np.hypot(sequence.snapshots[k].sigma, sequence.settings.overlap or 0.0))
        contacts, force = overlap_balance(sequence.packing, sequence.snapshots, k, noise)
        motion = frame.contacts.key, frame.fn
        geometry, balance = (positions.contacts.key, positions.fn), (contacts.key, force[:, 0])
        evidence = with_agreements(solution.evidence[k], motion, positions, balance, sequence.snapshots[k].sigma)
        truth = true[k][0], true[k][1][:, 0]
        fields = [frame.fn, *mixed_forces(sequence, frame, positions, motion_reliability(evidence), WEIGHTS[1:])]
        r = np.array([correlate((frame.contacts.key, fn), truth) for fn in fields])
        alone = correlate(geometry, truth)
        found.append((position_weight_terms(evidence), r, alone, evident_position_weight(evidence)))
    return found


def mixed_forces(
    sequence: CorrectedSequence, frame: FrameForces, positions: FramePosterior, reliability: float, weights: Array
) -> list[Array]:
    """Mix a motion estimate, solved with its members kept, as a run does.

    Returns f_n (c,) [N] of the mixture of every weight, on the contacts of the frame.
    """
    assert frame.member_force is not None
    problem = pose_frame(
        SequenceProblem(sequence.packing, sequence.snapshots, sequence.settings), frame.frame,
        SequenceState.first(sequence.packing),
    )  # fmt: skip
    balanced = FrameBalance(
        frame.contacts, problem.snapshot.position, assemble_frame_balance(problem, frame.contacts, frame.fn),
        problem.settings.ensemble.convex, problem.packing.scale_is_known, any(problem.packing.material.gravity),
    )  # fmt: skip
    fn_sd, ft_sd = np.nanstd(frame.member_force, axis=1).T
    motion = ForceEstimate(frame.fn, frame.ft, fn_sd, ft_sd)
    return [
        mix_in_equilibrium(balanced, motion, positions, reliability, position_weight=float(weight)).fn
        for weight in weights
    ]
