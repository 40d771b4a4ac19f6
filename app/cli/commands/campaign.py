"""The command that runs many experiments: campaign."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from ...process.counts import state_count
from ...process.errors import RunError
from ..arguments import AsJson, Flag, Quiet, Scheduler, Workers, worker_count
from ..terminal import print_line, progress_of, table_console

if TYPE_CHECKING:
    from ...campaigns.campaign import CampaignResults
    from ...campaigns.collect import Row


def campaign(
    table: Annotated[
        Path,
        Positional,
        arg(
            metavar="TABLE", help="CSV: column experiment (a folder, or a pattern of folders), keys of experiment.toml"
        ),
    ],
    /,
    out: Annotated[
        Path | None, arg(metavar="DIR", help="folder of all runs; default: runs/ and the table's name")
    ] = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    recordings: Annotated[bool, arg(help="write a recording of every run")] = True,
    dry: Annotated[Flag, arg(help="check the table and list its runs")] = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> int:
    """Run many experiments with many settings in parallel, with one report of all.

    Columns of TABLE: experiment; optionally name and frames (A:B); all others are keys such as material.friction, where
    an empty cell keeps the experiment's value. The same command resumes where it stopped; a failed run does not stop
    the others. In DIR: a folder for each run, catalogue.csv, contacts.parquet, grains.parquet, frames.parquet and
    walls.parquet of all runs, report.html.

    Example: rodsight campaign sample_data/campaign.csv --workers 2
    """
    from ...campaigns.campaign import run_campaign
    from ...campaigns.plan import read_plan

    processes = worker_count(workers)
    console = table_console(quiet=quiet or as_json)
    cases = read_plan(table, record=recordings)
    if dry:
        if as_json:
            print(json.dumps([case.as_plain() for case in cases], indent=1))
        for case in cases:
            print_line(console, f"{case.name}: {case.experiment} {' '.join(case.settings)}".rstrip())
        return 0
    folder = out if out is not None else Path("runs") / table.stem
    with progress_of(quiet) as progress:
        done = run_campaign(cases, folder, workers=processes, scheduler=scheduler, progress=progress)
    if as_json:
        print(json.dumps({"folder": str(folder), "report": str(done.report), "runs": done.rows}, indent=1))
        return _status(done, len(cases))
    _print(console, done.rows)
    for each in done.failed:
        print_line(console, f"{each.name} failed: {each.error}")
    counts = f"{state_count(len(cases), 'run')}, {done.reused} of them reused, {len(done.failed)} failed"
    print_line(console, f"{counts}. Report: {done.report}")
    return _status(done, len(cases))


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


def _status(done: CampaignResults, count: int) -> int:
    """Return the exit status; raise RunError, a line that is also printed with --quiet, where runs failed."""
    if not done.failed:
        return 0
    first = done.failed[0]
    raise RunError(f"{len(done.failed)} of {state_count(count, 'run')} failed, first {first.name}: {first.error}")
