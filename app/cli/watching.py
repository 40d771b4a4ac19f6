"""Watching a run while it is solved: the run tells what it has finished, a live recording shows it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from rich.console import Console

from ..experiment.scaling import make_scale
from ..experiment.shown import ShownPhotographs
from ..run_folder import Run
from .terminal import tell

if TYPE_CHECKING:
    from ..recording.files.live_process import LiveProcess

LIVE = "recording-live.rrd"  # what has been solved so far; the full recording takes its place


@contextmanager
def watching(run: Run, viewer: str, console: Console) -> Iterator[tuple[Run, LiveProcess | None]]:
    """Give the run with somebody who watches it, or as it is with the viewer `none`.

    The live recording is removed at the end, when the full one is there. If the run ends early, it stays.
    """
    if viewer == "none":
        yield run, None
        return

    watch = _watch(run, viewer, partial(tell, console))
    try:
        yield replace(run, watch=watch), watch
        watch.close(whole=True)
        watch.path.unlink(missing_ok=True)
    except BaseException:
        watch.close(whole=False)
        if watch.started and watch.path.is_file():
            tell(console, f"What was solved so far: rodsight view {watch.path}")
        raise


def _watch(run: Run, viewer: str, say: Callable[[str], None]) -> LiveProcess:
    from ..recording.files.live_process import LiveProcess

    config = run.experiment.config
    photograph = scale = None
    if config.photographs is not None:
        photographs = run.experiment.photographs()
        photograph = ShownPhotographs(photographs, run.frames[0]).__getitem__
        scale = make_scale(config.photographs, photographs.shape[0])
    sweeps = "none" if config.recording.sweeps == "none" else "log"
    return LiveProcess(run.file(LIVE), say, viewer=viewer, photograph=photograph, scale=scale, sweeps=sweeps)
