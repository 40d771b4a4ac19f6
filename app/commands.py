"""What each command does with its arguments: a run is made, stages are called, the outcome is told."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from app import pipeline
from app.errors import InputError
from app.experiment import Experiment, load_experiment
from app.progress import Progress, silent
from app.results import Results
from app.store import load_results, read_origin
from app.summary import print_summary, save_summary, summarize
from app.terminal import progress_bars
from app.truth import accuracy, correlations
from app.truth import score as score_frames
from app.watching import watching

WIDE = 120  # columns of a table that goes to a file


@dataclass(frozen=True, slots=True)
class Request:
    """The arguments that stages share, as the user gave them."""

    experiment: Path
    out: Path | None
    frames: str | None
    settings: tuple[str, ...]
    quiet: bool
    console: Console


def run_all(request: Request, view: str) -> int:
    began = time.perf_counter()
    with _run(request) as plain, watching(plain, view, request.console) as (run, watch):
        results = pipeline.solve(run)
        truth = pipeline.load_truth(run, results)
        agreement = score_frames(results, truth) if truth is not None else None
        recording = pipeline.record(run, results, truth)
    seconds = {**run.timings.seconds, "total": time.perf_counter() - began}
    summary = summarize(results, agreement, seconds)
    save_summary(run.file(pipeline.SUMMARY), summary)
    print_summary(request.console, summary)
    request.console.print(f"Results in {run.folder}/ after {seconds['total']:.1f} s.", highlight=False)
    watched = watch is not None and watch.started  # the viewer is open already
    return _show(recording, "none" if watched else view, request.console)


def check(request: Request) -> int:
    with _run(request) as run:
        tracks, walls = pipeline.check(run)
    config = run.experiment.config
    if tracks is not None:
        what = f"{tracks.grain_count} grains tracked over {tracks.frame_count} frames"
    else:
        what = f"{len(run.experiment.photographs())} photographs"
    what += f", {walls.count} walls" if walls is not None else ", no walls: it can be tracked but not solved"
    request.console.print(f"{config.name}: the input is good: {what}.", highlight=False)
    return 0


def track(request: Request) -> int:
    with _run(request) as run:
        tracks, _ = pipeline.track(run)
    lost = int((~tracks.present).sum())
    where = run.file(pipeline.TRACKS) if run.experiment.config.photographs else "the experiment's own tables"
    request.console.print(
        f"{tracks.grain_count} grains over {tracks.frame_count} frames, {lost} poses lost; tracks in {where}.",
        highlight=False,
    )
    return 0


def solve(request: Request) -> int:
    with _run(request) as run:
        results = pipeline.solve(run)
        truth = pipeline.load_truth(run, results)
    agreement = score_frames(results, truth) if truth is not None else None
    summary = summarize(results, agreement, run.timings.seconds)
    save_summary(run.file(pipeline.SUMMARY), summary)
    print_summary(request.console, summary)
    return 0


def record(request: Request) -> int:
    with _run(request) as run:
        results = pipeline.solve(run)
        recording = pipeline.record(run, results, pipeline.load_truth(run, results))
    return _show(recording, "none", request.console)


def view(path: Path, *, web: bool) -> int:
    recording = path / pipeline.RECORDING if path.is_dir() else path
    if not recording.is_file():
        raise InputError(recording, "", "there is no such recording")
    return _show(recording, "web" if web else "native", Console())


def score(path: Path, truth_file: Path | None, *, as_json: bool) -> int:
    file = path / pipeline.RESULTS if path.is_dir() else path
    results = load_results(file)
    origin = read_origin(file)
    assert origin is not None
    run = pipeline.Run(_stored_experiment(Path(origin.experiment)), file.parent, origin.frames)
    truth = pipeline.load_truth(run, results, truth_file)
    if truth is None:
        raise InputError(run.experiment.file, "key truth", "is missing: give --truth FILE")
    agreement = score_frames(results, truth)
    if as_json:
        print(json.dumps(accuracy(agreement), indent=1))
        return 0
    summary = summarize(results, agreement, {})
    print_summary(Console(), summary)
    r = correlations(agreement)
    Console().print(f"r(f_n) over all frames: mean {np.nanmean(r):.3f}, least {np.nanmin(r):.3f}.", highlight=False)
    return 0


def synth(out: Path, *, quiet: bool, **choices: Any) -> int:
    from app.synthetic.experiment import synthesize

    with progress_of(quiet) as progress:
        made = synthesize(out, progress=progress, **choices)
    if not quiet:
        told = f"{len(made.truth.radius)} rods, {made.truth.frame_count} frames"
        Console().print(f"{out}: {told}. Next: rodsight run {out}", highlight=False)
    return 0


def study(subject: str, *, seeds: tuple[int, ...], grains: int, estimator: str, folder: Path, quiet: bool) -> int:
    from app.study.accuracy import study_accuracy
    from app.study.claims import study_claims

    console = Console() if sys.stdout.isatty() else Console(width=WIDE)
    with progress_of(quiet) as progress:
        if subject == "accuracy":
            study_accuracy(seeds, grains=grains, folder=folder, estimator=estimator, console=console, progress=progress)
        else:
            study_claims(seeds, grains=grains, folder=folder, console=console, progress=progress)
    return 0


@contextmanager
def _run(request: Request) -> Iterator[pipeline.Run]:
    experiment = load_experiment(request.experiment, request.settings)
    folder = request.out if request.out is not None else Path("runs") / experiment.name
    with progress_of(request.quiet) as progress:
        yield pipeline.Run(experiment, folder, _frame_range(request.frames), progress)


@contextmanager
def progress_of(quiet: bool) -> Iterator[Progress]:
    if quiet or not sys.stderr.isatty():
        yield silent
    else:
        with progress_bars() as progress:
            yield progress


def _frame_range(text: str | None) -> tuple[int, int | None]:
    if text is None:
        return 0, None
    first, colon, last = text.partition(":")
    try:
        if not colon:
            raise ValueError
        return int(first or 0), int(last) if last else None
    except ValueError:
        raise InputError("--frames", text, "is not A:B, such as 0:12") from None


def _stored_experiment(file: Path) -> Experiment:
    return load_experiment(file)


def _show(recording: Path, how: str, console: Console) -> int:
    from app.recording.viewer import open_viewer

    hint = open_viewer(recording, how)
    if hint is not None:
        console.print(hint, highlight=False, soft_wrap=True)
    return 0


def results_of(path: Path) -> Results:
    """Results from a run's folder or from results.h5 itself."""
    return load_results(path / pipeline.RESULTS if path.is_dir() else path)
