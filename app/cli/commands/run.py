"""Commands that make an experiment's results: run, check, track, solve, record."""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro
from rich.console import Console

from ...errors import InputError
from ..arguments import (
    Ensemble,
    ExperimentPath,
    Frames,
    FullFrames,
    MaxSize,
    Out,
    ProgressForm,
    Quiet,
    Settings,
    Sweeps,
    parse_frames,
)
from ..terminal import Form, progress_of, tell

if TYPE_CHECKING:
    from ...run_folder import Run
    from ...tracks import Tracks, WallTracks


@dataclass(frozen=True, slots=True)
class Request:
    """The arguments that commands on an experiment share, as the user gave them."""

    experiment: Path
    settings: tuple[str, ...] = ()
    quiet: bool = False
    out: Path | None = None
    frames: str | None = None
    max_size: float | None = None  # [MB] of the recording
    full_frames: tuple[int, ...] = ()
    progress: Form = "bars"

    @property
    def console(self) -> Console:
        return Console(quiet=self.quiet)

    def laid_over(self, key: str, value: str | int | None) -> Request:
        """The same with one more setting, where a value was given."""
        return self if value is None else replace(self, settings=(*self.settings, f"{key}={json.dumps(value)}"))


def run(
    experiment: ExperimentPath,
    /,
    out: Out = None,
    view: Annotated[
        Literal["none", "native", "web"], tyro.conf.arg(help="watch while it is solved: in a window, in a browser")
    ] = "none",
    sweeps: Sweeps = None,
    max_size: MaxSize = None,
    full_frames: FullFrames = (),
    ensemble: Ensemble = None,
    frames: Frames = None,
    settings: Settings = (),
    progress: ProgressForm = "bars",
    follow: Annotated[
        bool,
        tyro.conf.FlagCreatePairsOff,
        tyro.conf.arg(help="wait for further photographs and solve them as they come, then run as ever"),
    ] = False,
    idle: Annotated[
        float | None,
        tyro.conf.arg(metavar="SECONDS", help="end when no photograph has come for so long [s]; with --follow"),
    ] = None,
    quiet: Quiet = False,
) -> int:
    """Photographs to contact forces and a recording: the main job.

    Example: rodsight run sample_data/shear --view web
    """
    from ... import pipeline
    from ...run_truth import load_truth
    from ..summary_table import print_summary
    from ..watching import watching
    from .look import show

    request = Request(experiment, settings, quiet, out, frames, max_size, full_frames, progress)
    request = request.laid_over("solver.ensemble_size", ensemble).laid_over("recording.sweeps", sweeps)
    console = request.console
    began = time.perf_counter()
    if follow:
        _follow(request, idle)
    with open_run(request) as plain, watching(plain, view, console) as (run, watch):
        results = pipeline.solve(run)
        truth = load_truth(run, results)
        recording = pipeline.record(run, results, truth)
        summary = pipeline.conclude(run, results, truth, began)
    print_summary(console, summary)
    console.print(f"Results in {run.folder}/ after {summary['timings']['total']:.1f} s.", highlight=False)
    _tell_notes(run, console)
    watched = watch is not None and watch.started  # the viewer is open already
    return show(recording, "none" if watched else view, console)


def check(
    experiment: ExperimentPath,
    /,
    budget: Annotated[
        bool, tyro.conf.arg(help="say what the first photographs, or their tracks, promise of the forces")
    ] = True,
    settings: Settings = (),
    quiet: Quiet = False,
) -> int:
    """Validate an experiment, and say from its first three photographs or their tracks what to expect of the forces.

    Example: rodsight check sample_data/shear
    """
    from ... import pipeline
    from ...promise import describe_photographs, describe_promise, glimpse

    request = Request(experiment, settings, quiet)
    with open_run(request, writes=False) as run:
        tracks, walls = pipeline.check(run)
        seen, sentences = None, []
        if budget and not quiet:  # nobody would read it
            seen = (tracks, walls) if tracks is not None else glimpse(run.experiment, run.progress, run.notes.append)
            sentences = [] if tracks is not None else describe_photographs(run.experiment)
            sentences += describe_promise(*seen)[0]
    config = run.experiment.config
    if tracks is not None:
        what = f"{tracks.grain_count} grains tracked over {tracks.frame_count} frames"
    else:
        what = f"{len(run.experiment.photographs())} photographs"
        what += f", {seen[0].grain_count} grains in the first" if seen is not None else ""
    what += f", {_bounds(tracks, walls)}"
    console = request.console
    console.print(f"{config.name}: the input is good: {what}.", highlight=False)
    _tell_notes(run, console)
    for sentence in sentences:
        tell(console, sentence)
    return 0


def _bounds(tracks: Tracks | None, walls: WallTracks | None) -> str:
    """What bounds the packing, in a phrase."""
    if walls is None:
        return "no walls: it can be tracked but not solved"
    told = [f"{walls.count} walls"] if walls.count else []
    if walls.cell is not None:
        told.append("in a periodic cell")
    if tracks is not None and tracks.boundary is not None:
        told.append(f"{int(tracks.boundary.sum())} of them the boundary")
    return ", ".join(told) or "bounded by grains"


def track(
    experiment: ExperimentPath,
    /,
    out: Out = None,
    frames: Frames = None,
    report: Annotated[
        bool, tyro.conf.FlagCreatePairsOff, tyro.conf.arg(help="write DIR/tracking_report.html: how well it went")
    ] = False,
    settings: Settings = (),
    quiet: Quiet = False,
) -> int:
    """Follow the grains through the photographs, no more.

    Example: rodsight track sample_data/shear --report
    """
    from ... import pipeline
    from ...run_folder import TRACKS

    request = Request(experiment, settings, quiet, out, frames)
    with open_run(request) as run:
        if report and run.experiment.config.photographs is None:
            raise InputError(run.experiment.file, "--report", "shows photographs, and these tracks come from a table")
        tracks, walls = pipeline.track(run)
        page = pipeline.report_tracking(run, tracks, walls) if report else None
    console = request.console
    renewed = f", {tracks.renewal_count} damaged grains with a new reference" if tracks.renewal_count else ""
    where = run.file(TRACKS) if run.experiment.config.photographs else "the experiment's own tables"
    console.print(
        f"{tracks.grain_count} grains over {tracks.frame_count} frames, {tracks.describe_missing()}{renewed}; "
        f"tracks in {where}.",
        highlight=False,
    )
    _tell_notes(run, console)
    if page is not None:
        console.print(f"How well it went: {page}", highlight=False)
    return 0


def solve(
    experiment: ExperimentPath,
    /,
    out: Out = None,
    sweeps: Sweeps = None,
    ensemble: Ensemble = None,
    frames: Frames = None,
    settings: Settings = (),
    quiet: Quiet = False,
) -> int:
    """Find contacts and forces, tracking first where that has not been done.

    Example: rodsight solve sample_data/shear --set material.friction=0.3
    """
    from ... import pipeline
    from ...run_truth import load_truth
    from ..summary_table import print_summary

    request = Request(experiment, settings, quiet, out, frames)
    request = request.laid_over("solver.ensemble_size", ensemble).laid_over("recording.sweeps", sweeps)
    began = time.perf_counter()
    with open_run(request) as run:
        results = pipeline.solve(run)
        truth = load_truth(run, results)
        summary = pipeline.conclude(run, results, truth, began)
    console = request.console
    print_summary(console, summary)
    _tell_notes(run, console)
    return 0


def record(
    experiment: ExperimentPath,
    /,
    out: Out = None,
    sweeps: Sweeps = None,
    max_size: MaxSize = None,
    full_frames: FullFrames = (),
    frames: Frames = None,
    settings: Settings = (),
    quiet: Quiet = False,
) -> int:
    """Write the recording, solving first where that has not been done.

    Example: rodsight record sample_data/shear --sweeps all
    """
    from ... import pipeline
    from ...run_truth import load_truth
    from .look import show

    request = Request(experiment, settings, quiet, out, frames, max_size, full_frames)
    request = request.laid_over("recording.sweeps", sweeps)
    with open_run(request) as run:
        results = pipeline.solve(run)
        recording = pipeline.record(run, results, load_truth(run, results))
    console = request.console
    _tell_notes(run, console)
    return show(recording, "none", console)


@contextmanager
def open_run(request: Request, *, writes: bool = True) -> Iterator[Run]:
    """The run that was asked for, with progress shown while it is open; its folder is its own if it writes there."""
    from ...experiment.config.unused_keys import refuse_unused_keys
    from ...experiment.experiment import load_experiment
    from ...run_folder import Run, owned

    experiment = load_experiment(request.experiment, request.settings)
    refuse_unused_keys(experiment.config, experiment.file)
    folder = request.out if request.out is not None else Path("runs") / experiment.name
    with progress_of(request.quiet, request.progress) as progress:
        run = Run(
            experiment, folder, parse_frames(request.frames), progress, max_size=_bytes(request.max_size),
            full_frames=request.full_frames,
        )  # fmt: skip
        if not writes:
            yield run
            return
        with owned(run):
            yield run


def _follow(request: Request, idle: float | None) -> None:
    """Solve photographs as they come, telling what a person should know at once."""
    from ...following.follow import follow

    if request.frames is not None:
        raise InputError("--frames", request.frames, "does not go with --follow, which takes every photograph")
    if idle is not None and not (math.isfinite(idle) and idle > 0.0):
        raise InputError("--idle", str(idle), "is not a positive number of seconds")

    def alarm(frame: int, text: str) -> None:
        if request.progress == "lines":
            print(json.dumps({"alarm": text, "frame": frame}), file=sys.stderr, flush=True)
        else:
            tell(request.console, f"\a{f'Frame {frame}: {text}'}")

    with open_run(request) as run:
        follow(run, request.settings, idle=idle, alarm=alarm, say=lambda text: tell(request.console, text))


def _bytes(megabytes: float | None) -> int | None:
    if megabytes is None:
        return None
    if not (math.isfinite(megabytes) and megabytes > 0.0):
        raise InputError("--max-size", str(megabytes), "is not a positive number of megabytes")
    return int(1e6 * megabytes)


def _tell_notes(run: Run, console: Console) -> None:
    for note in run.notes:
        tell(console, note)
