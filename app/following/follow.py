"""Photographs tracked and frames solved as they come, every frame once, with what was known when it came.

The rods of the first photograph are found once; a photograph that comes is correlated, all tracks so far are corrected,
and the frames that are new are solved from the forces of the last one. Everything is kept frame by frame in the run's
folder, so that a follower that is stopped goes on where it was.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from solver.sequence.frame_forces import FrameForces, FrameStatus
from solver.sequence.state import SequenceState
from solver.statistics.frame_statistics import FrameStatistics

from ..errors import InputError
from ..experiment.experiment import Experiment, load_experiment
from ..inference.inference import Inputs, SolvedFrame, correct_sequence, solve_frames
from ..inference.settings import material_of, settings_of
from ..results.checkpoint import Checkpoint
from ..results.hdf5.store import Provenance, save_tracks
from ..run_folder import TRACKS, UNFINISHED, Run
from ..tracking.follow import ReferenceGrains
from ..tracking.stage import find_reference, track_photographs, write_found_tables
from ..tracks import Tracks, WallTracks
from .arrivals import Arrivals

PAUSE = 0.3  # [s] between looks into the folder
FEWEST = 2  # photographs that forces can be found from
Alarm = Callable[[int, str], None]  # hears of a frame what a person should know at once


@dataclass(slots=True)
class _Followed:
    """What is kept between photographs."""

    grains: ReferenceGrains | None = None
    last: SolvedFrame | None = None
    files: tuple[Path, ...] = ()
    rods: int = 0  # that the last frame was solved with, found ones included
    lost: frozenset[int] = frozenset()


def follow(
    run: Run, settings: tuple[str, ...], *, idle: float | None, alarm: Alarm, say: Callable[[str], None]
) -> None:
    """Track and solve photographs as they come, until none has come for `idle` [s]; None: until it is interrupted.

    settings: KEY=VALUE, as the run has them. Raises InputError where the experiment cannot be followed.
    """
    section = run.experiment.config.photographs
    if section is None or run.experiment.config.walls is None:
        raise InputError(run.experiment.file, "--follow", "needs [photographs] and [walls]")
    if section.interval is None:
        raise InputError(run.experiment.file, "key photographs.interval", "is missing: times are not known beforehand")
    arrivals, state = Arrivals(run.experiment.folder, section.files), _Followed()
    say("Waiting for photographs.")
    since = time.monotonic()
    while idle is None or time.monotonic() - since < idle:
        ready = tuple(arrivals.look())
        if len(ready) <= len(state.files) and ready[: len(state.files)] == state.files[: len(ready)]:
            time.sleep(PAUSE)
            continue
        if ready[: len(state.files)] != state.files:
            say("A photograph has come between others: the test is followed from its beginning.")
            _forget(run)
            state = _Followed(state.grains if ready[:1] == state.files[:1] else None)
        _take_in(run, settings, ready, state, alarm)
        since = time.monotonic()


def _take_in(run: Run, settings: tuple[str, ...], ready: tuple[Path, ...], state: _Followed, alarm: Alarm) -> None:
    """Track the photographs that are new, and solve their frames."""
    experiment = load_experiment(run.experiment.file, settings)
    section = experiment.config.photographs
    assert section is not None
    experiment.inputs.listed(section.files, lambda: ready)
    here = replace(run, experiment=experiment)
    mark = _fingerprint(experiment, ready[0])
    if state.grains is None:
        run.progress("detection", 0, 1)
        state.grains = find_reference(experiment)
        run.progress("detection", 1, 1)

    def keep(stage: str) -> Checkpoint:
        return Checkpoint(run.folder / UNFINISHED / f"following-{stage}", mark, run.notes)

    tracks, walls, tables = track_photographs(
        experiment, len(ready), keep, run.progress, run.note_failure, grains=state.grains
    )
    write_found_tables(run.folder, tables)
    save_tracks(run.file(TRACKS), experiment.name, tracks, walls, Provenance(mark, experiment.file.name, (0, None), {}))
    for name in (TRACKS, *tables):
        run.manifest.add(name, mark)
    for k in range(len(state.files), len(ready)):
        state.lost = _tell_lost(tracks, k, state.lost, alarm)
    state.files = ready
    if len(ready) < FEWEST or walls is None:
        return
    for frame in _solve(here, tracks, walls, state, Checkpoint(run.folder / UNFINISHED / "solving", mark, run.notes)):
        run.progress("solving", frame.forces.frame + 1, len(ready))
        told_already = frame.forces.frame in tracks.failed
        if frame.forces.status in (FrameStatus.SUSPECT, FrameStatus.FAILED) and not told_already:
            alarm(frame.forces.frame, f"{frame.forces.status.name.lower()}: {_reason(frame.forces)}")


def _solve(run: Run, tracks: Tracks, walls: WallTracks, state: _Followed, kept: Checkpoint) -> Iterator[SolvedFrame]:
    """The frames that are new, from the last one on; all of them where the packing is another."""
    config = run.experiment.config
    sequence = correct_sequence(Inputs(tracks, walls, material_of(config), settings_of(config)))
    rods = sequence.packing.grains.count
    done = min(kept.finished(), tracks.frame_count)
    if state.last is None and done:
        state.last = SolvedFrame(*kept.load(done - 1, FrameForces, FrameStatistics, SequenceState))
        state.rods = state.last.forces.contacts.grain_count
    if state.rods != rods:
        state.last = None
    if state.last is not None and state.last.forces.frame + 1 >= tracks.frame_count:
        return
    for frame in solve_frames(sequence, after=state.last, observer=run.note_failure):
        kept.save(frame.forces.frame, frame.forces, frame.statistics, frame.state)
        state.last, state.rods = frame, rods
        yield frame


def _tell_lost(tracks: Tracks, frame: int, before: frozenset[int], alarm: Alarm) -> frozenset[int]:
    """Raise an alarm for rods that are lost in a frame and were not before; gives those that are."""
    lost = frozenset(tracks.id[~tracks.present[frame]].tolist())
    fresh = sorted(lost - before)
    reason = tracks.failed.get(frame)
    if reason is not None:
        alarm(frame, reason)
    elif fresh:
        names = ", ".join(str(each) for each in fresh[:5]) + (" …" if len(fresh) > 5 else "")
        alarm(frame, f"{len(fresh)} rod{'s' if len(fresh) > 1 else ''} lost: {names}")
    return lost


def _reason(forces: FrameForces) -> str:
    return forces.failed_reason or forces.reason


def _fingerprint(experiment: Experiment, first: Path) -> str:
    """Of what frames are made from: everything but the photographs that are still to come."""
    photographs = set(experiment.photographs().files) - {first}
    sums = {file.name: experiment.inputs.checksum(file) for file in experiment.input_files() if file not in photographs}
    told = ["following", experiment.config.model_dump(mode="json"), sums]
    return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()


def _forget(run: Run) -> None:
    for stage in ("following-walls", "following-tracking", "solving"):
        Checkpoint(run.folder / UNFINISHED / stage, "", run.notes).clear()
