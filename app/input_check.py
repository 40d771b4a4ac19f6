"""The check of an experiment's input without computing, with a prediction of the accuracy of its forces."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from typing import Any

from . import pipeline
from .compilation.ahead import SOLVER_KERNELS
from .inference.diagnosis.trial import PREDICTED_PHOTOGRAPHS
from .prediction import Prediction, describe_photographs, predict_accuracy
from .process.counts import state_count
from .results.finding import Finding
from .run_folder import Run
from .tracks import Tracks, WallTracks

UNKNOWN = float("nan")


@dataclass(frozen=True, slots=True)
class InputReport:
    """Valid input in numbers and sentences."""

    name: str
    frames: int  # photographs, or frames of the tracks
    photographs: bool  # whether photographs are tracked, rather than given tracks used
    grains: int | None  # None: not detected yet
    walls: tuple[str, ...]
    boundaries: str  # in a phrase
    expected_correlation: float = UNKNOWN  # of the normal forces; NaN: not predicted
    expected_low: float = UNKNOWN  # with `expected_high`, an interval with a coverage of two thirds
    expected_high: float = UNKNOWN
    sufficient: bool | None = None  # whether r >= .9 is expected and no cause is named; None: not predicted
    notes: tuple[str, ...] = field(default_factory=tuple)  # remarks on the input
    diagnosis: tuple[Finding, ...] = field(default_factory=tuple)  # causes of what contradicts the forces
    tracked: int | None = None  # grains with a pose in at least one frame of given tracks; None: photographs
    unused: tuple[str, ...] = field(default_factory=tuple)  # columns of tables that are not used
    prediction: tuple[str, ...] = field(default_factory=tuple)  # the verdict, then sentences on the data

    def content(self) -> str:
        """Describe the content of the experiment in a phrase."""
        if not self.photographs:
            part = "" if self.tracked in (None, self.grains) else f"{self.tracked} of "
            grains = f"{part}{state_count(self.grains or 0, 'grain')}"
            return f"{grains} tracked over {state_count(self.frames, 'frame')}, {self.boundaries}"
        detected = "" if self.grains is None else f", {state_count(self.grains, 'grain')} in the first"
        return f"{state_count(self.frames, 'photograph')}{detected}, {self.boundaries}"

    def as_plain(self) -> dict[str, Any]:
        """Return plain values for JSON; None where a number is unknown."""
        values = asdict(self)
        return {key: None if isinstance(each, float) and math.isnan(each) else each for key, each in values.items()}


def check_input(run: Run, *, predict: bool = True) -> InputReport:
    """Validate the input of a run, and predict the accuracy of its forces.

    Parameters
    ----------
    run : Run
        Its folder is not used.
    predict : bool
        Track the first photographs, or use the first frames of given tracks, and solve them on a trial basis.

    Raises
    ------
    InputError
        The input is invalid.
    """
    with run.compiling():
        return _check_input(run, predict)


def _check_input(run: Run, predict: bool) -> InputReport:
    tracks, walls = pipeline.check(run)
    photographed = run.experiment.config.photographs is not None
    count = len(run.experiment.photographs()) if tracks is None else tracks.frame_count
    first, first_walls, found = tracks, walls, Prediction(None, None)
    if first is None:  # rods and walls that run would refuse are refused here
        first, first_walls = pipeline.check_first_photographs(run, PREDICTED_PHOTOGRAPHS if predict else 1)
    sentences: list[str] = []
    if predict:
        run.kernels.wait(SOLVER_KERNELS)
        found = predict_accuracy(run.experiment.config, first, first_walls, run.progress)
        sentences = found.describe() + (describe_photographs(run.experiment) if tracks is None else [])
    unused = tuple(
        f"{file}: columns that are not used: {', '.join(names)}."
        for file, names in run.experiment.inputs.unused_columns.items()
        if names
    )
    return InputReport(
        run.experiment.name, count, photographed, first.grain_count,
        () if walls is None else walls.name, _describe_boundaries(tracks, walls), *found.expected,
        found.good if found.trial is not None else None, tuple(run.notes), found.diagnosis,
        None if tracks is None else int(tracks.present.any(axis=0).sum()), unused, tuple(sentences),
    )  # fmt: skip


def _describe_boundaries(tracks: Tracks | None, walls: WallTracks | None) -> str:
    """Describe the boundaries of the packing in a phrase."""
    if walls is None:
        return "no walls: it can be tracked but not solved"
    parts = [state_count(walls.count, "wall")] if walls.count else []
    if walls.cell is not None:
        parts.append("in a periodic cell")
    if tracks is not None and tracks.boundary is not None:
        parts.append(f"{int(tracks.boundary.sum())} of them the boundary")
    return ", ".join(parts) or "bounded by grains"
