"""An experiment on disk: its configuration, and its tables as arrays, checked."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array

from ..errors import InputError
from ..tracks import Tracks, TrackStatus, WallTracks
from .config.experiment_file import ExperimentFile, load_config
from .photographs import Photographs
from .tables import Table, check_frames, check_unique, read_table

CONFIG_NAME = "experiment.toml"
GRAIN_COLUMNS, POSE_COLUMNS = ("id", "radius"), ("frame", "id", "x", "y", "theta")
TIME_COLUMNS, WALL_COLUMNS = ("frame", "time"), ("frame", "wall", "x1", "y1", "x2", "y2")


@dataclass(frozen=True, slots=True)
class GrainGuess:
    """Grains named by the user on the first photograph."""

    id: NDArray[np.int64]  # (n,)
    x: Array  # (n,) [px]
    y: Array  # (n,) [px]
    radius: Array  # (n,) [px]


@dataclass(frozen=True, slots=True)
class Experiment:
    file: Path
    config: ExperimentFile

    @property
    def folder(self) -> Path:
        return self.file.parent

    @property
    def name(self) -> str:
        return self.config.name

    def photographs(self) -> Photographs:
        section = self.config.photographs
        assert section is not None
        return Photographs.matching(self.folder, section.files)

    def input_files(self) -> list[Path]:
        """Every file that the experiment names, photographs included."""
        config = self.config
        names = [config.truth, config.truth_tracks]
        if config.photographs:
            names += [config.photographs.times, config.photographs.grains, config.photographs.corrections]
        if config.tracks:
            names += [config.tracks.positions, config.tracks.grains, config.tracks.times]
        if config.walls:
            names += [config.walls.file, config.walls.forces]
        files = [self.folder / name for name in names if name is not None]
        return files + (list(self.photographs().files) if config.photographs else [])


def load_experiment(path: Path, settings: Sequence[str] = ()) -> Experiment:
    """Load an experiment from its folder or its experiment.toml, with KEY=VALUE settings laid over."""
    file = path / CONFIG_NAME if path.is_dir() else path
    if not file.exists():
        raise InputError(file, "", "there is no such file; an experiment is a folder with experiment.toml")
    return Experiment(file, load_config(file, tuple(settings)))


def checksums(experiment: Experiment) -> dict[str, str]:
    """SHA-256 of every input file, by its path in the experiment."""
    result = {}
    for file in experiment.input_files():
        try:
            with file.open("rb") as stream:
                digest = hashlib.file_digest(stream, "sha256").hexdigest()
        except OSError as error:
            raise InputError(file, "", f"cannot be read ({error.strerror})") from None
        result[_relative(file, experiment.folder)] = digest
    return result


def _relative(file: Path, folder: Path) -> str:
    return file.relative_to(folder).as_posix() if file.is_relative_to(folder) else str(file)


def read_times(experiment: Experiment, frame_count: int) -> Array:
    """Time of every frame (f,) [s], ascending."""
    config = experiment.config
    if config.photographs is not None and config.photographs.interval is not None:
        return np.arange(frame_count, dtype=np.float64) * config.photographs.interval
    name = config.photographs.times if config.photographs is not None else config.tracks and config.tracks.times
    assert name is not None
    return arrange_times(read_table(experiment.folder / name, TIME_COLUMNS), frame_count)


def arrange_times(table: Table, frame_count: int) -> Array:
    """Time of every frame (f,) [s], ascending, from a table frame,time."""
    frame, time = table.integers("frame"), table.numbers("time")
    check_unique(table, "frame", frame)
    found = check_frames(table, frame)
    if found != frame_count:
        raise InputError(table.file, "frame", f"there are times of {found} frames, but {frame_count} frames")
    order = np.argsort(frame)
    late = np.flatnonzero(np.diff(time[order]) <= 0)
    if len(late):
        raise table.error(int(order[late[0] + 1]), "time", "is not after the time of the frame before it")
    return time[order]


def read_tracks(experiment: Experiment) -> Tracks:
    """Grains tracked by another tool."""
    section = experiment.config.tracks
    assert section is not None
    grains = read_table(experiment.folder / section.grains, GRAIN_COLUMNS)
    poses = read_table(experiment.folder / section.positions, POSE_COLUMNS)
    times = read_table(experiment.folder / section.times, TIME_COLUMNS)
    return arrange_tracks(grains, poses, times, section.precision)


def arrange_tracks(grains: Table, poses: Table, times: Table, precision: float) -> Tracks:
    """Tracks of tables id,radius and frame,id,x,y,theta and frame,time; precision [m] of a position.

    A grain that has no row in a frame is lost there.
    """
    ids, radius = grains.integers("id"), grains.numbers("radius")
    check_unique(grains, "id", ids)
    _all_positive(grains, "radius", radius)
    frame, of = poses.integers("frame"), poses.integers("id")
    check_unique(poses, "id", frame, of)
    frame_count = check_frames(poses, frame)
    row = rows_of(poses, "id", of, ids)
    shape = (frame_count, len(ids))
    position, rotation = np.full((*shape, 2), np.nan), np.full(shape, np.nan)
    position[frame, row] = np.column_stack([poses.numbers("x"), poses.numbers("y")])
    rotation[frame, row] = poses.numbers("theta")
    present = np.isfinite(rotation)
    return Tracks(
        id=ids,
        radius=radius,
        time=arrange_times(times, frame_count),
        position=position,
        rotation=rotation,
        sigma=np.where(present, precision, np.nan),
        zncc=np.full(shape, np.nan),
        status=np.where(present, TrackStatus.GIVEN, TrackStatus.LOST).astype(np.uint8),
    )


def read_grain_guess(experiment: Experiment) -> GrainGuess | None:
    """The user's grains on the first photograph, if any."""
    section = experiment.config.photographs
    if section is None or section.grains is None:
        return None
    table = read_table(experiment.folder / section.grains, ("id", "x", "y", "radius"))
    ids, radius = table.integers("id"), table.numbers("radius")
    check_unique(table, "id", ids)
    _all_positive(table, "radius", radius)
    return GrainGuess(ids, table.numbers("x"), table.numbers("y"), radius)


def read_walls(experiment: Experiment, frame_count: int) -> WallTracks | None:
    """The walls in every frame; None where the experiment has none.

    Endpoints are NaN where they are to be followed in the photographs: with `walls.track`, wherever the table has no
    row; without it, where the table ends with frame 0.
    """
    section = experiment.config.walls
    if section is None:
        return None
    table = read_table(experiment.folder / section.file, WALL_COLUMNS)
    track = section.track
    if track and experiment.config.photographs is None:
        raise InputError(experiment.file, "key walls.track = true", "walls can be followed in photographs only")
    if track is None:
        track = experiment.config.photographs is not None and not np.any(table.integers("frame") > 0)
    names, endpoints = arrange_walls(table, frame_count, followed=track)
    for unknown in section.plates.keys() - set(names):
        raise InputError(experiment.file, f"key walls.{unknown}", f"there is no such wall in {section.file}")
    pressure = np.array([section.plates[n].pressure if n in section.plates else None for n in names], np.float64)
    return WallTracks(names, endpoints, pressure, _read_wall_forces(experiment, names, frame_count))


def arrange_walls(table: Table, frame_count: int, *, followed: bool = False) -> tuple[tuple[str, ...], Array]:
    """Names (w,) and endpoints (f, w, 2, 2) [m] of a table frame,wall,x1,y1,x2,y2.

    followed: frame 0 is enough; endpoints are NaN where the table has no row.
    """
    frame, name = table.integers("frame"), table.text("wall")
    names = tuple(dict.fromkeys(name))
    row = np.array([names.index(each) for each in name])
    check_unique(table, "wall", frame, row)
    found = int(frame.max()) + 1 if followed and frame.min() == 0 else check_frames(table, frame)
    if found > frame_count or (found < frame_count and not followed):
        raise InputError(table.file, "frame", f"there are walls of {found} frames, but {frame_count} frames")
    endpoints = np.full((frame_count, len(names), 2, 2), np.nan)
    endpoints[frame, row] = np.column_stack([table.numbers(c) for c in WALL_COLUMNS[2:]]).reshape(-1, 2, 2)
    absent = np.argwhere(np.isnan(endpoints[: 1 if followed else None, :, 0, 0]))
    if len(absent):
        raise InputError(table.file, f"frame {absent[0][0]}", f"has no row of wall {names[absent[0][1]]!r}")
    point = np.flatnonzero(np.all(endpoints[frame, row, 0] == endpoints[frame, row, 1], axis=1))
    if len(point):
        raise table.error(int(point[0]), "wall", "has no length: its two ends are the same point")
    return names, endpoints


def _read_wall_forces(experiment: Experiment, names: tuple[str, ...], frame_count: int) -> Array | None:
    """What sensors recorded on the walls (f, w, 2) [N], NaN where they did not; None without a table."""
    section = experiment.config.walls
    if section is None or section.forces is None:
        return None
    table = read_table(experiment.folder / section.forces, ("frame", "wall", "fx", "fy"))
    frame, name = table.integers("frame"), table.text("wall")
    for row, (k, each) in enumerate(zip(frame, name, strict=True)):
        if each not in names:
            raise table.error(row, "wall", "is not the name of a wall")
        if not 0 <= k < frame_count:
            raise table.error(row, "frame", f"is not one of the {frame_count} frames")
    wall = np.array([names.index(each) for each in name])
    check_unique(table, "wall", frame, wall)
    force = np.full((frame_count, len(names), 2), np.nan)
    force[frame, wall] = np.column_stack([table.numbers("fx"), table.numbers("fy")])
    return force


def _all_positive(table: Table, column: str, values: Array) -> None:
    bad = np.flatnonzero(values <= 0)
    if len(bad):
        raise table.error(int(bad[0]), column, "is not positive")


def rows_of(table: Table, column: str, of: NDArray[np.int64], ids: NDArray[np.int64]) -> NDArray[np.int64]:
    order = np.argsort(ids)
    place = np.minimum(np.searchsorted(ids[order], of), len(ids) - 1)
    unknown = np.flatnonzero(ids[order[place]] != of)
    if len(unknown):
        raise table.error(int(unknown[0]), column, "is not the id of a grain")
    return order[place]
