"""Verdicts of a run as a table: imported into the log, exported from it."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from rich.console import Console

from ..experiment.reading.tables import Table
from ..process.counts import state_count
from ..verdicts.reviewer_name import account_name
from ..verdicts.table import export_verdicts, import_verdicts
from .judging.candidate_pairs import find_candidate_pairs, gap_in_radii
from .reviewed_pairs import store_forces
from .reviewed_run import open_reviewed_run

UNNAMED = "python"  # reviewer of a table in memory, where the account is no person's


def import_table(path: Path, file: Path, *, reviewer: str | None, complete: bool) -> int:
    """Append a table of verdicts, or of contacts, to the log of a run, and print their number; the exit status."""
    count = import_verdicts_of_run(path, file, reviewer=reviewer, complete=complete)
    log = open_reviewed_run(path).log
    Console().print(f"{state_count(count, 'verdict')} added to {log.file}.", highlight=False, soft_wrap=True)
    return 0


def import_verdicts_of_run(path: Path, file: Path | Table, *, reviewer: str | None, complete: bool) -> int:
    """Append a table of verdicts, or of contacts, to the log of a run; return their number.

    Parameters
    ----------
    path : Path
        An experiment, a run's folder or results.h5.
    file : Path or Table
        Table frame,i,j[,verdict,reviewer,time,seconds], or its file.
    reviewer : str or None
        Reviewer of rows that name none; default: the file's name, or the user's name for a table without file.
    complete : bool
        The table lists every contact of its frames: all other candidate pairs are judged no contact.
    """
    run = open_reviewed_run(path)
    found = [find_candidate_pairs(run.results, k, run.threshold) for k in range(len(run.results.frames))]
    pairs = {each.frame: list(zip(each.contacts.i.tolist(), each.contacts.j.tolist(), strict=True)) for each in found}
    entries = import_verdicts(
        run.log, file, run.bodies, reviewer or _default_reviewer(file), frames=run.photographs(),
        candidates=pairs if complete else None, gap=partial(gap_in_radii, run.results),
    )  # fmt: skip
    store_forces(run, entries)
    return len(entries)


def _default_reviewer(file: Path | Table) -> str:
    return file.stem if isinstance(file, Path) else account_name() or UNNAMED


def export_table(path: Path, file: Path) -> int:
    """Write the verdicts of a run as a table; return the exit status."""
    count = export_verdicts(open_reviewed_run(path).log, file)
    Console().print(f"{state_count(count, 'verdict')} in {file}.", highlight=False, soft_wrap=True)
    return 0
