"""Live display of a run: finished frames are written to a live recording."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from rich.console import Console

from ..run_folder import Run
from .terminal import print_line

if TYPE_CHECKING:
    from ..recording.files.live_process import LiveProcess

LIVE = "recording-live.rrd"  # the frames solved so far; replaced by the full recording


@contextmanager
def watching(run: Run, viewer: str, console: Console) -> Iterator[tuple[Run, LiveProcess | None]]:
    """Yield the run with an observer that writes a live recording, or unchanged for the viewer `none`.

    The live recording is removed after the full one was written; it is kept if the run ends early.
    """
    if viewer == "none":
        yield run, None
        return

    watch = _watch(run, viewer, partial(print_line, console))
    try:
        yield replace(run, watch=watch), watch
        watch.close(complete=True)
        watch.path.unlink(missing_ok=True)
    except BaseException:
        watch.close(complete=False)
        if watch.started and watch.path.is_file():
            print_line(console, f"The frames solved so far: rodsight view {watch.path}")
        raise


def _watch(run: Run, viewer: str, report: Callable[[str], None]) -> LiveProcess:
    from ..experiment.jpeg_photographs import JpegPhotographs
    from ..experiment.scaling import make_scale
    from ..recording.files.live_process import LiveProcess

    config = run.experiment.config
    photograph = scale = None
    if config.photographs is not None:
        photographs = run.experiment.photographs()
        photograph = JpegPhotographs(photographs, run.frames).__getitem__
        scale = make_scale(config.photographs, photographs.shape[0])
    sweeps = "none" if config.recording.sweeps == "none" else "log"
    return LiveProcess(run.file(LIVE), report, viewer=viewer, photograph=photograph, scale=scale, sweeps=sweeps)
