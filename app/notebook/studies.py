"""Studies in Python: how much the forces depend on uncertain inputs, and many experiments with many settings."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from os import PathLike
from pathlib import Path
from typing import Any

import pandas as pd

from .. import pipeline
from ..campaigns.campaign import run_campaign
from ..campaigns.plan import EXPERIMENT, read_plan
from ..process.atomic import write_atomically
from ..process.errors import InputError, RunError
from ..process.progress import Progress
from ..robustness.execution import reach_scheduler
from ..run_folder import hold_run
from ..solver.parallel import available_cores
from .arguments import arguments_named
from .made_runs import folder_of
from .shown_progress import shown_progress

TABLE = "campaign.csv"  # of a campaign given as a data frame, in its folder


@arguments_named()
def sensitivity(
    experiment: str | PathLike[str],
    *,
    out: str | PathLike[str] | None = None,
    factors: Sequence[str] | Mapping[str, tuple[float, float]] = (),
    samples: int | None = None,
    settings: Mapping[str, object] | None = None,
    workers: int | str | None = None,
    progress: Progress | None = None,
) -> pd.DataFrame:
    """Vary uncertain inputs and measure how much the forces depend on them, as `rodsight sensitivity`.

    Runs that are finished are not repeated. The tables of the command are written, too.

    Parameters
    ----------
    experiment : path
        Folder of the experiment, or its experiment.toml.
    out : path, optional
        Folder of the results; default runs/NAME.
    factors : sequence of str, or mapping to (low, high)
        Factors to vary, perhaps with their ranges: {"friction": (0.7, 1.3)}; default: all.
    samples : int, optional
        Number of runs of a space-filling design, which varies all factors at once; default: one factor at a time.
    settings : mapping, optional
        Values by the keys of experiment.toml.
    workers : int or str, optional
        Number of processes, or the address of a dask scheduler; default: one process per core.
    progress : callable, optional
        Called with stage, done and total; default: a line in notebooks.

    Returns
    -------
    pandas.DataFrame
        One row per run, the strongest factor first: a column for every factor (nominal where it is not varied),
        r_fn, r_ft, relative_l2, scale (against the nominal run), friction_angle_change and principal_direction_change
        [°], pressure [Pa], contacts, trust; true_r_fn … against the truth; failure. `.attrs["summary"]`: a sentence.

    Raises
    ------
    InputError
        A factor is unknown, or a range is invalid.

    Examples
    --------
    >>> table = rodsight.sensitivity("my_test", out="runs/shear", factors={"friction": (0.8, 1.2)}, workers=1,
    ...                              settings={"solver.sweeps": 50})
    >>> table["friction"].tolist()
    [0.8, 1.2]
    """
    from ..robustness import design, report, study

    run = folder_of(experiment, out, settings, progress=progress)
    wanted = (
        [f"{name}={ends[0]!r}:{ends[1]!r}" for name, ends in factors.items()]
        if isinstance(factors, Mapping)
        else factors
    )
    scheduler = workers if isinstance(workers, str) else None
    if scheduler is not None:
        reach_scheduler(scheduler)
    kind: design.Design = "oat" if samples is None else "sobol"
    with hold_run(run):
        varied, cases = design.plan(run.experiment, kind, wanted, samples, 0)
        nominal, fingerprint = pipeline.nominal_run(run)
        effects = study.run_study(
            nominal, cases, study.EffectLog(run.file(study.EFFECT_LOG), fingerprint),
            workers=_processes(workers), scheduler=scheduler, progress=run.progress,
        )  # fmt: skip
        own = study.compare(nominal.networks, nominal)
        results = report.SensitivityResults(run.experiment.name, kind, varied, cases, effects, own)
        report.save_sensitivity(results, run.folder)
    rows = [
        {each.name: dict(case.values).get(each.name, each.nominal) for each in varied} | asdict(effect)
        for case, effect in results.runs()
    ]
    table = pd.DataFrame(rows)
    table.attrs["summary"] = results.sentence()
    return table


@arguments_named()
def campaign(
    table: str | PathLike[str] | pd.DataFrame,
    *,
    out: str | PathLike[str] | None = None,
    recordings: bool = True,
    workers: int | str | None = None,
    progress: Progress | None = None,
) -> pd.DataFrame:
    """Run many experiments with many settings in parallel, as `rodsight campaign`.

    The same call resumes where it stopped; a failed run does not stop the others. The folder then holds a folder for
    each run, catalogue.csv, contacts.parquet, grains.parquet, frames.parquet and walls.parquet of all runs, and
    report.html.

    Parameters
    ----------
    table : path or data frame
        Column experiment (a folder, or a pattern of folders), optionally name and frames ("A:B"), and keys of
        experiment.toml. Paths in a file are relative to it, in a data frame to the current folder.
    out : path, optional
        Folder of all runs; default: runs/ and the table's name, runs/campaign for a data frame.
    recordings : bool
        Write a recording of every run.
    workers : int or str, optional
        Number of processes, or the address of a dask scheduler; default: one process per core.
    progress : callable, optional
        Called with stage, done and total; default: a line in notebooks.

    Returns
    -------
    pandas.DataFrame
        One row per run: run, experiment, the varied keys, state (done, failed), error, seconds, and means over its
        frames: contacts, friction_angle_degrees, coordination_number, mean_fn, trust, r_fn against the truth, and
        others. `.attrs["folder"]`: where the runs are.

    Raises
    ------
    InputError
        The table is invalid.

    Examples
    --------
    >>> import pandas as pd
    >>> plan = pd.DataFrame({"experiment": "my_test", "material.friction": [0.2, 0.3], "solver.sweeps": 20})
    >>> found = rodsight.campaign(plan, out="runs/friction", recordings=False, workers=1)
    >>> found[["material.friction", "state"]].to_numpy().tolist()
    [[0.2, 'done'], [0.3, 'done']]
    >>> pd.read_parquet("runs/friction/frames.parquet")["run"].nunique()
    2
    """
    if isinstance(table, pd.DataFrame):
        folder = Path(out) if out is not None else Path("runs") / "campaign"
        file = _write_plan(table, folder)
    else:
        file = Path(table)
        folder = Path(out) if out is not None else Path("runs") / file.stem
    cases = read_plan(file, record=recordings)
    scheduler = workers if isinstance(workers, str) else None
    done = run_campaign(
        cases, folder, workers=_processes(workers), scheduler=scheduler, progress=progress or shown_progress()
    )
    catalogue = pd.DataFrame(done.rows)
    if len(done.failed) == len(cases):
        raise RunError(f"all runs of the campaign failed; the first one: {done.failed[0].error}")
    for key in {name for case in cases for name in (each.partition("=")[0] for each in case.settings)}:
        catalogue[key] = _numbers(catalogue[key].tolist())
    catalogue.attrs["folder"] = str(folder)
    return catalogue


def _write_plan(table: pd.DataFrame, folder: Path) -> Path:
    """Write a plan given as a data frame into the campaign's folder; paths relative to it."""
    if EXPERIMENT not in table:
        raise InputError("campaign", f"column {EXPERIMENT}", "there is no such column")
    folder.mkdir(parents=True, exist_ok=True)
    rows = [list(map(str, table.columns))]
    for values in table.to_dict("records"):
        values[EXPERIMENT] = os.path.relpath(str(values[EXPERIMENT]), folder)
        rows.append(["" if each is None or each != each else str(each) for each in values.values()])
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    write_atomically(folder / TABLE, text.getvalue().encode())
    return folder / TABLE


def _numbers(texts: list[Any]) -> list[Any]:
    """Return the texts of a column as numbers where all of them are; an absent one, of a default, is NaN."""
    try:
        return [float(each) for each in texts]
    except (TypeError, ValueError):
        return texts


def _processes(workers: int | str | None) -> int:
    if workers is None or isinstance(workers, str):
        return available_cores()
    if workers < 1:
        raise InputError("workers", str(workers), "must be at least one")
    return workers
