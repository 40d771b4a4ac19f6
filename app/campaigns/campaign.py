"""A whole campaign: all runs of a table, their tables and their report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ..process.progress import Progress, no_progress
from ..robustness.execution import reach_scheduler
from .collect import Row, collect
from .plan import Case
from .report import write_report
from .task import Outcome
from .workers import run_cases


@dataclass(frozen=True, slots=True)
class CampaignResults:
    """What a campaign wrote."""

    folder: Path
    rows: list[Row]  # of the catalogue, one for every run
    outcomes: list[Outcome]  # in the order in which the runs ended
    report: Path

    @property
    def failed(self) -> list[Outcome]:
        return [each for each in self.outcomes if each.error]

    @property
    def reused(self) -> int:
        """Number of runs whose results existed."""
        return sum(each.reused for each in self.outcomes)


def run_campaign(
    cases: Sequence[Case], folder: Path, *, workers: int, scheduler: str | None = None, progress: Progress = no_progress
) -> CampaignResults:
    """Execute all runs of a campaign, and write the tables of all of them and the report.

    Parameters
    ----------
    cases : sequence of Case
    folder : Path
        Folder of the campaign.
    workers : int
        Processes on this machine.
    scheduler : str, optional
        Address of a dask scheduler to use instead.
    progress : Progress

    Raises
    ------
    InputError
        The scheduler does not answer.
    """
    if scheduler is not None:
        reach_scheduler(scheduler)
    folder.mkdir(parents=True, exist_ok=True)
    outcomes: list[Outcome] = []
    progress("runs", 0, len(cases))
    for outcome in run_cases(cases, folder, workers=workers, scheduler=scheduler):
        outcomes.append(outcome)
        progress("runs", len(outcomes), len(cases))
    rows = collect(folder, cases, outcomes)
    return CampaignResults(folder, rows, outcomes, write_report(folder, rows))
