"""Calibration of intervals, trust and statistics on simulated truth, and violations of their limits."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ... import __version__
from ...process.progress import Progress, no_progress
from ...solver.bodies.grains import Array
from ...solver.frame_forces import FrameStatus
from ...solver.statistics.agreement import compare_forces
from ...synthetic.scenarios.preset_names import ScenarioName
from ...synthetic.scenarios.scenario_table import SCENARIOS
from ..scenarios.contact_errors import ContactErrors, measure_errors
from ..scenarios.interval_coverage import FIRST, GROUPS, covered, describe_violations
from ..scenarios.predictions import TRUE_CAUSE, PredictionOutcome, confusion, predict_all
from ..scenarios.scenario_score import ScenarioScore, StudyPlan
from ..scenarios.solved_scenario import SolvedScenario, solve_scenarios
from ..scenarios.statistic_errors import (
    StatisticErrors,
    measure_statistic_errors,
    relative_bias,
    scenario_rows,
    statistic_rows,
)

# Limits of the coverage of a group within one and two standard deviations.
COVERAGE_LIMITS = ((0.60, 0.82), (0.91, 0.985))
MIN_CONTACTS = 400  # of a group with a coverage
MAX_TOO_TRUSTING = 0.05  # fraction of frames with r below T
MAX_SLIDING_BIAS = 0.15  # relative, of the fraction of sliding contacts


@dataclass(frozen=True, slots=True)
class TrustedFrames:
    """Frames that have a trust."""

    scenario: NDArray[np.str_]  # (f,)
    trust: Array  # (f,)
    r: Array  # (f,) correlation of f_n with the truth
    suspect: NDArray[np.bool_]  # (f,)


@dataclass(frozen=True, slots=True)
class CalibrationStudy:
    """Scenarios that were solved, and their errors."""

    scenarios: tuple[ScenarioName, ...]
    seeds: tuple[int, ...]
    grains: int
    errors: ContactErrors
    numbers: list[StatisticErrors]
    frames: TrustedFrames
    outcomes: tuple[PredictionOutcome, ...] = ()  # predictions and diagnoses of `check`

    @property
    def data_hash(self) -> str:
        """SHA-256 of all errors, trusts and statistics: the same for the same program on the same machine."""
        digest = hashlib.sha256()
        for array in (self.errors.error, self.errors.sd, self.frames.trust, self.frames.r):
            digest.update(np.ascontiguousarray(array).tobytes())
        for each in self.numbers:
            digest.update(each.name.encode() + each.stated.tobytes() + each.true.tobytes())
        return digest.hexdigest()

    @property
    def too_trusting(self) -> float:
        """Fraction of the frames whose correlation is below their trust."""
        return float(np.mean(self.frames.r < self.frames.trust)) if len(self.frames.r) else float("nan")

    @property
    def too_trusting_by_scenario(self) -> dict[str, float]:
        """The same fraction for every scenario."""
        below = self.frames.r < self.frames.trust
        return {
            str(name): float(below[self.frames.scenario == name].mean()) for name in np.unique(self.frames.scenario)
        }

    @property
    def coverage(self) -> dict[str, tuple[float, ...]]:
        """By group: the fractions of f_n, then of f_t, within one and within two standard deviations."""
        parts = {name: self.errors.select(choose(self.errors)) for name, choose in GROUPS.items()}
        return {name: covered(part) for name, part in parts.items() if len(part.group) >= MIN_CONTACTS}

    @property
    def coverage_by_scenario(self) -> dict[str, tuple[float, ...]]:
        """The same for all contacts of each scenario without first frames."""
        late = self.errors.select(GROUPS["all"](self.errors))
        return {str(scenario): covered(late.select(late.scenario == scenario)) for scenario in np.unique(late.scenario)}

    def facts(self) -> dict[str, Any]:
        """Return all results as plain values."""
        return {
            "version": __version__, "worlds": list(self.scenarios), "seeds": list(self.seeds), "grains": self.grains,
            "data": self.data_hash, "contacts": len(self.errors.group), "coverage": self.coverage,
            "coverage_by_world": self.coverage_by_scenario,
            "frames": len(self.frames.r), "too_trusting": self.too_trusting,
            "too_trusting_by_world": self.too_trusting_by_scenario,
            "predicted": [[each.score.scenario, each.expected[0], each.score.r_late] for each in self.outcomes],
            "diagnosis": confusion(self.outcomes),
            "bias": {
                name: relative_bias([each for each in self.numbers if each.name == name])
                for name in dict.fromkeys(each.name for each in self.numbers)
            },
            "broken": violations(self),
        }  # fmt: skip


def study_calibration(
    plan: StudyPlan, scenarios: Sequence[ScenarioName], seeds: Sequence[int], progress: Progress = no_progress
) -> CalibrationStudy:
    """Solve scenarios and compare all stated quantities with the truth."""
    errors, numbers, frames, reached = [], [], [], []
    for solved in solve_scenarios(plan, scenarios, seeds, progress):
        errors.append(measure_errors(solved))
        numbers += measure_statistic_errors(solved)
        frames.append(_frames_of(solved))
        reached.append((solved.scenario, solved.seed, frames[-1][2]))
    outcomes = predict_all(plan, [_score_of(each) for each in reached], progress)
    joined = TrustedFrames(*(np.concatenate(column) for column in zip(*frames, strict=True)))
    return CalibrationStudy(
        tuple(scenarios), tuple(seeds), plan.grains, ContactErrors.joined(errors), numbers, joined, tuple(outcomes)
    )


def violations(study: CalibrationStudy) -> list[str]:
    """Describe every quantity outside its limits in one sentence."""
    found = []
    for name, fractions in study.coverage.items():
        if name == FIRST:  # too few independent force networks for a limit
            continue
        for fraction, (low, high), label in zip(
            fractions, COVERAGE_LIMITS * 2, ("1 σ of f_n", "2 σ of f_n", "1 σ of f_t", "2 σ of f_t"), strict=True
        ):
            if not low <= fraction <= high:
                found.append(f"{label} of {name} contacts: covers {100 * fraction:.0f} %, not {low:.0%} to {high:.0%}")
    if study.too_trusting > MAX_TOO_TRUSTING:
        found.append(f"the correlation is below the trust in {100 * study.too_trusting:.0f} % of the frames, not 5 %")
    sliding = relative_bias([each for each in study.numbers if each.name == "sliding_fraction"])
    if abs(sliding) > MAX_SLIDING_BIAS:
        found.append(f"the fraction of sliding contacts is off by {100 * sliding:+.0f} %")
    return found


def coverage_rows(study: CalibrationStudy) -> list[list[str]]:
    """Return a row of cells for every group and scenario: coverages, and those outside the tolerance."""
    both = {**study.coverage, **study.coverage_by_scenario}
    return [
        [name, *(f"{100.0 * each:.0f}" for each in fractions), describe_violations(fractions)]
        for name, fractions in both.items()
    ]


def sliding_rows(study: CalibrationStudy) -> list[list[str]]:
    """Return a row of cells for every scenario: the fraction of sliding contacts, under SCENARIO_HEADINGS."""
    return scenario_rows(study.numbers, "sliding_fraction")


def statistic_error_rows(study: CalibrationStudy) -> list[list[str]]:
    """Return a row of cells for every statistic, under HEADINGS of `statistic_errors`."""
    return statistic_rows(study.numbers)


def confusion_rows(study: CalibrationStudy) -> list[list[str]]:
    """Return a row of cells for every scenario: its group, what should be named, what was named in how many tests."""
    return [
        [name, SCENARIOS[name].group, " or ".join(TRUE_CAUSE.get(name, ("nothing",))), named]
        for name, named in confusion(study.outcomes).items()
    ]


def _score_of(reached: tuple[ScenarioName, int, Array]) -> ScenarioScore:
    """The score of a solved scenario as far as a prediction is compared with it."""
    scenario, seed, r = reached
    return ScenarioScore(scenario, seed, "", r=tuple(float(each) for each in r))


def _frames_of(solved: SolvedScenario) -> tuple[NDArray[Any], Array, Array, NDArray[Any]]:
    rows = [
        (frame.trust, compare_forces(frame.contacts.key, np.column_stack([frame.fn, frame.ft]), *solved.true[k]).r_fn,
         frame.status is FrameStatus.SUSPECT)
        for k, frame in enumerate(solved.frames)
        if np.isfinite(frame.trust)
    ]  # fmt: skip
    trust, r, suspect = (np.array(column) for column in zip(*rows, strict=True))
    return np.full(len(rows), solved.scenario), trust, r, suspect
