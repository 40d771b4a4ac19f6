"""Arrays or data frames in, a run out, nothing on disk: for tracks that any other code made."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd

from solver.bodies.cell import unwrap
from solver.bodies.wall_shapes import STRAIGHT

from ..errors import InputError, UndeterminedError
from ..experiment.boundary import boundary_of, check_cell, find_boundary
from ..experiment.config.experiment_file import as_toml, load_sections
from ..experiment.config.input_sections import OUTER
from ..experiment.config.unused_keys import refuse_unused_keys
from ..experiment.experiment import (
    CELL_COLUMNS,
    GRAIN_COLUMNS,
    PLACE_COLUMNS,
    POSE_COLUMNS,
    TIME_COLUMNS,
    arrange_cell,
    arrange_tracks,
)
from ..experiment.reading.tables import Table
from ..experiment.walls import ARC_COLUMNS, LOAD_COLUMNS, WALL_COLUMNS, arrange_arcs, arrange_loads, arrange_walls
from ..inference.inference import Inputs, correct_sequence, solve_all
from ..inference.settings import material_of, settings_of
from ..progress import Progress, silent
from ..results.results import Results
from ..tracks import Tracks, WallTracks
from .run import Run
from .settings import as_texts

Columns = pd.DataFrame | Mapping[str, Any]  # of equal length, by name
UNKNOWN = "theta"  # a column that may hold nothing
WHOLE = ("frame", "id")  # columns of whole numbers, which data frames like to make floats of


def solve(
    tracks: Columns,
    walls: Columns | None = None,
    material: Mapping[str, object] | None = None,
    *,
    arcs: Columns | None = None,
    load: Columns | None = None,
    boundary: Columns | Sequence[int] | Literal["outer"] | None = None,
    pressure: Mapping[str, float] | None = None,
    precision: float = 1e-5,
    settings: Mapping[str, object] | None = None,
    progress: Progress = silent,
) -> Run:
    """Contact forces from tracks that are in memory.

    tracks: columns frame, id, x, y [m], theta [rad], radius [m] and time [s], y up, angles counter-clockwise, theta
    absent or NaN where nobody measured it; a grain that has no row in a frame is lost there; without times frames are
    a second apart, which matters to forces only where inertia does. walls: columns frame, wall, x1, y1, x2, y2 [m],
    the packing to the left of 1 → 2. arcs: columns frame, wall, x, y, radius [m], side (in, out) and perhaps theta
    [rad] of circular walls. load: columns frame, wall, force [N] of walls whose load was measured. boundary: what
    bounds the packing where it is no wall: ids of grains that move as they were seen, "outer" for the outermost, or
    the columns frame, ax, ay, bx, by [m] of a periodic cell, instead of walls. material: keys of the experiment file's
    section (density, length, friction, …), with its defaults. pressure [Pa]: by wall, of those that are pressed; the
    others move as they were measured. precision [m]: standard deviation of a position. settings: by the keys of
    experiment.toml, {"solver.kappa": 0.1}; the defaults are those of `rodsight run`.
    Raises InputError naming column, row and value.

    Examples:
        >>> import pandas as pd
        >>> tracks = pd.read_csv("my_test/tracks.csv").merge(pd.read_csv("my_test/grains.csv"), on="id")
        >>> walls = pd.read_csv("my_test/walls.csv")
        >>> run = rodsight.solve(tracks, walls, {"friction": 0.25}, pressure={"top": 50e3})
        >>> len(run.frames()) == tracks["frame"].nunique()
        True
        >>> rodsight.solve(tracks.drop(columns="radius"), walls)
        Traceback (most recent call last):
        rodsight.errors.InputError: tracks: column radius: there is no such column
    """
    texts = as_texts({f"material.{key}": value for key, value in (material or {}).items()} | dict(settings or {}))
    sections = load_sections(texts)
    refuse_unused_keys(sections, "settings")
    followed = _arrange_tracks(pd.DataFrame(tracks), precision)
    bounded = _arrange_walls(walls, arcs, load, followed.frame_count, pressure or {})
    followed, bounded = _bound(followed, bounded, boundary)
    try:
        sequence = correct_sequence(Inputs(followed, bounded, material_of(sections), settings_of(sections)))
    except UndeterminedError as error:
        raise InputError("settings", f"key {error.key}", str(error)) from None
    solved = solve_all(sequence, lambda done: progress("solving", done, followed.frame_count))
    frames, packing = [each.forces for each in solved], sequence.packing
    unsolved = Results(
        "solved", sequence.tracks, sequence.walls, packing.grains, packing.material.friction, (), (),
        as_toml(sections), calibration=sequence.calibration, radius_tuning=sequence.tuning,
        boundary=sequence.boundary,
    )  # fmt: skip
    frames, check = sequence.check_friction(frames)
    statistics = [sequence.restate(each.statistics, frame, check) for each, frame in zip(solved, frames, strict=True)]
    return Run(replace(unsolved, frames=frames, statistics=statistics, friction_check=check))


def _arrange_tracks(tracks: pd.DataFrame, precision: float) -> Tracks:
    if not (np.isfinite(precision) and precision > 0):
        raise InputError("precision", repr(precision), "is not a positive number of metres")
    poses = _table("tracks", tracks, POSE_COLUMNS if "theta" in tracks else PLACE_COLUMNS)
    if "radius" not in tracks:
        raise InputError("tracks", "column radius", "there is no such column")
    _check_constant(tracks, "id", "radius")
    grains = tracks.drop_duplicates("id")
    if "time" in tracks:
        _check_constant(tracks, "frame", "time")
        times = tracks.drop_duplicates("frame")
    else:
        frames = sorted(tracks["frame"].unique())
        times = pd.DataFrame({"frame": frames, "time": np.asarray(frames, np.float64)})
    return arrange_tracks(
        _table("tracks", grains, GRAIN_COLUMNS), poses, _table("tracks", times, TIME_COLUMNS), precision
    )


def _bound(
    tracks: Tracks, walls: WallTracks, boundary: Columns | Sequence[int] | Literal["outer"] | None
) -> tuple[Tracks, WallTracks]:
    """Tracks and walls with what else bounds the packing."""
    if boundary is None:
        if walls.count == 0:
            raise InputError("walls", "", "are missing, and there is no boundary: nothing holds the packing")
        return tracks, walls
    if isinstance(boundary, str):
        if boundary != OUTER:
            raise InputError("boundary", repr(boundary), f'must be ids, the columns of a cell, or "{OUTER}"')
        return replace(tracks, boundary=find_boundary("boundary", tracks, walls)), walls
    if isinstance(boundary, pd.DataFrame | Mapping):
        if walls.count:
            raise InputError("boundary", "", "a periodic cell stands instead of walls: give one of them")
        table = _table("boundary", pd.DataFrame(boundary), CELL_COLUMNS)
        walls = replace(walls, cell=arrange_cell(table, tracks.frame_count))
        check_cell("boundary", tracks, walls)
        assert walls.cell is not None
        return replace(tracks, position=unwrap(tracks.position, walls.cell)), walls
    table = _table("boundary", pd.DataFrame({"id": list(boundary)}), ("id",))
    return replace(tracks, boundary=boundary_of(table, tracks)), walls


def _arrange_walls(
    walls: Columns | None,
    arcs: Columns | None,
    load: Columns | None,
    frame_count: int,
    pressure: Mapping[str, float],
) -> WallTracks:
    names, endpoints = (), np.empty((frame_count, 0, 2, 2))
    if walls is not None:
        names, endpoints = arrange_walls(_table("walls", pd.DataFrame(walls), WALL_COLUMNS), frame_count)
    side = None
    if arcs is not None:
        told = pd.DataFrame(arcs)
        columns = (*ARC_COLUMNS, "theta") if "theta" in told else ARC_COLUMNS
        circles, ends, its_side = arrange_arcs(_table("arcs", told, columns), frame_count, others=names)
        side = np.concatenate([np.full(len(names), STRAIGHT, np.int8), its_side])
        names, endpoints = names + circles, np.concatenate([endpoints, ends], axis=1)
    for name, value in pressure.items():
        if name not in names:
            raise InputError("pressure", repr(name), f"is not the name of a wall: there are {', '.join(names)}")
        if not (np.isfinite(value) and value > 0):
            raise InputError("pressure", f"{name} = {value!r}", "is not a positive number of pascals")
    pressed = np.array([pressure.get(name, np.nan) for name in names], np.float64)
    measured = None
    if load is not None:
        table = _table("load", pd.DataFrame(load), LOAD_COLUMNS)
        measured = arrange_loads(table, names, frame_count, pressed)
    return WallTracks(names, endpoints, pressed, side=side, load=measured)


def _check_constant(frame: pd.DataFrame, by: str, column: str) -> None:
    """One value of a column for each of another; the complaint names the first that has two."""
    counts = frame.groupby(by)[column].nunique(dropna=False)
    changing = counts.index[np.asarray(counts) > 1]
    if len(changing):
        raise InputError("tracks", f"{by} = {changing[0]}", f"has more than one {column}")


def _table(name: str, frame: pd.DataFrame, columns: Sequence[str]) -> Table:
    """Columns as a table that was read, so that the same checks say what is wrong with them."""
    for column in columns:
        if column not in frame:
            raise InputError(name, f"column {column}", f"there is no such column among {', '.join(map(str, frame))}")
    if frame.empty:
        raise InputError(name, "", "has no rows")
    return Table(Path(name), {column: _texts(column, frame[column]) for column in columns}, list(range(len(frame))))


def _texts(column: str, values: Iterable[Any]) -> list[str]:
    array = np.asarray(values)
    if column in WHOLE and array.dtype.kind == "f" and np.all(array == np.floor(array)):
        array = array.astype(np.int64)
    return ["" if column == UNKNOWN and each != each else str(each) for each in array.tolist()]  # NaN: not told
