"""What `check` promises from the first photographs, beside what came out of the whole test."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from rich.console import Console
from rich.table import Table

from ...errors import InputError
from ...experiment.experiment import load_experiment
from ...inference.data_budget import REFERENCE_STEP, DataBudget, Promise, measure_budget
from ...progress import Progress, silent
from ...synthetic.worlds.making import make_world
from ...synthetic.worlds.names import WorldName
from .world_score import WorldPlan, WorldScore, read_world
from .world_table import study_worlds, tell_seeds

WORLDS: tuple[WorldName, ...] = (
    "shear", "sheared", "biaxial", "isotropic", "unseen", "centres", "radii_03", "radii_1", "step_05", "step_1",
    "ten_frames", "outer", "soft", "mu_low", "mu_high",
)  # fmt: skip
FEWEST = 4  # tests that three numbers can be fitted to
PERFECT = 1e-3  # 1 − r below which a correlation counts as this


@dataclass(frozen=True, slots=True)
class KeptPromise:
    """One world of one seed: the budget of its first photographs, and what it came to."""

    score: WorldScore
    budget: DataBudget | None  # None: nothing can be said of such a test

    @property
    def inside(self) -> bool | None:
        """Whether r lies in the interval; None where one of them is missing."""
        if self.budget is None or self.score.r_late is None:
            return None
        _, low, high = self.budget.expected
        return low <= self.score.r_late <= high


def study_promises(
    plan: WorldPlan, worlds: Sequence[WorldName], seeds: Sequence[int], progress: Progress = silent
) -> list[KeptPromise]:
    """Every world of every seed, solved unless its score is kept, beside the budget of its first photographs."""
    scores = study_worlds(plan, worlds, seeds, progress=progress)
    return [KeptPromise(score, _budget(plan, score.world, score.seed)) for score in scores]


def fit_promise(kept: Sequence[KeptPromise]) -> Promise:
    """Fit ln(1 − r) on noise and step. Raises InputError with fewer than FEWEST tests to fit on."""
    known = [
        (each.budget, each.score.r_late) for each in kept
        if each.budget is not None and each.score.r_late is not None and not each.budget.coarse
    ]  # fmt: skip
    if len(known) < FEWEST:
        raise InputError("study budget", f"--fit with {len(known)} tests", f"needs {FEWEST} that tell something")
    rows = np.array([[1.0, *budget.witnesses] for budget, _ in known])
    error = np.log([max(1.0 - r, PERFECT) for _, r in known])
    found, _, rank, _ = np.linalg.lstsq(rows, error, rcond=None)
    freedom = max(len(known) - int(rank), 1)
    deviation = math.sqrt(float(np.sum((rows @ found - error) ** 2)) / freedom)
    a, b, c = found.tolist()
    return Promise(a, b, c, deviation)


def print_promises(console: Console, kept: Sequence[KeptPromise]) -> None:
    """Print a row for every world and seed, then how many intervals hold."""
    table = Table(box=None, pad_edge=False, header_style="bold", padding=(0, 1, 0, 0))
    for heading in ("world", "seed", "noise/motion", "step °", "gaps %", "expected", "from", "to", "r from 3", ""):
        table.add_column(heading, justify="left" if heading in ("world", "") else "right", no_wrap=True)
    for each in kept:
        table.add_row(each.score.world, str(each.score.seed), *_cells(each))
    console.print(table)
    told = [each.inside for each in kept if each.inside is not None]
    console.print(
        f"{sum(told)} of {len(told)} lie in their interval, meant for two of three. gaps: their scatter where grains "
        f"touch, over a diameter. Steps count from {math.degrees(REFERENCE_STEP):.2g}° on. Seeds "
        + tell_seeds([each.score for each in kept]),
        highlight=False, soft_wrap=True,
    )  # fmt: skip


def _budget(plan: WorldPlan, world: WorldName, seed: int) -> DataBudget | None:
    with TemporaryDirectory() as folder:
        made = make_world(Path(folder), world, seed, grains=plan.grains, kept=plan.folder / "kept")
        experiment = load_experiment(made.folder, plan.settings)
        try:
            tracks, walls = read_world(experiment)
        except InputError:
            return None
    return measure_budget(tracks, walls)


def _cells(each: KeptPromise) -> list[str]:
    budget, r = each.budget, each.score.r_late
    came = "–" if r is None else f"{r:.3f}"
    if budget is None:
        return ["–", "–", "–", "–", "–", "–", came, "nothing is promised"]
    told = {True: "", False: "outside", None: "refused"}[each.inside]
    return [
        f"{budget.noise_share:.3f}",
        f"{math.degrees(budget.shear):.2f}",
        f"{100.0 * budget.scatter / budget.diameter:.2f}",
        *(f"{value:.3f}" for value in budget.expected),
        came,
        told,
    ]
