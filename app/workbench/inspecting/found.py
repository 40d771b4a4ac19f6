"""The frames of a run that are there: of finished results, or of one that still goes on."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.contacts.contacts import ContactSource, ContactState
from solver.sequence.frame_forces import FrameForces
from solver.statistics.frame_statistics import FrameStatistics

from ...experiment.units import Scale
from ...results.checkpoint import Checkpoint, flatten
from ...results.hdf5.lazy import Lazily, Remembered
from ...results.hdf5.store import load_results, load_tracks, read_origin
from ...results.results import Results
from ...run_folder import RESULTS, TRACKS, UNFINISHED
from ...tracks import Tracks, TrackStatus, WallTracks

ROOM = 32 << 20  # [bytes] of frames that are kept: a test of fifty photographs is answered from at once
NUMBERS = ("trust", "residual", "correction", "friction_angle", "coordination", "mean_fn")


@dataclass(frozen=True, slots=True)
class Found:
    """Tracks, and the frames that have been solved, read when they are asked for."""

    tracks: Tracks
    walls: WallTracks | None
    frames: Sequence[FrameForces]
    statistics: Sequence[FrameStatistics]
    results: Results | None  # None: of a run that goes on
    going_on: GoingOn | None = None
    told: dict[int, Facts] = field(default_factory=dict)  # of frames that were looked at
    first: int = 0  # the photograph that its frame 0 shows

    @property
    def stop(self) -> int:
        """The photograph after those that are solved."""
        return self.first + len(self.frames)

    @property
    def provisional(self) -> bool:
        return self.results is None


@dataclass(slots=True)
class GoingOn:
    """Frames of a run that goes on, or was stopped: what has been read of them stays, however many come."""

    checkpoint: Checkpoint
    fingerprint: str
    solved: Remembered[list[Any]]
    told: dict[int, Facts] = field(default_factory=dict)


class Facts(NamedTuple):
    """What the time line tells of a frame."""

    status: str
    reason: str
    trust: float
    contacts: int
    residual: float
    correction: float
    friction_angle: float  # [degrees]
    coordination: float
    mean_fn: float


def find_run(folder: Path, former: Found | None = None) -> Found | None:
    """What lies in a run's folder; a run that goes on counts before what it will replace. None: nothing yet.

    former: what was found there before, of which it goes on.
    """
    going_on = _unfinished(folder, None if former is None else former.going_on)
    if going_on is not None:
        return going_on
    if not (folder / RESULTS).is_file():
        return None
    results = load_results(folder / RESULTS)
    stored = results.frames
    frames: Remembered[FrameForces] = Remembered(len(stored), lambda k: stored[k], _bytes_of, ROOM)
    return Found(
        results.tracks, results.walls, frames, results.statistics, replace(results, frames=frames),
        first=first_photograph(folder / RESULTS),
    )  # fmt: skip


def first_photograph(file: Path) -> int:
    """The photograph of a stored file's frame 0: runs of some photographs alone count from 0, too."""
    origin = read_origin(file)
    return 0 if origin is None else origin.frames[0]


def run_stamp(folder: Path) -> tuple[Any, ...]:
    """By which it is seen whether anything has come."""
    try:
        kept = sum(name.endswith(".piece") for name in os.listdir(folder / UNFINISHED / "solving"))
    except OSError:  # there is none, or a run takes it away while it is read
        kept = 0
    return kept, *(_changed(folder / name) for name in (TRACKS, RESULTS))


def _changed(file: Path) -> int:
    """When a file was changed [ns]; 0: there is none."""
    try:
        return file.stat().st_mtime_ns
    except OSError:
        return 0


def _unfinished(folder: Path, going_on: GoingOn | None) -> Found | None:
    """Finished frames of a run that goes on, or was stopped."""
    place, tracks = folder / UNFINISHED / "solving", folder / TRACKS
    try:
        fingerprint = (place / "fingerprint").read_text()
    except OSError:
        return None
    if not tracks.is_file():
        return None
    if going_on is None or going_on.fingerprint != fingerprint:
        checkpoint = Checkpoint(place, fingerprint, looks_on=True)
        solved: Remembered[list[Any]] = Remembered(
            0, lambda k: checkpoint.load(k, FrameForces, FrameStatistics), lambda both: _bytes_of(both[0]), ROOM
        )
        going_on = GoingOn(checkpoint, fingerprint, solved)
    solved = going_on.solved
    try:
        count = going_on.checkpoint.finished(len(solved))
    except FileNotFoundError:  # it finished just now, and took its pieces away
        return None
    if not count:
        return None
    solved.grow(count)
    seen, walls = load_tracks(tracks)
    frames, statistics = (Lazily(count, lambda k, at=at: solved[k][at]) for at in range(2))
    return Found(seen, walls, frames, statistics, None, going_on, going_on.told, first_photograph(tracks))


def _bytes_of(forces: FrameForces) -> int:
    return sum(array.nbytes for _, array in flatten(forces))


def frame_facts(found: Found) -> dict[str, Any]:
    """What is told of every photograph up to the last one that is solved, for the time line; None of those before."""
    tracks, count = found.tracks, len(found.frames)
    lost = np.isin(tracks.status, (TrackStatus.LOST, TrackStatus.OUT_OF_FRAME)).sum(axis=1)
    suspect = (tracks.status == TrackStatus.SUSPECT).sum(axis=1)
    for k in range(count):
        if k not in found.told:
            found.told[k] = _facts_of(found.frames[k], found.statistics[k])
    facts = [found.told[k] for k in range(count)]
    before: list[Any] = [None] * found.first
    return {
        "first": found.first, "count": found.stop, "provisional": found.provisional, "rods": tracks.grain_count,
        "status": before + [each.status for each in facts], "reason": before + [each.reason for each in facts],
        "contacts": before + [each.contacts for each in facts],
        **{name: before + plain([getattr(each, name) for each in facts]) for name in NUMBERS},
        "lost": before + lost.tolist(), "suspect_poses": before + suspect.tolist(),
        "time": before + tracks.time[:count].tolist(),
    }  # fmt: skip


def _facts_of(forces: FrameForces, statistics: FrameStatistics) -> Facts:
    return Facts(
        forces.status.name.lower(), forces.failed_reason or forces.reason, forces.trust, forces.contacts.count,
        forces.natural_map, forces.correction, float(np.rad2deg(statistics.friction_angle)),
        statistics.coordination_number, statistics.mean_fn,
    )  # fmt: skip


def network(found: Found, photograph: int, scale: Scale) -> dict[str, Any]:
    """Contacts and forces of a photograph's frame: places in pixels, forces in newtons."""
    frame, tracks = photograph - found.first, found.tracks
    forces = found.frames[frame]
    contacts = forces.contacts
    n = contacts.grain_count
    radius = np.full(n + contacts.wall_count, np.nan)
    radius[: tracks.grain_count] = tracks.radius[:n]
    radius[n:] = 0.0
    radius = np.where(np.isnan(radius), tracks.radius.mean(), radius)
    start = contacts.point - contacts.normal * radius[contacts.i, None]
    end = contacts.point + contacts.normal * radius[contacts.j, None]
    ids = np.append(tracks.id, np.arange(len(tracks.id), n))
    names = list(found.walls.name) if found.walls is not None else []
    return {
        "frame": photograph, "status": forces.status.name.lower(), "trust": plain([forces.trust])[0],
        "line": _pixels(scale, start, end), "point": np.round(scale.to_pixels(contacts.point), 2).tolist(),
        "i": ids[contacts.i].tolist(),
        "j": [int(ids[j]) if j < n else names[j - n] for j in contacts.j.tolist()],
        "fn": plain(forces.fn), "ft": plain(forces.ft), "fn_sd": plain(forces.fn_sd), "ft_sd": plain(forces.ft_sd),
        "gap": plain(contacts.gap), "probability": plain(forces.probability), "age": forces.age.tolist(),
        "state": [ContactState(each).name.lower() for each in forces.state.tolist()],
        "source": [ContactSource(each).name.lower().replace("_", " ") for each in forces.source.tolist()],
        "mean_fn": plain([found.statistics[frame].mean_fn])[0],
        "rods": rods_of(tracks, frame, scale),
    }  # fmt: skip


def rods_of(tracks: Tracks, frame: int, scale: Scale) -> dict[str, Any]:
    """The rods of a frame in pixels; lost ones are absent."""
    here = np.flatnonzero(tracks.present[frame])
    place = scale.to_pixels(tracks.position[frame, here])
    unbent = np.maximum(scale.size_at(place), 1e-12)
    return {
        "id": tracks.id[here].tolist(), "x": np.round(place[:, 0], 2).tolist(), "y": np.round(place[:, 1], 2).tolist(),
        "r": np.round(tracks.radius[here] / unbent, 2).tolist(), "zncc": plain(tracks.zncc[frame, here]),
        "angle": plain(-tracks.rotation[frame, here]),
        "status": [TrackStatus(each).name.lower() for each in tracks.status[frame, here].tolist()],
    }  # fmt: skip


def history(found: Found, i: int | str, j: int | str) -> dict[str, Any]:
    """One contact in every photograph, by the names of its bodies; None where it is not there."""
    told: dict[str, list[Any]] = {key: [None] * found.first for key in ("fn", "ft", "fn_sd", "gap", "probability")}
    for forces in found.frames:
        row = _row(found, forces, i, j)
        for key in told:
            values: Array | NDArray[Any] = forces.contacts.gap if key == "gap" else getattr(forces, key)
            told[key].append(None if row is None else plain(values[row : row + 1])[0])
    return told


def _row(found: Found, forces: FrameForces, i: int | str, j: int | str) -> int | None:
    names = found.walls.name if found.walls is not None else ()
    n = forces.contacts.grain_count
    a = np.flatnonzero(found.tracks.id == i)
    b = np.array([n + names.index(j)]) if isinstance(j, str) and j in names else np.flatnonzero(found.tracks.id == j)
    if not len(a) or not len(b):
        return None
    rows = np.flatnonzero((forces.contacts.i == a[0]) & (forces.contacts.j == b[0]))
    return int(rows[0]) if len(rows) else None


def plain(values: Any) -> list[float | None]:
    """Numbers with five digits that count; None for those that are none."""
    given = np.asarray(values, np.float64).ravel()
    finite = np.isfinite(given)
    number = np.where(finite, given, 0.0)
    size = np.floor(np.log10(np.where(number == 0.0, 1.0, np.abs(number))))
    up, down = (
        10.0 ** np.clip(4.0 - size, 0.0, None),
        10.0 ** np.clip(size - 4.0, 0.0, None),
    )  # whole, so both are exact
    told: list[float | None] = (np.round(number * up / down) * down / up).tolist()
    for k in np.flatnonzero(~finite).tolist():
        told[k] = None
    return told


def _pixels(scale: Scale, start: Array, end: Array) -> list[list[float]]:
    both = np.concatenate([scale.to_pixels(start), scale.to_pixels(end)], axis=1)
    return np.round(both, 2).tolist()
