"""Trust against the truth by group and kind of input, and the fit of the expected correlation.

The margin of the bound is fitted on seeds left out in turn; kinds of input that no fit reads judge the result.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from scipy.optimize import isotonic_regression
from scipy.stats import spearmanr

from ...solver.assessment.expected_correlation import LEAST, MEASURES
from ...solver.bodies.grains import Array
from ...synthetic.scenarios.preset_names import Group
from ...synthetic.scenarios.scenario_table import SCENARIOS, Scenario
from .scenario_score import TRUST_TOLERANCE, ScenarioScore

GROUPS: tuple[Group, ...] = ("correct", "missing physics", "wrong input")
# Kinds that no fit reads: of each group some, and of each mechanism at most one.
LEFT_OUT = frozenset({
    "step_1", "circle", "corners", "radii_03", "strong_cohesion", "rolling", "stiff_moving", "theta_sign", "aspect_03",
    "walls_late", "swapped_frames", "shuffled", "outliers", "one_jump", "missing_poses", "tilted_bed", "stiff_loose",
    "rough_walls",
})  # fmt: skip
TOO_HIGH, TOO_LOW = TRUST_TOLERANCE, 0.15  # T above r, T below r
# Excess of T over r, and fraction of the frames of any group that may have more.
LIMITS = ((TOO_HIGH, 0.03), (0.0, 0.05))
SOFT = 1.9e6  # [N/m] stiffness of contacts below which overlaps are forces
KNOTS, ROUNDS = 9, 12
SMOOTH = 0.15  # of the range of a measure, over which its isotonic regression is averaged
START = 2.6  # arctanh r below which the margin grows
SLOPES = np.linspace(0.0, 0.6, 7)
BEST_R, WORST_R = 0.995, -0.2  # limits of r whose arctanh is fitted
# The fits, each with the measures that it weighs.
FITS: dict[str, tuple[str, ...]] = {
    "both": tuple(name for name in MEASURES if name != "disagreement_of_positions"),
    "motion": (
        "correction", "previous_residual", "disagreement_of_members", "gap_error", "force_change", "power_gap",
    ),
    "overlaps": (
        "disagreement_of_positions", "disagreement_of_estimates", "previous_residual", "gap_error", "force_change",
    ),
}  # fmt: skip
# Least and greatest value of each measure: beyond them no more is known.
RANGES = {
    "disagreement_of_estimates": (0.02, 1.0), "disagreement_with_either": (0.03, 1.0),
    "correction": (0.02, 2.0),
    "previous_residual": (0.004, 0.2),
    "disagreement_of_members": (0.05, 1.0), "gap_error": (1e-4, 5e-3), "force_change": (0.01, 0.6),
    "power_gap": (0.01, 1.5), "disagreement_of_positions": (0.003, 1.0),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class TrustSample:
    """Frames after the first of several scenarios; f frames."""

    kind: NDArray[np.str_]  # (f,)
    seed: NDArray[np.int64]  # (f,)
    group: NDArray[np.str_]  # (f,)
    suspect: NDArray[np.bool_]  # (f,)
    overlaps: NDArray[np.bool_]  # (f,) whether the forces follow from the overlaps of soft grains
    r: Array  # (f,)
    trust: Array  # (f,)
    expected: Array  # (f,)
    measures: dict[str, Array]  # (f,) each, logarithms within RANGES; NaN: not known

    @classmethod
    def of(cls, scores: Sequence[ScenarioScore]) -> TrustSample:
        """Collect the frames of accepted scenarios to which a motion leads."""
        rows = [
            (score, k)
            for score in scores
            for k in range(1, len(score.r))
            if score.r[k] is not None and score.trust[k] is not None and score.status[k] != "failed"
        ]
        measures = np.array([[math.nan if v is None else v for v in score.measures[k]] for score, k in rows])
        return cls(
            np.array([score.scenario for score, _ in rows]),
            np.array([score.seed for score, _ in rows]),
            np.array([SCENARIOS[score.scenario].group for score, _ in rows]),
            np.array([score.status[k] == "suspect" for score, k in rows]),
            np.array([score.overlaps[k] for score, k in rows]),
            np.array([score.r[k] for score, k in rows], float),
            np.array([score.trust[k] for score, k in rows], float),
            np.array([score.expected[k] for score, k in rows], float),
            {
                name: np.log(np.clip(np.maximum(measures[:, m], LEAST), *RANGES[name]))
                for m, name in enumerate(MEASURES)
            },
        )  # fmt: skip

    def select(self, chosen: NDArray[np.bool_]) -> TrustSample:
        """The chosen frames (f,)."""
        return TrustSample(
            self.kind[chosen], self.seed[chosen], self.group[chosen], self.suspect[chosen],
            self.overlaps[chosen], self.r[chosen], self.trust[chosen], self.expected[chosen],
            {name: each[chosen] for name, each in self.measures.items()},
        )  # fmt: skip

    @property
    def weight(self) -> Array:
        """Weight of a frame (f,): every kind counts the same."""
        names, index, count = np.unique(self.kind, return_inverse=True, return_counts=True)
        return 1.0 / (count[index] * len(names))


@dataclass(frozen=True, slots=True)
class AdditiveFit:
    """arctanh r = constant + Σ value(measure)."""

    constant: float
    terms: dict[str, tuple[Array, Array]]  # knots of ln measure and values

    def score(self, sample: TrustSample) -> Array:
        """arctanh of the expected correlation (f,)."""
        total = np.full(len(sample.r), self.constant)
        for name, (at, value) in self.terms.items():
            total += _evaluate(sample.measures[name], at, value)
        return total


@dataclass(frozen=True, slots=True)
class Margin:
    """T = tanh(g − margin − slope max(START − g, 0))."""

    margin: float
    slope: float

    def bound(self, score: Array) -> Array:
        return np.maximum(np.tanh(score - self.margin - self.slope * np.maximum(START - score, 0.0)), 0.0)


def fit_expected(sample: TrustSample, names: Sequence[str]) -> tuple[AdditiveFit, Margin, Array]:
    """Fit the expected correlation, and the margin of its bound on seeds left out in turn.

    Returns
    -------
    AdditiveFit
        On all frames.
    Margin
    ndarray, shape (f,)
        Scores of each frame by fits without its seed; with one seed by the fit of all.
    """
    left_out = _fit(sample, names).score(sample)
    seeds = np.unique(sample.seed)
    for seed in seeds if len(seeds) > 1 else []:
        away = sample.seed == seed
        left_out[away] = _fit(sample.select(~away), names).score(sample.select(away))
    return _fit(sample, names), _fit_margin(sample, left_out), left_out


def refit(sample: TrustSample, fits: dict[str, tuple[AdditiveFit, Margin]]) -> TrustSample:
    """The sample with expected correlation and trust by new fits, without the penalties outside of them."""
    expected, trust = sample.expected.copy(), sample.trust.copy()
    for name, (fit, margin) in fits.items():
        here = sample.overlaps if name == "overlaps" else ~sample.overlaps
        if name == "motion" or not here.any():
            continue
        score = fit.score(sample.select(here))
        expected[here], trust[here] = np.maximum(np.tanh(score), 0.0), margin.bound(score)
    return replace(sample, expected=expected, trust=trust)


def rows_of(sample: TrustSample, fit: str) -> TrustSample:
    """The frames that a fit of this name reads: for overlaps all of soft grains, whether that was detected or not."""
    if fit == "overlaps":
        return sample.select(np.isin(sample.kind, [name for name, each in SCENARIOS.items() if _is_soft(each)]))
    return sample.select(~sample.overlaps)


def _is_soft(scenario: Scenario) -> bool:
    return scenario.loading.settings.normal_stiffness < SOFT


def describe_fit(title: str, fit: AdditiveFit, margin: Margin) -> str:
    """The table of fitted.toml."""
    lines = [
        f"[expected_correlation.{title}]", f"constant = {fit.constant:.3f}", f"margin = {margin.margin:.3f}",
        f"slope = {margin.slope:.2f}", f"start = {START}",
    ]  # fmt: skip
    for name, (at, value) in fit.terms.items():
        knots, values = (", ".join(f"{x:.3g}" for x in np.exp(at))), ", ".join(f"{x:.3f}" for x in value)
        lines.append(f"{name} = {{ at = [{knots}], value = [{values}] }}")
    return "\n".join(lines)


def print_trust(console: Console, title: str, sample: TrustSample) -> None:
    """Print r, expected correlation and trust by kind, then the summary of the groups."""
    table = Table(title=title, title_justify="left", box=None, pad_edge=False, padding=(0, 1, 0, 0))
    for heading in ("group", "kind", "frames", "r", "least", "expected", "T", "T > r + .03", "T < r − .15"):
        table.add_column(heading, justify="left" if heading in ("group", "kind") else "right")
    for group in GROUPS:
        for kind in np.unique(sample.kind[sample.group == group]):
            some = sample.select(sample.kind == kind)
            table.add_row(
                group, str(kind), str(len(some.r)), f"{some.r.mean():.3f}", f"{some.r.min():.3f}",
                f"{some.expected.mean():.3f}", f"{some.trust.mean():.2f}", *_fractions(some),
            )  # fmt: skip
    console.print(table)
    for group in (*GROUPS, "all", "suspect"):
        chosen = sample.suspect if group == "suspect" else np.ones(len(sample.r), np.bool_)
        some = sample.select(chosen if group in ("all", "suspect") else sample.group == group)
        if len(some.r) < 3:
            continue
        high, low = _fractions(some)
        order = float(np.asarray(spearmanr(some.trust, some.r))[0])
        console.print(
            f"{group}: {len(some.r)} frames, T > r + .03 in {high}, T < r − .15 in {low}, Spearman of T and r "
            f"{order:.2f}, median |expected − r| {np.median(np.abs(some.expected - some.r)):.3f}", highlight=False,
        )  # fmt: skip


def _fractions(sample: TrustSample) -> tuple[str, str]:
    high, low = sample.trust > sample.r + TOO_HIGH, sample.trust < sample.r - TOO_LOW
    return f"{100.0 * high.mean():.1f} %", f"{100.0 * low.mean():.1f} %"


def _fit(sample: TrustSample, names: Sequence[str]) -> AdditiveFit:
    """Backfitting of isotonic regressions, each averaged to knots."""
    target, weight = np.arctanh(np.clip(sample.r, WORST_R, BEST_R)), sample.weight
    constant = float(np.average(target, weights=weight))
    parts = {name: np.zeros(len(target)) for name in names}
    terms: dict[str, tuple[Array, Array]] = {}
    for _ in range(ROUNDS):
        for name in names:
            rest = target - constant - sum((parts[other] for other in names if other != name), np.zeros(len(target)))
            terms[name] = _regress(sample.measures[name], rest, weight)
            parts[name] = _evaluate(sample.measures[name], *terms[name])
    return AdditiveFit(constant, terms)


def _regress(measure: Array, rest: Array, weight: Array) -> tuple[Array, Array]:
    known = np.isfinite(measure)
    x, y, w = measure[known], rest[known], weight[known]
    order = np.argsort(x, kind="stable")
    x, w = x[order], w[order]
    fitted = isotonic_regression(y[order], weights=w, increasing=False).x
    at = np.unique(np.quantile(x, np.linspace(0.0, 1.0, KNOTS), method="nearest"))
    reach = max(SMOOTH * float(at[-1] - at[0]), 1e-9)
    value = np.array([np.average(fitted[near], weights=w[near]) for near in (np.abs(x - c) <= reach for c in at)])
    value = np.minimum.accumulate(value)
    return at, value - np.average(np.interp(x, at, value), weights=w)


def _evaluate(measure: Array, at: Array, value: Array) -> Array:
    return np.where(np.isfinite(measure), np.interp(np.nan_to_num(measure), at, value), 0.0)


def _fit_margin(sample: TrustSample, score: Array) -> Margin:
    """The margin with which T is too high in few frames of each group, and least often too low."""
    best, fewest = Margin(0.0, 0.0), math.inf
    for slope in SLOPES:
        low, high = 0.0, 3.0
        for _ in range(30):
            middle = 0.5 * (low + high)
            bound = Margin(middle, slope).bound(score)
            worst = max(
                np.average(bound[chosen] > sample.r[chosen] + excess, weights=sample.weight[chosen]) / allowed
                for group in GROUPS
                for excess, allowed in LIMITS
                if (chosen := sample.group == group).any()
            )
            low, high = (middle, high) if worst > 1.0 else (low, middle)
        margin = Margin(float(high), float(slope))
        humble = float(np.average(margin.bound(score) < sample.r - TOO_LOW, weights=sample.weight))
        if humble < fewest:
            best, fewest = margin, humble
    return best
