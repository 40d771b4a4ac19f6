"""The frames of a run that are solved: of finished results, or of a run in progress."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...drawing.force_range import ForceRange
from ...experiment.units import Scale
from ...process.machine.free_memory import release_free_memory
from ...results.checkpoint import Checkpoint, flatten
from ...results.hdf5.lazy_sequences import CachedSequence, LazySequence
from ...results.hdf5.store import load_results, load_tracks, read_origin
from ...results.results import Results
from ...reviewing.rounding import rounded, rounded_one
from ...run_folder import RESULTS, TRACKS, UNFINISHED
from ...solver.bodies.grains import Array
from ...solver.contacts.contacts import ContactSource, ContactState
from ...solver.frame_forces import FrameForces
from ...solver.statistics.frame_statistics import FrameStatistics
from ...tracks import Tracks, TrackStatus, WallTracks

KEPT_BYTES = 8 << 20  # of frames in memory: enough to go back and forth; another frame is read in some milliseconds
NUMBERS = ("trust", "residual", "correction", "friction_angle", "coordination", "mean_fn")


@dataclass(frozen=True, slots=True)
class RunData:
    """Tracks, and the frames that are solved, read on demand."""

    tracks: Tracks
    walls: WallTracks | None
    frames: Sequence[FrameForces]
    statistics: Sequence[FrameStatistics]
    results: Results | None  # None: the run is in progress
    unfinished: UnfinishedRun | None = None
    summaries: dict[int, FrameSummary] = field(default_factory=dict)  # of frames that were read
    first: int = 0  # the photograph that its frame 0 shows
    force_ranges: dict[int, ForceRange] = field(default_factory=dict)  # by the number of frames: there is one at most

    @property
    def stop(self) -> int:
        """The photograph after those that are solved."""
        return self.first + len(self.frames)

    @property
    def provisional(self) -> bool:
        return self.results is None


@dataclass(slots=True)
class UnfinishedRun:
    """Frames of a run in progress, or stopped: those that were read stay in memory when more are added."""

    checkpoint: Checkpoint
    fingerprint: str
    solved: CachedSequence[list[Any]]
    summaries: dict[int, FrameSummary] = field(default_factory=dict)


class FrameSummary(NamedTuple):
    """Values of a frame on the time line."""

    status: str
    reason: str
    trust: float
    contacts: int
    residual: float
    correction: float
    friction_angle: float  # [degrees]
    coordination: float
    mean_fn: float
    fn: NDArray[np.float32]  # (c,) [N] of all contacts, for the range of the colours


def read_run(folder: Path, former: RunData | None = None) -> RunData | None:
    """Read the frames in a run's folder; None: there are none.

    A run in progress takes precedence over the results that it will replace. former: the result of the last call.
    """
    unfinished = _unfinished(folder, None if former is None else former.unfinished)
    if unfinished is not None:
        return unfinished
    return read_finished_run(folder)


def read_finished_run(folder: Path) -> RunData | None:
    """Read the results in a run's folder, whether or not a later run is in progress; None: there are none."""
    if not (folder / RESULTS).is_file():
        return None
    results = load_results(folder / RESULTS)
    stored = results.frames
    frames: CachedSequence[FrameForces] = CachedSequence(len(stored), lambda k: stored[k], _bytes_of, KEPT_BYTES)
    shown = replace(results, frames=frames)
    return RunData(
        results.tracks, results.walls, frames, results.statistics, shown,
        first=first_photograph(folder / RESULTS),
    )  # fmt: skip


def first_photograph(file: Path) -> int:
    """Return the photograph of a stored file's frame 0: a run of some photographs counts its frames from 0, too."""
    origin = read_origin(file)
    return 0 if origin is None else origin.frames.start


def run_stamp(folder: Path) -> tuple[Any, ...]:
    """Return values that change whenever frames, tracks or results are written."""
    try:
        kept = sum(name.endswith(".piece") for name in os.listdir(folder / UNFINISHED / "solving"))
    except OSError:  # there is none, or a run removes it at this moment
        kept = 0
    return kept, *(_changed(folder / name) for name in (TRACKS, RESULTS))


def _changed(file: Path) -> int:
    """Time of the last change of a file [ns]; 0: there is none."""
    try:
        return file.stat().st_mtime_ns
    except OSError:
        return 0


def _unfinished(folder: Path, unfinished: UnfinishedRun | None) -> RunData | None:
    """Finished frames of a run in progress, or stopped."""
    place, tracks = folder / UNFINISHED / "solving", folder / TRACKS
    try:
        fingerprint = (place / "fingerprint").read_text()
    except OSError:
        return None
    if not tracks.is_file():
        return None
    if unfinished is None or unfinished.fingerprint != fingerprint:
        checkpoint = Checkpoint(place, fingerprint, read_only=True)
        solved: CachedSequence[list[Any]] = CachedSequence(
            0, lambda k: checkpoint.load(k, FrameForces, FrameStatistics), lambda both: _bytes_of(both[0]), KEPT_BYTES
        )
        unfinished = UnfinishedRun(checkpoint, fingerprint, solved)
    solved = unfinished.solved
    try:
        count = unfinished.checkpoint.finished(len(solved))
    except FileNotFoundError:  # it finished at this moment and removed its pieces
        return None
    if not count:
        return None
    solved.extend_to(count)
    given, walls = load_tracks(tracks)
    frames, statistics = (LazySequence(count, lambda k, at=at: solved[k][at]) for at in range(2))
    return RunData(given, walls, frames, statistics, None, unfinished, unfinished.summaries, first_photograph(tracks))


def _bytes_of(forces: FrameForces) -> int:
    return sum(array.nbytes for _, array in flatten(forces))


def frame_summaries(data: RunData) -> dict[str, Any]:
    """Summarise every photograph up to the last one that is solved; None for those before the run."""
    tracks, count = data.tracks, len(data.frames)
    missing = (TrackStatus.LOST, TrackStatus.OUT_OF_FRAME, TrackStatus.INTERPOLATED)
    lost = np.isin(tracks.status, missing).sum(axis=1)
    suspect = (tracks.status == TrackStatus.SUSPECT).sum(axis=1)
    summaries = _summaries(data)
    before: list[Any] = [None] * data.first
    return {
        "first": data.first, "count": data.stop, "provisional": data.provisional, "rods": tracks.grain_count,
        "status": before + [each.status for each in summaries], "reason": before + [each.reason for each in summaries],
        "contacts": before + [each.contacts for each in summaries],
        **{name: before + rounded([getattr(each, name) for each in summaries]) for name in NUMBERS},
        "lost": before + lost.tolist(), "suspect_poses": before + suspect.tolist(),
        "time": before + tracks.time[:count].tolist(),
        "camera": "" if data.results is None or data.results.lens is None else data.results.lens.describe_terms(),
        "fringes": data.results is not None and data.results.fringes is not None,
    }  # fmt: skip


def _summaries(data: RunData) -> list[FrameSummary]:
    for k in range(len(data.frames)):
        if k not in data.summaries:
            data.summaries[k] = _summary_of(data.frames[k], data.statistics[k])
    return [data.summaries[k] for k in range(len(data.frames))]


def _force_range(data: RunData) -> dict[str, float]:
    """The range of widths and colours of the forces [N], the same in every frame and in the recording."""
    count = len(data.frames)
    found = data.force_ranges.get(count)
    if found is None:
        found = ForceRange.of_forces([each.fn.astype(np.float64) for each in _summaries(data)])
        data.force_ranges[count] = found
        release_free_memory()  # of all frames
    return {"mean": found.mean, "weak": found.weak, "top": found.top}


def _summary_of(forces: FrameForces, statistics: FrameStatistics) -> FrameSummary:
    return FrameSummary(
        forces.status.name.lower(), forces.failed_reason or forces.reason, forces.trust, forces.contacts.count,
        forces.natural_map, forces.correction, float(np.rad2deg(statistics.friction_angle)),
        statistics.coordination_number, statistics.mean_fn, forces.fn.astype(np.float32),
    )  # fmt: skip


def frame_network(data: RunData, photograph: int, scale: Scale) -> dict[str, Any]:
    """Describe contacts, forces and rods of a photograph: places in pixels, forces in newtons."""
    frame, tracks = photograph - data.first, data.tracks
    forces = data.frames[frame]
    contacts = forces.contacts
    n = contacts.grain_count
    radius = np.full(n + contacts.wall_count, np.nan)
    radius[: tracks.grain_count] = tracks.radius[:n]
    radius[n:] = 0.0
    radius = np.where(np.isnan(radius), tracks.radius.mean(), radius)
    start = contacts.point - contacts.normal * radius[contacts.i, None]
    end = contacts.point + contacts.normal * radius[contacts.j, None]
    ids = np.append(tracks.id, np.arange(len(tracks.id), n))
    names = list(data.walls.name) if data.walls is not None else []
    return {
        "frame": photograph, "status": forces.status.name.lower(), "trust": rounded_one(forces.trust),
        "line": _pixels(scale, start, end), "point": np.round(scale.to_pixels(contacts.point), 2).tolist(),
        "i": ids[contacts.i].tolist(),
        "j": [int(ids[j]) if j < n else names[j - n] for j in contacts.j.tolist()],
        "fn": rounded(forces.fn), "ft": rounded(forces.ft),
        "fn_sd": rounded(forces.fn_sd), "ft_sd": rounded(forces.ft_sd),
        "gap": rounded(contacts.gap), "probability": rounded(forces.probability), "age": forces.age.tolist(),
        "state": _names(ContactState, forces.state), "source": _names(ContactSource, forces.source),
        "mean_fn": rounded_one(data.statistics[frame].mean_fn), "range": _force_range(data),
        "rods": list_rods(tracks, frame, scale),
    }  # fmt: skip


def list_rods(tracks: Tracks, frame: int, scale: Scale) -> dict[str, Any]:
    """List the rods of a frame, in pixels; lost ones are absent."""
    here = np.flatnonzero(tracks.present_in(frame))
    place = scale.to_pixels(tracks.position[frame, here])
    pixel = np.maximum(scale.size_at(place), 1e-12)  # [m] at each rod
    return {
        "id": tracks.id[here].tolist(), "x": np.round(place[:, 0], 2).tolist(), "y": np.round(place[:, 1], 2).tolist(),
        "r": np.round(tracks.radius[here] / pixel, 2).tolist(), "zncc": rounded(tracks.zncc[frame, here]),
        "angle": rounded(-tracks.rotation[frame, here]),
        "status": _names(TrackStatus, tracks.status[frame, here]),
    }  # fmt: skip


def _names(kind: type[IntEnum], values: NDArray[Any]) -> list[str]:
    words = {each.value: each.name.lower().replace("_", " ") for each in kind}
    return [words[each] for each in values.tolist()]


def contact_history(data: RunData, i: int | str, j: int | str) -> dict[str, Any]:
    """List the values of one contact in every photograph; None where it is no contact."""
    values: dict[str, list[Any]] = {key: [None] * data.first for key in ("fn", "ft", "fn_sd", "gap", "probability")}
    for forces in data.frames:
        row = _row(data, forces, i, j)
        for key, listed in values.items():
            stored: Array | NDArray[Any] = forces.contacts.gap if key == "gap" else getattr(forces, key)
            listed.append(None if row is None else rounded_one(stored[row]))
    return values


def _row(data: RunData, forces: FrameForces, i: int | str, j: int | str) -> int | None:
    names = data.walls.name if data.walls is not None else ()
    n = forces.contacts.grain_count
    a = np.flatnonzero(data.tracks.id == i)
    b = np.array([n + names.index(j)]) if isinstance(j, str) and j in names else np.flatnonzero(data.tracks.id == j)
    if not len(a) or not len(b):
        return None
    rows = np.flatnonzero((forces.contacts.i == a[0]) & (forces.contacts.j == b[0]))
    return int(rows[0]) if len(rows) else None


def _pixels(scale: Scale, start: Array, end: Array) -> list[list[float]]:
    both = np.concatenate([scale.to_pixels(start), scale.to_pixels(end)], axis=1)
    return np.round(both, 2).tolist()
