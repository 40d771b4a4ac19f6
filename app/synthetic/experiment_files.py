"""The files of a synthetic experiment besides its photographs: tables and experiment.toml."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from solver.bodies.grains import Array
from solver.dem.simulation import DemTruth


def write_walls(path: Path, names: Sequence[str], endpoints: Array) -> None:
    """Write endpoints (f, w, 2, 2) [m] as walls.csv."""
    rows = (
        (frame, name, *(_metres(value) for value in ends.ravel()))
        for frame, walls in enumerate(endpoints)
        for name, ends in zip(names, walls, strict=True)
    )
    _write(path, ("frame", "wall", "x1", "y1", "x2", "y2"), rows)


def write_tracks(path: Path, position: Array, rotation: Array) -> None:
    """Write position (f, n, 2) [m] and rotation (f, n) [rad]; a grain's id is its row."""
    rows = (
        (frame, grain, _metres(x), _metres(y), f"{theta:.9f}")
        for frame in range(len(position))
        for grain, ((x, y), theta) in enumerate(zip(position[frame], rotation[frame], strict=True))
    )
    _write(path, ("frame", "id", "x", "y", "theta"), rows)


def write_truth_contacts(path: Path, truth: DemTruth) -> None:
    """Write the true forces [N]; j is a grain's id or a wall's name."""
    n = len(truth.radius)
    frame = np.repeat(np.arange(truth.frame_count), np.diff(truth.offset))
    rows = (
        (k, i, j if j < n else truth.wall_names[j - n], f"{fn:.9g}", f"{ft:.9g}")
        for k, i, j, fn, ft in zip(frame, truth.i, truth.j, truth.fn, truth.ft, strict=True)
    )
    _write(path, ("frame", "i", "j", "fn", "ft"), rows)


def write_wall_forces(path: Path, truth: DemTruth) -> None:
    """Write the packing's force on every wall [N], as sensors would record it."""
    n, w = len(truth.radius), len(truth.wall_names)
    along = truth.endpoints[:, :, 1] - truth.endpoints[:, :, 0]
    along /= np.linalg.norm(along, axis=2, keepdims=True)
    normal = np.stack([along[..., 1], -along[..., 0]], axis=2)  # the tangent, normal turned by +90°, is `along`
    frame = np.repeat(np.arange(truth.frame_count), np.diff(truth.offset))
    on_wall = truth.j >= n
    k, wall = frame[on_wall], truth.j[on_wall] - n
    force = np.zeros((truth.frame_count, w, 2))
    each = truth.fn[on_wall, None] * normal[k, wall] + truth.ft[on_wall, None] * along[k, wall]
    np.add.at(force, (k, wall), each)
    rows = (
        (k, name, f"{fx:.4f}", f"{fy:.4f}")
        for k, walls in enumerate(force)
        for name, (fx, fy) in zip(truth.wall_names, walls, strict=True)
    )
    _write(path, ("frame", "wall", "fx", "fy"), rows)


def write_grains(path: Path, radius: Array) -> None:
    """Write radius (n,) [m], as tracks need it."""
    _write(path, ("id", "radius"), ((grain, _metres(value)) for grain, value in enumerate(radius)))


def write_grains_in_pixels(path: Path, pixels: Array, radius: Array) -> None:
    """Write centres (n, 2) and radius (n,) [px] on the first photograph."""
    rows = (
        (grain, f"{x:.4f}", f"{y:.4f}", f"{r:.4f}")
        for grain, ((x, y), r) in enumerate(zip(pixels, radius, strict=True))
    )
    _write(path, ("id", "x", "y", "radius"), rows)


def write_times(path: Path, time: Array) -> None:
    """Write time (f,) [s]."""
    _write(path, ("frame", "time"), ((frame, f"{value:.6f}") for frame, value in enumerate(time)))


def write_experiment(path: Path, *, name: str, remark: str, source: str, truth: DemTruth) -> None:
    """Write experiment.toml; source is its [photographs] or [tracks] table."""
    settings = truth.settings
    name = re.sub(r"[^\w .+-]", "-", name)
    name = name if re.match(r"\w", name) else f"synthetic {name}"
    remarks = "".join(f"# {line}\n" for line in remark.splitlines())
    path.write_text(
        f"""{remarks}name = "{name}"
truth = "truth_contacts.csv"
truth_tracks = "truth_tracks.csv"

{source}
[walls]
file = "walls.csv"
forces = "wall_forces.csv"
[walls.top]
pressure = {settings.pressure}

[material]
density = {settings.density}
length = {settings.length}
friction = {settings.friction}
wall_friction = {settings.wall_friction}
""",
        encoding="utf-8",
    )


def _metres(value: float) -> str:
    return f"{value:.9f}"


def _write(path: Path, header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(rows)
