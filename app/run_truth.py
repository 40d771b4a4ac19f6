"""The truth that an experiment names, on the rows and frames of its results."""

from __future__ import annotations

from pathlib import Path

from .errors import InputError
from .experiment.experiment import load_experiment
from .results.hdf5.store import load_results, origin_of
from .results.results import Results, TruthContacts
from .results.truth import names_of_told, read_truth, true_ids, true_names
from .run_folder import Run, find_experiment


def truth_of(file: Path) -> TruthContacts | None:
    """The truth that the experiment of finished results names; None without one, or where the experiment is gone."""
    origin = origin_of(file)
    try:
        experiment = find_experiment(file, origin)
    except InputError:
        return None
    return load_truth(Run(load_experiment(experiment), file.parent, origin.frames), load_results(file))


def load_truth(run: Run, results: Results, file: Path | None = None) -> TruthContacts | None:
    """The truth on the rows and frames of the results; None if the experiment names none.

    file replaces the experiment's own. Grains that were detected have numbers of their own, so that
    `truth_tracks` must tell which is which.
    """
    config, folder = run.experiment.config, run.experiment.folder
    if file is None and config.truth is None:
        return None
    first = run.frames[0]
    ids = results.tracks.id
    if config.truth_tracks is not None:
        find_names = true_names if config.tracks is None else names_of_told
        ids = find_names(folder / config.truth_tracks, results.tracks, first)
    else:
        refuse_unnamed_truth(run)
    return read_truth(
        file if file is not None else folder / str(config.truth),
        ids,
        results.walls.name,
        first_frame=first,
        frame_count=len(results.frames),
        unseen=None if config.truth_tracks is None else true_ids(folder / config.truth_tracks),
    ).outside(results.tracks.boundary)


def refuse_unnamed_truth(run: Run) -> None:
    """Grains that are detected get names of their own, which a truth does not know."""
    config = run.experiment.config
    detected = config.photographs is not None and config.photographs.grains is None
    if config.truth_tracks is None and detected:
        raise InputError(
            run.experiment.file,
            "key truth",
            "names grains by ids, but these grains were detected: give truth_tracks or photographs.grains",
        )
