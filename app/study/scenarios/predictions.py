"""Predicted accuracy of `check` from the first photographs, beside the accuracy of the whole test."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from rich.console import Console
from rich.table import Table

from ...experiment.experiment import load_experiment
from ...inference.predicted_accuracy import REFERENCE_STEP, AccuracyFit, DataQuality, measure_data_quality
from ...process.errors import InputError
from ...process.progress import Progress, no_progress
from ...synthetic.scenarios.preset_names import ScenarioName
from ...synthetic.scenarios.scenario_folder import make_scenario
from .scenario_score import ScenarioScore, StudyPlan, read_scenario
from .score_table import describe_seeds, score_scenarios

COMPARED_SCENARIOS: tuple[ScenarioName, ...] = (
    "shear", "sheared", "biaxial", "isotropic", "unseen", "centres", "radii_03", "radii_1", "step_05", "step_1",
    "ten_frames", "outer", "soft", "mu_low", "mu_high",
)  # fmt: skip
MIN_TESTS = 4  # to fit three numbers
MIN_ERROR = 1e-3  # 1 − r, lower bound in the fit


@dataclass(frozen=True, slots=True)
class PredictionOutcome:
    """One scenario and seed: the budget of its first photographs, and the score of the whole test."""

    score: ScenarioScore
    quality: DataQuality | None  # None: no prediction is possible

    @property
    def inside(self) -> bool | None:
        """Whether r lies in the interval; None where one of them is missing."""
        if self.quality is None or self.score.r_late is None:
            return None
        _, low, high = self.quality.expected
        return low <= self.score.r_late <= high


def study_predictions(
    plan: StudyPlan, scenarios: Sequence[ScenarioName], seeds: Sequence[int], progress: Progress = no_progress
) -> list[PredictionOutcome]:
    """Score every scenario of every seed and measure the budget of its first photographs."""
    scores = score_scenarios(plan, scenarios, seeds, progress=progress)
    return [PredictionOutcome(score, _measure_quality(plan, score.scenario, score.seed)) for score in scores]


def fit_prediction(outcomes: Sequence[PredictionOutcome]) -> AccuracyFit:
    """Fit ln(1 − r) on noise and step. Raises InputError with fewer than MIN_TESTS tests to fit on."""
    known = [
        (each.quality, each.score.r_late) for each in outcomes
        if each.quality is not None and each.score.r_late is not None and not each.quality.gaps_unclear
    ]  # fmt: skip
    if len(known) < MIN_TESTS:
        raise InputError(
            "study budget", f"--fit with {len(known)} tests", f"needs {MIN_TESTS} or more tests with a prediction"
        )
    rows = np.array([[1.0, *quality.predictors] for quality, _ in known])
    error = np.log([max(1.0 - r, MIN_ERROR) for _, r in known])
    found, _, rank, _ = np.linalg.lstsq(rows, error, rcond=None)
    freedom = max(len(known) - int(rank), 1)
    deviation = math.sqrt(float(np.sum((rows @ found - error) ** 2)) / freedom)
    a, b, c = found.tolist()
    return AccuracyFit(a, b, c, deviation)


def print_predictions(console: Console, outcomes: Sequence[PredictionOutcome]) -> None:
    """Print a row for every scenario and seed, then the number of correct intervals."""
    table = Table(box=None, pad_edge=False, header_style="bold", padding=(0, 1, 0, 0))
    for heading in ("scenario", "seed", "noise/motion", "step °", "gaps %", "expected", "from", "to", "r from 3", ""):
        table.add_column(heading, justify="left" if heading in ("scenario", "") else "right", no_wrap=True)
    for each in outcomes:
        table.add_row(each.score.scenario, str(each.score.seed), *_cells(each))
    console.print(table)
    inside = [each.inside for each in outcomes if each.inside is not None]
    console.print(
        f"{sum(inside)} of {len(inside)} are in their interval, which should hold two of three. gaps: standard "
        f"deviation of the gaps of touching grains over a diameter. Reference step: "
        f"{math.degrees(REFERENCE_STEP):.2g}°. Seeds "
        + describe_seeds([each.score for each in outcomes]),
        highlight=False, soft_wrap=True,
    )  # fmt: skip


def _measure_quality(plan: StudyPlan, scenario: ScenarioName, seed: int) -> DataQuality | None:
    with TemporaryDirectory() as folder:
        made = make_scenario(Path(folder), scenario, seed, grains=plan.grains, cache=plan.folder / "kept")
        experiment = load_experiment(made.folder, plan.settings)
        try:
            tracks, walls = read_scenario(experiment)
        except InputError:
            return None
    return measure_data_quality(tracks, walls)


def _cells(each: PredictionOutcome) -> list[str]:
    quality, r = each.quality, each.score.r_late
    reached = "–" if r is None else f"{r:.3f}"
    if quality is None:
        return ["–", "–", "–", "–", "–", "–", reached, "no prediction"]
    remark = {True: "", False: "outside", None: "refused"}[each.inside]
    return [
        f"{quality.noise_ratio:.3f}",
        f"{math.degrees(quality.shear):.2f}",
        f"{100.0 * quality.gap_sd / quality.diameter:.2f}",
        *(f"{value:.3f}" for value in quality.expected),
        reached,
        remark,
    ]
