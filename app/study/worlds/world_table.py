"""All worlds in one table: where the forces hold, where they do not, and whether the program says so.

A finished world is kept in a file of its own and not solved again unless the program, its settings or the size changed.
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

import solver

from ...atomic import write_atomically
from ...progress import Progress, silent
from ...sensitivity.execution import run_all
from ...synthetic.worlds.names import WorldName
from .world_score import FITTED, WorldPlan, WorldScore, score_world

HEADINGS = (
    "world", "seed", "r from 3", "r 0", "r 1", "r 2", "scale", "T", "T > r", "suspect", "statuses", "68 %", "95 %",
    "near: ours", "static", "overlap", "same", "CPU s",
)  # fmt: skip
WIDTH = 175  # columns of the printed table
ROWS = "scores"  # folder of finished worlds
SHORT = {"reset": "re", "suspect": "su", "rearranging": "ra", "settling": "si", "settled": "se", "failed": "fa"}


def study_worlds(
    plan: WorldPlan,
    worlds: Sequence[WorldName],
    seeds: Sequence[int],
    *,
    jobs: int = 1,
    progress: Progress = silent,
) -> list[WorldScore]:
    """Score every world with every seed, in the order given; finished ones are taken from the plan's folder."""
    cases: list[tuple[WorldName, int]] = [(world, seed) for world in worlds for seed in seeds]
    found = {case: kept for case in cases if (kept := load_score(_file(plan, *case))) is not None}
    missing = [case for case in cases if case not in found]
    progress("worlds", len(found), len(cases))
    for number, score in run_all(_score_case, plan, missing, workers=jobs):
        found[missing[number]] = score
        save_score(_file(plan, *missing[number]), score)
        progress("worlds", len(found), len(cases))
    return [found[case] for case in cases]


def print_worlds(console: Console, scores: Sequence[WorldScore]) -> None:
    """Print one row for every world and seed, then what the columns mean."""
    table = Table(box=None, pad_edge=False, header_style="bold", padding=(0, 1, 0, 0))
    for heading in HEADINGS:
        table.add_column(heading, justify="left" if heading in ("world", "statuses") else "right", no_wrap=True)
    for score in scores:
        table.add_row(*_cells(score))
    console.print(table)
    for score in scores:
        if score.refused:
            console.print(f"{score.world} {score.seed}: {score.refused}", highlight=False, soft_wrap=True)
    console.print(
        "r: of f_n over true and inferred contacts. T > r: frames whose trust exceeds r by more than .03, of those not "
        "suspect; suspect: of those that are. Statuses: "
        + ", ".join(f"{short} {name}" for name, short in SHORT.items())
        + ". 68 %, 95 %: true f_n within one and two standard deviations. near: r over all near pairs, beside forces "
        "that need no motion. Seeds " + tell_seeds(scores),
        highlight=False, soft_wrap=True,
    )  # fmt: skip


def tell_seeds(scores: Sequence[WorldScore]) -> str:
    """Which seeds constants were fitted on, and which judge."""
    seeds = sorted({score.seed for score in scores})
    fitted = " ".join(str(seed) for seed in seeds if seed in FITTED) or "none here"
    judging = " ".join(str(seed) for seed in seeds if seed not in FITTED) or "none here"
    return f"for fitting: {fitted}; for judging: {judging}."


def as_json(scores: Sequence[WorldScore]) -> dict[str, Any]:
    """The table as plain values."""
    seeds = sorted({score.seed for score in scores})
    return {
        "fitted_on": [seed for seed in seeds if seed in FITTED],
        "judged_on": [seed for seed in seeds if seed not in FITTED],
        "worlds": [
            asdict(score)
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


def save_score(file: Path, score: WorldScore) -> None:
    write_atomically(file, json.dumps(asdict(score), indent=1, allow_nan=False).encode())


def load_score(file: Path) -> WorldScore | None:
    """A score that was kept; None without such a file."""
    if not file.exists():
        return None
    values: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    values |= {name: tuple(value) for name, value in values.items() if isinstance(value, list)}
    return WorldScore(**values)


def _score_case(plan: WorldPlan, case: tuple[WorldName, int]) -> WorldScore:
    return score_world(plan, *case)


def _file(plan: WorldPlan, world: WorldName, seed: int) -> Path:
    said = f"{_code()} {plan.grains} {plan.settings}"
    key = hashlib.sha256(said.encode()).hexdigest()[:12]
    return plan.folder / ROWS / f"{world}_{seed}_{key}.json"


@cache
def _code() -> str:
    """A fingerprint of all source files that a score may hang on."""
    mark = hashlib.sha256()
    for root in (Path(solver.__file__).parent, Path(__file__).parents[2]):
        for file in sorted(root.rglob("*.py")):
            if file.relative_to(root).parts[0] not in ("cli", "recording", "review", "tracking"):
                mark.update(file.read_bytes())
    return mark.hexdigest()


def _cells(score: WorldScore) -> list[str]:
    if score.refused:
        return [score.world, str(score.seed), "refused"]
    first = [*score.r[:3], None, None, None][:3]
    return [
        score.world,
        str(score.seed),
        *(_number(value, 3) for value in (score.r_late, *first)),
        _number(score.scale, 2),
        _number(score.trust_mean, 2),
        *("{}/{}".format(*score.too_trusting(suspect=suspect)) for suspect in (False, True)),
        " ".join(f"{count} {SHORT[name]}" for name, count in score.status_count.items()),
        *("–" if share is None else f"{100.0 * share:.0f}" for share in score.coverage),
        *(_number(value, 3) for value in (score.r_ours, score.r_static, score.r_overlap, score.r_uniform)),
        _number(score.cpu, 2),
    ]


def _number(value: float | None, digits: int) -> str:
    return "–" if value is None else f"{value:.{digits}f}"
