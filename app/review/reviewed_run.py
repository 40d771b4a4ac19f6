"""The results under review, with what belongs to them on disk."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ..errors import InputError
from ..experiment.experiment import CONFIG_NAME, Experiment, load_experiment
from ..results.hdf5.store import load_results, origin_of
from ..results.results import Results
from ..run_folder import RESULTS, find_experiment
from ..verdicts.decisions import Bodies
from ..verdicts.log import VERDICTS, VerdictLog


@dataclass(frozen=True, slots=True)
class Reviewed:
    """Results on disk with what belongs to them."""

    file: Path
    results: Results
    experiment: Experiment
    first_frame: int  # of the experiment

    @property
    def log(self) -> VerdictLog:
        return VerdictLog(self.file.parent / VERDICTS)

    @property
    def bodies(self) -> Bodies:
        return Bodies.of(self.results.tracks, self.results.walls)

    @property
    def threshold(self) -> float | None:
        """The gap threshold [m] that the experiment names; None: six standard deviations of a position."""
        return self.experiment.config.contacts.threshold


def open_reviewed(path: Path) -> Reviewed:
    """Open the results of an experiment (its default folder), of a run's folder, or results.h5 itself."""
    if path.is_dir() and not (path / RESULTS).exists() and (path / CONFIG_NAME).exists():
        path = Path("runs") / load_experiment(path).name
    file = path / RESULTS if path.is_dir() else path
    if not file.exists():
        raise InputError(file, "", "there are no results: run `rodsight run` on the experiment first")
    results, origin = load_results(file), origin_of(file)
    return Reviewed(file, results, load_experiment(find_experiment(file, origin)), origin.frames[0])
