"""results.h5: what a run found out, in one file that any HDF5 reader opens.

What is in it is the table of `schema`; this file says how it begins and ends, and where it comes from.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import cast

import h5py
import numpy as np

from solver.sequence.ensemble import MEMBERS

from ... import __version__
from ...atomic import replacing
from ...errors import InputError
from ...tracks import Tracks, WallTracks
from ..manifest import MANIFEST, Manifest
from ..results import Results
from ..schema import DEVIATIONS, SCHEMA, SCHEMA_VERSION
from .reader import Stored
from .refusable import created
from .writer import columns_of, write_columns, write_results


@dataclass(frozen=True, slots=True)
class Provenance:
    """Where results come from; stored as attributes."""

    fingerprint: str  # of the input and the settings that matter for what is stored
    experiment: str  # name of the experiment file; earlier versions: its path
    frames: tuple[int, int | None]  # the experiment's frames that are in it: first, and end or None
    checksums: dict[str, str]  # SHA-256 by input file


def save_tracks(file: Path, name: str, tracks: Tracks, walls: WallTracks | None, origin: Provenance) -> None:
    """Write tracks alone, as the tracking stage leaves them."""
    with _creating(file) as store:
        _write_origin(store, name, origin)
        write_columns(store, columns_of("tracks", tracks) | columns_of("walls", walls))


def load_tracks(file: Path) -> tuple[Tracks, WallTracks | None]:
    with _open(file) as store:
        stored = Stored(file, store)
        return stored.part("tracks"), stored.part("walls")


def save_results(file: Path, results: Results, origin: Provenance) -> None:
    """Write everything, frame after frame; float64 where it was computed so, recorded sweeps in float32."""
    with _creating(file) as store:
        _write_origin(store, results.name, origin)
        store.attrs["configuration"] = results.configuration
        store.attrs["friction"] = results.friction
        write_results(store, results)
        for path in DEVIATIONS:
            store[path].attrs["source"] = _source_of_deviation(results.ensemble_size)
            store[path].attrs["ensemble_size"] = results.ensemble_size
        if "members/force" in store:
            store["members/force"].attrs["member"] = list(MEMBERS)


def load_results(file: Path) -> Results:
    """Read what save_results wrote, in any version; raises InputError if the file is something else."""
    with _open(file) as store:
        if "forces" not in store:
            raise InputError(file, "", "holds no forces: solve the experiment first")
        stored = Stored(file, store)
        tracks, walls, grains = (stored.need(part) for part in ("tracks", "walls", "grains"))
        return Results(
            name=str(_attribute(file, store, "name")),
            tracks=tracks,
            walls=walls,
            grains=grains,
            friction=_friction(file, store),
            frames=stored.frames(grains.count, walls.count),
            statistics=stored.statistics(),
            configuration=_configuration(file, store),
            calibration=stored.part("calibration"),
            boundary=stored.part("boundary"),
            friction_check=stored.part("friction_check"),
            radius_tuning=stored.part("radius_tuning"),
            ensemble_size=_ensemble_size(store),
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
    except (OSError, KeyError, TypeError, ValueError):
        return None


def origin_of(file: Path) -> Provenance:
    """Where a stored file comes from. Raises InputError where it does not say so."""
    origin = read_origin(file)
    if origin is None:
        raise InputError(file, "", "does not say where it comes from")
    return origin


@contextmanager
def _creating(file: Path) -> Iterator[h5py.File]:
    with replacing(file) as part, created(part) as store:
        yield store


@contextmanager
def _open(file: Path) -> Iterator[h5py.File]:
    """Open one of our files; what cannot be read of it is an InputError."""
    store = _opened(file)
    try:
        with store:
            yield store
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:  # the library reads when it is asked
        if isinstance(error, OSError) and error.filename is not None:
            raise
        raise InputError(file, "", f"is damaged: {error}") from None


def _opened(file: Path) -> h5py.File:
    if file.exists() and not file.is_file():
        raise InputError(file, "", "is not a file")
    if not Manifest(file.parent).is_whole(file.name):
        raise InputError(file, "", f"is not what {MANIFEST} lists: it was damaged or changed; run the experiment again")
    try:
        store = h5py.File(file, "r")
    except FileNotFoundError:
        raise InputError(file, "", "there is no such file") from None
    except OSError:
        raise InputError(file, "", "is not an HDF5 file that can be read") from None
    found = store.attrs.get(SCHEMA)
    if not isinstance(found, np.integer) or not 1 <= found <= SCHEMA_VERSION:
        store.close()
        known = f"those that this version reads (1 to {SCHEMA_VERSION})"
        raise InputError(file, f"{SCHEMA} {found}", f"is not one of {known}")
    return store


def _attribute(file: Path, store: h5py.File, name: str) -> object:
    if name not in store.attrs:
        raise InputError(file, f"attribute {name}", "is missing")
    return store.attrs[name]


def _friction(file: Path, store: h5py.File) -> float:
    found = float(cast(float, _attribute(file, store, "friction")))
    if not 0.0 <= found < np.inf:
        raise InputError(file, f"attribute friction = {found:g}", "is no coefficient of friction")
    return found


def _configuration(file: Path, store: h5py.File) -> str:
    text = str(_attribute(file, store, "configuration"))
    try:
        tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise InputError(file, "attribute configuration", f"is not TOML: {error}") from None
    return text


def _ensemble_size(store: h5py.File) -> int:
    deviation = store.get(DEVIATIONS[0])
    return int(deviation.attrs.get("ensemble_size", 0)) if isinstance(deviation, h5py.Dataset) else 0


def _source_of_deviation(ensemble_size: int) -> str:
    if ensemble_size:
        return f"spread of {ensemble_size} sequences solved again with resampled noise and varied settings"
    return "formula fitted on simulated truth"


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
