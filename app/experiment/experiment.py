"""An experiment on disk: its configuration, and its tables as arrays, checked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from solver.bodies.cell import follow_cell
from solver.bodies.grains import Array

from ..errors import InputError
from ..tracks import Tracks, TrackStatus
from .config.experiment_file import ExperimentFile, load_config
from .photographs import Channel, Look, Photographs
from .reading.input_files import InputFiles
from .reading.tables import Table, check_frames, check_unique, read_table

CONFIG_NAME = "experiment.toml"
PLACE_COLUMNS = ("frame", "id", "x", "y")  # of a pose whose rotation may be unknown
GRAIN_COLUMNS, POSE_COLUMNS = ("id", "radius"), ("frame", "id", "x", "y", "theta")
TIME_COLUMNS, CELL_COLUMNS = ("frame", "time"), ("frame", "ax", "ay", "bx", "by")
FLAT = 1e-9  # sine of the angle between the vectors of a cell without area


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
    inputs: InputFiles = field(default_factory=InputFiles, compare=False)

    @property
    def folder(self) -> Path:
        return self.file.parent

    @property
    def name(self) -> str:
        return self.config.name

    def photographs(self, channel: Channel | None = None) -> Photographs:
        """The photographs; channel: another than the experiment's own."""
        section = self.config.photographs
        assert section is not None
        files = self.inputs.listed(section.files, lambda: Photographs.matching(self.folder, section.files).files)
        look = Look(channel or section.channel, section.region)
        return Photographs(files, inputs=self.inputs, max_pixels=section.max_pixels, look=look)

    def table(self, name: str, columns: Sequence[str], optional: Sequence[str] = ()) -> Table:
        """A table of the experiment's folder. Raises InputError naming file, row and value."""
        return read_table(self.folder / name, columns, self.inputs, optional)

    def input_files(self) -> list[Path]:
        """Every file that the experiment names, photographs included."""
        config = self.config
        names = [config.truth, config.truth_tracks]
        if config.photographs:
            names += [config.photographs.times, config.photographs.grains, config.photographs.corrections]
        if config.tracks:
            names += [config.tracks.positions, config.tracks.grains, config.tracks.times]
        if config.walls:
            names += [config.walls.file, config.walls.arcs, config.walls.load, config.walls.forces]
        if config.boundary:
            names += [config.boundary.periodic, None if config.boundary.found else config.boundary.grains]
        files = [self.folder / name for name in names if name is not None]
        return files + (list(self.photographs().files) if config.photographs else [])


def load_experiment(path: Path, settings: Sequence[str] = ()) -> Experiment:
    """Load an experiment from its folder or its experiment.toml, with KEY=VALUE settings laid over."""
    file = path / CONFIG_NAME if path.is_dir() else path
    if not file.exists():
        raise InputError(file, "", "there is no such file; an experiment is a folder with experiment.toml")
    inputs = InputFiles()
    return Experiment(file, load_config(file, tuple(settings), inputs), inputs)


def checksums(experiment: Experiment, *, corrected: bool = True) -> dict[str, str]:
    """SHA-256 of every input file as it was read, by its path in the experiment; of one elsewhere, by its name.

    corrected=False: without the table of poses told by hand.
    """
    result, photographs = {}, experiment.config.photographs
    by_hand = None if corrected or photographs is None else photographs.corrections
    for file in experiment.input_files():
        if by_hand is not None and file == experiment.folder / by_hand:
            continue
        try:
            result[_relative(file, experiment.folder)] = experiment.inputs.checksum(file)
        except OSError as error:
            raise InputError(file, "", f"cannot be read ({error.strerror})") from None
    return result


def _relative(file: Path, folder: Path) -> str:
    if file.is_relative_to(folder):
        return file.relative_to(folder).as_posix()
    return f"elsewhere/{file.parent.name}/{file.name}"  # where on this machine is nobody's business


def read_times(experiment: Experiment, frame_count: int) -> Array:
    """Time of every frame (f,) [s], ascending."""
    config = experiment.config
    if config.photographs is not None and config.photographs.interval is not None:
        return np.arange(frame_count, dtype=np.float64) * config.photographs.interval
    name = config.photographs.times if config.photographs is not None else config.tracks and config.tracks.times
    assert name is not None
    return arrange_times(experiment.table(name, TIME_COLUMNS), frame_count)


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
    grains = experiment.table(section.grains, GRAIN_COLUMNS)
    poses = experiment.table(section.positions, PLACE_COLUMNS, optional=("theta",))
    times = experiment.table(section.times, TIME_COLUMNS)
    tracks = arrange_tracks(grains, poses, times, section.precision)
    if section.radius_offset == "estimate":
        return tracks
    radius = tracks.radius + section.radius_offset
    if not radius.min() > 0.0:
        least = f"leaves a radius of {radius.min():g} m: {section.grains} has one of {tracks.radius.min():g} m"
        raise InputError(experiment.file, f"key tracks.radius_offset = {section.radius_offset:g}", least)
    return replace(tracks, radius=radius)


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
    rotation[frame, row] = poses.numbers_if_told("theta")
    present = np.isfinite(position).all(axis=2)
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
    table = experiment.table(section.grains, ("id", "x", "y", "radius"))
    ids, radius = table.integers("id"), table.numbers("radius")
    check_unique(table, "id", ids)
    _all_positive(table, "radius", radius)
    return GrainGuess(ids, table.numbers("x"), table.numbers("y"), radius)


def arrange_cell(table: Table, frame_count: int) -> Array:
    """Vectors of the cell (f, 2, 2) [m] of a table frame,ax,ay,bx,by, without jumps by whole vectors."""
    frame = table.integers("frame")
    check_unique(table, "frame", frame)
    found = check_frames(table, frame)
    if found != frame_count:
        raise InputError(table.file, "frame", f"there are cells of {found} frames, but {frame_count} frames")
    order = np.argsort(frame)
    vectors = np.column_stack([table.numbers(c) for c in CELL_COLUMNS[1:]]).reshape(-1, 2, 2)
    flat = np.flatnonzero(np.abs(np.linalg.det(vectors)) <= FLAT * np.prod(np.linalg.norm(vectors, axis=2), axis=1))
    if len(flat):
        raise table.error(int(flat[0]), "bx", "makes b parallel to a: the cell has no area")
    return follow_cell(vectors[order])


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
