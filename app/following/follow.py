"""Tracking of photographs and solution of frames as they arrive, every frame once with the data available then.

The rods of the first photograph are detected once; every new photograph is correlated, all tracks so far are corrected,
and new frames are solved from the forces of the previous one. Every frame is stored in the run's folder, so that an
interrupted follower resumes where it stopped.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from ..compilation.ahead import SOLVER_KERNELS, TRACKING_KERNELS
from ..experiment.config.experiment_file import as_toml
from ..experiment.experiment import Experiment, load_experiment
from ..inference.corrected_sequence import CorrectedSequence
from ..inference.frame_store import CheckpointStore, SolvedFrame
from ..inference.infer_sequence import infer_sequence
from ..inference.inference_settings import material_of, settings_of
from ..inference.inputs import Inputs
from ..inference.solve_frames import InferenceObserver
from ..process.counts import state_count
from ..process.errors import InputError
from ..process.frame_range import ALL_FRAMES
from ..process.sources import hash_of_code
from ..process.stages import FORCES
from ..process.version import library_versions
from ..results.checkpoint import Checkpoint
from ..results.hdf5.store import Provenance, save_tracks
from ..results.results import Results
from ..run_folder import TRACKS, UNFINISHED, Run
from ..solver.frame_forces import FrameForces, FrameStatus
from ..tracking.follow import ReferenceGrains
from ..tracking.stage import find_reference, track_photographs, write_found_tables
from ..tracks import Tracks
from .arrivals import Arrivals

PAUSE = 0.3  # [s] between listings of the folder
MIN_PHOTOGRAPHS = 2  # for forces
Alarm = Callable[[int, str], None]  # called with frame and message for immediate attention


@dataclass(slots=True)
class _Followed:
    """The state between photographs."""

    grains: ReferenceGrains | None = None
    files: tuple[Path, ...] = ()
    lost: frozenset[int] = frozenset()


def follow(
    run: Run, settings: tuple[str, ...], *, idle: float | None, alarm: Alarm, report: Callable[[str], None]
) -> Iterator[Results]:
    """Track and solve photographs as they arrive, and yield the results so far whenever some were solved.

    Parameters
    ----------
    run : Run
    settings : tuple of str
        KEY=VALUE of the run.
    idle : float or None
        Time without a photograph after which to end [s]; None: never.
    alarm : callable
        Called with frame and message for lost rods and suspect or failed frames.
    report : callable
        Called with other messages.

    Raises
    ------
    InputError
        If the experiment has no photographs, interval or walls.
    """
    section = run.experiment.config.photographs
    if section is None or run.experiment.config.walls is None:
        raise InputError(run.experiment.file, "--follow", "needs [photographs] and [walls]")
    if section.interval is None:
        raise InputError(
            run.experiment.file, "key photographs.interval", "is missing: it gives the times of future photographs"
        )
    if section.order is not None:
        raise InputError(
            run.experiment.file, f"key photographs.order = {section.order!r}",
            "lists the photographs, but --follow uses all that arrive: remove the key",
        )  # fmt: skip
    arrivals, state = Arrivals(run.experiment.folder, section.files), _Followed()
    report("Waiting for photographs.")
    since = time.monotonic()
    while idle is None or time.monotonic() - since < idle:
        ready = tuple(arrivals.complete_files())
        if len(ready) <= len(state.files) and ready[: len(state.files)] == state.files[: len(ready)]:
            time.sleep(PAUSE)
            continue
        if ready[: len(state.files)] != state.files:
            report("A photograph arrived between others: the test is followed from its beginning.")
            _forget(run)
            state = _Followed(state.grains if ready[:1] == state.files[:1] else None)
        results = _process_new(run, settings, ready, state, alarm)
        if results is not None:
            yield results
        since = time.monotonic()


def _process_new(
    run: Run, settings: tuple[str, ...], ready: tuple[Path, ...], state: _Followed, alarm: Alarm
) -> Results | None:
    """Track the new photographs and solve their frames; None as long as there are too few for forces."""
    experiment = load_experiment(run.experiment.file, settings)
    section = experiment.config.photographs
    assert section is not None
    experiment.inputs.listed(section.files, lambda: ready)
    current = replace(run, experiment=experiment)
    fingerprint = _fingerprint(experiment, ready[0])
    if state.grains is None:
        run.progress("detection", 0, 1)
        state.grains = find_reference(experiment)
        run.progress("detection", 1, 1)

    def checkpoint_of(stage: str) -> Checkpoint:
        return Checkpoint(run.folder / UNFINISHED / f"following-{stage}", fingerprint, run.notes)

    run.kernels.wait(TRACKING_KERNELS)
    tracks, walls, tables = track_photographs(experiment, len(ready), checkpoint_of, run.progress, grains=state.grains)
    write_found_tables(run.folder, tables)
    save_tracks(
        run.file(TRACKS),
        experiment.name,
        tracks,
        walls,
        Provenance(fingerprint, experiment.file.name, ALL_FRAMES, {}),
    )
    for name in (TRACKS, *tables):
        run.manifest.add(name, fingerprint)
    for k in range(len(state.files), len(ready)):
        state.lost = _report_lost(tracks, k, state.lost, alarm)
    state.files = ready
    if len(ready) < MIN_PHOTOGRAPHS or walls is None:
        return None
    config = current.experiment.config
    store = CheckpointStore(lambda: Checkpoint(run.folder / UNFINISHED / "solving", fingerprint, run.notes))
    observer = _FollowObserver(current, tracks, store, alarm)
    inputs = Inputs(tracks, walls, material_of(config), settings_of(config))
    run.kernels.wait(SOLVER_KERNELS)
    results = infer_sequence(inputs, observer, store, complete=False)
    return replace(results, name=experiment.name, configuration=as_toml(config))


class _FollowObserver(InferenceObserver):
    """Raises an alarm for new frames that need attention; restarts if the set of rods has changed."""

    def __init__(self, run: Run, tracks: Tracks, store: CheckpointStore, alarm: Alarm) -> None:
        super().__init__(run.progress)
        self._run, self._tracks, self._store, self._alarm = run, tracks, store, alarm

    def corrected(self, sequence: CorrectedSequence) -> None:
        done = self._store.finished()
        if done and self._store.load(done - 1).forces.contacts.grain_count != sequence.packing.grains.count:
            self._store.checkpoint.drop(0)

    def solved(self, frame: SolvedFrame) -> None:
        forces = frame.forces
        lost_photograph = forces.frame in self._tracks.failed  # reported when it was tracked
        if forces.status in (FrameStatus.SUSPECT, FrameStatus.FAILED) and not lost_photograph:
            self._alarm(forces.frame, f"{forces.status.name.lower()}: {_reason(forces)}")

    def failed(self, stage: str, frame: int, error: Exception) -> None:
        self._run.note_failure(stage, frame, error)


def _report_lost(tracks: Tracks, frame: int, before: frozenset[int], alarm: Alarm) -> frozenset[int]:
    """Raise an alarm for newly lost rods of a frame; return all lost ones."""
    lost = frozenset(tracks.id[~tracks.present[frame]].tolist())
    newly_lost = sorted(lost - before)
    reason = tracks.failed.get(frame)
    if reason is not None:
        alarm(frame, reason)
    elif newly_lost:
        names = ", ".join(str(each) for each in newly_lost[:5]) + (" …" if len(newly_lost) > 5 else "")
        alarm(frame, f"{state_count(len(newly_lost), 'rod')} lost: {names}")
    return lost


def _reason(forces: FrameForces) -> str:
    return forces.failed_reason or forces.reason


def _fingerprint(experiment: Experiment, first: Path) -> str:
    """Return a fingerprint of the inputs of the frames, without photographs that have not arrived."""
    photographs = set(experiment.photographs().files) - {first}
    sums = {file.name: experiment.inputs.checksum(file) for file in experiment.input_files() if file not in photographs}
    program = [hash_of_code(FORCES.code, (*FORCES.alone, "following/follow.py")), library_versions()]
    inputs = ["following", experiment.config.model_dump(mode="json"), sums, program]
    return hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()


def _forget(run: Run) -> None:
    for stage in ("following-walls", "following-tracking", "solving"):
        Checkpoint(run.folder / UNFINISHED / stage, "", run.notes).clear()
