"""What the first photographs promise of the forces, before anything is computed: for `check` and for the workbench."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from .experiment.experiment import Experiment, GrainGuess, read_grain_guess
from .inference.data_budget import LOOKED_AT, UNPROMISED, measure_budget
from .progress import Progress, silent
from .tracks import Tracks, WallTracks

if TYPE_CHECKING:
    from .tracking.picture_quality import PictureQuality


def glimpse(
    experiment: Experiment, progress: Progress = silent, tell: Callable[[str], None] = lambda _: None
) -> tuple[Tracks, WallTracks | None]:
    """Tracks of the first photographs, of which nothing is kept. Raises InputError where no grain is found."""
    from .tracking.stage import track_first  # not where rods are tracked already

    return track_first(experiment, LOOKED_AT, progress, tell)


def measure_photographs(experiment: Experiment, rods: GrainGuess | None) -> PictureQuality:
    """What the photographs are good for; rods [px]: where some are in the first, None: not known."""
    from .tracking.picture_quality import measure_pictures

    centre = None if rods is None else np.stack([rods.x, rods.y], axis=1)
    section = experiment.config.photographs
    return measure_pictures(
        experiment.photographs(), centre, None if rods is None else rods.radius,
        patterned=section is None or section.follow != "outline",
    )  # fmt: skip


def describe_photographs(experiment: Experiment) -> list[str]:
    """Light, noise and pattern of the photographs in a few sentences. Raises InputError."""
    measured = measure_photographs(experiment, read_grain_guess(experiment))
    return [*measured.facts(), *measured.faults()]


def describe_promise(tracks: Tracks, walls: WallTracks | None) -> tuple[list[str], bool]:
    """What to expect of the forces by the first frames of these tracks, in a few sentences; whether that is good."""
    promised = measure_budget(tracks, walls)
    return ([UNPROMISED], False) if promised is None else (promised.describe(), promised.suffices)
