"""Commands that compute an experiment's results: run, check, track, solve, record."""

from __future__ import annotations

import json
import math
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from rich.console import Console
from tyro.conf import arg

from ...process.counts import state_count
from ...process.errors import InputError
from ..arguments import (
    AsJson,
    Ensemble,
    ExperimentPath,
    Flag,
    Frames,
    FullFrames,
    KeepOld,
    MaxSize,
    Out,
    ProgressForm,
    Quiet,
    Settings,
    Sweeps,
    Threads,
    refuse_unused,
    worker_count,
)
from ..run_request import Request, byte_count, open_run
from ..terminal import print_line, progress_of

if TYPE_CHECKING:
    from ...run_folder import Run


def run(
    experiment: ExperimentPath,
    /,
    out: Out = None,
    view: Annotated[
        Literal["none", "native", "web"], arg(help="watch while it is solved: in a window, in a browser")
    ] = "none",
    sweeps: Sweeps = None,
    max_size: MaxSize = None,
    full_frames: FullFrames = (),
    ensemble: Ensemble = None,
    frames: Frames = None,
    settings: Settings = (),
    workers: Threads = None,
    progress: ProgressForm = "bars",
    follow: Annotated[
        Flag, arg(help="wait for further photographs and solve them as they arrive, then run as usual")
    ] = False,
    idle: Annotated[
        float | None, arg(metavar="SECONDS", help="end after this time without a photograph [s]; for --follow")
    ] = None,
    keep_old: KeepOld = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> int:
    """Compute contact forces and a recording from photographs: the main command.

    Example: rodsight run sample_data/shear --view web
    """
    from ...run_folder import SUMMARY
    from ..watching import watching
    from .view_commands import show

    request = Request(
        experiment, settings, quiet, out, frames, max_size, full_frames, progress, keep_old, print_table=not as_json
    )
    request = request.with_setting("solver.ensemble_size", ensemble).with_setting("recording.sweeps", sweeps)
    threads = None if workers is None else worker_count(workers)
    request = request.with_setting("solver.workers", threads).with_setting("tracking.workers", threads)
    console = request.console
    began = time.perf_counter()
    refuse_unused("run", {} if follow else {"--idle": idle}, "without --follow")
    if follow:
        _follow(request, idle)
    with open_run(request) as plain:
        plain.check_photographs()
        from ... import pipeline  # after that, since all libraries are loaded here
        from ...run_truth import load_truth
        from ..summary_table import print_summary

        with watching(plain, view, console) as (run, watch):
            results = pipeline.solve(run)
            truth = load_truth(run, results)
            recording = pipeline.record(run, results, truth)
            summary = pipeline.conclude(run, results, truth, began)
    if as_json:
        stored = json.loads(run.file(SUMMARY).read_text(encoding="utf-8"))  # with null for unknown numbers
        print(json.dumps({"folder": str(run.folder), "notes": run.notes, **stored}, indent=1))
        return 0
    print_summary(console, summary)
    console.print(f"Results in {run.folder}/ after {summary['timings']['total']:.1f} s.", highlight=False)
    _print_notes(run, console)
    watched = watch is not None and watch.started  # the viewer is already open
    return show(recording, "none" if watched else view, console)


def check(
    experiment: ExperimentPath,
    /,
    budget: Annotated[
        bool, arg(help="predict the accuracy of the forces from the first photographs or their tracks")
    ] = True,
    settings: Settings = (),
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> int:
    """Validate an experiment, and predict the accuracy of its forces from its first photographs.

    Example: rodsight check sample_data/shear
    """
    from ...input_check import check_input

    request = Request(experiment, settings, quiet)
    with open_run(request, writes=False) as run:
        report = check_input(run, predict=budget and (as_json or not quiet))
    if as_json:
        print(json.dumps(report.as_plain(), indent=1))
        return 0
    console = request.console
    for verdict in report.prediction[:1]:
        print_line(console, verdict)
    console.print(f"{report.name}: the input is valid: {report.content()}.", highlight=False)
    for sentence in (*report.notes, *report.unused, *report.prediction[1:]):
        print_line(console, sentence)
    return 0


def track(
    experiment: ExperimentPath,
    /,
    out: Out = None,
    frames: Frames = None,
    report: Annotated[Flag, arg(help="write DIR/tracking_report.html on the quality of tracking")] = False,
    settings: Settings = (),
    keep_old: KeepOld = False,
    quiet: Quiet = False,
) -> int:
    """Track the grains through the photographs only.

    Example: rodsight track sample_data/shear --report
    """
    from ... import pipeline
    from ...run_folder import TRACKS

    request = Request(experiment, settings, quiet, out, frames, keep_old=keep_old)
    with open_run(request) as run:
        if report and run.experiment.config.photographs is None:
            raise InputError(run.experiment.file, "--report", "needs photographs, but these tracks come from a table")
        tracks, walls = pipeline.track(run)
        page = pipeline.report_tracking(run, tracks, walls) if report else None
    console = request.console
    renewed = (
        f", {state_count(tracks.renewal_count, 'damaged grain')} with a new reference" if tracks.renewal_count else ""
    )
    where = run.file(TRACKS) if run.experiment.config.photographs else "the experiment's own tables"
    console.print(
        f"{state_count(tracks.grain_count, 'grain')} over {state_count(tracks.frame_count, 'frame')}, "
        f"{tracks.describe_missing()}{renewed}; "
        f"tracks in {where}.",
        highlight=False,
    )
    _print_notes(run, console)
    if page is not None:
        console.print(f"Report: {page}", highlight=False)
    return 0


def solve(
    experiment: ExperimentPath,
    /,
    out: Out = None,
    sweeps: Sweeps = None,
    ensemble: Ensemble = None,
    frames: Frames = None,
    settings: Settings = (),
    keep_old: KeepOld = False,
    quiet: Quiet = False,
) -> int:
    """Find contacts and forces, tracking first if needed.

    Example: rodsight solve sample_data/shear --set material.friction=0.3
    """
    from ... import pipeline
    from ...run_truth import load_truth
    from ..summary_table import print_summary

    request = Request(experiment, settings, quiet, out, frames, keep_old=keep_old)
    request = request.with_setting("solver.ensemble_size", ensemble).with_setting("recording.sweeps", sweeps)
    began = time.perf_counter()
    with open_run(request) as run:
        results = pipeline.solve(run)
        truth = load_truth(run, results)
        summary = pipeline.conclude(run, results, truth, began)
    console = request.console
    print_summary(console, summary)
    _print_notes(run, console)
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
    keep_old: KeepOld = False,
    quiet: Quiet = False,
) -> int:
    """Write the recording, solving first if needed; of results.h5 alone one without photographs.

    Example: rodsight record sample_data/shear --sweeps all
    """
    from ... import pipeline
    from ...run_truth import load_truth
    from .view_commands import show

    request = Request(experiment, settings, quiet, out, frames, max_size, full_frames, keep_old=keep_old)
    if _is_results(experiment):
        return _record_alone(request, sweeps)
    request = request.with_setting("recording.sweeps", sweeps)
    began = time.perf_counter()
    with open_run(request) as run:
        pipeline.keep_finished_frames(run)
        results = pipeline.solve(run)
        truth = load_truth(run, results)
        if run.timings.seconds:  # the results are new, and so is their summary
            pipeline.conclude(run, results, truth, began)
        recording = pipeline.record(run, results, truth)
    console = request.console
    _print_notes(run, console)
    return show(recording, "none", console)


def _is_results(path: Path) -> bool:
    """Whether a path is results.h5, or a folder with it and without an experiment."""
    from ...experiment.experiment import CONFIG_NAME
    from ...run_folder import RESULTS

    return path.suffix == ".h5" or ((path / RESULTS).is_file() and not (path / CONFIG_NAME).is_file())


def _record_alone(request: Request, sweeps: str | None) -> int:
    """Write the recording of results without their experiment, and so without photographs. Exit status 0."""
    from ...process.lock import hold_folder
    from ...recording.files.finished_run import RecordingOptions, write_recording
    from ...results.hdf5.store import load_results
    from ...run_folder import RECORDING
    from ..stored_results import results_file
    from .view_commands import show

    given = {"--set": request.settings, "--frames": request.frames, "--full-frames": request.full_frames}
    for option, value in given.items():
        if value:
            raise InputError("record", option, "needs the experiment, not its results alone")
    file = results_file(request.experiment)
    results = load_results(file)
    target = (file.parent if request.out is None else request.out) / RECORDING
    if request.out is None and target.exists():
        raise InputError(target, "", "is there already, perhaps with photographs: choose another folder with --out")
    notes: list[str] = []
    with progress_of(request.quiet) as progress, hold_folder(target.parent, notes.append):
        written = write_recording(
            results, target, progress=lambda done, total: progress("recording", done, total),
            options=RecordingOptions(sweeps or "log", byte_count(request.max_size)),
        )  # fmt: skip
    for note in (*notes, *written.notes):
        print_line(request.console, note)
    return show(target, "none", request.console)


def _follow(request: Request, idle: float | None) -> None:
    """Solve photographs as they arrive, reporting alarms at once."""
    from ...following.follow import follow

    if request.frames is not None:
        raise InputError("--frames", request.frames, "cannot be used with --follow, which solves every photograph")
    if idle is not None and not (math.isfinite(idle) and idle > 0.0):
        raise InputError("--idle", str(idle), "is not a positive number of seconds")

    def alarm(frame: int, text: str) -> None:
        if request.progress == "lines":
            print(json.dumps({"alarm": text, "frame": frame}), file=sys.stderr, flush=True)
        else:
            print_line(request.console, f"\a{f'Frame {frame}: {text}'}")

    with open_run(request) as run:
        for _ in follow(
            run, request.settings, idle=idle, alarm=alarm, report=lambda text: print_line(request.console, text)
        ):
            pass


def _print_notes(run: Run, console: Console) -> None:
    for note in run.notes:
        print_line(console, note)
