"""`rodsight.run` and `rodsight.open`: a run computed, or opened, in Python."""

from __future__ import annotations

import time
import warnings
from collections.abc import Mapping
from os import PathLike
from pathlib import Path

from .. import pipeline
from ..experiment.config.unused_keys import refuse_unused_keys
from ..experiment.experiment import load_experiment
from ..process.errors import MissingFileError
from ..process.frame_range import ALL_FRAMES
from ..process.progress import Progress
from ..run_folder import RESULTS, hold_run
from ..run_folder import Run as RunFolder
from ..run_truth import load_truth
from .arguments import as_frames, as_strings
from .run import Run
from .shown_progress import shown_progress


def run(
    experiment: str | PathLike[str],
    *,
    out: str | PathLike[str] | None = None,
    settings: Mapping[str, object] | None = None,
    frames: tuple[int, int | None] | tuple[int, int | None, int] = ALL_FRAMES,
    progress: Progress | None = None,
) -> Run:
    """Compute forces and a recording from photographs or tracks, as `rodsight run` with its defaults.

    Existing results of the same input are reused.

    Parameters
    ----------
    experiment : path
        Folder of the experiment, or its experiment.toml.
    out : path, optional
        Folder of the results; default runs/NAME.
    settings : mapping, optional
        Values by the keys of experiment.toml, which they override: {"solver.kappa": 0.1}.
    frames : tuple
        First frame, end or None, and perhaps a step: (0, None, 4) for every fourth photograph.
    progress : callable, optional
        Called with stage, done and total; default: a line in notebooks.

    Raises
    ------
    InputError
        If the input is invalid.
    RunError
        If another process works in the folder, or no frame can be solved.

    Examples
    --------
    >>> run = rodsight.run("my_test", out="runs/shear", settings={"solver.sweeps": 50})
    >>> run.name
    'my_test'
    """
    began = time.perf_counter()
    folder_of_run = folder_of(experiment, out, settings, frames, progress)
    with hold_run(folder_of_run):
        results = pipeline.solve(folder_of_run)
        truth = load_truth(folder_of_run, results)
        pipeline.record(folder_of_run, results, truth)
        pipeline.conclude(folder_of_run, results, truth, began)
    return Run(folder_of_run.file(RESULTS))


def folder_of(
    experiment: str | PathLike[str],
    out: str | PathLike[str] | None,
    settings: Mapping[str, object] | None,
    frames: tuple[int, int | None] | tuple[int, int | None, int] = ALL_FRAMES,
    progress: Progress | None = None,
) -> RunFolder:
    """Return the folder of a run of an experiment, by default runs/NAME. Raises InputError."""
    loaded = load_experiment(Path(experiment), as_strings(settings or {}))
    refuse_unused_keys(loaded.config, loaded.file)
    folder = Path(out) if out is not None else Path("runs") / loaded.name
    return RunFolder(loaded, folder, as_frames(frames), progress or shown_progress())


def open_run(path: str | PathLike[str]) -> Run:
    """Open the results of a run of any version.

    A run whose input, settings or code have changed since is opened with a warning; `Run.out_of_date` states why.

    Parameters
    ----------
    path : path
        Folder of the run, or results.h5.

    Raises
    ------
    InputError
        If there are no results; it is a FileNotFoundError as well.

    Examples
    --------
    >>> rodsight.open("runs/shear")
    <rodsight.Run 'my_test': 40 grains, 5 frames>
    >>> rodsight.open("runs/nothing")
    Traceback (most recent call last):
    rodsight.process.errors.MissingFileError: runs/nothing: there are no results
    """
    file = Path(path) / RESULTS if Path(path).is_dir() else Path(path)
    if not file.is_file():
        raise MissingFileError(file, "", "there are no results")
    found = Run(file)
    if found.out_of_date:
        warnings.warn(f"{file} is out of date: {'; '.join(found.out_of_date)}; run the experiment again", stacklevel=2)
    return found
