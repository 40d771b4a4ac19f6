"""The stages in order: photographs → tracks → contacts and forces → statistics → recording.

The only file that knows the order. Every stage leaves its result in the run's folder under the fingerprint of what
it was made from; a stage whose result is already there is not done again, and an unfinished one goes on at the
frame where it stopped.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from solver.contacts.verdicts import Verdicts
from solver.detection.touch_probability import ContactProbabilitySettings
from solver.sequence.frame_forces import FrameForces
from solver.sequence.frames import SequenceState, solve_sequence
from solver.statistics.frame_statistics import FrameStatistics

from . import __version__
from .atomic import write_atomically
from .errors import InputError
from .experiment.config import as_toml
from .experiment.corrections import read_corrections
from .experiment.experiment import (
    Experiment,
    checksums,
    read_grain_guess,
    read_times,
    read_tracks,
    read_walls,
)
from .experiment.plausibility import check_inside, check_radii, rods_beyond_ends
from .experiment.scaling import make_scale
from .inference.friction_and_radii import friction_of
from .inference.inference import Inputs, gather
from .inference.preparation import Prepared, prepare
from .inference.solver_input import make_snapshots, sequence_settings
from .progress import Progress, silent
from .results.checkpoint import Checkpoint
from .results.results import Results, TruthContacts
from .results.store import Provenance, load_results, load_tracks, read_origin, save_results, save_tracks
from .results.truth import read_truth, true_names
from .sensitivity.execution import available_cores
from .sensitivity.spread import calibrated_inputs, solve_members, with_spread
from .sensitivity.study import Nominal
from .tracking.report.page import tracking_report
from .tracking.stage import DETECTIONS, gather_report, track_photographs, write_tables
from .tracks import Tracks, WallTracks
from .verdicts.decisions import Bodies, Decisions, decide, fingerprint
from .verdicts.log import VERDICTS, Flag, VerdictLog

TRACKS, RESULTS, RECORDING, SUMMARY = "tracks.h5", "results.h5", "recording.rrd", "summary.json"
REPORT = "tracking_report.html"
SIDE = "recording-sweeps.rrd"  # every sweep of some frames; opens as one with the recording
UNFINISHED = ".unfinished"  # folder of checkpoints
ERROR_BARS = {"solver": {"ensemble_size"}}  # settings that leave the forces as they are


@dataclass(slots=True)
class Timings:
    """Seconds that each stage took; 0 where its result was already there."""

    seconds: dict[str, float] = field(default_factory=dict)

    def add(self, stage: str, since: float) -> None:
        self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - since


class Watch(Protocol):
    """Somebody who is told what has been solved, while it is."""

    def start(self, run: Results) -> None:
        """Bodies, motion and settings; the frames are still to come."""

    def frame(self, forces: FrameForces, statistics: FrameStatistics) -> None:
        """The next frame is there."""


@dataclass(frozen=True, slots=True)
class Run:
    """One experiment and the folder its results go to."""

    experiment: Experiment
    folder: Path
    frames: tuple[int, int | None] = (0, None)
    progress: Progress = silent
    timings: Timings = field(default_factory=Timings)
    watch: Watch | None = None  # hears every frame as it is solved
    max_size: int | None = None  # [bytes] of the recording
    full_frames: tuple[int, ...] = ()  # whose every sweep goes to a side file, the recording then being thinned
    notes: list[str] = field(default_factory=list)  # sentences for the user

    def file(self, name: str) -> Path:
        return self.folder / name


def check(run: Run) -> tuple[Tracks | None, WallTracks | None]:
    """Read and check all input without computing. Returns given tracks, and the walls."""
    experiment = run.experiment
    if experiment.config.tracks is not None:
        tracks = read_tracks(experiment)
        walls = read_walls(experiment, tracks.frame_count)
        if walls is not None:
            _check_packing(run, tracks, walls)
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
    _frame_range(run, count)
    # Grains of photographs are named by truth_tracks where there is one, and not by their own ids.
    named = experiment.config.photographs is not None and experiment.config.truth_tracks is not None
    if experiment.config.truth is not None and ids is not None and not named:
        file = experiment.folder / experiment.config.truth
        read_truth(file, ids, walls.name if walls else (), first_frame=0, frame_count=count)
    return tracks, walls


def track(run: Run) -> tuple[Tracks, WallTracks | None]:
    """The tracks of the experiment's grains: from tables, or from its photographs."""
    experiment = run.experiment
    if experiment.config.tracks is not None:
        tracks, walls = check(run)
        assert tracks is not None
        start, stop = _frame_range(run, tracks.frame_count)
        return tracks.frames(start, stop), walls.frames(start, stop) if walls is not None else None
    origin = _origin(run, ("photographs", "tracking", "walls"))
    stored = read_origin(run.file(TRACKS))
    if stored is not None and stored.fingerprint == origin.fingerprint and run.file(DETECTIONS).exists():
        return load_tracks(run.file(TRACKS))
    check(run)
    since = time.perf_counter()
    start, stop = _frame_range(run, len(experiment.photographs()))
    unfinished = run.folder / UNFINISHED
    tracks, walls, tables = track_photographs(experiment, stop, unfinished, origin.fingerprint, run.progress)
    if walls is not None:
        _check_packing(run, tracks, walls)
        walls = walls.frames(start, stop)
    tracks = tracks.frames(start, stop)
    write_tables(run.folder, tables)
    save_tracks(run.file(TRACKS), experiment.name, tracks, walls, origin)
    for stage in ("tracking", "walls"):
        Checkpoint(unfinished / stage, origin.fingerprint).clear()
    run.timings.add("tracking", since)
    return tracks, walls


def report_tracking(run: Run, tracks: Tracks, walls: WallTracks | None) -> Path:
    """Write the page that shows how well the photographs were tracked."""
    run.progress("report", 0, 1)
    tracked = gather_report(run.experiment, run.folder, tracks, walls, run.frames[0])
    write_atomically(run.file(REPORT), tracking_report(tracked).encode())
    run.progress("report", 1, 1)
    return run.file(REPORT)


def solve(run: Run) -> Results:
    """Contacts, forces and statistics of every frame, stored in results.h5."""
    experiment = run.experiment
    if experiment.config.walls is None:
        raise InputError(experiment.file, "key walls", "is missing: without walls grains can be tracked but not solved")
    origin = _origin(
        run,
        ("photographs", "tracking", "tracks", "walls", "calibration", "material", "contacts", "solver", "recording"),
    )
    log = VerdictLog(run.file(VERDICTS))
    origin = replace(origin, fingerprint=_with_verdicts(origin.fingerprint, log))
    stored = read_origin(run.file(RESULTS))
    results = None
    if stored is not None and stored.fingerprint == origin.fingerprint:
        results = load_results(run.file(RESULTS))
        if experiment.config.solver.ensemble_size in (0, results.ensemble_size):
            return results
        if results.ensemble_size:
            results = None  # the free formula is part of new error bars, and the former ones took its place
    if results is None:
        results = _solve_nominal(run, origin, log)
    if experiment.config.solver.ensemble_size:
        results = _add_error_bars(run, origin, log, results)
    return results


def nominal_run(run: Run) -> tuple[Nominal, str]:
    """What the robustness study varies and compares with: the run as it was given, and its fingerprint."""
    results = solve(run)
    stored = read_origin(run.file(RESULTS))
    tracks, walls = track(run)
    assert stored is not None
    assert walls is not None
    truth = load_truth(run, results)
    frames = np.arange(tracks.frame_count)
    decisions = _decisions(run, VerdictLog(run.file(VERDICTS)), tracks, walls)
    inputs = Inputs(run.experiment, tracks, walls, results.tracks.sigma, frames, decisions.for_solver())
    nominal = Nominal(
        inputs,
        gather(frames, results.frames, results.statistics),
        None if truth is None else truth.by_frame(results.grains.count + results.walls.count, len(frames)),
    )
    return nominal, stored.fingerprint


def _solve_nominal(run: Run, origin: Provenance, log: VerdictLog) -> Results:
    """Solve the sequence as it was given, and store it."""
    experiment = run.experiment
    tracks, walls = track(run)
    assert walls is not None
    since = time.perf_counter()
    prepared = prepare(experiment, tracks, walls)
    tracks, walls, packing = prepared.tracks, prepared.walls, prepared.packing
    checkpoint = Checkpoint(run.folder / UNFINISHED / "solving", origin.fingerprint)
    decisions = _decisions(run, log, tracks, walls)
    if decisions.flags and all(Flag.IGNORE in decisions.flags.get(k, ()) for k in range(tracks.frame_count)):
        raise InputError(log.file, "flag ignore", "is set on every frame: nothing is left to solve")
    frames, statistics = _solve_frames(run, prepared, checkpoint, decisions.for_solver())
    results = Results(
        name=experiment.name,
        tracks=tracks,
        walls=walls,
        grains=packing.grains,
        friction=packing.material.friction,
        frames=frames,
        statistics=statistics,
        configuration=as_toml(experiment.config),
        calibration=prepared.calibration,
        friction_check=friction_of(
            packing, make_snapshots(tracks, walls), frames, ContactProbabilitySettings(overlap=prepared.overlap)
        ),
        radius_tuning=prepared.tuning,
    )
    save_results(run.file(RESULTS), results, origin)
    checkpoint.clear()
    run.timings.add("solving", since)
    return results


def _decisions(run: Run, log: VerdictLog, tracks: Tracks, walls: WallTracks) -> Decisions:
    return decide(log, Bodies.of(tracks, walls), first_frame=run.frames[0], frame_count=tracks.frame_count)


def _add_error_bars(run: Run, origin: Provenance, log: VerdictLog, results: Results) -> Results:
    """Replace the standard deviations by those of an ensemble of sequences solved again, and store the results so."""
    since = time.perf_counter()
    config = run.experiment.config
    size = config.solver.ensemble_size
    checkpoint = Checkpoint(run.folder / UNFINISHED / "ensemble", f"{origin.fingerprint} {size}")
    verdicts = _decisions(run, log, results.tracks, results.walls).for_solver()
    inputs = calibrated_inputs(run.experiment, results.tracks, results.walls, verdicts)
    members = solve_members(inputs, size, checkpoint, workers=available_cores(), progress=run.progress)
    frames = with_spread(results.frames, members, sequence_settings(config, 0.0).estimator)
    results = replace(results, frames=frames, ensemble_size=size, configuration=as_toml(config))
    save_results(run.file(RESULTS), results, origin)
    checkpoint.clear()
    run.timings.add("ensemble", since)
    run.notes.append(f"Error bars (forces/fn_sd, ft_sd) from {size} sequences solved again with resampled inputs.")
    return results


def _solve_frames(
    run: Run, prepared: Prepared, checkpoint: Checkpoint, verdicts: Mapping[int, Verdicts]
) -> tuple[list[FrameForces], list[FrameStatistics]]:
    packing, tracks, walls = prepared.packing, prepared.tracks, prepared.walls
    snapshots = make_snapshots(tracks, walls)
    frames: list[FrameForces] = []
    statistics: list[FrameStatistics] = []
    kept_state: SequenceState | None = None
    if run.watch is not None:
        config, grains = run.experiment.config, packing.grains
        friction = packing.material.friction
        run.watch.start(Results(config.name, tracks, walls, grains, friction, (), (), as_toml(config)))
    for k in range(min(checkpoint.finished(), len(snapshots))):
        forces, kept, kept_state = checkpoint.load(k, FrameForces, FrameStatistics, SequenceState)
        frames.append(forces)
        statistics.append(kept)
        if run.watch is not None:
            run.watch.frame(forces, kept)
    settings = sequence_settings(run.experiment.config, prepared.overlap)
    done = len(frames)
    run.progress("solving", done, len(snapshots))
    for forces, state in solve_sequence(packing, snapshots, settings, state=kept_state, first=done, verdicts=verdicts):
        summary = prepared.statistics(forces, snapshots[forces.frame])
        checkpoint.save(forces.frame, forces, summary, state)
        frames.append(forces)
        statistics.append(summary)
        if run.watch is not None:
            run.watch.frame(forces, summary)
        run.progress("solving", len(frames), len(snapshots))
    return frames, statistics


def record(run: Run, results: Results, truth: TruthContacts | None) -> Path:
    """Write the recording of finished results, the truth beside them where there is one."""
    from .recording.files.recorder import record as write_recording
    from .recording.files.side_file import write_side_file

    since = time.perf_counter()
    section = run.experiment.config.photographs
    photographs = run.experiment.photographs() if section is not None else None

    def photograph(frame: int) -> NDArray[np.uint8] | None:
        if photographs is None:
            return None
        return np.clip(np.rint(photographs[run.frames[0] + frame]), 0, 255).astype(np.uint8)

    file = run.file(RECORDING)
    report = write_recording(
        results,
        file,
        photograph=photograph if photographs is not None else None,
        scale=make_scale(section, photographs.shape[0], results.calibration)
        if section and photographs is not None
        else None,
        sweeps="log" if run.full_frames else run.experiment.config.recording.sweeps,
        max_size=run.max_size,
        truth=truth,
        progress=lambda done, total: run.progress("recording", done, total),
    )
    run.notes.extend(report.notes)
    run.file(SIDE).unlink(missing_ok=True)  # of a former recording
    if run.full_frames:
        run.notes.append(write_side_file(results, file, run.file(SIDE), run.full_frames))
    run.timings.add("recording", since)
    return file


def load_truth(run: Run, results: Results, file: Path | None = None) -> TruthContacts | None:
    """The truth on the rows and frames of the results; None if the experiment names none.

    file replaces the experiment's own. Grains that were detected have numbers of their own, so that
    `truth_tracks` must tell which is which.
    """
    config, folder = run.experiment.config, run.experiment.folder
    if file is None and config.truth is None:
        return None
    first = run.frames[0]
    ids = results.tracks.id
    if config.truth_tracks is not None:
        ids = true_names(folder / config.truth_tracks, results.tracks, first)
    elif config.photographs is not None and config.photographs.grains is None:
        raise InputError(
            run.experiment.file,
            "key truth",
            "names grains by ids, but these grains were detected: give truth_tracks or photographs.grains",
        )
    return read_truth(
        file if file is not None else folder / str(config.truth),
        ids,
        results.walls.name,
        first_frame=first,
        frame_count=len(results.frames),
    )


def _check_packing(run: Run, tracks: Tracks, walls: WallTracks) -> None:
    check_inside(run.experiment, tracks, walls)
    check_radii(run.experiment, tracks)
    run.notes.extend(rods_beyond_ends(tracks, walls))


def _frame_range(run: Run, count: int) -> tuple[int, int]:
    start, stop = run.frames
    stop = count if stop is None else stop
    if not 0 <= start < stop <= count:
        raise InputError("--frames", f"{start}:{stop}", f"is not a range of the frames 0:{count}")
    return start, stop


def _with_verdicts(digest: str, log: VerdictLog) -> str:
    """The fingerprint of results that obey a log of verdicts; without verdicts it stays what it was."""
    told = fingerprint(log)
    return hashlib.sha256((digest + told).encode()).hexdigest() if told else digest


def _origin(run: Run, sections: tuple[str, ...]) -> Provenance:
    config = run.experiment.config.model_dump(mode="json", include=set(sections), exclude=ERROR_BARS)
    sums = checksums(run.experiment)
    told = json.dumps([__version__, config, sums, run.frames], sort_keys=True)
    digest = hashlib.sha256(told.encode()).hexdigest()
    return Provenance(digest, str(run.experiment.file.resolve()), run.frames, sums)
