"""Watching a run while it is solved: the run tells what it has finished, a live recording shows it."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from app.pipeline import Run
from app.results import Results
from app.scaling import make_scale
from solver.frame_forces import FrameForces
from solver.frame_statistics import FrameStatistics

LIVE = "recording-live.rrd"  # what has been solved so far; the full recording takes its place


class LiveWatch:
    """Hands a run's frames to a live recording, and says how to look at it once it is there."""

    def __init__(self, run: Run, viewer: str, console: Console) -> None:
        from app.recording.live import LiveRecording

        section = run.experiment.config.photographs
        photographs = run.experiment.photographs() if section is not None else None

        def photograph(frame: int) -> NDArray[np.uint8] | None:
            assert photographs is not None
            return np.clip(np.rint(photographs[run.frames[0] + frame]), 0, 255).astype(np.uint8)

        self.started = False
        self._console = console
        self.recording = LiveRecording(
            run.file(LIVE),
            viewer,
            photograph=photograph if photographs is not None else None,
            scale=make_scale(section, photographs.shape[0]) if section and photographs is not None else None,
            sweeps="none" if run.experiment.config.recording.sweeps == "none" else "log",
        )

    def start(self, run: Results) -> None:
        self.recording.start(run)
        self.started = True
        if self.recording.hint:
            self._console.print(self.recording.hint, markup=False, highlight=False, soft_wrap=True)

    def frame(self, forces: FrameForces, statistics: FrameStatistics) -> None:
        self.recording.frame(forces, statistics)


@contextmanager
def _terminated_like_interrupted() -> Iterator[None]:
    """Let a termination from outside end the run as an interrupt does: else the page's server would live on."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    former = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, former)


@contextmanager
def watching(run: Run, viewer: str, console: Console) -> Iterator[tuple[Run, LiveWatch | None]]:
    """Give the run with somebody who watches it, or as it is with the viewer `none`.

    The live recording is removed at the end, when the full one is there. If the run ends early, it stays.
    """
    if viewer == "none":
        yield run, None
        return
    watch = LiveWatch(run, viewer, console)
    try:
        with _terminated_like_interrupted():
            yield replace(run, watch=watch), watch
        watch.recording.finish()
        watch.recording.close()
        watch.recording.path.unlink(missing_ok=True)
    except BaseException:
        watch.recording.finish(("The run ended before its last frame.",))
        watch.recording.close()
        if watch.started:
            console.print(
                f"What was solved so far: rodsight view {watch.recording.path}",
                markup=False,
                highlight=False,
                soft_wrap=True,
            )
        raise
    for note in watch.recording.notes:
        console.print(note, markup=False, highlight=False, soft_wrap=True)
