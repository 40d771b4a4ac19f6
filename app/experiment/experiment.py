"""An experiment on disk: its configuration, and its checked tables as arrays."""

from __future__ import annotations

import json
import os
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..process.errors import InputError, MissingFileError
from ..solver.bodies.cell import unwrap_cell
from ..solver.bodies.grains import Array
from ..tracks import Tracks, TrackStatus, held_once
from .config.dotted_keys import leaves
from .config.experiment_file import ExperimentFile, load_config
from .photographs import Photographs
from .pictures.image import Channel, ImageSelection
from .pictures.picture_file import read_photograph
from .reading.input_files import InputFiles
from .reading.photograph_order import NUMBER, ORDER_COLUMNS, GivenOrder, arrange_order, relative_name
from .reading.tables import Table, check_frame_count, check_frames, check_unique, read_table

CONFIG_NAME = "experiment.toml"
POSITION_COLUMNS = ("frame", "id", "x", "y")  # of a pose without its rotation
GRAIN_COLUMNS, POSE_COLUMNS = ("id", "radius"), ("frame", "id", "x", "y", "theta")
TIME_COLUMNS, CELL_COLUMNS = ("frame", "time"), ("frame", "ax", "ay", "bx", "by")
MAX_TIME = 9e9  # [s]: whole nanoseconds on the time line of a recording end at 9.2e9
FLAT = 1e-9  # sine of the angle between the vectors of a cell, at most, that has no area


Stamp = list[int]  # size, number and times of a file: as long as they are unchanged, its content is, too


@dataclass(frozen=True, slots=True)
class GrainGuess:
    """Grains given by the user on the first photograph."""

    id: NDArray[np.int64]  # (n,)
    x: Array  # (n,) [px]
    y: Array  # (n,) [px]
    radius: Array  # (n,) [px]


@dataclass(frozen=True, slots=True)
class Experiment:
    """An experiment file with its configuration and input files."""

    file: Path
    config: ExperimentFile
    inputs: InputFiles = field(default_factory=InputFiles, compare=False)
    file_settings: dict[str, Any] | None = field(default=None, compare=False)  # in the file as it was read

    @property
    def folder(self) -> Path:
        return self.file.parent

    @property
    def name(self) -> str:
        return self.config.name

    def photographs(self, channel: Channel | None = None) -> Photographs:
        """Return the photographs; channel: used instead of the experiment's own."""
        section = self.config.photographs
        assert section is not None
        self.inputs.refuse_outside(Path(os.path.normpath(self.folder / section.files)))  # before folders are listed
        order = self.given_order()
        files = self.matching() if order is None else order.files
        selection = self.selection(files[0], channel)
        return Photographs(
            files, inputs=self.inputs, max_pixels=section.max_pixels,
            selection=selection, ordered=order is not None,
        )  # fmt: skip

    def given_order(self) -> GivenOrder | None:
        """Return the photographs and their places in time that a table lists; None where there is no such table."""
        section = self.config.photographs
        if section is None or section.order is None:
            return None
        return arrange_order(self.table(section.order, ORDER_COLUMNS, (NUMBER,)), self.matching(), self.folder)

    def matching(self) -> Sequence[Path]:
        """Return all photographs that the pattern matches, in natural order."""
        section = self.config.photographs
        assert section is not None
        return self.inputs.listed(section.files, lambda: Photographs.matching(self.folder, section.files).files)

    def selection(self, first: Path, channel: Channel | None = None) -> ImageSelection:
        """Return the part of the photographs that is used; first: a photograph, whose size a mask must have."""
        section = self.config.photographs
        assert section is not None
        used = ImageSelection(channel or section.channel, section.region, rotation=section.rotation)
        if not isinstance(section.mask, str):
            return replace(used, mask=section.mask)
        file = self.folder / section.mask
        hidden = read_photograph(file, self.inputs, section.max_pixels) > 0.0
        shape = read_photograph(first, self.inputs, section.max_pixels).shape
        if section.rotation in (90, 270):
            shape = shape[::-1]
        if hidden.shape != shape:
            found, expected = (f"{columns} x {rows}" for rows, columns in (hidden.shape, shape))
            raise InputError(file, "key photographs.mask", f"is {found} pixels, the photographs are {expected}")
        if hidden.all():
            raise InputError(file, "key photographs.mask", "hides every pixel: those that are not zero are not used")
        return replace(used, hidden=hidden)

    def fringe_photographs(self) -> Photographs | None:
        """Return the photographs in which fringes are read, one for every photograph; None: not given."""
        section = self.config.photographs
        if section is None or section.fringes is None:
            return None
        if section.fringes == "same":
            return self.photographs(section.fringe_channel)
        pattern = section.fringes
        self.inputs.refuse_outside(Path(os.path.normpath(self.folder / pattern)))
        files = self.inputs.listed(pattern, lambda: Photographs.matching(self.folder, pattern).files)
        selection = ImageSelection(section.fringe_channel, rotation=section.rotation)
        return Photographs(files, inputs=self.inputs, max_pixels=section.max_pixels, selection=selection)

    def table(self, name: str, columns: Sequence[str], optional: Sequence[str] = ()) -> Table:
        """Read a table of the experiment's folder. Raises InputError with file, row and value."""
        return read_table(self.folder / name, columns, self.inputs, optional)

    def named_inputs(self) -> dict[Path, str]:
        """Return a name of every input file, as `checksums` lists it."""
        return _names_of(self.input_files(), self.folder)

    def photograph_names(self) -> list[str]:
        """Return the names of the photographs in their order, as a table of the order has them."""
        return (
            [relative_name(file, self.folder) for file in self.photographs().files] if self.config.photographs else []
        )

    def input_files(self) -> list[Path]:
        """Return all input files of the experiment, photographs included."""
        config = self.config
        names = [config.truth, config.truth_tracks]
        if config.photographs:
            section = config.photographs
            names += [section.times, section.order, section.grains, section.corrections]
            names += [section.mask] if isinstance(section.mask, str) else []
        if config.tracks:
            names += [config.tracks.positions, config.tracks.grains, config.tracks.times]
        if config.walls:
            names += [config.walls.file, config.walls.arcs, config.walls.corners]
            names += [config.walls.load, config.walls.forces]
        if config.boundary:
            names += [config.boundary.periodic, None if config.boundary.found else config.boundary.grains]
        files = [self.folder / name for name in names if name is not None]
        if config.photographs:
            files += self.photographs().files
            if config.photographs.fringes not in (None, "same"):
                fringes = self.fringe_photographs()
                files += () if fringes is None else fringes.files
        return files


def load_experiment(path: Path, settings: Sequence[str] = (), *, root: Path | None = None) -> Experiment:
    """Load an experiment from its folder or its experiment.toml, overridden by KEY=VALUE settings.

    root: folder outside of which no file of the experiment is read.
    """
    file = path / CONFIG_NAME if path.is_dir() else path
    if not file.exists():
        raise MissingFileError(file, "", "there is no such file; an experiment is a folder with experiment.toml")
    inputs = InputFiles(root)
    config = load_config(file, tuple(settings), inputs)
    return Experiment(file, config, inputs, settings_of_file(inputs.read(file, text=True)))


def settings_of_file(content: bytes) -> dict[str, Any] | None:
    """Return the settings of an experiment file by dotted keys, without comments; None where it is no TOML."""
    try:
        return leaves(json.loads(json.dumps(tomllib.loads(content.decode("utf-8")), default=str)))
    except (ValueError, RecursionError):
        return None


def stamp_of_input(file: Path) -> Stamp:
    """Return size, number and times of a file. Raises OSError."""
    status = file.stat()
    return [status.st_size, status.st_ino, status.st_mtime_ns, status.st_ctime_ns]


def checksums(experiment: Experiment, *, corrected: bool = True) -> dict[str, str]:
    """Return the SHA-256 of every input file as it was read, by its path in the experiment's folder.

    Files outside the folder are listed by the names of their folders, which are numbered where two have the same name.
    The path on this machine stays private. corrected=False leaves out the table of poses entered by hand.
    """
    result, photographs = {}, experiment.config.photographs
    by_hand = None if corrected or photographs is None else photographs.corrections
    files = [file for file in experiment.input_files() if by_hand is None or file != experiment.folder / by_hand]
    for file, name in _names_of(files, experiment.folder).items():
        try:
            result[name] = experiment.inputs.checksum(file)
        except OSError as error:
            raise InputError(file, "", f"cannot be read ({error.strerror})") from None
    return result


def _names_of(files: Sequence[Path], folder: Path) -> dict[Path, str]:
    """Return a name of every file that no other file has: its path in a folder, or below `elsewhere`."""
    names: dict[Path, str] = {}
    outside: dict[str, list[Path]] = {}  # folders by name
    base = Path(os.path.abspath(folder))
    for file in files:
        place = Path(os.path.abspath(file))
        if place.is_relative_to(base):
            names[file] = place.relative_to(base).as_posix()
            continue
        alike = outside.setdefault(place.parent.name, [])
        if place.parent not in alike:
            alike.append(place.parent)
        number = alike.index(place.parent) + 1
        names[file] = f"elsewhere/{place.parent.name}{f' ({number})' if number > 1 else ''}/{place.name}"
    return names


def read_times(experiment: Experiment, frame_count: int) -> Array:
    """Return the time of every frame (f,) [s], ascending."""
    config = experiment.config
    if config.photographs is not None and config.photographs.interval is not None:
        order = experiment.given_order()
        number = np.arange(frame_count) if order is None else order.number[:frame_count] - order.number[0]
        times = number.astype(np.float64) * config.photographs.interval
        if frame_count and times[-1] > MAX_TIME:
            beyond = f"puts the last photograph at {times[-1]:.3g} s, and times end at {MAX_TIME:.0e} s (285 years)"
            raise InputError(experiment.file, f"key photographs.interval = {config.photographs.interval:g}", beyond)
        return times
    name = config.photographs.times if config.photographs is not None else config.tracks and config.tracks.times
    assert name is not None
    return arrange_times(experiment.table(name, TIME_COLUMNS), frame_count)


def arrange_times(table: Table, frame_count: int) -> Array:
    """Return the time of every frame (f,) [s], ascending, from a table frame,time."""
    frame, time = table.integers("frame"), table.numbers("time")
    check_unique(table, "frame", frame)
    check_frame_count(table, "times", check_frames(table, frame), frame_count)
    beyond = np.flatnonzero(np.abs(time) > MAX_TIME)
    if len(beyond):
        raise table.error(int(beyond[0]), "time", f"is beyond {MAX_TIME:.0e} s (285 years): times are in seconds")
    order = np.argsort(frame)
    late = np.flatnonzero(np.diff(time[order]) <= 0)
    if len(late):
        raise table.error(int(order[late[0] + 1]), "time", "is not after the time of the frame before it")
    return time[order]


def read_tracks(experiment: Experiment) -> Tracks:
    """Read grains tracked by another tool."""
    section = experiment.config.tracks
    assert section is not None
    grains = experiment.table(section.grains, GRAIN_COLUMNS)
    poses = experiment.table(section.positions, POSITION_COLUMNS, optional=("theta",))
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
    """Return tracks from tables id,radius and frame,id,x,y,theta and frame,time.

    A grain without a row in a frame is lost there. precision: standard deviation of a position component [m].
    """
    from .coincident_rods import refuse_coincident_rods  # SciPy is loaded late: a photograph is read before

    ids, radius = grains.integers("id"), grains.numbers("radius")
    check_unique(grains, "id", ids)
    _all_positive(grains, "radius", radius)
    order = np.argsort(ids)  # the same forces to the last bit, whatever the order of the rows
    ids, radius = ids[order], radius[order]
    frame, of = poses.integers("frame"), poses.integers("id")
    check_unique(poses, "id", frame, of)
    frame_count = check_frames(poses, frame)
    row = rows_of(poses, "id", of, ids)
    shape = (frame_count, len(ids))
    position, rotation = np.full((*shape, 2), np.nan), np.full(shape, np.nan)
    position[frame, row] = np.column_stack([poses.numbers("x"), poses.numbers("y")])
    rotation[frame, row] = poses.optional_numbers("theta")
    refuse_coincident_rods(poses.file, ids, radius, position)
    present = np.isfinite(position).all(axis=2)
    return Tracks(
        id=ids,
        radius=radius,
        time=arrange_times(times, frame_count),
        position=position,
        rotation=unwrap_angles(rotation),
        sigma=held_once(np.where(present, precision, np.nan)),
        zncc=np.broadcast_to(np.nan, shape),
        status=held_once(np.where(present, np.uint8(TrackStatus.GIVEN), np.uint8(TrackStatus.LOST))),
    )


def unwrap_angles(angle: Array) -> Array:
    """Return angles (f, n) [rad] without jumps by whole turns, where all are given within one turn, as by atan2.

    A rod that turns from 359° to 1° turned by 2°. Angles over more than a turn are given continuously, and stay.
    """
    known = np.isfinite(angle)
    if not known.any() or np.nanmax(angle) - np.nanmin(angle) > 2.0 * np.pi:
        return angle
    unwrapped, last = angle.copy(), np.full(angle.shape[1], np.nan)
    for each, seen in zip(unwrapped, known, strict=True):
        turns = np.rint((each - last) / (2.0 * np.pi))
        each -= 2.0 * np.pi * np.where(np.isfinite(turns), turns, 0.0)
        last[seen] = each[seen]
    return unwrapped


def read_grain_guess(experiment: Experiment) -> GrainGuess | None:
    """Read the grains given on the first photograph, if any."""
    section = experiment.config.photographs
    if section is None or section.grains is None:
        return None
    table = experiment.table(section.grains, ("id", "x", "y", "radius"))
    ids, radius = table.integers("id"), table.numbers("radius")
    check_unique(table, "id", ids)
    _all_positive(table, "radius", radius)
    guess = GrainGuess(ids, table.numbers("x"), table.numbers("y"), radius)
    from .coincident_rods import refuse_coincident_rods  # SciPy is loaded late: a photograph is read before

    refuse_coincident_rods(table.file, ids, radius, np.column_stack([guess.x, guess.y])[None])
    height, width = experiment.photographs().shape
    outside = (guess.x < -0.5) | (guess.y < -0.5) | (guess.x > width - 0.5) | (guess.y > height - 0.5)
    for row in np.flatnonzero(outside)[:1].tolist():
        place = f"({guess.x[row]:g}, {guess.y[row]:g}) px"
        raise InputError(
            table.file, f"grain {ids[row]}", f"lies at {place}, outside of the photograph of {width} x {height} pixels"
        )
    return guess


def arrange_cell(table: Table, frame_count: int) -> Array:
    """Return the cell's vectors (f, 2, 2) [m] from a table frame,ax,ay,bx,by, without jumps by whole vectors."""
    frame = table.integers("frame")
    check_unique(table, "frame", frame)
    check_frame_count(table, "cells", check_frames(table, frame), frame_count)
    order = np.argsort(frame)
    vectors = np.column_stack([table.numbers(c) for c in CELL_COLUMNS[1:]]).reshape(-1, 2, 2)
    flat = np.flatnonzero(np.abs(np.linalg.det(vectors)) <= FLAT * np.prod(np.linalg.norm(vectors, axis=2), axis=1))
    if len(flat):
        raise table.error(int(flat[0]), "bx", "makes b parallel to a: the cell has no area")
    return unwrap_cell(vectors[order])


def _all_positive(table: Table, column: str, values: Array) -> None:
    bad = np.flatnonzero(values <= 0)
    if len(bad):
        raise table.error(int(bad[0]), column, "is not positive")


def rows_of(table: Table, column: str, of: NDArray[np.int64], ids: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the index in `ids` (n,) of every id in `of` (m,). Raises InputError for an unknown id."""
    order = np.argsort(ids)
    place = np.minimum(np.searchsorted(ids[order], of), len(ids) - 1)
    unknown = np.flatnonzero(ids[order[place]] != of)
    if len(unknown):
        raise table.error(int(unknown[0]), column, "is not the id of a grain")
    return order[place]
