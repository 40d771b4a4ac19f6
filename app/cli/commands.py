"""What each command does with its arguments: a run is made, stages are called, the outcome is told."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from rich.console import Console

from .. import pipeline
from ..errors import InputError
from ..experiment.experiment import load_experiment
from ..progress import Progress, silent
from ..results.store import load_results, read_origin
from ..results.summary import print_summary, save_summary, summarize
from ..results.truth import accuracy, correlations
from ..results.truth import score as score_frames
from ..run_folder import SUMMARY, TRACKS
from .frame_range import parse_frames
from .terminal import progress_bars
from .watching import watching

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
    max_size: float | None = None  # [MB] of the recording
    full_frames: tuple[int, ...] = ()


def run_all(request: Request, view: str) -> int:
    began = time.perf_counter()
    with _run(request) as plain, watching(plain, view, request.console) as (run, watch):
        results = pipeline.solve(run)
        truth = pipeline.load_truth(run, results)
        agreement = score_frames(results, truth) if truth is not None else None
        recording = pipeline.record(run, results, truth)
    seconds = {**run.timings.seconds, "total": time.perf_counter() - began}
    summary = summarize(results, agreement, seconds)
    save_summary(run.file(SUMMARY), summary)
    print_summary(request.console, summary)
    request.console.print(f"Results in {run.folder}/ after {seconds['total']:.1f} s.", highlight=False)
    _tell_notes(run, request.console)
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
    _tell_notes(run, request.console)
    return 0


def track(request: Request, *, report: bool = False) -> int:
    with _run(request) as run:
        if report and run.experiment.config.photographs is None:
            raise InputError(run.experiment.file, "--report", "shows photographs, and these tracks come from a table")
        tracks, walls = pipeline.track(run)
        page = pipeline.report_tracking(run, tracks, walls) if report else None
    lost = int((~tracks.present).sum())
    renewed = f", {tracks.renewal_count} damaged grains with a new reference" if tracks.renewal_count else ""
    where = run.file(TRACKS) if run.experiment.config.photographs else "the experiment's own tables"
    request.console.print(
        f"{tracks.grain_count} grains over {tracks.frame_count} frames, {lost} poses lost{renewed}; tracks in {where}.",
        highlight=False,
    )
    if page is not None:
        request.console.print(f"How well it went: {page}", highlight=False)
    return 0


def solve(request: Request) -> int:
    with _run(request) as run:
        results = pipeline.solve(run)
        truth = pipeline.load_truth(run, results)
    agreement = score_frames(results, truth) if truth is not None else None
    summary = summarize(results, agreement, run.timings.seconds)
    save_summary(run.file(SUMMARY), summary)
    print_summary(request.console, summary)
    _tell_notes(run, request.console)
    return 0


def record(request: Request) -> int:
    with _run(request) as run:
        results = pipeline.solve(run)
        recording = pipeline.record(run, results, pipeline.load_truth(run, results))
    _tell_notes(run, request.console)
    return _show(recording, "none", request.console)


def view(path: Path, *, web: bool, only_list: bool = False) -> int:
    if path.is_dir() and (only_list or not (path / pipeline.RECORDING).is_file()):
        from .viewing import view_folder

        console = Console() if sys.stdout.isatty() else Console(width=WIDE)
        return view_folder(path, web=web, only_list=only_list, console=console)
    recording = path / pipeline.RECORDING if path.is_dir() else path
    if not recording.is_file():
        raise InputError(recording, "", "there is no such recording")
    side = recording.with_name(pipeline.SIDE)
    also = (side,) if path.is_dir() and side.is_file() else ()
    return _show(recording, "web" if web else "native", Console(), *also)


def score(path: Path, truth_file: Path | None, *, as_json: bool, fit_threshold: bool = False) -> int:
    from ..review import scoring
    from ..review.command import Reviewed

    file = path / pipeline.RESULTS if path.is_dir() else path
    results = load_results(file)
    origin = read_origin(file)
    assert origin is not None
    run = pipeline.Run(load_experiment(Path(origin.experiment)), file.parent, origin.frames)
    truth = pipeline.load_truth(run, results, truth_file)
    reviewed = Reviewed(file, results, run.experiment, origin.frames[0])
    verdicts = scoring.score_verdicts(reviewed)
    if truth is None and verdicts is None:
        raise InputError(
            run.experiment.file, "key truth", "is missing: give --truth FILE, or verdicts (rodsight review)"
        )
    if fit_threshold and verdicts is None:
        raise InputError(reviewed.log.file, "", "holds no verdicts to fit a threshold to: rodsight review")
    fitted = scoring.fit(reviewed, verdicts) if fit_threshold and verdicts is not None else None
    agreement = score_frames(results, truth) if truth is not None else []
    if as_json:
        told: dict[str, Any] = accuracy(agreement) if truth is not None else {}
        if verdicts is not None:
            told["verdicts"] = scoring.as_json(verdicts, fitted)
        print(json.dumps(told, indent=1))
        return 0
    if verdicts is not None:
        scoring.print_score(Console(), verdicts, fitted)
    if truth is None:
        return 0
    summary = summarize(results, agreement, {})
    print_summary(Console(), summary)
    r = correlations(agreement)
    Console().print(f"r(f_n) over all frames: mean {np.nanmean(r):.3f}, least {np.nanmin(r):.3f}.", highlight=False)
    return 0


def review(
    path: Path,
    *,
    port: int,
    browser: bool,
    reviewer: str | None,
    import_csv: Path | None,
    complete: bool,
    export_csv: Path | None,
) -> int:
    from ..review import command

    if import_csv is not None:
        return command.import_table(path, import_csv, reviewer=reviewer, complete=complete)
    if export_csv is not None:
        return command.export_table(path, export_csv)
    return command.review(path, port=port, browser=browser, reviewer=reviewer)


def synth(out: Path, *, quiet: bool, **choices: Any) -> int:
    from ..synthetic.experiment import synthesize

    with progress_of(quiet) as progress:
        made = synthesize(out, progress=progress, **choices)
    if not quiet:
        told = f"{len(made.truth.radius)} rods, {made.truth.frame_count} frames"
        Console().print(f"{out}: {told}. Next: rodsight run {out}", highlight=False)
    return 0


def sensitivity(
    request: Request,
    *,
    design: Literal["oat", "sobol"],
    wanted: tuple[str, ...],
    samples: int | None,
    seed: int,
    workers: int | None,
    scheduler: str | None,
    as_json: bool,
) -> int:
    from ..sensitivity import design as designs
    from ..sensitivity import report, study
    from ..sensitivity.execution import available_cores, reach_scheduler

    if workers is not None and workers < 1:
        raise InputError("--workers", str(workers), "must be at least one")
    console = request.console if sys.stdout.isatty() else Console(width=report.WIDTH, quiet=request.quiet)
    with _run(request) as run:
        factors, cases = designs.plan(run.experiment, design, wanted, samples, seed)
        if scheduler is not None:
            reach_scheduler(scheduler)
        nominal, fingerprint = pipeline.nominal_run(run)
        effects = study.run_study(
            nominal, cases, study.Diary(run.file(study.DIARY), fingerprint),
            workers=available_cores() if workers is None else workers, scheduler=scheduler, progress=run.progress,
        )  # fmt: skip
        own = study.compare(nominal.networks, nominal)
        findings = report.Findings(run.experiment.name, design, factors, cases, effects, own)
        report.save_findings(findings, run.folder)
    if as_json:
        print(json.dumps(report.as_json(findings), indent=1))
        return 0
    report.print_findings(console, findings)
    console.print(f"Tables in {run.folder}/: {', '.join(report.FILES)}.", highlight=False)
    return 0


def study(
    subject: str,
    *,
    seeds: tuple[int, ...],
    grains: int,
    estimator: str,
    ensemble: int,
    folder: Path,
    quiet: bool,
) -> int:
    from ..study.accuracy import study_accuracy
    from ..study.claims import study_claims
    from ..study.status import refit_status
    from ..study.uncertainty import study_uncertainty

    console = Console() if sys.stdout.isatty() else Console(width=WIDE)
    if subject in ("status", "uncertainty") and len(seeds) < 2:
        raise InputError("--seeds", " ".join(map(str, seeds)), "must be two or more: to fit on, and to judge on")
    half = (len(seeds) + 1) // 2
    with progress_of(quiet) as progress:
        if subject == "accuracy":
            study_accuracy(seeds, grains=grains, folder=folder, estimator=estimator, console=console, progress=progress)
        elif subject == "uncertainty":
            study_uncertainty(
                seeds[:half], seeds[half:], members=ensemble, grains=grains, estimator=estimator, folder=folder,
                console=console, progress=progress,
            )  # fmt: skip
        elif subject == "status":
            refit_status(
                seeds[:half], seeds[half:], grains=(grains,), folder=folder, console=console, progress=progress
            )
        else:
            study_claims(seeds, grains=grains, folder=folder, console=console, progress=progress)
    return 0


@contextmanager
def _run(request: Request) -> Iterator[pipeline.Run]:
    experiment = load_experiment(request.experiment, request.settings)
    folder = request.out if request.out is not None else Path("runs") / experiment.name
    with progress_of(request.quiet) as progress:
        yield pipeline.Run(
            experiment, folder, parse_frames(request.frames), progress, max_size=_bytes(request.max_size),
            full_frames=request.full_frames,
        )  # fmt: skip


@contextmanager
def progress_of(quiet: bool) -> Iterator[Progress]:
    if quiet or not sys.stderr.isatty():
        yield silent
    else:
        with progress_bars() as progress:
            yield progress


def _bytes(megabytes: float | None) -> int | None:
    if megabytes is None:
        return None
    if not (np.isfinite(megabytes) and megabytes > 0.0):
        raise InputError("--max-size", str(megabytes), "is not a positive number of megabytes")
    return int(1e6 * megabytes)


def _tell_notes(run: pipeline.Run, console: Console) -> None:
    for note in run.notes:
        console.print(note, markup=False, highlight=False, soft_wrap=True)


def _show(recording: Path, how: str, console: Console, *also: Path) -> int:
    from ..recording.viewing.viewer import open_viewer

    hint = open_viewer(recording, how, *also)
    if hint is not None:
        console.print(hint, highlight=False, soft_wrap=True)
    return 0
