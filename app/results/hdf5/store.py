"""Save and load results.h5, one file with all results of a run for any HDF5 reader.

`schema` lists its datasets; this module writes and checks its attributes and its provenance.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import cast

import h5py
import numpy as np

from ... import __version__
from ...process.atomic import replacing
from ...process.errors import InputError
from ...process.frame_range import FrameRange
from ...solver.frame_forces import MEMBERS
from ...tracks import Tracks, WallTracks
from ..finding import Finding
from ..manifest import MANIFEST, Manifest
from ..results import Results
from ..schema import DEVIATIONS, SCHEMA, SCHEMA_VERSION
from .file_creation import CACHED_BLOCKS, create_file
from .provenance import Provenance
from .reader import StoredRun
from .writer import columns_of, write_columns, write_results


def save_tracks(file: Path, name: str, tracks: Tracks, walls: WallTracks | None, origin: Provenance) -> None:
    """Write the tracks of the tracking stage."""
    with _creating(file) as store:
        _write_origin(store, name, origin)
        write_columns(store, columns_of("tracks", tracks) | columns_of("walls", walls))


def load_tracks(file: Path) -> tuple[Tracks, WallTracks | None]:
    """Read tracks. Raises InputError where the file is damaged or something else."""
    with _open(file) as store:
        stored = StoredRun(file, store)
        return stored.part("tracks"), stored.part("walls")


def save_results(file: Path, results: Results, origin: Provenance) -> None:
    """Write all results frame after frame, in float64 as computed, recorded sweeps in float32."""
    with _creating(file) as store:
        _write_origin(store, results.name, origin)
        store.attrs["configuration"] = results.configuration
        store.attrs["friction"] = results.friction
        store.attrs["base_friction"] = results.base_friction
        store.attrs["diagnosis"] = json.dumps([asdict(each) for each in results.diagnosis])
        write_results(store, results)
        for path in DEVIATIONS:
            store[path].attrs["source"] = _source_of_deviation(results.ensemble_size)
            store[path].attrs["ensemble_size"] = results.ensemble_size
        if "members/force" in store:
            store["members/force"].attrs["member"] = list(MEMBERS)


def load_results(file: Path) -> Results:
    """Read results of any schema version. Raises InputError where the file is damaged or something else."""
    with _open(file) as store:
        if "forces" not in store:
            raise InputError(file, "", "holds no forces: solve the experiment first")
        stored = StoredRun(file, store)
        tracks, walls, grains = (stored.require(part) for part in ("tracks", "walls", "grains"))
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
            lens=stored.part("lens"),
            fringes=stored.part("fringes"),
            friction_check=stored.part("friction_check"),
            radius_tuning=stored.part("radius_tuning"),
            read_kinematics=stored.deferred("kinematics"),
            base_friction=float(store.attrs.get("base_friction", 0.0)),
            diagnosis=tuple(Finding(**each) for each in json.loads(str(store.attrs.get("diagnosis", "[]")))),
            ensemble_size=_ensemble_size(store),
        )


def read_origin(file: Path) -> Provenance | None:
    """Return the provenance of a stored file; None if it is missing or not of Rodsight."""
    try:
        with h5py.File(file, "r") as store:
            sums = store["origin/checksums"].attrs
            first, stop, *step = (int(each) for each in cast(np.ndarray, store.attrs["frames"]))
            return Provenance(
                str(store.attrs["fingerprint"]),
                str(store.attrs["experiment"]),
                FrameRange(first, stop if stop >= 0 else None, *step),
                {str(key): str(value) for key, value in sums.items()},
                str(store.attrs.get("inputs", "")),
                str(store.attrs.get("code", "")),
                _libraries(store),
            )
    except (OSError, KeyError, TypeError, ValueError, RecursionError):
        return None


def _libraries(store: h5py.File) -> dict[str, str]:
    stored = json.loads(str(store.attrs.get("libraries", "{}")))
    return {str(name): str(version) for name, version in stored.items()} if isinstance(stored, dict) else {}


def origin_of(file: Path) -> Provenance:
    """Return the provenance of a stored file. Raises InputError where it is missing."""
    origin = read_origin(file)
    if origin is None:
        raise InputError(file, "", "has no provenance: it is not a results.h5 of Rodsight")
    return origin


@contextmanager
def _creating(file: Path) -> Iterator[h5py.File]:
    with replacing(file) as part, create_file(part) as store:
        yield store


@contextmanager
def _open(file: Path) -> Iterator[h5py.File]:
    """Open a file of Rodsight; errors of reading it become an InputError."""
    store = _opened(file)
    try:
        with store:
            yield store
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:  # the library reads on access
        if isinstance(error, OSError) and error.filename is not None:
            raise
        raise InputError(file, "", f"is damaged: {error}") from None


def _opened(file: Path) -> h5py.File:
    if file.exists() and not file.is_file():
        raise InputError(file, "", "is not a file")
    if not Manifest(file.parent).is_whole(file.name):
        raise InputError(
            file, "", f"differs from its entry in {MANIFEST}: it was damaged or changed; run the experiment again"
        )
    try:
        store = h5py.File(file, "r", rdcc_nslots=CACHED_BLOCKS)
    except FileNotFoundError:
        raise InputError(file, "", "there is no such file") from None
    except OSError:
        raise InputError(file, "", "is not a readable HDF5 file") from None
    found = store.attrs.get(SCHEMA)
    if not isinstance(found, np.integer) or not 1 <= found <= SCHEMA_VERSION:
        store.close()
        known = f"the versions that this program reads (1 to {SCHEMA_VERSION})"
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
        return f"standard deviation of {ensemble_size} sequences solved with resampled noise and varied settings"
    return "formula fitted on simulated truth"


def _write_origin(store: h5py.File, name: str, origin: Provenance) -> None:
    store.attrs[SCHEMA] = SCHEMA_VERSION
    store.attrs["rodsight_version"] = __version__
    store.attrs["created"] = datetime.now(UTC).isoformat(timespec="seconds")
    store.attrs["name"] = name
    store.attrs["fingerprint"] = origin.fingerprint
    store.attrs["inputs"] = origin.inputs
    store.attrs["code"] = origin.code
    store.attrs["libraries"] = json.dumps(origin.libraries)
    store.attrs["experiment"] = origin.experiment
    store.attrs["frames"] = origin.frames.stored
    sums = store.create_group("origin/checksums").attrs
    for file, digest in origin.checksums.items():
        sums[file] = digest
