"""Writers of a synthetic experiment's tables and experiment.toml."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..process.atomic import replacing, write_atomically
from ..process.errors import InputError
from ..solver.bodies.grains import Array
from ..solver.bodies.wall_shapes import IN, circle_parameters, wall_distance
from ..solver.dem.dem_truth import DemSettings, DemTruth

Ids = NDArray[np.integer]

FINEST_PRECISION = 1e-6  # [m], claimed of tracks without noise: tables are rounded, rods are elastic


@dataclass(frozen=True, slots=True)
class StatedInputs:
    """The material and the loads that an experiment file states."""

    pressure: dict[str, float]  # [Pa] on plates by the names of their walls; with a plate, all walls have sensors
    density: float  # [kg/m³]
    length: float  # [m]
    friction: float
    wall_friction: float
    gravity: tuple[float, float]  # [m/s²]

    @classmethod
    def of(cls, settings: DemSettings, *, plates: tuple[str, ...]) -> StatedInputs:
        """Return the true values of a simulation in which these walls are plates under its pressure."""
        return cls(
            dict.fromkeys(plates, settings.pressure), settings.density, settings.length, settings.friction,
            settings.wall_friction, settings.gravity,
        )  # fmt: skip


def refuse_full_folder(out: Path) -> None:
    """Raise InputError if a folder to be written exists and is not empty."""
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(out, "", "exists already and is not an empty folder")


def write_walls(path: Path, names: Sequence[str], endpoints: Array) -> None:
    """Write endpoints (f, w, 2, 2) [m] as walls.csv."""
    rows = (
        (frame, name, *(_metres(value) for value in ends.ravel()))
        for frame, walls in enumerate(endpoints)
        for name, ends in zip(names, walls, strict=True)
    )
    _write(path, ("frame", "wall", "x1", "y1", "x2", "y2"), rows)


def write_cell(path: Path, vectors: Array) -> None:
    """Write the vectors of a periodic cell (f, 2, 2) [m] as cell.csv."""
    rows = ((frame, *(_metres(value) for value in each.ravel())) for frame, each in enumerate(vectors))
    _write(path, ("frame", "ax", "ay", "bx", "by"), rows)


def write_boundary(path: Path, names: NDArray[np.int64]) -> None:
    """Write the ids (b,) of the grains that are the boundary as boundary.csv."""
    _write(path, ("id",), ((str(each),) for each in names))


def write_arcs(path: Path, names: Sequence[str], endpoints: Array, side: NDArray[np.int8]) -> None:
    """Write circles by their diameters (f, w, 2, 2) [m] as arcs.csv, with their rotations."""
    centre, radius, angle = circle_parameters(endpoints)
    rows = (
        (frame, name, _metres(x), _metres(y), _metres(radius[frame, w]), side_name, _metres(angle[frame, w]))
        for frame in range(len(endpoints))
        for w, (name, side_name) in enumerate(zip(names, ("in" if s == IN else "out" for s in side), strict=True))
        for x, y in (centre[frame, w],)
    )
    _write(path, ("frame", "wall", "x", "y", "radius", "side", "theta"), rows)


def write_corners(path: Path, names: Sequence[str], endpoints: Array) -> None:
    """Write discs by their diameters (f, c, 2, 2) [m] as corners.csv."""
    centre, radius, _ = circle_parameters(endpoints)
    rows = (
        (frame, name, _metres(x), _metres(y), _metres(radius[frame, c]))
        for frame in range(len(endpoints))
        for c, (name, (x, y)) in enumerate(zip(names, centre[frame], strict=True))
    )
    _write(path, ("frame", "corner", "x", "y", "radius"), rows)


def write_loads(path: Path, names: Sequence[str], load: Array) -> None:
    """Write loads on walls (f, w) [N] as load.csv."""
    rows = (
        (frame, name, f"{force:.4f}") for frame, row in enumerate(load) for name, force in zip(names, row, strict=True)
    )
    _write(path, ("frame", "wall", "force"), rows)


def write_tracks(
    path: Path, ids: Ids, position: Array, rotation: Array | None, lost: NDArray[np.bool_] | None = None
) -> None:
    """Write position (f, n, 2) [m] and rotation (f, n) [rad], None: unknown, of grains by id (n,); not of lost ones."""
    rows = (
        (frame, grain, _metres(x), _metres(y), *(() if rotation is None else (f"{rotation[frame, row]:.9f}",)))
        for frame in range(len(position))
        for row, (grain, (x, y)) in enumerate(zip(ids, position[frame], strict=True))
        if lost is None or not lost[frame, row]
    )
    _write(path, ("frame", "id", "x", "y", *(() if rotation is None else ("theta",))), rows)


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
    """Write the packing's force on every wall [N], as sensors record it."""
    rows = (
        (k, name, f"{fx:.4f}", f"{fy:.4f}")
        for k, walls in enumerate(forces_on_walls(truth))
        for name, (fx, fy) in zip(truth.wall_names, walls, strict=True)
    )
    _write(path, ("frame", "wall", "fx", "fy"), rows)


def forces_on_walls(truth: DemTruth) -> Array:
    """Return the packing's force on every wall (f, w, 2) [N]."""
    n, w = len(truth.radius), len(truth.wall_names)
    frame = np.repeat(np.arange(truth.frame_count), np.diff(truth.offset))
    on_wall = truth.j >= n
    k, wall = frame[on_wall], truth.j[on_wall] - n
    force = np.zeros((truth.frame_count, w, 2))
    side = None if truth.side is None else truth.side[wall]
    _, normal = wall_distance(truth.endpoints[k, wall], side, truth.position[k, truth.i[on_wall]])
    tangent = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
    each = truth.fn[on_wall, None] * normal + truth.ft[on_wall, None] * tangent
    np.add.at(force, (k, wall), each)
    return force


def write_grains(path: Path, ids: Ids, radius: Array) -> None:
    """Write radius (n,) [m] of grains by id (n,), in the form for tracks."""
    _write(path, ("id", "radius"), ((grain, _metres(value)) for grain, value in zip(ids, radius, strict=True)))


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


def write_experiment(
    path: Path,
    *,
    name: str,
    remark: str,
    source: str,
    known: StatedInputs,
    boundary: str = "",
    walls: str = 'file = "walls.csv"\n',
) -> None:
    """Write experiment.toml.

    Parameters
    ----------
    path : Path
    name, remark : str
    source : str
        The [photographs] or [tracks] table.
    known : StatedInputs
    boundary : str
        The [boundary] table, beside the walls or in place of them.
    walls : str
        The keys of [walls] that name tables; empty: there are none.
    """
    name = re.sub(r"[^\w .+-]", "-", name)
    name = name if re.match(r"\w", name) else f"synthetic {name}"
    remarks = "".join(f"# {line}\n" for line in remark.splitlines())
    sensors = 'forces = "wall_forces.csv"\n' if known.pressure else ""
    plates = "".join(f"[walls.{wall}]\npressure = {value}\n" for wall, value in known.pressure.items())
    walls = f"[walls]\n{walls}{sensors}{plates}" if walls else ""
    gravity = f"gravity = [{known.gravity[0]}, {known.gravity[1]}]\n" if any(known.gravity) else ""
    write_atomically(
        path,
        f"""{remarks}name = "{name}"
truth = "truth_contacts.csv"
truth_tracks = "truth_tracks.csv"

{source}
{boundary}{walls}
[material]
density = {known.density}
length = {known.length}
friction = {known.friction}
wall_friction = {known.wall_friction}
{gravity}""".encode(),
    )


def _metres(value: float) -> str:
    return f"{value:.9f}"


def _write(path: Path, header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    with replacing(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(rows)
