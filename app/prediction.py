"""Predict the accuracy of the forces from the first photographs, for `check` and for the workbench."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from .experiment.experiment import Experiment, GrainGuess, read_grain_guess
from .inference.predicted_accuracy import EXAMINED_PHOTOGRAPHS, NOT_PREDICTED, measure_data_quality
from .process.progress import Progress, no_progress
from .tracks import Tracks, WallTracks

if TYPE_CHECKING:
    from .tracking.picture_quality import PictureQuality


def track_first_photographs(
    experiment: Experiment, progress: Progress = no_progress, notify: Callable[[str], None] = lambda _: None
) -> tuple[Tracks, WallTracks | None]:
    """Track the first photographs without storing the result. Raises InputError where no grain is found."""
    from .tracking.stage import track_first  # imported late: given tracks do not need it

    return track_first(experiment, EXAMINED_PHOTOGRAPHS, progress, notify)


def measure_photographs(experiment: Experiment, rods: GrainGuess | None) -> PictureQuality:
    """Measure light, noise and pattern of the photographs; rods: some of the first photograph [px], None: unknown."""
    from .tracking.picture_quality import measure_pictures

    centre = None if rods is None else np.stack([rods.x, rods.y], axis=1)
    section = experiment.config.photographs
    return measure_pictures(
        experiment.photographs(), centre, None if rods is None else rods.radius,
        patterned=section is None or section.follow != "outline",
    )  # fmt: skip


def describe_photographs(experiment: Experiment) -> list[str]:
    """Describe light, noise and pattern of the photographs in a few sentences. Raises InputError."""
    measured = measure_photographs(experiment, read_grain_guess(experiment))
    return [*measured.facts(), *measured.faults()]


def describe_prediction(tracks: Tracks, walls: WallTracks | None) -> tuple[list[str], bool]:
    """Describe the expected accuracy of the forces from the first frames of tracks, and whether the data suffice."""
    quality = measure_data_quality(tracks, walls)
    return ([NOT_PREDICTED], False) if quality is None else (quality.describe(), quality.suffices)
