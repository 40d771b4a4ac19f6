"""Predicted accuracy of `check` from the first photographs, beside the accuracy of the whole test."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from rich.console import Console
from rich.table import Table
from scipy.stats import rankdata

from ...experiment.experiment import load_experiment
from ...prediction import NO_EXPECTATION, Prediction, predict_accuracy
from ...process.errors import InputError
from ...process.progress import Progress, no_progress
from ...solver.dem.dem_truth import UnbalancedError
from ...solver.part_settings import REFERENCE_STEP
from ...solver.statistics.agreement import pearson
from ...synthetic.scenarios.preset_names import ScenarioName
from ...synthetic.scenarios.scenario_table import SCENARIOS
from .scenario_score import ScenarioScore, StudyPlan, make_planned, read_scenario
from .score_table import describe_seeds, score_scenarios

# The causes that a diagnosis should name. Of all other scenarios it should name none, except "not_explained" where the
# model lacks physics; bars that overhang and unknown rotations are no errors.
TRUE_CAUSE: dict[ScenarioName, tuple[str, ...]] = {
    "time_reversed": ("photographs_reversed",), "swapped_frames": ("photographs_swapped",),
    "shuffled": ("photographs_swapped",), "duplicate_frame": ("photograph_repeated",),
    "theta_sign": ("rotation_sign",), "theta_zero": ("rotation_zero",), "theta_degrees": ("rotation_in_degrees",),
    "mu_01": ("friction",), "mu_05": ("friction",), "mu_low": ("friction",), "mu_high": ("friction",),
    "walls_late": ("walls_shifted",), "left_late": ("walls_shifted",), "top_fixed": ("wall_at_rest", "wall_misplaced"),
    "wall_inside": ("wall_misplaced",), "walls_scatter": ("wall_scatter",),
    "aspect_03": ("stretched_picture",), "aspect_1": ("stretched_picture",),
    "lens_03": ("lens",), "outer_theta_sign": ("rotation_sign",), "outer_mu_05": ("friction",),
    "unloaded_mu_01": ("friction",), "unloaded_theta_degrees": ("rotation_in_degrees",),
    "unloaded_time_reversed": ("photographs_reversed",), "unloaded_class_2": ("class_radii",),
    "unloaded_walls_late": ("walls_shifted",), "unloaded_rolling": ("rolling_resistance",),
    "unloaded_inertia": ("inertia",),
    "soft_stretched": ("stretched_picture",), "softer_stretched": ("stretched_picture",),
    "class_2": ("class_radii",), "wrong_class": ("exchanged_sizes",),
    **dict.fromkeys(
        ("some_radii", "stepped_some_radii", "annulus_some_radii", "unloaded_some_radii"),
        ("not_explained", "all_radii", "class_radii", "exchanged_sizes"),
    ),
    "rising_lens": ("lens", "not_explained"),
    "outliers": ("outlier_tracks",), "one_jump": ("outlier_tracks",), "missing_poses": ("missing_poses",),
    "exchanged_ids": ("exchanged_ids",),
    "base_friction": ("base_friction",), "smooth_walls": ("wall_friction",), "rough_walls": ("wall_friction",),
    "smooth_walls_spread": ("wall_friction",), "cohesion": ("adhesion",), "strong_cohesion": ("adhesion",),
    "rolling": ("rolling_resistance",),
    "elliptic": ("sections_not_round",), "slightly_elliptic": ("sections_not_round",),
    "inertia": ("inertia",), "strong_inertia": ("inertia",), "nearly_jammed": ("base_friction",),
}  # fmt: skip
# Of several scenarios with the same input error but for its size, one.
COMPARED_SCENARIOS: tuple[ScenarioName, ...] = tuple(
    name for name in SCENARIOS if name not in ("corners", "short_walls", "camera", "radius_offset", "ten_frames")
)
NOT_EXPLAINED = "not_explained"
HIGH, POOR_RESULT = 0.95, 0.9  # predicted r above which no test may reach less than the second


@dataclass(frozen=True, slots=True)
class PredictionOutcome:
    """One scenario and seed: what its first photographs predict, and the score of the whole test."""

    score: ScenarioScore
    prediction: Prediction | None  # None: the input was refused

    @property
    def expected(self) -> tuple[float, float, float]:
        """Expected r and its interval; NaN where nothing is predicted."""
        return NO_EXPECTATION if self.prediction is None else self.prediction.expected

    @property
    def inside(self) -> bool | None:
        """Whether r lies in the interval; None where one of them is missing."""
        r, low, high = self.expected
        if math.isnan(r) or self.score.r_late is None:
            return None
        return low <= self.score.r_late <= high

    @property
    def named(self) -> str:
        """Causes that the diagnosis named; empty: none."""
        return "" if self.prediction is None else ", ".join(each.cause for each in self.prediction.diagnosis)

    @property
    def rightly(self) -> bool | None:
        """Whether the true cause was named; None: none was named, or only that something is not explained."""
        if self.prediction is None or not self.named:
            return None
        true = set(TRUE_CAUSE.get(self.score.scenario, ()))
        causes = {each.cause for each in self.prediction.diagnosis}
        return None if causes == {NOT_EXPLAINED} and NOT_EXPLAINED not in true else causes <= true


def study_predictions(
    plan: StudyPlan, scenarios: Sequence[ScenarioName], seeds: Sequence[int], progress: Progress = no_progress
) -> list[PredictionOutcome]:
    """Score every scenario of every seed, and predict its accuracy from its first photographs."""
    return predict_all(plan, score_scenarios(plan, scenarios, seeds, progress=progress), progress)


def predict_all(
    plan: StudyPlan, scores: Sequence[ScenarioScore], progress: Progress = no_progress
) -> list[PredictionOutcome]:
    """Predict the accuracy of solved scenarios from their first photographs, and name what is wrong with them."""
    found = []
    for done, score in enumerate(scores):
        progress("predictions", done, len(scores))
        found.append(PredictionOutcome(score, _predict(plan, score.scenario, score.seed)))
    return found


def confusion(outcomes: Sequence[PredictionOutcome]) -> dict[ScenarioName, str]:
    """What was named for every scenario, with the number of seeds: ``{"mu_01": "friction 2"}``."""
    found: dict[ScenarioName, Counter[str]] = {}
    for each in outcomes:
        found.setdefault(each.score.scenario, Counter())[each.named or "nothing"] += 1
    return {name: ", ".join(f"{cause} {n}" for cause, n in count.items()) for name, count in found.items()}


def print_predictions(console: Console, outcomes: Sequence[PredictionOutcome]) -> None:
    """Print a row for every scenario and seed, then the number of correct intervals."""
    table = Table(box=None, pad_edge=False, header_style="bold", padding=(0, 1, 0, 0))
    for heading in (
        "scenario",
        "seed",
        "noise/motion",
        "step °",
        "gaps %",
        "expected",
        "from",
        "to",
        "r from 3",
        "",
        "diagnosis",
    ):
        table.add_column(heading, justify="left" if heading in ("scenario", "", "diagnosis") else "right", no_wrap=True)
    for each in outcomes:
        table.add_row(each.score.scenario, str(each.score.seed), *_cells(each))
    console.print(table)
    known = [each for each in outcomes if each.inside is not None]
    reached, expected = [each.score.r_late for each in known], [each.expected[0] for each in known]
    excessive = sum(r < POOR_RESULT and e > HIGH for r, e in zip(reached, expected, strict=True) if r is not None)
    rank = pearson(rankdata(reached), rankdata(expected)) if len(set(expected)) > 2 else math.nan
    wrong_input = [each for each in outcomes if SCENARIOS[each.score.scenario].group == "wrong input"]
    console.print(
        f"The diagnosis named the right cause in {sum(each.rightly is True for each in wrong_input)} of "
        f"{len(wrong_input)} wrong inputs, and a wrong one in {sum(each.rightly is False for each in outcomes)} of all "
        f"{len(outcomes)}.",
        highlight=False, soft_wrap=True,
    )  # fmt: skip
    console.print(
        f"{sum(bool(each.inside) for each in known)} of {len(known)} are in their interval, which should hold two of "
        f"three; rank correlation of prediction and result {rank:.2f}; {excessive} predictions above {HIGH} of those "
        f"that reached less than {POOR_RESULT}. gaps: standard deviation of the gaps of touching grains over a "
        f"diameter. Reference step: {math.degrees(REFERENCE_STEP):.2g}°. Seeds "
        + describe_seeds([each.score for each in outcomes]),
        highlight=False, soft_wrap=True,
    )  # fmt: skip


def _predict(plan: StudyPlan, scenario: ScenarioName, seed: int) -> Prediction | None:
    with TemporaryDirectory() as folder:
        try:
            made = make_planned(plan, Path(folder), scenario, seed)
            experiment = load_experiment(made.folder, plan.settings)
            tracks, walls = read_scenario(experiment)
        except (InputError, UnbalancedError):  # the score states which
            return None
    return predict_accuracy(experiment.config, tracks, walls)


def _cells(each: PredictionOutcome) -> list[str]:
    quality = None if each.prediction is None else each.prediction.quality
    r = each.score.r_late
    data = ["–"] * 3
    if quality is not None:
        step, gaps = math.degrees(quality.shear), 100.0 * quality.gap_sd / quality.diameter
        data = [f"{quality.noise_ratio:.3f}", f"{step:.2f}", f"{gaps:.2f}"]
    expected = ["–" if math.isnan(value) else f"{value:.3f}" for value in each.expected]
    remark = {True: "", False: "outside", None: "refused" if each.prediction is None else "no prediction"}[each.inside]
    return [*data, *expected, "–" if r is None else f"{r:.3f}", remark, each.named]
