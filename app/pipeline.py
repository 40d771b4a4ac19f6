"""Stages of a run in order: photographs → tracks → contacts and forces → statistics → recording.

The only file that knows the order. Every stage stores its result in the run's folder under the fingerprint of its
input; a finished stage is not repeated, and an unfinished one continues at the frame where it stopped.
"""

from __future__ import annotations

import time
import tomllib
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .compilation.ahead import TRACKING_KERNELS
from .experiment.boundary import apply_boundary
from .experiment.config.experiment_file import ExperimentFile, as_toml
from .experiment.config.unused_keys import refuse_unused_keys
from .experiment.corrections import read_corrections
from .experiment.experiment import POSE_COLUMNS, checksums, load_experiment, read_grain_guess, read_times, read_tracks
from .experiment.photographs import PrefetchedPhotographs
from .experiment.plausibility import check_packing
from .experiment.scaling import make_scale
from .experiment.walls import describe_walls_at_rest, read_walls
from .out_of_date import out_of_date
from .process.atomic import write_atomically
from .process.errors import InputError
from .process.frame_range import ALL_FRAMES, FrameRange
from .process.machine.free_memory import release_free_memory, return_large_blocks
from .process.machine.linear_algebra import one_thread_each
from .process.sources import hash_of_code
from .process.stages import EFFECTS, FORCES, PHOTOGRAPHS_SHOWN, TRACKING
from .results.checkpoint import Checkpoint
from .results.hdf5.lazy_sequences import LazySequence
from .results.hdf5.store import Provenance, load_results, load_tracks, origin_of, save_tracks
from .results.results import Results, TruthContacts
from .results.summary import save_summary, summarize
from .results.truth import TRUTH_COLUMNS, score
from .run_folder import RECORDING, REPORT, RESULTS, SIDE, SUMMARY, TRACKS, Run, find_experiment
from .run_truth import check_truth, load_truth
from .solver.parallel import available_cores
from .tracking import DETECTIONS, PICTURES
from .tracks import Tracks, WallTracks
from .verdicts.decisions import BodyNames, decide
from .verdicts.log import VERDICTS, Flag, VerdictLog

if TYPE_CHECKING:  # imported where they are used: the first photograph is read before
    from .inference.inputs import Inputs
    from .robustness.study import Nominal


@one_thread_each
def check(run: Run) -> tuple[Tracks | None, WallTracks | None]:
    """Read and check all input without computing. Returns given tracks, and the walls."""
    experiment = run.experiment
    if experiment.config.tracks is not None:
        return_large_blocks()  # tables would leave holes in the memory of all later stages
        tracks = read_tracks(experiment)
        walls = read_walls(experiment, tracks.frame_count)
        tracks = apply_boundary(experiment, tracks, walls)
        if walls is not None:
            run.notes.extend(check_packing(experiment, tracks, walls))
        ids, count = tracks.id, tracks.frame_count
    else:
        photographs = experiment.photographs()
        photographs.check()
        tracks, count = None, len(photographs)
        read_times(experiment, count)
        guess = read_grain_guess(experiment)
        walls = read_walls(experiment, count)
        ids = guess.id if guess is not None else None
        read_corrections(experiment, ids, count)
    run.notes.extend(describe_walls_at_rest(experiment, count))
    run.frame_range(count)
    for name, columns in ((experiment.config.truth, TRUTH_COLUMNS), (experiment.config.truth_tracks, POSE_COLUMNS)):
        if name is not None:
            experiment.table(name, columns)
    check_truth(run, ids, None if walls is None else walls.name, count)
    return tracks, walls


def check_first_photographs(run: Run, count: int) -> tuple[Tracks, WallTracks | None]:
    """Track the first photographs without storing anything, and check their rods against walls and loads.

    Raises InputError where no grain is found, or where rods and walls cannot be right.
    """
    from .tracking.stage import track_first  # given tracks do not need it

    run.kernels.wait(TRACKING_KERNELS)
    tracks, walls = track_first(run.experiment, count, run.progress, run.notes.append)
    if walls is not None:
        run.notes.extend(check_packing(run.experiment, tracks, walls))
    return tracks, walls


def track(run: Run) -> tuple[Tracks, WallTracks | None]:
    """The tracks of the experiment's grains: from tables, or from its photographs."""
    experiment = run.experiment
    if experiment.config.tracks is not None:
        tracks, walls = check(run)
        release_free_memory()
        assert tracks is not None
        part = run.frame_range(tracks.frame_count)
        return tracks.frames(*part), walls.frames(*part) if walls is not None else None
    origin = run.origin(TRACKING)
    if run.has(TRACKS, origin) and run.has(DETECTIONS, origin):
        run.forget("tracking", "walls", PICTURES)
        return load_tracks(run.file(TRACKS))
    check(run)
    # Imported neither where rods are tracked already, nor before the photographs are known to be readable.
    from .tracking.corrected_frames import drop_outdated_frames
    from .tracking.stage import track_photographs, write_found_tables

    since = time.perf_counter()
    start, stop, step = run.frame_range(len(experiment.photographs()))
    uncorrected, of_pictures = (run.origin(each, corrected=False).fingerprint for each in (TRACKING, PHOTOGRAPHS_SHOWN))
    kept: list[str] = []

    def keep(stage: str) -> Checkpoint:
        checkpoint = run.checkpoint(stage, of_pictures if stage == PICTURES else uncorrected)
        if stage == "tracking":  # walls are followed independently of corrected rods
            drop_outdated_frames(checkpoint, read_corrections(experiment, None, len(experiment.photographs())))
        kept.append(stage)
        return checkpoint

    run.kernels.wait(TRACKING_KERNELS)
    tracks, walls, tables = track_photographs(
        experiment, stop, keep, run.progress, notify=run.notes.append
    )  # fmt: skip
    tracks = apply_boundary(experiment, tracks, walls)
    if walls is not None:
        run.notes.extend(check_packing(experiment, tracks, walls))
        walls = walls.frames(start, stop, step)
    tracks = tracks.frames(start, stop, step)
    write_found_tables(run.folder, tables)
    save_tracks(run.file(TRACKS), experiment.name, tracks, walls, origin)
    run.write_manifest()
    for name in (DETECTIONS, TRACKS):
        run.manifest.add(name, origin.fingerprint, origin.program)
    for stage in kept:
        run.set_aside(stage)
    run.timings.add("tracking", since)
    return tracks, walls


def report_tracking(run: Run, tracks: Tracks, walls: WallTracks | None) -> Path:
    """Write the page that shows how well the photographs were tracked."""
    from .tracking.report.page import tracking_report
    from .tracking.stage import gather_report

    run.progress("report", 0, 1)
    tracked = gather_report(run.experiment, run.folder, tracks, walls, run.frames)
    write_atomically(run.file(REPORT), tracking_report(tracked).encode())
    run.progress("report", 1, 1)
    return run.file(REPORT)


def solve(run: Run) -> Results:
    """Contacts, forces and statistics of every frame, stored in results.h5."""
    experiment = run.experiment
    if experiment.config.walls is None and experiment.config.boundary is None:
        missing = "is missing: without walls grains can be tracked but not solved; or give a [boundary]"
        raise InputError(experiment.file, "key walls", missing)
    return _solve(run, VerdictLog(run.file(VERDICTS)).snapshot())


def nominal_run(run: Run) -> tuple[Nominal, str]:
    """Nominal run of the robustness study, with the fingerprint of effects that are measured from it."""
    from .robustness.study import Nominal

    log = VerdictLog(run.file(VERDICTS)).snapshot()
    results, inputs = _solve_with_inputs(run, log)
    fingerprint = f"{run.origin(FORCES, log).fingerprint} {hash_of_code(EFFECTS.code)}"
    return Nominal.of(inputs, results, load_truth(run, results)), fingerprint


def stored_inputs(file: Path) -> tuple[Inputs, Results]:
    """Return the inputs and the results of a finished run, for analyses that solve it again with other inputs.

    Raises
    ------
    InputError
        The experiment is missing, or the input changed since the run was solved.
    """
    results, origin = load_results(file), origin_of(file)
    experiment = load_experiment(find_experiment(file, origin))
    config = ExperimentFile.model_validate(tomllib.loads(results.configuration))
    run = Run(replace(experiment, config=config), file.parent, origin.frames)
    changed = [name for name, sum_ in checksums(run.experiment).items() if origin.checksums.get(name) != sum_]
    if changed:
        raise InputError(file, ", ".join(changed[:3]), "changed since this run was solved: run it again")
    photographed = config.photographs is not None
    tracks, walls = load_tracks(run.file(TRACKS)) if photographed else track(run)
    assert walls is not None
    log = VerdictLog(run.file(VERDICTS)).snapshot()
    inputs = _inputs_of_solved(run, log, results, tracks, walls)
    return replace(inputs, settings=inputs.settings.without_sweeps()), results


def solved_inputs(run: Run) -> tuple[Inputs, Results, TruthContacts | None]:
    """Inputs of a solved run, its results and their truth, for analyses that vary the inputs."""
    results, inputs = _solve_with_inputs(run, VerdictLog(run.file(VERDICTS)).snapshot())
    return replace(inputs, settings=inputs.settings.without_sweeps()), results, load_truth(run, results)


def _solve_with_inputs(run: Run, log: VerdictLog) -> tuple[Results, Inputs]:
    began = time.perf_counter()
    results = _solve(run, log)
    if run.timings.seconds:  # they are new
        conclude(run, results, load_truth(run, results), began)
    tracks, walls = track(run)
    assert walls is not None
    return results, _inputs_of_solved(run, log, results, tracks, walls)


def _solve(run: Run, log: VerdictLog) -> Results:
    """Results of a run with the verdicts given until now; verdicts given meanwhile do not count."""
    origin = run.origin(FORCES, log)
    results = None
    if run.has(RESULTS, origin):
        run.forget("solving")
        results = load_results(run.file(RESULTS))
        if not run.manifest.lists(RESULTS, origin.fingerprint):  # of other code: nothing of this one is added
            return results
        if run.experiment.config.solver.ensemble_size in (0, results.ensemble_size):
            run.forget("ensemble")
            return results
        if results.ensemble_size:
            results = None  # new error bars need the formula's, which the previous ones replaced
    if results is None:
        results = _solve_nominal(run, origin, log)
    if run.experiment.config.solver.ensemble_size:
        results = _add_error_bars(run, origin, log, results)
    return results


def _inputs(run: Run, log: VerdictLog, tracks: Tracks, walls: WallTracks) -> Inputs:
    """Inputs of the forces of a run."""
    from .inference.inference_settings import material_of, settings_of
    from .inference.inputs import Inputs

    config, bodies = run.experiment.config, BodyNames.of(tracks, walls)
    decisions = decide(log, bodies, frames=run.frames, frame_count=tracks.frame_count)
    if decisions.flags and all(Flag.IGNORE in decisions.flags.get(k, ()) for k in range(tracks.frame_count)):
        raise InputError(log.file, "flag ignore", "is set on every frame: nothing is left to solve")
    refuse_unused_keys(config, run.experiment.file)
    return Inputs(tracks, walls, material_of(config), settings_of(config), decisions.for_solver())


def _inputs_of_solved(run: Run, log: VerdictLog, results: Results, tracks: Tracks, walls: WallTracks) -> Inputs:
    """The same with the friction that was measured, for sequences that are solved again."""
    inputs = _inputs(run, log, tracks, walls).with_friction(results.friction, results.friction_check)
    return inputs.with_base_friction(results.base_friction) if np.isfinite(results.base_friction) else inputs


def _solve_nominal(run: Run, origin: Provenance, log: VerdictLog) -> Results:
    """Infer the forces of the sequence as it was given, and store them."""
    tracks, walls = track(run)
    assert walls is not None
    return_large_blocks()  # not before photographs are tracked, which would take longer
    from .forces_of_run import infer_forces  # the first photograph is read before all this is imported

    return infer_forces(run, _inputs(run, log, tracks, walls), origin, log)


def _add_error_bars(run: Run, origin: Provenance, log: VerdictLog, results: Results) -> Results:
    """Replace the standard deviations by those of an ensemble of sequences solved again, and store the results so."""
    from .forces_of_run import store_results
    from .robustness.ensemble_sd import calibrated_inputs, frame_with_ensemble_sd, solve_members

    since = time.perf_counter()
    size = run.experiment.config.solver.ensemble_size
    checkpoint = run.checkpoint("ensemble", f"{origin.fingerprint} {size}")
    inputs = calibrated_inputs(_inputs_of_solved(run, log, results, results.tracks, results.walls))
    workers = inputs.settings.sequence.workers or available_cores()
    members = solve_members(inputs, size, checkpoint, workers=workers, progress=run.progress)
    former, estimator = results.frames, inputs.settings.sequence.estimator
    frames = LazySequence(
        len(former), lambda k: frame_with_ensemble_sd(former[k], [each.at(k) for each in members], estimator)
    )  # fmt: skip
    results = replace(results, frames=frames, ensemble_size=size, configuration=as_toml(run.experiment.config))
    results = store_results(run, results, origin, log)
    checkpoint.clear()
    run.timings.add("ensemble", since)
    run.notes.append(f"Error bars (forces/fn_sd, ft_sd) from {size} sequences solved again with resampled inputs.")
    return results


def add_error_budget(run: Run, workers: int) -> Results:
    """Divide the error of every frame of a run among its causes, and store that with its results and its summary."""
    from .forces_of_run import store_results
    from .robustness.ensemble_sd import calibrated_inputs
    from .robustness.error_budget import budget_cases, measure_budget

    since = time.perf_counter()
    log = VerdictLog(run.file(VERDICTS)).snapshot()
    results, origin = _solve(run, log), run.origin(FORCES, log)
    inputs = calibrated_inputs(_inputs_of_solved(run, log, results, results.tracks, results.walls))
    calibration = results.calibration
    radius_sd = 0.0
    if calibration is not None and calibration.applied:
        radius_sd = float(np.nanmedian(calibration.radius_sd / results.tracks.radius))
    cases = budget_cases(inputs, radius_sd=radius_sd)
    budget = measure_budget(inputs, results.frames, cases, workers=workers, progress=run.progress)
    former = results.frames
    results = replace(results, frames=LazySequence(len(former), lambda k: budget.apply_to(former[k])))
    results = store_results(run, results, origin, log)
    run.timings.add("error budget", since)
    conclude(run, results, load_truth(run, results), since)
    return results


def keep_finished_frames(run: Run) -> None:
    """Raise InputError where frames are requested whose results would replace those of other finished frames.

    For commands that solve only what is missing: run and solve themselves replace results by those of other frames.
    """
    stored, results = run.manifest.fact("frames"), run.file(RESULTS)
    if not results.is_file() or not isinstance(stored, list) or run.frames.covers(finished := FrameRange(*stored)):
        return
    held = "all frames" if finished == ALL_FRAMES else f"the frames {finished}"
    raise InputError(
        "--frames", str(run.frames), f"{results} holds {held}, which these would replace: leave --frames out, or "
        "choose another folder with --out; rodsight share RUN --frames A:B makes a recording of some frames",
    )  # fmt: skip


def record(run: Run, results: Results, truth: TruthContacts | None) -> Path:
    """Write the recording of finished results, the truth beside them where there is one."""
    from .recording.files.finished_run import RecordingOptions, write_recording
    from .recording.files.side_file import write_side_file
    from .tracking.photograph_cache import CachedPhotographs

    release_free_memory()
    since = time.perf_counter()
    section, scale, file = run.experiment.config.photographs, None, run.file(RECORDING)
    with ExitStack() as opened:
        pictures = None
        if section is not None:
            photographs = run.experiment.photographs()
            scale = make_scale(section, photographs.shape[0], results.calibration)
            kept = run.aside(PICTURES, run.origin(PHOTOGRAPHS_SHOWN, corrected=False).fingerprint)
            shown = CachedPhotographs(photographs, run.frames, kept)
            pictures = opened.enter_context(PrefetchedPhotographs(shown, len(results.frames)))
        sweeps = "log" if run.full_frames else run.experiment.config.recording.sweeps
        report = write_recording(
            results,
            file,
            photograph=None if pictures is None else pictures.__getitem__,
            scale=scale,
            truth=truth,
            progress=lambda done, total: run.progress("recording", done, total),
            options=RecordingOptions(sweeps, run.max_size),
        )
    run.drop_aside(PICTURES)  # the recording holds them
    run.notes.extend(report.notes)
    run.file(SIDE).unlink(missing_ok=True)  # of a previous recording
    if run.full_frames:
        run.notes.append(write_side_file(results, file, run.file(SIDE), run.full_frames))
    run.manifest.note(RECORDING, {"results": run.manifest.piece(RESULTS).get("sha256")})
    run.timings.add("recording", since)
    return file


def conclude(run: Run, results: Results, truth: TruthContacts | None, since: float) -> dict[str, Any]:
    """Summarise a run, its accuracy where there is a truth, and store that beside the results.

    since: when it began, of time.perf_counter.
    """
    agreement = score(results, truth) if truth is not None else None
    summary = summarize(results, agreement, {**run.timings.seconds, "total": time.perf_counter() - since})
    summary["out_of_date"] = out_of_date(run.folder)  # where old results were kept
    save_summary(run.file(SUMMARY), summary)
    return summary
