"""The frames of a run that are there: of finished results, or of one that still goes on."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.contacts.contacts import ContactSource, ContactState
from solver.sequence.frame_forces import FrameForces
from solver.statistics.frame_statistics import FrameStatistics

from ...experiment.units import Scale
from ...results.checkpoint import Checkpoint
from ...results.results import Results
from ...results.store import load_results, load_tracks
from ...run_folder import RESULTS, TRACKS, UNFINISHED
from ...tracks import Tracks, TrackStatus, WallTracks


@dataclass(frozen=True, slots=True)
class Found:
    """Tracks, and the frames that have been solved."""

    tracks: Tracks
    walls: WallTracks | None
    frames: tuple[FrameForces, ...]
    statistics: tuple[FrameStatistics, ...]
    results: Results | None  # None: of a run that goes on

    @property
    def provisional(self) -> bool:
        return self.results is None


def find_run(folder: Path) -> Found | None:
    """What lies in a run's folder; a run that goes on counts before what it will replace. None: nothing yet."""
    going_on = _unfinished(folder)
    if going_on is not None:
        return going_on
    if not (folder / RESULTS).is_file():
        return None
    results = load_results(folder / RESULTS)
    return Found(results.tracks, results.walls, tuple(results.frames), tuple(results.statistics), results)


def run_stamp(folder: Path) -> tuple[Any, ...]:
    """By which it is seen whether anything has come."""
    kept = sorted((folder / UNFINISHED / "solving").glob("*.piece"))
    told = [folder / TRACKS, folder / RESULTS]
    return len(kept), *(file.stat().st_mtime_ns if file.is_file() else 0 for file in told)


def _unfinished(folder: Path) -> Found | None:
    """Finished frames of a run that goes on, or was stopped."""
    place, tracks = folder / UNFINISHED / "solving", folder / TRACKS
    try:
        fingerprint = (place / "fingerprint").read_text()
    except OSError:
        return None
    if not tracks.is_file():
        return None
    checkpoint = Checkpoint(place, fingerprint)
    try:
        solved = [checkpoint.load(k, FrameForces, FrameStatistics) for k in range(checkpoint.finished())]
    except FileNotFoundError:  # it finished just now, and took its pieces away
        return None
    if not solved:
        return None
    seen, walls = load_tracks(tracks)
    return Found(seen, walls, tuple(each[0] for each in solved), tuple(each[1] for each in solved), None)


def frame_facts(found: Found) -> dict[str, Any]:
    """What is told of every frame, for the time line."""
    frames, statistics, tracks = found.frames, found.statistics, found.tracks
    lost = np.isin(tracks.status, (TrackStatus.LOST, TrackStatus.OUT_OF_FRAME)).sum(axis=1)
    suspect = (tracks.status == TrackStatus.SUSPECT).sum(axis=1)
    return {
        "count": len(frames), "provisional": found.provisional, "rods": tracks.grain_count,
        "status": [frame.status.name.lower() for frame in frames],
        "reason": [frame.failed_reason or frame.reason for frame in frames],
        "trust": plain([frame.trust for frame in frames]),
        "contacts": [frame.contacts.count for frame in frames],
        "residual": plain([frame.natural_map for frame in frames]),
        "correction": plain([frame.correction for frame in frames]),
        "friction_angle": plain([np.rad2deg(each.friction_angle) for each in statistics]),
        "coordination": plain([each.coordination_number for each in statistics]),
        "mean_fn": plain([each.mean_fn for each in statistics]),
        "lost": lost.tolist(), "suspect_poses": suspect.tolist(),
        "time": tracks.time[: len(frames)].tolist(),
    }  # fmt: skip


def network(found: Found, frame: int, scale: Scale) -> dict[str, Any]:
    """Contacts and forces of a frame: places in pixels of the photograph, forces in newtons."""
    forces, tracks = found.frames[frame], found.tracks
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
        "frame": frame, "status": forces.status.name.lower(), "trust": plain([forces.trust])[0],
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
    """One contact in every frame, by the names of its bodies; None where it is not there."""
    told: dict[str, list[Any]] = {key: [] for key in ("fn", "ft", "fn_sd", "gap", "probability")}
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
    return [float(f"{v:.5g}") if np.isfinite(v) else None for v in np.asarray(values, np.float64).tolist()]


def _pixels(scale: Scale, start: Array, end: Array) -> list[list[float]]:
    both = np.concatenate([scale.to_pixels(start), scale.to_pixels(end)], axis=1)
    return np.round(both, 2).tolist()
