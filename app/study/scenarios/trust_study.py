"""Trust against the truth by group and kind of input, and the fit of the expected correlation.

The bound is fitted on seeds and kinds left out in turn; kinds that no fit reads judge the result. The prediction of
`check` is fitted on the first photographs of the same tests.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from scipy.stats import spearmanr

from ...process.counts import mean_of_known
from ...solver.assessment.expected_correlation import BY_SLIDING, CLOSED, LEAST, MEASURES, seen_sliding
from ...solver.assessment.intervals.scale_sd import FIRST_BY_SECOND, TABLE, TERMS
from ...solver.assessment.intervals.scale_sd import LEAST as LEAST_SCALE_SD
from ...solver.bodies.grains import Array
from ...solver.frame_forces import FrameStatus
from ...synthetic.scenarios.preset_names import Group, ScenarioName
from ...synthetic.scenarios.scenario_table import SCENARIOS
from ..fitting.additive_fit import AdditiveFit, correlation_target, fit_additive
from ..fitting.bound_fit import BoundFit, JudgedFrames, fit_bound
from ..fitting.scale_fit import ScaleSample, describe_scale, fit_first, scale_sd_of
from .scenario_score import TRUST_TOLERANCE, ScenarioScore

GROUPS: tuple[Group, ...] = ("correct", "missing physics", "wrong input")
STATUSES = tuple(each.name.lower() for each in FrameStatus if each not in (FrameStatus.RESET, FrameStatus.FAILED))
MEANINGFUL = 0.9  # trust from which on single forces are meaningful
# Kinds that no fit reads: of each group some, and of each mechanism at most one.
LEFT_OUT = frozenset({
    "step_1", "circle", "corners", "radii_03", "strong_cohesion", "rolling", "stiff_moving", "theta_sign", "aspect_03",
    "walls_late", "left_late", "swapped_frames", "shuffled", "outliers", "one_jump", "missing_poses", "tilted_bed",
    "stiff_loose", "rough_walls", "rising_corners", "shear_box", "footing", "intruder", "drum", "stiffest",
    "isotropic_centres", "stepped_centres", "rising_centres", "annulus_centres", "cycles_centres", "annulus_radii_1",
    "cycles_radii_1", "tilted_radii_1", "stepped_some_radii", "annulus_some_radii", "rising_lens", "exchanged_ids",
    "outer_moving", "outer_gravity", "biaxial_unseen", "unloaded_loose", "unloaded_rolling", "unloaded_walls_late",
    "stiff_annulus", "pins", "stepped_pins", "tilted_pins", "cycles_pins", "walls_scatter",
})  # fmt: skip
# Kinds at rest whose errors look like overlaps, by which the effect of closed gaps is fitted; others judge it.
CLOSED_KINDS: tuple[ScenarioName, ...] = (
    "stepped_centres", "cycles_centres", "annulus_radii_1", "tilted_radii_1",
    "stepped_some_radii", "annulus_some_radii",
)  # fmt: skip
CLOSED_STEPS = (0.05, 0.03, 0.02, 0.015, 0.01, 0.0075, 0.005)  # tried from the first on
CLOSED_TOO_HIGH = 0.1  # fraction of their frames with a trust that is too high
TOO_HIGH, TOO_LOW = TRUST_TOLERANCE, 0.15  # T above r, T below r
# Excess of T over r, and fraction of the frames of any group that may have more while their kind is left out: what T
# claims, of kinds that no fit has read.
LIMITS = ((TOO_HIGH, 0.03), (0.0, 0.10))
WITHIN_INTERVAL = 0.68  # of the tests, within one standard deviation of a prediction
SOFT = 1.9e6  # [N/m] stiffness of contacts below which overlaps are forces
SETTLED_SCALE = 3  # first photograph whose scale is judged
SETTLED = 2  # first photograph of a trial solution that is judged
FOLDS = 6  # groups of kinds that are left out in turn
# The fits, each with the measures that it weighs.
FITS: dict[str, tuple[str, ...]] = {
    "both": tuple(name for name in MEASURES if name not in ("undetermined", "noise", "few_interior")),
    "unloaded": tuple(name for name in MEASURES if name not in ("load_mismatch", "inertial_number")),
    "motion": (
        "correction", "previous_residual", "disagreement_of_members", "gap_error", "force_change", "power_gap",
        "hidden_sliding", "load_mismatch",
    ),
    "overlaps": (
        "disagreement_of_positions", "disagreement_of_estimates", "previous_residual", "gap_error", "force_change",
    ),
}  # fmt: skip
# Of a prediction from the first photographs.
PREDICTIONS = {"prediction": True, "unloaded_prediction": False}  # tables, and whether their tests are loaded
PREDICTED_BY = {
    title: tuple(name for name in FITS["both" if loaded else "unloaded"] if name != "gap_error")
    for title, loaded in PREDICTIONS.items()
}
# Least and greatest value of each measure: beyond them no more is known.
RANGES = {
    "disagreement_of_estimates": (0.02, 1.0), "disagreement_with_either": (0.03, 1.0),
    "correction": (0.02, 2.0), "previous_residual": (0.004, 0.2),
    "disagreement_of_members": (0.05, 1.0), "gap_error": (1e-4, 5e-3), "force_change": (0.01, 0.6),
    "power_gap": (0.01, 1.5), "disagreement_of_positions": (0.003, 1.0), "hidden_sliding": (0.03, 10.0),
    "load_mismatch": (0.02, 2.0), "force_residual": (0.002, 0.5), "inertial_number": (1e-3, 0.1),
    "coarse_step": (0.004, 0.02), "undetermined": (0.02, 0.5), "noise": (1e-4, 5e-3),
    "few_interior": (3e-3, 0.05),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class TrustSample:
    """Frames after the first of several scenarios; f frames."""

    kind: NDArray[np.str_]  # (f,)
    seed: NDArray[np.int64]  # (f,)
    frame: NDArray[np.int64]  # (f,)
    group: NDArray[np.str_]  # (f,)
    status: NDArray[np.str_]  # (f,)
    overlaps: NDArray[np.bool_]  # (f,) whether the forces follow from the overlaps of soft grains
    loaded: NDArray[np.bool_]  # (f,) whether a known load, or weight alone, bears on the grains
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
            np.array([k for _, k in rows]),
            np.array([SCENARIOS[score.scenario].group for score, _ in rows]),
            np.array([score.status[k] for score, k in rows], str),
            np.array([score.overlaps[k] for score, k in rows], np.bool_),
            np.array([score.loaded for score, _ in rows], np.bool_),
            np.array([score.r[k] for score, k in rows], float),
            np.array([score.trust[k] for score, k in rows], float),
            np.array([score.expected[k] for score, k in rows], float),
            {
                name: np.log(np.clip(np.maximum(measures[:, m], LEAST), *RANGES[name]))
                for m, name in enumerate(MEASURES)
            },
        )  # fmt: skip

    @classmethod
    def of_tests(cls, scores: Sequence[ScenarioScore], photographs: int) -> TrustSample:
        """Collect whole tests: r from the third photograph on, and the mean evidence of the first photographs."""
        frames = cls.of([score for score in scores if score.r_late is not None])
        chosen = (frames.frame >= SETTLED) & (frames.frame < photographs)
        late = {(score.scenario, score.seed): score.r_late for score in scores}
        rows = sorted({(str(kind), int(seed)) for kind, seed in zip(frames.kind, frames.seed, strict=True)})
        of_row = [np.flatnonzero(chosen & (frames.kind == kind) & (frames.seed == seed)) for kind, seed in rows]
        first, r = np.array([some[0] for some in of_row]), np.array([late[row] for row in rows], float)
        return replace(
            frames.select(first), r=r,
            measures={
                name: np.array([mean_of_known(each[some]) for some in of_row]) for name, each in frames.measures.items()
            },
        )  # fmt: skip

    def select(self, chosen: NDArray[np.bool_] | NDArray[np.int64]) -> TrustSample:
        """The chosen frames."""
        return TrustSample(
            self.kind[chosen], self.seed[chosen], self.frame[chosen], self.group[chosen], self.status[chosen],
            self.overlaps[chosen], self.loaded[chosen], self.r[chosen], self.trust[chosen], self.expected[chosen],
            {name: each[chosen] for name, each in self.measures.items()},
        )  # fmt: skip

    @property
    def weight(self) -> Array:
        """Weight of a frame (f,): every kind counts the same."""
        names, index, count = np.unique(self.kind, return_inverse=True, return_counts=True)
        return 1.0 / (count[index] * len(names))

    @property
    def strength(self) -> dict[str, Array]:
        """Factors (f,) of what measures of little motion add: the fraction of the sliding that is seen."""
        hidden = self.measures["hidden_sliding"]
        seen = np.where(np.isfinite(hidden), seen_sliding(np.exp(np.nan_to_num(hidden))), 1.0)
        return dict.fromkeys(BY_SLIDING, seen)

    def fold(self) -> NDArray[np.int64]:
        """Number of the group of kinds that is left out with a frame (f,)."""
        names, index = np.unique(self.kind, return_inverse=True)
        if len(names) < 2 * FOLDS:  # of so few, those left out would be extrapolated
            return np.zeros(len(self.kind), np.int64)
        return np.random.default_rng(0).permutation(len(names))[index] % FOLDS


@dataclass(frozen=True, slots=True)
class TrustFit:
    """Expected correlation, and its bound."""

    expected: AdditiveFit
    bound: BoundFit

    def describe(self, title: str) -> str:
        """The table of fitted.toml."""
        lines = self.expected.describe()
        return "\n".join([f"[expected_correlation.{title}]", *lines[:2], self.bound.describe(), *lines[2:]])


def fit_expected(sample: TrustSample, names: Sequence[str]) -> TrustFit:
    """Fit the expected correlation by measures, and its bound on seeds and kinds left out in turn."""
    whole, score = _fit_leaving_out(sample, names)
    frames = JudgedFrames(sample.r, score, correlation_target(sample.r) - score, sample.weight, sample.fold())
    groups = [sample.group == group for group in GROUPS]
    return TrustFit(whole, fit_bound(frames, groups, LIMITS))


def fit_by_title(scores: Sequence[ScenarioScore]) -> dict[str, TrustFit]:
    """Fit every one of FITS that reads frames of enough kinds."""
    known = TrustSample.of(scores)
    read = {title: rows_of(known, title) for title in FITS}
    return {title: fit_expected(rows, FITS[title]) for title, rows in read.items() if _has_kinds(rows)}


def describe_fits(
    fits: Mapping[str, TrustFit],
    scores: Sequence[ScenarioScore],
    closed_scores: Sequence[ScenarioScore],
    photographs: int,
) -> list[str]:
    """Describe all fits as tables of fitted.toml.

    Parameters
    ----------
    fits : mapping of str to TrustFit
        By `fit_by_title`.
    scores : sequence of ScenarioScore
        That they were fitted to.
    closed_scores : sequence of ScenarioScore
        Of CLOSED_KINDS; empty: fits without a known load only, under which there is no scale either.
    photographs : int
        The first ones of a test, by which r is predicted.
    """
    tests = TrustSample.of_tests([each for each in scores if not each.refused], photographs)
    tables = [
        *(fit.describe(title) for title, fit in fits.items()),
        *(describe_prediction(title, tests.select(tests.loaded == loaded)) for title, loaded in PREDICTIONS.items()),
    ]  # fmt: skip
    scale = [describe_scale_fit(scores), describe_closed_fit(closed_scores)] if closed_scores else []
    return [*filter(None, tables), *scale]


def describe_prediction(title: str, tests: TrustSample) -> str:
    """Fit the prediction on whole tests, and describe it as the table of fitted.toml; empty with few kinds of tests."""
    if not _has_kinds(tests):
        return ""
    whole, score = _fit_leaving_out(tests, PREDICTED_BY[title])
    sd = float(np.quantile(np.abs(correlation_target(tests.r) - score), WITHIN_INTERVAL))
    lines = whole.describe()
    return "\n".join([f"[expected_correlation.{title}]", *lines[:2], f"sd = {sd:.3f}", *lines[2:]])


def describe_closed_fit(scores: Sequence[ScenarioScore]) -> str:
    """Fit the effect of closed gaps on the trust, and describe it as a line of fitted.toml."""
    return f"[expected_correlation]\nclosed_overlap = {fit_closed(scores):g}"


def fit_closed(scores: Sequence[ScenarioScore]) -> float:
    """The greatest of CLOSED_STEPS with which the trust of CLOSED_KINDS is too high in few frames; NaN without these.

    Notes
    -----
    T is proportional to x_0/(x_0 + x) with the closed overlap x of a frame.
    """
    rows = [
        (score.closed_overlap[k], score.trust[k], score.r[k])
        for score in scores
        if score.scenario in CLOSED_KINDS
        for k in range(1, len(score.r))
        if None not in (score.trust[k], score.r[k], score.closed_overlap[k])
    ]
    if not rows:
        return math.nan
    closed, trust, r = np.array(rows, float).T
    alone = trust * (CLOSED + closed) / CLOSED
    fractions = [float(np.mean(alone * each / (each + closed) > r + TOO_HIGH)) for each in CLOSED_STEPS]
    enough = [step for step, high in zip(CLOSED_STEPS, fractions, strict=True) if high <= CLOSED_TOO_HIGH]
    return max(enough, default=CLOSED_STEPS[-1])


def scale_sample(scores: Sequence[ScenarioScore]) -> ScaleSample:
    """Frames of all scenarios with a known scale, from the fourth photograph on."""
    rows = [
        (score.scenario, score.scale_terms[k], scale)
        for score in scores
        for k, scale in enumerate(score.scales)
        if k >= SETTLED_SCALE and scale is not None and scale > 0.0 and None not in score.scale_terms[k]
    ]
    terms = np.array([each for _, each, _ in rows], float).reshape(len(rows), len(TERMS))
    return ScaleSample(np.array([kind for kind, *_ in rows]), terms, np.abs([1.0 / scale - 1.0 for *_, scale in rows]))


def first_scales(scores: Sequence[ScenarioScore]) -> ScaleSample:
    """First frames with a known scale: their own standard deviation and that of the second frame, as `fit_first`."""
    rows = [
        (score.scenario, score.scale_sd[0], score.scale_sd[1], score.scales[0])
        for score in scores
        if len(score.scales) > 1 and None not in (*score.scale_sd[:2], score.scales[0]) and score.scales[0] != 0.0
    ]
    stated, second, scale = np.array([each for _, *each in rows], float).reshape(len(rows), 3).T
    own = np.sqrt(np.maximum(stated**2 - (FIRST_BY_SECOND * second) ** 2, 0.0))
    return ScaleSample(
        np.array([kind for kind, *_ in rows]), np.stack([own, second], axis=1), np.abs(1.0 / scale - 1.0)
    )


def describe_scale_fit(scores: Sequence[ScenarioScore]) -> str:
    """Fit the standard deviation of the scale, and describe it as the table of fitted.toml."""
    lines = describe_scale(scale_sample(scores), {name: TABLE[name] for name in TERMS}, LEAST_SCALE_SD)
    return "\n".join([*lines, f"first_by_second = {fit_first(first_scales(scores)):g}"])


def print_scale(console: Console, scores: Sequence[ScenarioScore]) -> None:
    """Print how many true scales are within one and two stated standard deviations, and the kinds with fewer."""
    sample = scale_sample(scores)
    if not len(sample.error):
        return
    sd = scale_sd_of(sample.terms, np.array([TABLE[name] for name in TERMS]), LEAST_SCALE_SD)
    one, two = sample.coverage(sd)
    poor = [str(kind) for kind in np.unique(sample.kind) if (sample.error > 2.0 * sd)[sample.kind == kind].mean() > 0.1]
    console.print(
        f"scale: the true one is within one and two stated standard deviations in {100.0 * one:.0f} and "
        f"{100.0 * two:.0f} % of {len(sd)} frames (every kind counts the same); mean standard deviation "
        f"{100.0 * float(sample.weight @ sd):.1f} %; beyond two in more than a tenth of the frames of "
        + (", ".join(poor) or "no kind"), highlight=False, soft_wrap=True,
    )  # fmt: skip
    first = first_scales(scores)
    sd = scale_sd_of(first.terms, np.array([1.0, FIRST_BY_SECOND]), 0.0)
    one, two = first.coverage(sd)
    console.print(
        f"of {len(sd)} first photographs {100.0 * one:.0f} and {100.0 * two:.0f} %; mean standard deviation "
        f"{100.0 * float(first.weight @ sd):.1f} %", highlight=False, soft_wrap=True,
    )  # fmt: skip


def _fit_leaving_out(sample: TrustSample, names: Sequence[str]) -> tuple[AdditiveFit, Array]:
    """Fit all, and scores (f,) by fits without the seed and the kind; where these leave nothing, by the fit of all."""
    target, fold = correlation_target(sample.r), sample.fold()
    whole = fit_additive(sample.measures, sample.strength, names, target, sample.weight)
    score = whole.score(sample.measures, sample.strength)
    for seed in np.unique(sample.seed):
        for each in range(FOLDS):
            away = (sample.seed == seed) & (fold == each)
            known = (sample.seed != seed) & ((fold != each) | (fold.max() == 0))
            if away.any() and known.any():
                some, others = sample.select(known), sample.select(away)
                found = fit_additive(some.measures, some.strength, names, target[known], some.weight)
                score[away] = found.score(others.measures, others.strength)
    return whole, score


def refit(sample: TrustSample, fits: dict[str, TrustFit]) -> TrustSample:
    """The sample with expected correlation and trust by new fits, without the penalties outside of them."""
    expected, trust = sample.expected.copy(), sample.trust.copy()
    for name, fit in fits.items():
        here = sample.overlaps if name == "overlaps" else ~sample.overlaps & (sample.loaded == (name != "unloaded"))
        if name == "motion" or not here.any():
            continue
        some = sample.select(here)
        score = fit.expected.score(some.measures, some.strength)
        expected[here], trust[here] = np.maximum(np.tanh(score), 0.0), fit.bound.bound(score)
    return replace(sample, expected=expected, trust=trust)


def rows_of(sample: TrustSample, fit: str) -> TrustSample:
    """The frames that a fit of this name reads; for overlaps also all of soft grains where that was not detected."""
    if fit == "overlaps":
        stiffness = {name: each.loading.settings.normal_stiffness for name, each in SCENARIOS.items()}
        soft = np.isin(sample.kind, [name for name, each in stiffness.items() if each < SOFT])
        return sample.select(soft | sample.overlaps)
    return sample.select(~sample.overlaps & (sample.loaded == (fit != "unloaded")))


def _has_kinds(sample: TrustSample) -> bool:
    """Whether a fit on these frames holds for more than a few kinds."""
    return len(np.unique(sample.kind)) >= FOLDS


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
    for group in (*GROUPS, "all", *STATUSES):
        some = sample.select((group == "all") | (sample.group == group) | (sample.status == group))
        if len(some.r) < 3:
            continue
        (high, low), order = _fractions(some), float(np.asarray(spearmanr(some.trust, some.r))[0])
        sure = some.r[some.trust >= MEANINGFUL]
        tenth = float(np.quantile(sure, 0.1)) if len(sure) else math.nan
        console.print(
            f"{group}: {len(some.r)} frames, T > r + .03 in {high}, T < r − .15 in {low}, Spearman of T and r "
            f"{order:.2f}, median |expected − r| {np.median(np.abs(some.expected - some.r)):.3f}; {len(sure)} have T ≥ "
            f"{MEANINGFUL:g}, and a tenth of these r < {tenth:.2f}", highlight=False, soft_wrap=True,
        )  # fmt: skip


def _fractions(sample: TrustSample) -> tuple[str, str]:
    high, low = sample.trust > sample.r + TOO_HIGH, sample.trust < sample.r - TOO_LOW
    return f"{100.0 * high.mean():.1f} %", f"{100.0 * low.mean():.1f} %"
