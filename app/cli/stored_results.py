"""Stored results that a command reads: the file of a given path, its experiment and its truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ..process.errors import InputError

if TYPE_CHECKING:
    from rich.console import Console

    from ..results.results import Results
    from ..run_folder import Run


def results_file(path: Path) -> Path:
    """Return results.h5 of a run's folder, or the file itself."""
    from ..run_folder import RESULTS

    return _file_of_run(path, RESULTS)


def recording_file(path: Path) -> Path:
    """Return recording.rrd of a run's folder, or the file itself."""
    from ..run_folder import RECORDING

    return _file_of_run(path, RECORDING)


def _file_of_run(path: Path, name: str) -> Path:
    """Return a file of a run's folder, or the file itself. Raises InputError for the folder of an experiment."""
    if not path.is_dir():
        return path
    if (path / "experiment.toml").is_file() and not (path / name).is_file():
        run = f"runs/{path.resolve().name}"
        raise InputError(path, "", f"is an experiment: give the folder of its run, such as {run}")
    return path / name


def warn_out_of_date(path: Path, console: Console | None = None) -> None:
    """Print why a run is out of date, by its folder, results.h5 or recording; by default to standard error."""
    from rich.console import Console as RichConsole

    from ..out_of_date import state_of_source
    from .terminal import print_line

    reasons = state_of_source(path)
    if reasons:
        text = f"Out of date: {'; '.join(reasons)}. Run the experiment again."
        print_line(console or RichConsole(stderr=True), text)


def has_experiment(path: Path) -> bool:
    """Whether the experiment of results is at hand. Raises InputError where there are no results."""
    from ..results.hdf5.store import origin_of
    from ..run_folder import find_experiment

    file = results_file(path)
    try:
        find_experiment(file, origin_of(file))
    except InputError:
        if not file.is_file():
            raise
        return False
    return True


def load_run(path: Path) -> tuple[Run, Results]:
    """Load results with the experiment that they belong to. Raises InputError."""
    from ..experiment.experiment import load_experiment
    from ..results.hdf5.store import load_results, origin_of
    from ..run_folder import Run, find_experiment

    file = results_file(path)
    results, origin = load_results(file), origin_of(file)
    return Run(load_experiment(find_experiment(file, origin)), file.parent, origin.frames), results
