"""Errors of every statistic against the truth: bias, standard deviation, and coverage of the stated intervals.

The true statistics are computed by the same functions from the true forces, whose bearing and sliding contacts are
known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from ...inference.corrected_sequence import CorrectedSequence
from ...solver.assessment.intervals.force_intervals import EvidenceSource, evidence_source_of, penalty_of, usual_trust
from ...solver.assessment.intervals.statistic_intervals import (
    CONSTANT,
    MIN_PENALTY,
    SIZED,
    size_of,
)
from ...solver.bodies.grains import Array
from ...solver.contacts.contacts import measure_pairs
from ...solver.contacts.pairs import Keys
from ...solver.quantity import quantities
from ...solver.statistics.frame_statistics import ContactProbabilities, FrameStatistics, frame_statistics
from ...synthetic.scenarios.preset_names import ScenarioName
from ...synthetic.scenarios.scenario_table import SCENARIOS as SCENARIO_TABLE
from ..fitting.coverage import coverage_scale
from .interval_coverage import FIT_SCENARIOS as INTERVAL_SCENARIOS
from .interval_coverage import JUDGE_SCENARIOS
from .scenario_score import SETTLED
from .solved_scenario import SolvedScenario

# Scenarios whose truth and input have the same rods, so that every statistic can be compared.
SCENARIOS: tuple[ScenarioName, ...] = (
    "shear", "sheared", "biaxial", "isotropic", "gravity", "soft", "corners", "radii_03", "mu_low", "step_05", "step_1",
)  # fmt: skip
# Standard deviations are fitted on all scenarios except those with a wrong stated friction, and judged on other seeds.
FIT_SCENARIOS: tuple[ScenarioName, ...] = (
    *INTERVAL_SCENARIOS,
    *(scenario for scenario in JUDGE_SCENARIOS if not scenario.startswith("mu_")),
    # Noise that hides the overlaps, and a stretched picture, which gaps of soft grains do not distinguish from stress,
    # bias the principal direction; photoelastic discs have both.
    "soft_noise",
    "softer_noise",
    "soft_stretched",
    "softer_stretched",
)
# Statistics of a first frame have no standard deviation.
FITTED = (EvidenceSource.MOTION, EvidenceSource.BOTH, EvidenceSource.POSITIONS)
BIASED = 0.05  # relative bias above which the table names it
FAR_OFF = 0.15  # relative bias of one scenario that its interval has to cover …
COVERS = 0.93  # … with this fraction of its frames within two standard deviations
CONE = 0.999  # quantile of |f_t| / f_n of true contacts that equals their friction: a fifth of them slide
IN_PI = ("principal_direction",)  # directions, modulo π
SHAPES = ("fn_density", "ft_density", "mobilisation_density")  # compared as a whole: fraction in another bin
NOT_COMPARED = ("area",)  # no estimate
DEGREES = ("friction_angle", "wall_ratio_angle", "principal_direction", "friction_angle_of_anisotropies")

NOT_STATED = "–"  # no standard deviation
SCENARIO_HEADINGS = ("world", "true", "stated", "bias", "sd", "68 %", "95 %", "")
HEADINGS = ("statistic", "true mean", "bias", "worst world", "bias there", "sd", "68 %", "95 %", "")


@dataclass(frozen=True, slots=True)
class StatisticErrors:
    """One statistic of one scenario and seed, frame by frame from SETTLED on."""

    scenario: ScenarioName
    seed: int
    name: str
    stated: Array  # (f,)
    true: Array  # (f,)
    sd: Array  # (f,) stated standard deviation, NaN without one
    penalty: Array  # (f,) 1 − T
    evidence_source: NDArray[np.uint8]  # (f,) of EvidenceSource

    @property
    def error(self) -> Array:
        """Inferred minus true (f,), of angles in degrees; of a shape, the fraction in another bin."""
        difference = self.stated - self.true
        if self.name in IN_PI:
            difference = (difference + 0.5 * np.pi) % np.pi - 0.5 * np.pi
        return np.degrees(difference) if self.name in DEGREES else difference


def measure_statistic_errors(solved: SolvedScenario) -> list[StatisticErrors]:
    """Compare every statistic of a solved scenario, magnitudes of forces only where their scale is known."""
    scenario, seed, frames, true = solved.scenario, solved.seed, solved.frames, solved.true
    sequence, statistics = solved.solution.sequence, solved.solution.results.statistics
    pairs = [(stated, _statistics_of_truth(sequence, k, *true[k])) for k, stated in enumerate(statistics)]
    late = pairs[SETTLED:]
    penalty = np.array([float(penalty_of(usual_trust(each))) for each in frames[SETTLED:]])
    evidence_source = np.array([evidence_source_of(each.position_weight) for each in frames[SETTLED:]], np.uint8)
    return [
        _compared(scenario, seed, name, values, penalty, evidence_source)
        for name in compared_names()
        if is_compared(scenario, name)
        if (values := [_values(name, stated, exact) for stated, exact in late])
    ]


def _compared(
    scenario: ScenarioName,
    seed: int,
    name: str,
    values: Sequence[tuple[float, float, float]],
    penalty: Array,
    evidence_source: NDArray[np.uint8],
) -> StatisticErrors:
    stated, true, sd = (np.array(column) for column in zip(*values, strict=True))
    return StatisticErrors(scenario, seed, name, stated, true, sd, penalty, evidence_source)


def is_compared(scenario: ScenarioName, name: str) -> bool:
    """Whether a scenario determines a statistic: without a scale of forces, magnitudes are not stated."""
    return name not in SIZED or SCENARIO_TABLE[scenario].scale_known


def compared_names() -> list[str]:
    """Return the names of the compared statistics: scalars and distributions."""
    names = [each.name for each in quantities(FrameStatistics) if not each.quantity.dims or each.name in SHAPES]
    return [name for name in names if name not in NOT_COMPARED and not name.endswith("_sd")]


def print_statistic_errors(console: Console, found: Sequence[StatisticErrors]) -> None:
    """Print one row per statistic: mean, bias over all scenarios, worst bias of one scenario, standard deviation."""
    table = Table(box=None, pad_edge=False, header_style="bold", padding=(0, 1, 0, 0))
    for heading in HEADINGS:
        table.add_column(heading, justify="left" if heading in ("statistic", "worst world", "") else "right")
    for row in statistic_rows(found):
        table.add_row(*row)
    console.print(table)
    console.print(
        "Bias: mean of inferred minus true over the mean true value; of angles in degrees; of densities the fraction "
        "in another bin. sd: standard deviation of single frames about the bias. 68 %, 95 %: fraction of the frames "
        f"within one and two stated standard deviations. Frames from {SETTLED} on.",
        highlight=False, soft_wrap=True,
    )  # fmt: skip


def print_by_scenario(console: Console, found: Sequence[StatisticErrors], name: str) -> None:
    """Print one row per scenario: a statistic inferred and true, its bias, standard deviation and coverage."""
    table = Table(box=None, pad_edge=False, header_style="bold", padding=(0, 1, 0, 0))
    for heading in (name, *SCENARIO_HEADINGS[1:]):
        table.add_column(heading, justify="left" if heading in (name, "") else "right")
    for row in scenario_rows(found, name):
        table.add_row(*row)
    console.print(table)


def scenario_rows(found: Sequence[StatisticErrors], name: str) -> list[list[str]]:
    """Return a row of cells under SCENARIO_HEADINGS for every scenario in which a statistic is compared."""
    named = [each for each in found if each.name == name]
    rows = []
    for scenario in dict.fromkeys(each.scenario for each in named):
        here = [each for each in named if each.scenario == scenario]
        true, stated, sd = (
            np.concatenate([getattr(each, column) for each in here]) for column in ("true", "stated", "sd")
        )
        values = (np.nanmean(true), np.nanmean(stated), np.nanmean(sd))
        true_mean, stated_mean, sd_mean = (f"{value:.3g}" for value in values)
        bias, covered = relative_bias(here), _covered(here)
        rows.append([
            scenario, true_mean, stated_mean, _format(bias, name), sd_mean, *covered, _judge_bias(bias, covered[1]),
        ])  # fmt: skip
    return rows


def _judge_bias(bias: float, within_two: str) -> str:
    """Return whether a bias above FAR_OFF is covered by the interval; empty for a smaller bias."""
    if not abs(bias) > FAR_OFF:
        return ""
    return "covered" if within_two != NOT_STATED and float(within_two) >= 100.0 * COVERS else "far off"


def statistic_rows(found: Sequence[StatisticErrors]) -> list[list[str]]:
    """Return a row of cells under HEADINGS for every statistic."""
    by_name = {name: [each for each in found if each.name == name] for name in compared_names()}
    return [[name, *_cells(rows)] for name, rows in by_name.items() if rows]


def fit_sd_constants(found: Sequence[StatisticErrors]) -> dict[str, tuple[float, ...]]:
    """Fit the constants of `solver.assessment.intervals.statistic_intervals` by evidence source; NaN without frames."""
    fitted = {}
    for name in CONSTANT:
        rows = [each for each in found if each.name == name and is_compared(each.scenario, name)]
        error, penalty = _errors_of_fit(name, rows, found), np.concatenate([each.penalty for each in rows])
        size = np.array([size_of(name, float(value)) for each in rows for value in each.stated])
        ratio = error / (size * np.sqrt(np.maximum(penalty, MIN_PENALTY)))
        evidence_source = np.concatenate([each.evidence_source for each in rows])
        fitted[name] = tuple(_scale(ratio[(evidence_source == each) & np.isfinite(ratio)]) for each in FITTED)
    return fitted


def _errors_of_fit(name: str, rows: Sequence[StatisticErrors], found: Sequence[StatisticErrors]) -> Array:
    """Return absolute errors (k,); of a direction that of the deviator across it, over the mean stress.

    Notes
    -----
    sin φ |sin 2Δ|, with φ the true friction angle and Δ the error of the direction: `direction_sd` is its inverse.
    """
    if name not in IN_PI:
        return np.abs(_raw(rows))
    angles = {(each.scenario, each.seed): each.true for each in found if each.name == "friction_angle"}
    deviator = np.concatenate([np.sin(angles[each.scenario, each.seed]) for each in rows])
    return deviator * np.abs(np.sin(2.0 * _raw(rows)))


def _scale(ratio: Array) -> float:
    """Return the standard deviation that best covers 68 and 95 % of these (k,) within one and two of it."""
    return coverage_scale(ratio)


def relative_bias(rows: Sequence[StatisticErrors]) -> float:
    """Return the mean error over the mean true value; for angles in degrees, for shapes absolute; NaN without data."""
    error = np.concatenate([each.error for each in rows])
    return float(np.nanmean(error)) / _unit(rows) if np.isfinite(error).any() else float("nan")


def _unit(rows: Sequence[StatisticErrors]) -> float:
    if rows[0].name in DEGREES or rows[0].name in SHAPES:
        return 1.0
    return float(np.nanmean(np.abs(np.concatenate([each.true for each in rows])))) or 1.0


def _cells(rows: Sequence[StatisticErrors]) -> list[str]:
    name, bias = rows[0].name, relative_bias(rows)
    true = np.concatenate([each.true for each in rows])
    scenarios = {
        scenario: [each for each in rows if each.scenario == scenario] for scenario in {each.scenario for each in rows}
    }
    by_world = {scenario: relative_bias(some) for scenario, some in sorted(scenarios.items())}
    worst = max(by_world, key=lambda scenario: -1.0 if np.isnan(by_world[scenario]) else abs(by_world[scenario]))
    error = np.concatenate([each.error for each in rows]) / _unit(rows)
    covered = _covered(rows)
    mean = np.degrees(np.nanmean(true)) if name in DEGREES else np.nanmean(true)
    flag = ""
    if name not in DEGREES and name not in SHAPES and abs(bias) > BIASED:
        flag = "biased" if covered[0] == NOT_STATED else "biased, interval stated"
    return [
        "–" if name in SHAPES else f"{mean:.3g}", _format(bias, name), worst, _format(by_world[worst], name),
        _format(float(np.nanstd(error)), name), *covered, flag,
    ]  # fmt: skip


def _covered(rows: Sequence[StatisticErrors]) -> list[str]:
    """Return the percentages of frames within one and within two stated standard deviations."""
    sigma = np.concatenate([each.sd for each in rows])
    error = np.abs(_raw(rows))
    known = np.isfinite(sigma) & np.isfinite(error)
    return [f"{100.0 * np.mean(error[known] <= t * sigma[known]):.0f}" if known.any() else NOT_STATED for t in (1, 2)]


def _raw(rows: Sequence[StatisticErrors]) -> Array:
    error = np.concatenate([each.error for each in rows])
    return np.radians(error) if rows[0].name in DEGREES else error


def _format(value: float, name: str) -> str:
    return f"{value:+.1f}°" if name in DEGREES else f"{100.0 * value:+.1f} %"


def _values(name: str, stated: FrameStatistics, exact: FrameStatistics) -> tuple[float, float, float]:
    one, other = getattr(stated, name), getattr(exact, name)
    if name in SHAPES:
        return 0.5 * float(np.abs(one - other).sum() / max(other.sum(), 1e-300)), 0.0, float("nan")
    return float(one), float(other), float(getattr(stated, f"{name}_sd", float("nan")))


def _statistics_of_truth(sequence: CorrectedSequence, frame: int, key: Keys, force: Array) -> FrameStatistics:
    packing, snapshot = sequence.packing, sequence.snapshots[frame]
    walls = packing.walls_of(snapshot)
    order = np.argsort(key)
    contacts = measure_pairs(packing.grains, snapshot.position, walls, key[order])
    fn, ft = force[order].T.copy()
    friction = _friction_of(fn, ft, contacts.with_wall)
    known = ContactProbabilities.of_known(fn, ft, friction)
    return frame_statistics(contacts, fn, ft, known, snapshot, packing)


def _friction_of(fn: Array, ft: Array, with_wall: NDArray[np.bool_]) -> Array:
    """Return the friction (c,) of true forces: the greatest ratio that contacts of walls and of grains reach."""
    friction = np.ones_like(fn)
    for kind in (with_wall, ~with_wall):
        if (fn[kind] > 0).any():
            friction[kind] = np.quantile(np.abs(ft[kind])[fn[kind] > 0] / fn[kind][fn[kind] > 0], CONE)
    return friction
