"""Tracking of the small photographed experiment, and the errors of its walls."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from rodsight.cli.main import main
from rodsight.experiment.reading.tables import read_table
from rodsight.results.hdf5.store import load_tracks
from rodsight.tracks import Tracks, WallTracks


@dataclass(frozen=True, slots=True)
class Tracked:
    """A tracked experiment."""

    out: Path
    tracks: Tracks
    walls: WallTracks
    true_walls: np.ndarray  # (f, w, 2, 2) [m]


def track(experiment: Path, out: Path, *more: str) -> tuple[Tracks, WallTracks | None]:
    with pytest.raises(SystemExit) as stop:
        main(["track", str(experiment), "--out", str(out), "--quiet", *more])
    assert stop.value.code == 0
    return load_tracks(out / "tracks.h5")


def track_all(experiment: Path, true_walls: np.ndarray, *more: str) -> Tracked:
    """Track an experiment and write the result beside it."""
    out = experiment.parent / "out"
    tracks, walls = track(experiment, out, *more)
    assert walls is not None
    return Tracked(out, tracks, walls, true_walls)


def read_walls(experiment: Path) -> np.ndarray:
    """Read the ends of the walls of all frames (f, w, 2, 2) [m]."""
    table = read_table(experiment / "walls.csv", ("frame", "x1", "y1", "x2", "y2"))
    return np.column_stack([table.numbers(name) for name in ("x1", "y1", "x2", "y2")]).reshape(-1, 4, 2, 2)


def keep_first_walls(experiment: Path) -> np.ndarray:
    """Remove all walls but those of frame 0 from the table; returns those of all frames (f, w, 2, 2) [m]."""
    file, ends = experiment / "walls.csv", read_walls(experiment)
    file.write_text("\n".join(file.read_text().splitlines()[:5]) + "\n")
    return ends


def wall_errors(found: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Return the errors of found ends along the true walls' normals (f, w, 2) [m]."""
    along = true[:, :, 1] - true[:, :, 0]
    normal = np.stack([along[..., 1], -along[..., 0]], axis=-1) / np.linalg.norm(along, axis=-1, keepdims=True)
    return np.einsum("fwek,fwk->fwe", found - true, normal)
