"""The true forces of an experiment, on the rows and frames of its results."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from .experiment.config.experiment_file import ExperimentFile
from .experiment.experiment import load_experiment
from .process.errors import InputError
from .results.hdf5.store import load_results, origin_of
from .results.results import Results, TruthContacts
from .results.truth import TRUTH_COLUMNS, names_in_table, names_of_given, read_truth, true_ids, true_names
from .run_folder import Run, find_experiment

MOST_APART = 0.5  # of true forces whose grains are far apart: wrong ids in some photographs are left to the score


def truth_of(file: Path) -> TruthContacts | None:
    """Return the truth of the experiment of finished results; None without one, or where the experiment is missing."""
    origin = origin_of(file)
    try:
        experiment = find_experiment(file, origin)
    except InputError:
        return None
    return load_truth(Run(load_experiment(experiment), file.parent, origin.frames), load_results(file))


def check_truth(run: Run, ids: NDArray[np.int64] | None, walls: tuple[str, ...] | None, frame_count: int) -> None:
    """Check the true forces of an experiment, if there are any, before it is computed.

    Without walls, contacts with walls are noted and ignored: grains can be tracked nevertheless.

    Parameters
    ----------
    run
        The run with its experiment.
    ids
        Ids of the grains (n,); None: they are not known yet.
    walls
        Names of the walls; None: there are neither walls nor another boundary.
    frame_count
        Number of frames of the experiment.

    Raises
    ------
    InputError
        A grain or wall is unknown.
    """
    experiment, config = run.experiment, run.experiment.config
    if config.truth is None:
        return
    refuse_unnamed_truth(run)
    # Grains of photographs are named by truth_tracks where there is one, and not by their own ids.
    if ids is None or (config.photographs is not None and config.truth_tracks is not None):
        return
    unseen = None if config.truth_tracks is None else true_ids(experiment.folder / config.truth_tracks)
    table = experiment.table(config.truth, TRUTH_COLUMNS)
    if walls is None and not all(each.lstrip("-").isdecimal() for each in table.text("j")):
        run.notes.append(f"{config.truth}: contacts with walls are ignored, since no walls are given.")
    read_truth(table, ids, walls, frame_count=frame_count, unseen=unseen)


def load_truth(run: Run, results: Results, file: Path | None = None) -> TruthContacts | None:
    """Return the truth on the rows and frames of the results; None if the experiment has none.

    Detected grains have their own ids, which `truth_tracks` maps to those of the truth.

    Parameters
    ----------
    run
        The run with its experiment.
    results
        The results of the run.
    file
        Table of true forces to read instead of the experiment's own.

    Raises
    ------
    InputError
        The truth cannot be read, or its ids cannot be mapped.
    """
    config, folder = run.experiment.config, run.experiment.folder
    if file is None and config.truth is None:
        return None
    first = run.frames.start
    ids = names_in_table(results.tracks)
    if config.truth_tracks is not None:
        find_names = true_names if config.tracks is None else names_of_given
        ids = find_names(folder / config.truth_tracks, results.tracks, first)
    else:
        refuse_unnamed_truth(run)
    file = file if file is not None else folder / str(config.truth)
    truth = read_truth(
        file,
        ids,
        results.walls.name,
        frames=run.frames,
        frame_count=len(results.frames),
        unseen=None if config.truth_tracks is None else true_ids(folder / config.truth_tracks),
    )
    return _of_same_grains(truth, results, file).outside(results.tracks.boundary)


def truth_beside(results_file: Path, results: Results, file: Path) -> TruthContacts:
    """Return a table of true forces on the rows and frames of results whose experiment is not at hand.

    Grains that were detected are named by the table `truth_tracks` of the stored configuration, which is expected
    beside the truth. Given tracks without that table have the names of the truth.

    Parameters
    ----------
    results_file
        The file of the results.
    results
        The results.
    file
        Table of true forces.

    Raises
    ------
    InputError
        The truth cannot be read, or its ids cannot be mapped.
    """
    config, frames = _stored_config(results), origin_of(results_file).frames
    ids, unseen = names_in_table(results.tracks), None
    poses = None if config is None or config.truth_tracks is None else file.parent / Path(config.truth_tracks).name
    if config is not None and poses is not None and (poses.is_file() or config.tracks is None):
        find_names = true_names if config.tracks is None else names_of_given
        ids, unseen = find_names(poses, results.tracks, frames.start), true_ids(poses)
    elif config is not None:
        _refuse_unnamed(config, results_file)
    truth = read_truth(file, ids, results.walls.name, frames=frames, frame_count=len(results.frames), unseen=unseen)
    return _of_same_grains(truth, results, file).outside(results.tracks.boundary)


def _of_same_grains(truth: TruthContacts, results: Results, file: Path) -> TruthContacts:
    """Return the truth; raise InputError where most of its forces act between grains that are far apart in the run."""
    tracks, n = results.tracks, results.grains.count
    pairs = (truth.j < n) & (truth.fn > 0.0)
    frame, i, j = truth.frame[pairs], truth.i[pairs], truth.j[pairs]
    if results.walls.cell is not None or not len(frame):
        return truth
    reach = 2.0 * (tracks.radius[i] + tracks.radius[j])
    apart = np.linalg.norm(tracks.position[frame, i] - tracks.position[frame, j], axis=1) > reach  # NaN: not known
    if apart.mean() > MOST_APART:
        raise InputError(
            file, "",
            f"names other grains than this run: {apart.sum()} of its {len(apart)} forces act between grains that are "
            "more than a diameter apart",
        )  # fmt: skip
    return truth


def _stored_config(results: Results) -> ExperimentFile | None:
    """Return the configuration that results were computed with; None where an earlier version stored another form."""
    try:
        return ExperimentFile.model_validate(tomllib.loads(results.configuration))
    except (ValidationError, tomllib.TOMLDecodeError):
        return None


def refuse_unnamed_truth(run: Run) -> None:
    """Raise InputError where detected grains have their own ids, which a truth without truth_tracks does not have."""
    _refuse_unnamed(run.experiment.config, run.experiment.file)


def _refuse_unnamed(config: ExperimentFile, file: Path) -> None:
    detected = config.photographs is not None and config.photographs.grains is None
    if config.truth_tracks is None and detected:
        raise InputError(
            file,
            "key truth",
            "names grains by ids, but these grains were detected: give truth_tracks or photographs.grains",
        )
