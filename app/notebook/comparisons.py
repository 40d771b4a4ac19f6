"""Runs in Python compared with their truth, or with one another; verdicts of reviewers."""

from __future__ import annotations

import tempfile
from os import PathLike
from pathlib import Path

import numpy as np
import pandas as pd

from ..exchange.tidy_tables import AT_WALL
from ..experiment.experiment import load_experiment
from ..experiment.reading.tables import Table
from ..process.errors import InputError
from ..process.frame_range import ALL_FRAMES, FrameRange
from ..results.comparison import Comparison, DifferentPackingError, FieldFrame, compare_runs, compare_with_truth
from ..results.hdf5.store import origin_of
from ..results.results import Results, TruthContacts
from ..results.truth import TRUTH_COLUMNS, accuracy, read_truth
from ..results.truth import score as score_frames
from ..run_folder import Run as RunFolder
from ..run_folder import find_experiment
from ..run_truth import load_truth, truth_beside
from ..solver.contacts.pairs import align
from .arguments import as_table
from .made_runs import open_run
from .run import Run

Source = Run | str | PathLike[str]
TRUTH = "truth"
PAIR_COLUMNS = ("frame", "i", "j")


def score(results: Source, truth: str | PathLike[str] | pd.DataFrame | None = None) -> pd.DataFrame:
    """Compare a run with true forces frame by frame, as `rodsight score`.

    Parameters
    ----------
    results : Run or path
    truth : path or data frame, optional
        Columns frame, i, j, fn, ft; at a wall j is its name, or −1 with the name in `wall`. Default: the truth of the
        experiment.

    Returns
    -------
    pandas.DataFrame
        One row per frame: frame, status, trust, expected_correlation; r_fn and r_ft, correlations of f_n and f_t over
        all contacts of either; relative_l2 = ‖f − f_true‖ / ‖f_true‖; scale = Σ f_n / Σ f_n,true; contact_precision,
        contact_recall.

    Raises
    ------
    InputError
        There is no truth, or a grain or wall in it is unknown.

    Examples
    --------
    >>> scores = rodsight.score("runs/shear")
    >>> bool(scores["r_fn"].iloc[1:].gt(0.5).all())
    True
    """
    run = as_run(results)
    known = _truth_of(run, truth)
    frames = run.frames()[["frame", "status", "trust", "expected_correlation"]]
    found = {key: pd.Series(column, dtype=float) for key, column in accuracy(score_frames(run.results, known)).items()}
    return frames.assign(**found)


def compare(first: Source, second: Source | pd.DataFrame = TRUTH) -> pd.DataFrame:
    """Compare two runs of one packing contact by contact, as `rodsight compare`, or a run with its truth.

    Parameters
    ----------
    first : Run or path
    second : Run, path, data frame or 'truth'
        The reference: another run, true forces (as in `rodsight.score`), or the truth of the experiment. Grains are
        matched by their ids, or by their positions where ids denote different grains.

    Returns
    -------
    pandas.DataFrame
        One row per contact of either and frame: frame, i, j, wall (ids of the first run), fn, ft, fn_reference,
        ft_reference [N]; 0 where one of them lacks the contact. `.attrs["notes"]`: sentences on what could not be
        compared.

    Raises
    ------
    InputError
        The runs are not of one packing, or there is no truth.

    Examples
    --------
    >>> both = rodsight.compare("runs/shear", "truth")
    >>> r = both.groupby("frame")[["fn", "fn_reference"]].corr().xs("fn", level=1)["fn_reference"]
    >>> bool(r.iloc[1:].gt(0.5).all())
    True
    >>> rodsight.compare("runs/shear", "runs/shear").eval("fn == fn_reference").all().item()
    True
    """
    run = as_run(first)
    if isinstance(second, pd.DataFrame) or (isinstance(second, str) and second == TRUTH):
        known = _truth_of(run, None if isinstance(second, str) else second)
        comparison = compare_with_truth(run.results, known, name=run.name)
    else:
        other = as_run(second)
        try:
            comparison = compare_runs(run.results, other.results, starts=(_frames(run).start, _frames(other).start))
        except DifferentPackingError as error:
            raise InputError("compare", "", str(error)) from None
    table = pd.concat([_of_frame(comparison, k) for k in range(len(comparison.first.frames))], ignore_index=True)
    table.attrs["units"] = dict.fromkeys(("fn", "ft", "fn_reference", "ft_reference"), "N")
    table.attrs["notes"] = list(comparison.notes)
    return table


def review(
    results: Source,
    verdicts: pd.DataFrame | str | PathLike[str] | None = None,
    *,
    reviewer: str | None = None,
    complete: bool = False,
    page: bool = True,
) -> pd.DataFrame:
    """Judge contacts by eye on a local page, as `rodsight review`, or by a table; return all verdicts.

    The next `rodsight.run` of the experiment applies them.

    Parameters
    ----------
    results : Run or path
        A run with a folder.
    verdicts : data frame or path, optional
        Verdicts to add instead of opening the page: columns frame, i, j (or j = −1 and wall), and perhaps verdict
        ('contact', 'no contact', 'unsure'; absent: every row is a contact).
    reviewer : str, optional
        Who judges; default: the user's name, or the name of the table's file.
    complete : bool
        The table lists every contact of its frames: all other candidate pairs are no contacts.
    page : bool
        Without verdicts: serve the page until the cell is interrupted. False: only return the verdicts so far.

    Returns
    -------
    pandas.DataFrame
        Columns frame, i, j (a wall's name, or an id as text), verdict, reviewer, time, seconds.

    Raises
    ------
    InputError
        The run is in memory only, or a frame, grain, wall or verdict is unknown; then nothing is stored.

    Examples
    --------
    >>> import pandas as pd
    >>> found = rodsight.review("runs/shear", page=False)
    >>> list(found.columns)
    ['frame', 'i', 'j', 'verdict', 'reviewer', 'time', 'seconds']
    """
    from ..reviewing import verdict_tables
    from ..reviewing.reviewed_run import open_reviewed_run
    from ..verdicts.table import export_verdicts
    from ..workbench.command import open_review

    file = as_run(results).file
    if file is None:
        raise InputError("review", "", "needs a run with a folder: rodsight.run, not rodsight.solve")
    with tempfile.TemporaryDirectory(prefix="rodsight-") as place:
        if isinstance(verdicts, pd.DataFrame):
            named = _with_wall_names(verdicts)
            table = as_table("verdicts", named, [*PAIR_COLUMNS, *(each for each in named if each not in PAIR_COLUMNS)])
            verdict_tables.import_verdicts_of_run(file, table, reviewer=reviewer, complete=complete)
        elif verdicts is not None:
            verdict_tables.import_verdicts_of_run(file, Path(verdicts), reviewer=reviewer, complete=complete)
        elif page:
            open_review(file, port=0, browser=True, reviewer=reviewer)
        listed = Path(place) / "all.csv"
        export_verdicts(open_reviewed_run(file).log, listed)
        return pd.read_csv(listed, dtype={"j": str})


def as_run(source: Source) -> Run:
    """Return a run, opened where a path is given."""
    return source if isinstance(source, Run) else open_run(source)


def _frames(run: Run) -> FrameRange:
    return ALL_FRAMES if run.file is None else origin_of(run.file).frames


def _truth_of(run: Run, truth: str | PathLike[str] | pd.DataFrame | None) -> TruthContacts:
    results = run.results
    if isinstance(truth, pd.DataFrame):
        return _arrange_truth(run, truth)
    if run.file is None:
        if truth is None:
            raise InputError("truth", "", "is missing: a run in memory has no experiment; give a table of true forces")
        return _read(Path(truth), run)
    origin = origin_of(run.file)
    try:
        experiment = find_experiment(run.file, origin)
    except InputError:  # results.h5 stands alone
        if truth is None:
            raise
        return truth_beside(run.file, results, Path(truth))
    folder = RunFolder(load_experiment(experiment), run.file.parent, origin.frames)
    known = load_truth(folder, results, None if truth is None else Path(truth))
    if known is None:
        raise InputError(folder.experiment.file, "key truth", "is missing: give a table of true forces")
    return known


def _arrange_truth(run: Run, truth: pd.DataFrame) -> TruthContacts:
    return _read(as_table("truth", _with_wall_names(truth), TRUTH_COLUMNS), run)


def _read(file: Path | Table, run: Run) -> TruthContacts:
    results = run.results
    return read_truth(
        file, results.tracks.id, results.walls.name, frames=_frames(run), frame_count=len(results.frames)
    ).outside(results.tracks.boundary)


def _with_wall_names(table: pd.DataFrame) -> pd.DataFrame:
    """Return the table with the names of walls in the column j, as files have them."""
    if "wall" not in table:
        return table
    at_wall = table["wall"].fillna("").ne("")
    return table.assign(j=table["wall"].where(at_wall, table["j"].astype(str))).drop(columns="wall")


def _of_frame(comparison: Comparison, frame: int) -> pd.DataFrame:
    """Return both force fields of one frame on the union of their contacts."""
    one, other = comparison.first.frames[frame], comparison.second.frames[frame]
    keys, forces, reference = align(one.contacts.key, _forces(one), other.contacts.key, _forces(other))
    i, j, wall = _bodies(keys, comparison.base)
    return pd.DataFrame(
        {
            "frame": frame, "i": i, "j": j, "wall": wall, "fn": forces[:, 0], "ft": forces[:, 1],
            "fn_reference": reference[:, 0], "ft_reference": reference[:, 1],
        }
    )  # fmt: skip


def _forces(field: FieldFrame) -> np.ndarray:
    return np.nan_to_num(np.column_stack([field.fn, field.ft]))


def _bodies(keys: np.ndarray, base: Results) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Return ids i and j, and names of walls, of the pairs with these keys."""
    n, walls = base.grains.count, base.walls.name
    low, high = np.divmod(keys, n + len(walls))
    ids = np.append(base.tracks.id, np.full(len(walls), AT_WALL))
    names = [*[""] * n, *walls]
    return ids[low], ids[high], [names[body] for body in high.tolist()]
