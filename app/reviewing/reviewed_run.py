"""The results under review with the files that belong to them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ..experiment.experiment import CONFIG_NAME, Experiment, load_experiment
from ..process.errors import InputError
from ..results.hdf5.store import load_results, origin_of
from ..results.results import Results
from ..run_folder import RESULTS, find_experiment, refuse_foreign_folder
from ..verdicts.decisions import BodyNames
from ..verdicts.log import VERDICTS, VerdictLog


@dataclass(frozen=True, slots=True)
class ReviewedRun:
    """Results of a run, the experiment that they were computed from, and the log of verdicts beside them."""

    file: Path
    results: Results
    experiment: Experiment
    first_frame: int  # the photograph of the experiment that frame 0 of the run shows

    @property
    def folder(self) -> Path:
        return self.file.parent

    @property
    def log(self) -> VerdictLog:
        return VerdictLog(self.folder / VERDICTS)

    @property
    def bodies(self) -> BodyNames:
        return BodyNames.of(self.results.tracks, self.results.walls)

    @property
    def threshold(self) -> float | None:
        """The gap threshold [m] of the experiment; None: six standard deviations of a position."""
        return self.experiment.config.contacts.threshold

    def photographs(self) -> range:
        """Numbers of the photographs that the run covers."""
        return range(self.first_frame, self.first_frame + len(self.results.frames))


def find_reviewed_results(path: Path) -> Path:
    """Find results.h5 of an experiment (its default folder), of a run's folder, or the file itself.

    Raises
    ------
    InputError
        There are no results, or they are those of another experiment.
    """
    if path.is_dir() and not (path / RESULTS).exists() and (path / CONFIG_NAME).exists():
        experiment = load_experiment(path)
        path = Path("runs") / experiment.name
        refuse_foreign_folder(path, experiment)
    file = path / RESULTS if path.is_dir() else path
    if not file.exists():
        raise InputError(file, "", "there are no results: run `rodsight run` on the experiment first")
    return file


def open_reviewed_run(path: Path) -> ReviewedRun:
    """Open the results of an experiment (its default folder), of a run's folder, or results.h5 itself."""
    file = find_reviewed_results(path)
    results, origin = load_results(file), origin_of(file)
    if origin.frames.step != 1:
        problem = f"hold one photograph in {origin.frames.step}: contacts are judged on runs of consecutive ones"
        raise InputError(file, f"frames {origin.frames}", problem)
    return ReviewedRun(file, results, load_experiment(find_experiment(file, origin)), origin.frames.start)
