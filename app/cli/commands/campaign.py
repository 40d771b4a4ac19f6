"""The command that runs many experiments: campaign."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from ...errors import InputError
from ..arguments import Quiet
from ..terminal import progress_of, table_console, tell

if TYPE_CHECKING:
    from ...campaign.collect import Row


def campaign(
    table: Annotated[
        Path,
        tyro.conf.Positional,
        tyro.conf.arg(
            metavar="TABLE", help="CSV: column experiment (a folder, or a pattern of folders), keys of experiment.toml"
        ),
    ],
    /,
    out: Annotated[
        Path | None, tyro.conf.arg(metavar="DIR", help="folder of all runs; default: runs/ and the table's name")
    ] = None,
    workers: Annotated[int | None, tyro.conf.arg(metavar="N", help="processes; default: one for every core")] = None,
    scheduler: Annotated[
        str | None, tyro.conf.arg(metavar="ADDRESS", help="run on the machines of this dask scheduler instead")
    ] = None,
    recordings: Annotated[bool, tyro.conf.arg(help="write a recording of every run")] = True,
    dry: Annotated[
        bool, tyro.conf.FlagCreatePairsOff, tyro.conf.arg(help="check the table, and list the runs that it asks for")
    ] = False,
    quiet: Quiet = False,
) -> int:
    """Run many experiments with many settings, side by side, and tell of them as one.

    Columns of TABLE: experiment; name, frames (A:B) where wanted; all others are keys such as material.friction, an
    empty cell leaving the experiment's own. The same command goes on where it stopped. A run that fails does not stop
    the others. In DIR: a folder for each run, catalogue.csv, contacts.parquet, grains.parquet, frames.parquet and
    walls.parquet of all runs, report.html.

    Example: rodsight campaign sample_data/campaign.csv --workers 2
    """
    from solver.together import available_cores

    from ...campaign.collect import collect
    from ...campaign.plan import read_plan
    from ...campaign.report import write_report
    from ...campaign.workers import run_cases
    from ...sensitivity.execution import reach_scheduler

    if workers is not None and workers < 1:
        raise InputError("--workers", str(workers), "must be at least one")
    console = table_console(quiet=quiet)
    cases = [replace(case, record=recordings) for case in read_plan(table)]
    if dry:
        for case in cases:
            tell(console, f"{case.name}: {case.experiment} {' '.join(case.settings)}".rstrip())
        return 0
    if scheduler is not None:
        reach_scheduler(scheduler)
    folder = out if out is not None else Path("runs") / table.stem
    folder.mkdir(parents=True, exist_ok=True)
    outcomes = []
    with progress_of(quiet) as progress:
        progress("runs", 0, len(cases))
        crew = available_cores() if workers is None else workers
        for outcome in run_cases(cases, folder, workers=crew, scheduler=scheduler):
            outcomes.append(outcome)
            progress("runs", len(outcomes), len(cases))
    rows = collect(folder, cases, outcomes)
    report = write_report(folder, rows)
    _print(console, rows)
    failed = [each for each in outcomes if each.error]
    for each in failed:
        tell(console, f"{each.name} failed: {each.error}")
    kept = sum(each.kept for each in outcomes)
    tell(console, f"{len(cases)} runs, {kept} of them there already, {len(failed)} failed. All of it: {report}")
    return 1 if failed else 0


def _print(console: object, rows: list[Row]) -> None:
    from rich.console import Console
    from rich.table import Table

    assert isinstance(console, Console)
    shown = ("run", "state", "frames", "contacts", "friction_angle_degrees", "trust", "suspect", "r_fn", "seconds")
    present = [name for name in shown if any(name in row for row in rows)]
    table = Table(box=None, header_style="bold", pad_edge=False, padding=(0, 1, 0, 0))
    for name in present:
        table.add_column({"friction_angle_degrees": "φ/°", "r_fn": "r(f_n)"}.get(name, name),
                         justify="left" if name in ("run", "state") else "right")  # fmt: skip
    for row in rows:
        table.add_row(*("–" if row.get(name) is None else str(row[name]) for name in present))
    console.print(table)
