"""results.h5: what a run found out, in one file that any HDF5 reader opens.

The layout is public: README lists it. Datasets of contacts are concatenated over frames; the rows of frame k are
offset[k] : offset[k + 1].
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from datetime import UTC, datetime
from enum import IntEnum
from pathlib import Path
from typing import Any, TypeVar, cast

import h5py
import numpy as np

from solver.bodies.grains import Grains
from solver.calibration.calibrate import Calibration
from solver.contacts.contacts import Contacts, ContactSource, ContactState
from solver.contacts.radius_tuning import RadiusTuning
from solver.convex.friction_check import FrictionCheck
from solver.nlgs.sweep_record import SweepHistory
from solver.sequence.ensemble import MEMBERS
from solver.sequence.frame_forces import FrameForces, FrameStatus
from solver.statistics.frame_statistics import FrameStatistics

from .. import __version__
from ..atomic import replacing
from ..errors import InputError
from ..tracks import Tracks, TrackStatus, WallTracks
from .checkpoint import flatten, restore
from .results import Results
from .schema import (
    CONTACT_COLUMNS,
    FORCE_COLUMNS,
    FRAME_SCALARS,
    GEOMETRY,
    HISTORY_COLUMNS,
    LATER_FRAME_SCALARS,
    SCHEMA,
    SCHEMA_VERSION,
    TRACK_OPTIONS,
    UNITS,
)

T = TypeVar("T")
DEVIATIONS = ("forces/fn_sd", "forces/ft_sd")


@dataclass(frozen=True, slots=True)
class Provenance:
    """Where results come from; stored as attributes."""

    fingerprint: str  # of the input and the settings that matter for what is stored
    experiment: str  # path of the experiment file
    frames: tuple[int, int | None]  # the experiment's frames that are in it: first, and end or None
    checksums: dict[str, str]  # SHA-256 by input file


def save_tracks(file: Path, name: str, tracks: Tracks, walls: WallTracks | None, origin: Provenance) -> None:
    """Write tracks alone, as the tracking stage leaves them."""
    with replacing(file) as part, h5py.File(part, "w") as store:
        _write_origin(store, name, origin)
        _write_tracks(store, tracks, walls)
        store.create_dataset("grains/radius", data=tracks.radius)
        _add_units(store)


def load_tracks(file: Path) -> tuple[Tracks, WallTracks | None]:
    with _open(file) as store:
        return _read_tracks(store)


def save_results(file: Path, results: Results, origin: Provenance) -> None:
    """Write everything; float64 where it was computed so, recorded sweeps in float32."""
    with replacing(file) as part, h5py.File(part, "w") as store:
        _write_origin(store, results.name, origin)
        store.attrs["configuration"] = results.configuration
        store.attrs["friction"] = results.friction
        _write_tracks(store, results.tracks, results.walls)
        store.create_dataset("grains/radius", data=results.grains.radius)
        store.create_dataset("grains/mass", data=results.grains.mass)
        _write_frames(store, results)
        _write_contacts(store, results.frames)
        for name in DEVIATIONS:
            store[name].attrs["source"] = _source_of_deviation(results.ensemble_size)
            store[name].attrs["ensemble_size"] = results.ensemble_size
        _write_sweeps(store, results.frames)
        _write_members(store, results.frames)
        for each in fields(FrameStatistics):
            values = np.array([getattr(s, each.name) for s in results.statistics])
            store.create_dataset(f"statistics/{each.name}", data=values)
        _write_part(store, "calibration", results.calibration)
        _write_part(store, "friction_check", results.friction_check)
        _write_part(store, "radius_tuning", results.radius_tuning)
        _add_units(store)


def load_results(file: Path) -> Results:
    """Read what save_results wrote; raises InputError if the file is something else."""
    with _open(file) as store:
        if "forces" not in store:
            raise InputError(file, "", "holds no forces: solve the experiment first")
        tracks, walls = _read_tracks(store)
        assert walls is not None
        grains = Grains(_read(store, "grains/radius"), _read(store, "grains/mass"))
        statistics = {each.name: _read(store, f"statistics/{each.name}") for each in fields(FrameStatistics)}
        return Results(
            name=str(store.attrs["name"]),
            tracks=tracks,
            walls=walls,
            grains=grains,
            friction=float(cast(float, store.attrs["friction"])),
            frames=_read_frames(store, grains.count, walls.count),
            statistics=[
                FrameStatistics(**{key: _plain(values[k]) for key, values in statistics.items()})
                for k in range(tracks.frame_count)
            ],
            configuration=str(store.attrs["configuration"]),
            calibration=_read_part(store, "calibration", Calibration),
            friction_check=_read_part(store, "friction_check", FrictionCheck),
            radius_tuning=_read_part(store, "radius_tuning", RadiusTuning),
            ensemble_size=int(cast(int, store[DEVIATIONS[0]].attrs.get("ensemble_size", 0))),
        )


def read_origin(file: Path) -> Provenance | None:
    """Where a stored file comes from; None if there is no such file, or it is not one of ours."""
    try:
        with h5py.File(file, "r") as store:
            sums = store["origin/checksums"].attrs
            first, stop = cast(np.ndarray, store.attrs["frames"])
            return Provenance(
                str(store.attrs["fingerprint"]),
                str(store.attrs["experiment"]),
                (int(first), int(stop) if stop >= 0 else None),
                {str(key): str(value) for key, value in sums.items()},
            )
    except (OSError, KeyError):
        return None


def _open(file: Path) -> h5py.File:
    try:
        store = h5py.File(file, "r")
    except FileNotFoundError:
        raise InputError(file, "", "there is no such file") from None
    except OSError:
        raise InputError(file, "", "is not an HDF5 file that can be read") from None
    if store.attrs.get(SCHEMA) != SCHEMA_VERSION:
        found = store.attrs.get(SCHEMA)
        store.close()
        raise InputError(file, f"{SCHEMA} {found}", f"is not the schema that this version reads ({SCHEMA_VERSION})")
    return store


def _write_origin(store: h5py.File, name: str, origin: Provenance) -> None:
    store.attrs[SCHEMA] = SCHEMA_VERSION
    store.attrs["rodsight_version"] = __version__
    store.attrs["created"] = datetime.now(UTC).isoformat(timespec="seconds")
    store.attrs["name"] = name
    store.attrs["fingerprint"] = origin.fingerprint
    store.attrs["experiment"] = origin.experiment
    first, stop = origin.frames
    store.attrs["frames"] = (first, -1 if stop is None else stop)
    sums = store.create_group("origin/checksums").attrs
    for file, digest in origin.checksums.items():
        sums[file] = digest


def _write_tracks(store: h5py.File, tracks: Tracks, walls: WallTracks | None) -> None:
    store.create_dataset("grains/id", data=tracks.id)
    store.create_dataset("frames/time", data=tracks.time)
    for key in ("position", "rotation", "sigma", "zncc"):
        _compressed(store, f"tracks/{key}", getattr(tracks, key))
    _enumerated(store, "tracks/status", tracks.status, TrackStatus)
    if tracks.centre_sigma is not None:
        store.create_dataset("tracks/centre_sigma", data=tracks.centre_sigma)
    for key in TRACK_OPTIONS:
        if getattr(tracks, key) is not None:
            _compressed(store, f"tracks/{key}", getattr(tracks, key))
    if walls is not None:
        store.create_dataset("walls/name", data=np.array(walls.name, dtype=object), dtype=h5py.string_dtype())
        store.create_dataset("walls/endpoints", data=walls.endpoints)
        store.create_dataset("walls/pressure", data=walls.pressure)
        if walls.force is not None:
            store.create_dataset("walls/force", data=walls.force)
        if walls.sigma is not None:
            store.create_dataset("walls/sigma", data=walls.sigma)


def _read_tracks(store: h5py.File) -> tuple[Tracks, WallTracks | None]:
    tracks = Tracks(
        id=_read(store, "grains/id"),
        radius=_read(store, "grains/radius"),
        time=_read(store, "frames/time"),
        **{key: _read(store, f"tracks/{key}") for key in ("position", "rotation", "sigma", "zncc", "status")},
        centre_sigma=_read(store, "tracks/centre_sigma") if "tracks/centre_sigma" in store else None,
        **{key: _read(store, f"tracks/{key}") for key in TRACK_OPTIONS if f"tracks/{key}" in store},
    )
    if "walls" not in store:
        return tracks, None
    names = tuple(name.decode() for name in _read(store, "walls/name"))
    force, sigma = (_read(store, f"walls/{key}") if f"walls/{key}" in store else None for key in ("force", "sigma"))
    return tracks, WallTracks(names, _read(store, "walls/endpoints"), _read(store, "walls/pressure"), force, sigma)


def _write_frames(store: h5py.File, results: Results) -> None:
    frames = results.frames
    _enumerated(store, "frames/status", np.array([f.status for f in frames], np.uint8), FrameStatus)
    reasons = np.array([f.reason for f in frames], dtype=object)
    store.create_dataset("frames/reason", data=reasons, dtype=h5py.string_dtype())
    for key in (*FRAME_SCALARS, *LATER_FRAME_SCALARS):
        store.create_dataset(f"frames/{key}", data=np.array([getattr(f, key) for f in frames]))


def _write_contacts(store: h5py.File, frames: Any) -> None:
    counts = [f.contacts.count for f in frames]
    store.create_dataset("contacts/offset", data=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64))
    for key in GEOMETRY:
        _compressed(store, f"contacts/{key}", np.concatenate([getattr(f.contacts, key) for f in frames]))
    for key in CONTACT_COLUMNS:
        values = np.concatenate([getattr(f, key) for f in frames])
        kind = {"state": ContactState, "source": ContactSource}.get(key)
        if kind is None:
            _compressed(store, f"contacts/{key}", values)
        else:
            _enumerated(store, f"contacts/{key}", values, kind)
    for key in FORCE_COLUMNS:
        _compressed(store, f"forces/{key}", np.concatenate([getattr(f, key) for f in frames]))


def _source_of_deviation(ensemble_size: int) -> str:
    if ensemble_size:
        return f"spread of {ensemble_size} sequences solved again with resampled noise and varied settings"
    return "formula fitted on simulated truth"


def _write_members(store: h5py.File, frames: Any) -> None:
    if any(f.member_force is None for f in frames):
        return
    _compressed(store, "members/force", np.concatenate([f.member_force for f in frames]))
    store["members/force"].attrs["member"] = list(MEMBERS)


def _write_sweeps(store: h5py.File, frames: Any) -> None:
    histories = [f.history for f in frames]
    # Rows of the sweeps that were measured; `number` says which sweeps of their frame they are.
    measured = [_measured(h) for h in histories]
    store.create_dataset("sweeps/count", data=np.array([h.count for h in histories], np.int64))
    store.create_dataset("sweeps/offset", data=np.concatenate([[0], np.cumsum([len(m) for m in measured])]))
    _compressed(store, "sweeps/number", np.concatenate(measured))
    for key in HISTORY_COLUMNS:
        rows = [getattr(h, key)[m] for h, m in zip(histories, measured, strict=True)]
        _compressed(store, f"sweeps/{key}", np.concatenate(rows))
    # Sweeps whose forces were kept: their numbers, and rows of forces laid end to end over all frames.
    kept = np.concatenate([[0], np.cumsum([len(h.recorded) for h in histories])])
    store.create_dataset("sweeps/recorded_offset", data=kept)
    _compressed(store, "sweeps/recorded", np.concatenate([h.recorded for h in histories]))
    for key in ("fn", "ft"):
        _compressed(store, f"sweeps/{key}", np.concatenate([getattr(h, key).ravel() for h in histories]))


def _measured(history: SweepHistory) -> np.ndarray:
    """Sweeps of a frame, from 0, whose residuals were measured."""
    rows = np.stack([getattr(history, key) for key in HISTORY_COLUMNS])
    return np.flatnonzero(~np.isnan(rows).all(axis=0))


def _write_part(store: h5py.File, group: str, part: Any) -> None:
    """One dataset per field of a dataclass, nested ones in groups of their own."""
    if part is None:
        return
    for name, value in flatten(part):
        data = str(value) if value.dtype.kind == "U" else value
        store.create_dataset(f"{group}/{name.replace('.', '/')}", data=data)


def _read_part(store: h5py.File, group: str, kind: type[T]) -> T | None:
    if group not in store:
        return None
    values: dict[str, Any] = {}

    def gather(path: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset):
            values[path.replace("/", ".")] = item.asstr()[()] if h5py.check_string_dtype(item.dtype) else item[()]

    store[group].visititems(gather)  # type: ignore[union-attr]
    return restore(kind, values, "")


def _read_frames(store: h5py.File, grain_count: int, wall_count: int) -> list[FrameForces]:
    columns = {key: _read(store, f"contacts/{key}") for key in (*GEOMETRY, *CONTACT_COLUMNS)}
    columns |= {key: _read(store, f"forces/{key}") for key in FORCE_COLUMNS}
    later = [key for key in LATER_FRAME_SCALARS if f"frames/{key}" in store]
    scalars = {key: _read(store, f"frames/{key}") for key in (*FRAME_SCALARS, *later)}
    status, reason = _read(store, "frames/status"), _read(store, "frames/reason")
    history = {key: _read(store, f"sweeps/{key}") for key in ("number", *HISTORY_COLUMNS, "recorded", "fn", "ft")}
    sweep_count = _read(store, "sweeps/count")
    offset, sweep_offset = _read(store, "contacts/offset"), _read(store, "sweeps/offset")
    kept_offset = _read(store, "sweeps/recorded_offset")
    members = _read(store, "members/force") if "members/force" in store else None
    frames, at = [], 0
    for k in range(len(status)):
        rows, sweeps = slice(offset[k], offset[k + 1]), slice(sweep_offset[k], sweep_offset[k + 1])
        recorded = history["recorded"][kept_offset[k] : kept_offset[k + 1]]
        count = int(offset[k + 1] - offset[k])
        block = slice(at, at + len(recorded) * count)
        at = block.stop
        geometry = {key: columns[key][rows] for key in GEOMETRY}
        frames.append(
            FrameForces(
                frame=k,
                contacts=Contacts(**geometry, grain_count=grain_count, wall_count=wall_count),
                **{key: columns[key][rows] for key in (*CONTACT_COLUMNS, *FORCE_COLUMNS)},
                status=FrameStatus(status[k]),
                reason=reason[k].decode(),
                **{key: _plain(values[k]) for key, values in scalars.items()},
                history=SweepHistory(
                    **{
                        key: _on_every_sweep(sweep_count[k], history["number"][sweeps], history[key][sweeps])
                        for key in HISTORY_COLUMNS
                    },
                    recorded=recorded,
                    fn=history["fn"][block].reshape(len(recorded), count),
                    ft=history["ft"][block].reshape(len(recorded), count),
                ),
                member_force=None if members is None else members[rows],
            )
        )
    return frames


def _on_every_sweep(count: int, number: np.ndarray, values: np.ndarray) -> np.ndarray:
    """The values of some sweeps on a row for every sweep (count,), NaN where nothing was measured."""
    every = np.full(count, np.nan)
    every[number] = values
    return every


def _read(store: h5py.File, path: str) -> Any:
    dataset = store[path]
    assert isinstance(dataset, h5py.Dataset)
    return dataset[()]


def _plain(value: Any) -> Any:
    return value.item() if np.ndim(value) == 0 else value


def _compressed(store: h5py.File, path: str, values: np.ndarray) -> None:
    if values.size:
        store.create_dataset(path, data=values, compression="gzip", compression_opts=4, shuffle=True)
    else:
        store.create_dataset(path, data=values)


def _enumerated(store: h5py.File, path: str, values: np.ndarray, kind: type[IntEnum]) -> None:
    names = {member.name.lower(): member.value for member in kind}
    store.create_dataset(path, data=values.astype(np.uint8), dtype=h5py.enum_dtype(names, basetype=np.uint8))


def _add_units(store: h5py.File) -> None:
    for path, unit in UNITS.items():
        if path in store:
            store[path].attrs["unit"] = unit
