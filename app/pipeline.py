"""The stages in order: photographs → tracks → contacts and forces → statistics → recording.

The only file that knows the order. Every stage leaves its result in the run's folder under the fingerprint of what
it was made from; a stage whose result is already there is not done again, and an unfinished one goes on at the
frame where it stopped.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from solver.sequence.frame_forces import FrameForces, FrameStatus
from solver.sequence.state import SequenceState
from solver.statistics.frame_statistics import FrameStatistics
from solver.together import available_cores

from .atomic import write_atomically
from .errors import InputError, RunError, UndeterminedError
from .experiment.boundary import bound_tracks
from .experiment.config.experiment_file import as_toml
from .experiment.config.unused_keys import refuse_unused_keys
from .experiment.corrections import read_corrections
from .experiment.experiment import POSE_COLUMNS, read_grain_guess, read_times, read_tracks
from .experiment.photographs import ReadAhead
from .experiment.plausibility import check_packing
from .experiment.scaling import make_scale
from .experiment.walls import read_walls
from .inference.inference import (
    CorrectedSequence,
    Inputs,
    SolvedFrame,
    correct_sequence,
    renew_first,
    solve_frames,
)
from .inference.settings import material_of, settings_of
from .results.checkpoint import Checkpoint
from .results.hdf5.lazy import Lazily
from .results.hdf5.store import Provenance, load_results, load_tracks, save_results, save_tracks
from .results.results import Results, TruthContacts
from .results.summary import save_summary, summarize
from .results.truth import TRUTH_COLUMNS, read_truth, score, true_ids
from .run_folder import FAILURES, RECORDING, REPORT, RESULTS, SIDE, SUMMARY, TRACKS, Run
from .run_truth import load_truth, refuse_unnamed_truth
from .sensitivity.error_budget import budget_cases, measure_budget
from .sensitivity.spread import calibrated_inputs, frame_with_spread, solve_members
from .sensitivity.study import Nominal
from .tracking import DETECTIONS, PICTURES
from .tracks import Tracks, WallTracks
from .verdicts.decisions import Bodies, decide
from .verdicts.log import VERDICTS, Flag, VerdictLog

# Sections of the experiment file on which forces depend.
FORCES_FROM = (
    "photographs", "tracking", "tracks", "walls", "boundary", "calibration", "material", "contacts", "solver",
    "recording",
)  # fmt: skip
PICTURES_FROM = ("photographs",)  # likewise, photographs as they are shown


def check(run: Run) -> tuple[Tracks | None, WallTracks | None]:
    """Read and check all input without computing. Returns given tracks, and the walls."""
    experiment = run.experiment
    if experiment.config.tracks is not None:
        tracks = read_tracks(experiment)
        walls = read_walls(experiment, tracks.frame_count)
        tracks = bound_tracks(experiment, tracks, walls)
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
    run.frame_range(count)
    for name, columns in ((experiment.config.truth, TRUTH_COLUMNS), (experiment.config.truth_tracks, POSE_COLUMNS)):
        if name is not None:
            experiment.table(name, columns)
    if experiment.config.truth is not None:
        refuse_unnamed_truth(run)
    # Grains of photographs are named by truth_tracks where there is one, and not by their own ids.
    named = experiment.config.photographs is not None and experiment.config.truth_tracks is not None
    if experiment.config.truth is not None and ids is not None and not named:
        file = experiment.folder / experiment.config.truth
        poses, names = experiment.config.truth_tracks, walls.name if walls else ()
        unseen = None if poses is None else true_ids(experiment.folder / poses)
        read_truth(
            file, ids, names, first_frame=0, frame_count=count, unseen=unseen, inputs=experiment.inputs
        )  # fmt: skip
    return tracks, walls


def track(run: Run) -> tuple[Tracks, WallTracks | None]:
    """The tracks of the experiment's grains: from tables, or from its photographs."""
    experiment = run.experiment
    if experiment.config.tracks is not None:
        tracks, walls = check(run)
        assert tracks is not None
        start, stop = run.frame_range(tracks.frame_count)
        return tracks.frames(start, stop), walls.frames(start, stop) if walls is not None else None
    sections = ("photographs", "tracking", "walls", "boundary")
    origin = run.origin(sections)
    if run.has(TRACKS, origin) and run.has(DETECTIONS, origin):
        run.forget("tracking", "walls", PICTURES)
        return load_tracks(run.file(TRACKS))
    from .tracking.corrected_frames import keep_frames_before
    from .tracking.stage import track_photographs, write_found_tables  # not where rods are tracked already

    check(run)
    since = time.perf_counter()
    start, stop = run.frame_range(len(experiment.photographs()))
    uncorrected, of_pictures = (run.origin(each, corrected=False).fingerprint for each in (sections, PICTURES_FROM))
    kept: list[str] = []

    def keep(stage: str) -> Checkpoint:
        checkpoint = run.checkpoint(stage, of_pictures if stage == PICTURES else uncorrected)
        if stage == "tracking":  # walls are followed by themselves, whatever is told of rods
            keep_frames_before(checkpoint, read_corrections(experiment, None, len(experiment.photographs())))
        kept.append(stage)
        return checkpoint

    tracks, walls, tables = track_photographs(
        experiment, stop, keep, run.progress, run.note_failure, tell=run.notes.append
    )  # fmt: skip
    tracks = bound_tracks(experiment, tracks, walls)
    if walls is not None:
        run.notes.extend(check_packing(experiment, tracks, walls))
        walls = walls.frames(start, stop)
    tracks = tracks.frames(start, stop)
    write_found_tables(run.folder, tables)
    save_tracks(run.file(TRACKS), experiment.name, tracks, walls, origin)
    run.tell_manifest()
    for name in (DETECTIONS, TRACKS):
        run.manifest.add(name, origin.fingerprint)
    for stage in kept:
        run.set_aside(stage)
    run.timings.add("tracking", since)
    return tracks, walls


def report_tracking(run: Run, tracks: Tracks, walls: WallTracks | None) -> Path:
    """Write the page that shows how well the photographs were tracked."""
    from .tracking.report.page import tracking_report
    from .tracking.stage import gather_report

    run.progress("report", 0, 1)
    tracked = gather_report(run.experiment, run.folder, tracks, walls, run.frames[0])
    write_atomically(run.file(REPORT), tracking_report(tracked).encode())
    run.progress("report", 1, 1)
    return run.file(REPORT)


def solve(run: Run) -> Results:
    """Contacts, forces and statistics of every frame, stored in results.h5."""
    experiment = run.experiment
    if experiment.config.walls is None and experiment.config.boundary is None:
        missing = "is missing: without walls grains can be tracked but not solved; or give a [boundary]"
        raise InputError(experiment.file, "key walls", missing)
    return _solve(run, VerdictLog(run.file(VERDICTS)).as_of_now())


def nominal_run(run: Run) -> tuple[Nominal, str]:
    """What the robustness study varies and compares with: the run as it was given, and its fingerprint."""
    log = VerdictLog(run.file(VERDICTS)).as_of_now()
    results, inputs = _solve_with_inputs(run, log)
    return Nominal.of(inputs, results, load_truth(run, results)), run.origin(FORCES_FROM, log).fingerprint


def solved_inputs(run: Run) -> tuple[Inputs, Results, TruthContacts | None]:
    """What the forces of a run follow from, with the forces and their truth, for whoever changes it a little."""
    results, inputs = _solve_with_inputs(run, VerdictLog(run.file(VERDICTS)).as_of_now())
    return replace(inputs, settings=inputs.settings.without_sweeps()), results, load_truth(run, results)


def _solve_with_inputs(run: Run, log: VerdictLog) -> tuple[Results, Inputs]:
    results = _solve(run, log)
    tracks, walls = track(run)
    assert walls is not None
    return results, _inputs_of_solved(run, log, results, tracks, walls)


def _solve(run: Run, log: VerdictLog) -> Results:
    """The results of a run that obeys what has been said until now, and nothing that is said meanwhile."""
    origin = run.origin(FORCES_FROM, log)
    results = None
    if run.has(RESULTS, origin):
        run.forget("solving")
        results = load_results(run.file(RESULTS))
        if run.experiment.config.solver.ensemble_size in (0, results.ensemble_size):
            run.forget("ensemble")
            return results
        if results.ensemble_size:
            results = None  # the free formula is part of new error bars, and the former ones took its place
    if results is None:
        results = _solve_nominal(run, origin, log)
    if run.experiment.config.solver.ensemble_size:
        results = _add_error_bars(run, origin, log, results)
    return results


def _inputs(run: Run, log: VerdictLog, tracks: Tracks, walls: WallTracks) -> Inputs:
    """What the forces of a run follow from."""
    config, bodies = run.experiment.config, Bodies.of(tracks, walls)
    decisions = decide(log, bodies, first_frame=run.frames[0], frame_count=tracks.frame_count)
    if decisions.flags and all(Flag.IGNORE in decisions.flags.get(k, ()) for k in range(tracks.frame_count)):
        raise InputError(log.file, "flag ignore", "is set on every frame: nothing is left to solve")
    refuse_unused_keys(config, run.experiment.file)
    return Inputs(tracks, walls, material_of(config), settings_of(config), decisions.for_solver())


def _inputs_of_solved(run: Run, log: VerdictLog, results: Results, tracks: Tracks, walls: WallTracks) -> Inputs:
    """The same with the friction that was found, for sequences that are solved again."""
    return _inputs(run, log, tracks, walls).with_friction(results.friction, results.friction_check)


def _solve_nominal(run: Run, origin: Provenance, log: VerdictLog) -> Results:
    """Solve the sequence as it was given, and store it."""
    tracks, walls = track(run)
    assert walls is not None
    since = time.perf_counter()
    try:
        sequence = correct_sequence(_inputs(run, log, tracks, walls)).with_first_renewed()
    except UndeterminedError as error:
        raise InputError(run.experiment.file, f"key {error.key}", str(error)) from None
    run.tell_manifest(log)
    checkpoint = run.checkpoint("solving", origin.fingerprint)
    packing, configuration = sequence.packing, as_toml(run.experiment.config)
    unsolved = Results(
        run.experiment.name, sequence.tracks, sequence.walls, packing.grains, packing.material.friction, (), (),
        configuration, calibration=sequence.calibration, radius_tuning=sequence.tuning,
        boundary=sequence.boundary,
    )  # fmt: skip
    if run.watch is not None:
        run.watch.start(unsolved)
    _solve_frames(run, sequence, checkpoint)
    frames, statistics = checkpoint.lazily(len(sequence.snapshots), FrameForces, FrameStatistics)
    _refuse_nothing(run, frames)
    frames, statistics = _with_first_renewed(run, sequence, frames, statistics)
    check = sequence.find_friction(frames)
    judged = Lazily(len(frames), lambda k: sequence.doubt_friction(frames[k], check))
    restated = Lazily(len(frames), lambda k: sequence.restate(statistics[k], judged[k], check))
    results = replace(unsolved, frames=judged, statistics=restated, friction_check=check)
    results = _store(run, results, origin)
    checkpoint.clear()
    run.timings.add("solving", since)
    return results


def _with_first_renewed(
    run: Run,
    sequence: CorrectedSequence,
    frames: Sequence[FrameForces],
    statistics: Sequence[FrameStatistics],
) -> tuple[Sequence[FrameForces], Sequence[FrameStatistics]]:
    """The same with the first frame as it is seen from the others; as it was, where that is impossible."""
    try:
        first = renew_first(sequence, frames)
    except MemoryError:  # not the frame's fault
        raise
    except Exception as error:
        run.note_failure("first photograph", 0, error)
        run.notes.append("The first photograph could not be solved again when all were known (failures.log).")
        return frames, statistics
    if first is None:
        return frames, statistics
    return (
        Lazily(len(frames), lambda k: first.forces if k == 0 else frames[k]),
        Lazily(len(frames), lambda k: first.statistics if k == 0 else statistics[k]),
    )


def _store(run: Run, results: Results, origin: Provenance) -> Results:
    """Results as they are read back from their file: a frame at a time."""
    save_results(run.file(RESULTS), results, origin)
    run.manifest.add(RESULTS, origin.fingerprint)
    return load_results(run.file(RESULTS))


def _solve_frames(run: Run, sequence: CorrectedSequence, checkpoint: Checkpoint) -> None:
    """Have every frame in the checkpoint: those that are there stay as they are, the others are kept as they come."""
    total, last = len(sequence.snapshots), None
    done = min(checkpoint.finished(), total)
    if run.watch is not None:
        for k in range(done):
            run.watch.frame(*checkpoint.load(k, FrameForces, FrameStatistics))
    if done:
        last = SolvedFrame(*checkpoint.load(done - 1, FrameForces, FrameStatistics, SequenceState))
    run.progress("solving", done, total)
    for frame in solve_frames(sequence, after=last, observer=run.note_failure, ahead=True):
        checkpoint.save(frame.forces.frame, frame.forces, frame.statistics, frame.state)
        if run.watch is not None:
            run.watch.frame(frame.forces, frame.statistics)
        run.progress("solving", frame.forces.frame + 1, total)


def _refuse_nothing(run: Run, frames: Sequence[FrameForces]) -> None:
    if all(frame.status is FrameStatus.FAILED for frame in frames):
        log = f"; {run.file(FAILURES)} tells more" if run.file(FAILURES).exists() else ""
        raise RunError(f"{run.experiment.file}: no frame could be solved; the first one: {frames[0].reason}{log}")


def _add_error_bars(run: Run, origin: Provenance, log: VerdictLog, results: Results) -> Results:
    """Replace the standard deviations by those of an ensemble of sequences solved again, and store the results so."""
    since = time.perf_counter()
    size = run.experiment.config.solver.ensemble_size
    checkpoint = run.checkpoint("ensemble", f"{origin.fingerprint} {size}")
    inputs = calibrated_inputs(_inputs_of_solved(run, log, results, results.tracks, results.walls))
    members = solve_members(inputs, size, checkpoint, workers=available_cores(), progress=run.progress)
    former, estimator = results.frames, inputs.settings.sequence.estimator
    frames = Lazily(
        len(former), lambda k: frame_with_spread(former[k], [each.at(k) for each in members], estimator)
    )  # fmt: skip
    results = replace(results, frames=frames, ensemble_size=size, configuration=as_toml(run.experiment.config))
    results = _store(run, results, origin)
    checkpoint.clear()
    run.timings.add("ensemble", since)
    run.notes.append(f"Error bars (forces/fn_sd, ft_sd) from {size} sequences solved again with resampled inputs.")
    return results


def add_error_budget(run: Run, workers: int) -> Results:
    """Divide the error of every frame of a run among its causes, and store that with its results and its summary."""
    since = time.perf_counter()
    log = VerdictLog(run.file(VERDICTS)).as_of_now()
    results, origin = _solve(run, log), run.origin(FORCES_FROM, log)
    inputs = calibrated_inputs(_inputs_of_solved(run, log, results, results.tracks, results.walls))
    calibration = results.calibration
    scatter = 0.0
    if calibration is not None and calibration.applied:
        scatter = float(np.nanmedian(calibration.radius_sd / results.tracks.radius))
    cases = budget_cases(inputs, scatter=scatter)
    budget = measure_budget(inputs, results.frames, cases, workers=workers, progress=run.progress)
    former = results.frames
    results = replace(results, frames=Lazily(len(former), lambda k: budget.told(former[k])))
    results = _store(run, results, origin)
    run.timings.add("error budget", since)
    conclude(run, results, load_truth(run, results), since)
    return results


def record(run: Run, results: Results, truth: TruthContacts | None) -> Path:
    """Write the recording of finished results, the truth beside them where there is one."""
    from .recording.files.finished_run import write_recording
    from .recording.files.side_file import write_side_file
    from .tracking.kept_pictures import KeptPictures

    since = time.perf_counter()
    section, scale, file = run.experiment.config.photographs, None, run.file(RECORDING)
    with ExitStack() as opened:
        pictures = None
        if section is not None:
            photographs = run.experiment.photographs()
            scale = make_scale(section, photographs.shape[0], results.calibration)
            kept = run.aside(PICTURES, run.origin(PICTURES_FROM, corrected=False).fingerprint)
            shown = KeptPictures(photographs, run.frames[0], kept)
            pictures = opened.enter_context(ReadAhead(shown, len(results.frames)))
        report = write_recording(
            results,
            file,
            photograph=None if pictures is None else pictures.__getitem__,
            scale=scale,
            sweeps="log" if run.full_frames else run.experiment.config.recording.sweeps,
            max_size=run.max_size,
            truth=truth,
            progress=lambda done, total: run.progress("recording", done, total),
        )
    run.drop_aside(PICTURES)  # the recording holds them
    run.notes.extend(report.notes)
    run.file(SIDE).unlink(missing_ok=True)  # of a former recording
    if run.full_frames:
        run.notes.append(write_side_file(results, file, run.file(SIDE), run.full_frames))
    run.timings.add("recording", since)
    return file


def conclude(run: Run, results: Results, truth: TruthContacts | None, since: float) -> dict[str, Any]:
    """Summarise a run, its accuracy where there is a truth, and store that beside the results.

    since: when it began, of time.perf_counter.
    """
    agreement = score(results, truth) if truth is not None else None
    summary = summarize(results, agreement, {**run.timings.seconds, "total": time.perf_counter() - since})
    save_summary(run.file(SUMMARY), summary)
    return summary
