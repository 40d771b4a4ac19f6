"""What the first photographs promise of the forces, before anything is computed: for `check` and for the workbench."""

from __future__ import annotations

from collections.abc import Callable

from .experiment.experiment import Experiment
from .inference.data_budget import LOOKED_AT, UNPROMISED, measure_budget
from .progress import Progress, silent
from .tracks import Tracks, WallTracks


def glimpse(
    experiment: Experiment, progress: Progress = silent, tell: Callable[[str], None] = lambda _: None
) -> tuple[Tracks, WallTracks | None]:
    """Tracks of the first photographs, of which nothing is kept. Raises InputError where no grain is found."""
    from .tracking.stage import track_first  # not where rods are tracked already

    return track_first(experiment, LOOKED_AT, progress, tell)


def describe_promise(tracks: Tracks, walls: WallTracks | None) -> tuple[list[str], bool]:
    """What to expect of the forces by the first frames of these tracks, in a few sentences; whether that is good."""
    promised = measure_budget(tracks, walls)
    return ([UNPROMISED], False) if promised is None else (promised.describe(), promised.suffices)
