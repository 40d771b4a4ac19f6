"""The table of all scenarios: accuracy of the forces, trust, status and coverage.

Every score is stored in a file and recomputed only if the program, its settings or the size changed.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from ... import solver
from ...process.atomic import write_atomically
from ...process.progress import Progress, no_progress
from ...robustness.execution import run_all
from ...synthetic.scenarios.preset_names import ScenarioName
from .scenario_score import FITTED, ScenarioScore, StudyPlan, score_scenario

HEADINGS = (
    "scenario", "seed", "r from 3", "r 0", "r 1", "r 2", "scale", "T", "T > r", "suspect", "statuses", "68 %", "95 %",
    "pairs: ours", "static", "overlap", "same", "CPU s",
)  # fmt: skip
WIDTH = 175  # columns of the printed table
ROWS = "scores"  # folder of finished scores
SHORT = {"reset": "re", "suspect": "su", "rearranging": "ra", "settling": "si", "settled": "se", "failed": "fa"}


def score_scenarios(
    plan: StudyPlan,
    scenarios: Sequence[ScenarioName],
    seeds: Sequence[int],
    *,
    jobs: int = 1,
    progress: Progress = no_progress,
) -> list[ScenarioScore]:
    """Score every scenario with every seed, in the given order; stored scores are read from the plan's folder."""
    cases: list[tuple[ScenarioName, int]] = [(scenario, seed) for scenario in scenarios for seed in seeds]
    found = {case: cached for case in cases if (cached := load_score(_file(plan, *case))) is not None}
    missing = [case for case in cases if case not in found]
    progress("scenarios", len(found), len(cases))
    for number, score in run_all(_score_case, plan, missing, workers=jobs):
        found[missing[number]] = score
        save_score(_file(plan, *missing[number]), score)
        progress("scenarios", len(found), len(cases))
    return [found[case] for case in cases]


def print_scores(console: Console, scores: Sequence[ScenarioScore]) -> None:
    """Print one row for every scenario and seed, then the meaning of the columns."""
    table = Table(box=None, pad_edge=False, header_style="bold", padding=(0, 1, 0, 0))
    for heading in HEADINGS:
        table.add_column(heading, justify="left" if heading in ("scenario", "statuses") else "right", no_wrap=True)
    for score in scores:
        table.add_row(*_cells(score))
    console.print(table)
    for score in scores:
        if score.refused:
            console.print(f"{score.scenario} {score.seed}: {score.refused}", highlight=False, soft_wrap=True)
    console.print(
        "r: of f_n over true and inferred contacts. T > r: frames whose trust exceeds r by more than .03, without "
        "suspect ones; suspect: only those. Statuses: "
        + ", ".join(f"{short} {name}" for name, short in SHORT.items())
        + ". 68 %, 95 %: true f_n within one and two standard deviations. pairs: r over all candidate pairs, beside "
        "motion-free baselines. Seeds " + describe_seeds(scores),
        highlight=False, soft_wrap=True,
    )  # fmt: skip


def describe_seeds(scores: Sequence[ScenarioScore]) -> str:
    """Name the seeds used for fitting and those used for judging."""
    seeds = sorted({score.seed for score in scores})
    fitted = " ".join(str(seed) for seed in seeds if seed in FITTED) or "none"
    judging = " ".join(str(seed) for seed in seeds if seed not in FITTED) or "none"
    return f"for fitting: {fitted}; for judging: {judging}."


def as_json(scores: Sequence[ScenarioScore]) -> dict[str, Any]:
    """Return the table as plain values."""
    seeds = sorted({score.seed for score in scores})
    return {
        "fitted_on": [seed for seed in seeds if seed in FITTED],
        "judged_on": [seed for seed in seeds if seed not in FITTED],
        "worlds": [
            {("world" if name == "scenario" else name): value for name, value in asdict(score).items()}
            | {
                "r_late": score.r_late,
                "trust_mean": score.trust_mean,
                "too_trusting": score.too_trusting(suspect=False),
                "too_trusting_suspect": score.too_trusting(suspect=True),
                "status_count": score.status_count,
            }
            for score in scores
        ],
    }


def save_score(file: Path, score: ScenarioScore) -> None:
    write_atomically(file, json.dumps(asdict(score), indent=1, allow_nan=False).encode())


def load_score(file: Path) -> ScenarioScore | None:
    """Load a stored score; None without such a file."""
    if not file.exists():
        return None
    values: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    values |= {name: tuple(value) for name, value in values.items() if isinstance(value, list)}
    return ScenarioScore(**values)


def _score_case(plan: StudyPlan, case: tuple[ScenarioName, int]) -> ScenarioScore:
    return score_scenario(plan, *case)


def _file(plan: StudyPlan, scenario: ScenarioName, seed: int) -> Path:
    inputs = f"{_code_fingerprint()} {plan.grains} {plan.settings} {seed in plan.varied}"
    key = hashlib.sha256(inputs.encode()).hexdigest()[:12]
    return plan.folder / ROWS / f"{scenario}_{seed}_{key}.json"


@cache
def _code_fingerprint() -> str:
    """Return a fingerprint of all source files and fitted constants that a score may depend on."""
    digest = hashlib.sha256()
    for root in (Path(solver.__file__).parent, Path(__file__).parents[2]):
        for file in sorted([*root.rglob("*.py"), *root.rglob("*.toml")]):
            if file.relative_to(root).parts[0] not in ("cli", "recording", "review", "tracking"):
                digest.update(file.read_bytes())
    return digest.hexdigest()


def _cells(score: ScenarioScore) -> list[str]:
    if score.refused:
        return [score.scenario, str(score.seed), "refused"]
    first = [*score.r[:3], None, None, None][:3]
    return [
        score.scenario,
        str(score.seed),
        *(_number(value, 3) for value in (score.r_late, *first)),
        _number(score.scale, 2),
        _number(score.trust_mean, 2),
        *("{}/{}".format(*score.too_trusting(suspect=suspect)) for suspect in (False, True)),
        " ".join(f"{count} {SHORT[name]}" for name, count in score.status_count.items()),
        *("–" if fraction is None else f"{100.0 * fraction:.0f}" for fraction in score.coverage),
        *(_number(value, 3) for value in (score.r_ours, score.r_static, score.r_overlap, score.r_uniform)),
        _number(score.cpu, 2),
    ]


def _number(value: float | None, digits: int) -> str:
    return "–" if value is None else f"{value:.{digits}f}"
