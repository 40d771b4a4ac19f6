"""Solution of tracks in memory, given as arrays or data frames, without files."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pandas as pd

from ..compilation.ahead import SOLVER_KERNELS, KernelsAhead
from ..experiment.boundary import boundary_of, check_cell, find_boundary
from ..experiment.config.experiment_file import as_toml, load_sections
from ..experiment.config.input_sections import OUTER, PRESSURES
from ..experiment.config.unused_keys import refuse_unused_keys
from ..experiment.experiment import (
    CELL_COLUMNS,
    GRAIN_COLUMNS,
    POSE_COLUMNS,
    POSITION_COLUMNS,
    TIME_COLUMNS,
    arrange_cell,
    arrange_tracks,
)
from ..experiment.plausibility import PackingSources, check_inside, check_radii, implausible_loads
from ..experiment.walls import ARC_COLUMNS, LOAD_COLUMNS, WALL_COLUMNS, arrange_arcs, arrange_loads, arrange_walls
from ..inference.infer_sequence import infer_sequence
from ..inference.inference_settings import material_of, settings_of
from ..inference.inputs import Inputs
from ..inference.solve_frames import InferenceObserver
from ..process.errors import InputError, UndeterminedError
from ..process.progress import Progress
from ..solver.bodies.cell import unwrap
from ..solver.bodies.wall_shapes import IN, OUT, STRAIGHT
from ..tracks import Tracks, WallTracks
from .arguments import as_frame, as_mapping, as_strings, as_table, is_number
from .run import Run
from .shown_progress import shown_progress

WALL_ARGUMENTS = {STRAIGHT: "walls", IN: "arcs", OUT: "arcs"}  # by the side of a wall

Columns = pd.DataFrame | Mapping[str, Any]  # of equal length, by name


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
    progress: Progress | None = None,
) -> Run:
    """Infer contact forces from tracks in memory.

    Parameters
    ----------
    tracks : data frame or mapping of columns
        Columns frame, id, x, y [m], theta [rad], radius [m] and time [s]; y up, angles counter-clockwise; theta absent
        or NaN where it is unknown. A grain without a row in a frame is lost there. Without times frames are one second
        apart, which matters only where inertia does.
    walls : data frame or mapping of columns, optional
        Columns frame, wall, x1, y1, x2, y2 [m]; the packing is to the left of 1 → 2. A wall given in frame 0
        alone does not move.
    material : mapping, optional
        Keys of the section [material] of experiment.toml (density, length, friction, …), with its defaults.
    arcs : data frame or mapping of columns, optional
        Circular walls: columns frame, wall, x, y, radius [m], side (in, out) and optionally theta [rad].
    load : data frame or mapping of columns, optional
        Measured loads: columns frame, wall, force [N].
    boundary : data frame, mapping of columns, sequence of int or 'outer', optional
        Boundary without walls: ids of grains with imposed measured motion, 'outer' for the outermost ones, or the
        columns frame, ax, ay, bx, by [m] of a periodic cell.
    pressure : mapping of str to float, optional
        Pressure by wall [Pa]; the other walls move as measured.
    precision : float
        Standard deviation of a position [m].
    settings : mapping, optional
        Keys of experiment.toml with values, as {"solver.kappa": 0.1}; the defaults are those of `rodsight run`.
    progress : callable, optional
        Called with stage, done and total; default: a line in notebooks.

    Returns
    -------
    Run

    Raises
    ------
    InputError
        Names column, row and value.

    Examples
    --------
    >>> import pandas as pd
    >>> tracks = pd.read_csv("my_test/tracks.csv").merge(pd.read_csv("my_test/grains.csv"), on="id")
    >>> walls = pd.read_csv("my_test/walls.csv")
    >>> run = rodsight.solve(tracks, walls, {"friction": 0.25}, pressure={"top": 50e3})
    >>> len(run.frames()) == tracks["frame"].nunique()
    True
    >>> rodsight.solve(tracks.drop(columns="radius"), walls)
    Traceback (most recent call last):
    rodsight.process.errors.InputError: tracks: column radius: there is no such column
    """
    given = as_mapping("material", material or {}, 'keys to values, such as {"friction": 0.25}')
    texts = as_strings({f"material.{key}": value for key, value in given.items()}, "material")
    sections = load_sections([*texts, *as_strings(settings or {})])
    refuse_unused_keys(sections, "settings")
    tracked = _arrange_tracks(as_frame("tracks", tracks), precision)
    wall_tracks = _arrange_walls(walls, arcs, load, tracked.frame_count, {} if pressure is None else pressure)
    tracked, wall_tracks = _add_boundary(tracked, wall_tracks, boundary)
    sources = PackingSources(("tracks", "column radius"), ("precision", f"{precision:g}"), WALL_ARGUMENTS)
    check_inside(sources, tracked, wall_tracks)
    check_radii(sources, tracked)
    for sentence in implausible_loads(sections.material, tracked, wall_tracks):
        warnings.warn(sentence, stacklevel=2)
    inputs = Inputs(tracked, wall_tracks, material_of(sections), settings_of(sections))
    shown, kernels = progress or shown_progress(), KernelsAhead()
    try:
        with kernels.compiling((SOLVER_KERNELS,), shown):
            kernels.wait(SOLVER_KERNELS)
        results = infer_sequence(inputs, InferenceObserver(shown))
    except UndeterminedError as error:
        raise InputError("settings", f"key {error.key}", str(error)) from None
    return Run.in_memory(results, "solved", as_toml(sections), inputs)


def _arrange_tracks(tracks: pd.DataFrame, precision: float) -> Tracks:
    if not (is_number(precision) and precision > 0):
        raise InputError("precision", repr(precision), "is not a positive number of metres")
    poses = as_table("tracks", tracks, POSE_COLUMNS if "theta" in tracks else POSITION_COLUMNS)
    if "radius" not in tracks:
        raise InputError("tracks", "column radius", "there is no such column")
    _check_constant(tracks, "id", "radius")
    grains = tracks.drop_duplicates("id")
    if "time" in tracks:
        _check_constant(tracks, "frame", "time")
        times = tracks.drop_duplicates("frame")
    else:
        frames = np.unique(poses.integers("frame"))
        times = pd.DataFrame({"frame": frames, "time": frames.astype(np.float64)})
    return arrange_tracks(
        as_table("tracks", grains, GRAIN_COLUMNS), poses, as_table("tracks", times, TIME_COLUMNS), precision
    )


def _add_boundary(
    tracks: Tracks, walls: WallTracks, boundary: Columns | Sequence[int] | Literal["outer"] | None
) -> tuple[Tracks, WallTracks]:
    """Add a boundary other than walls to tracks and walls."""
    if boundary is None:
        if walls.count == 0:
            raise InputError("walls", "", "are missing, and no boundary is given: give one of them")
        return tracks, walls
    if isinstance(boundary, str):
        if boundary != OUTER:
            raise InputError("boundary", repr(boundary), f'must be ids, the columns of a cell, or "{OUTER}"')
        return replace(tracks, boundary=find_boundary("boundary", tracks, walls)), walls
    if isinstance(boundary, pd.DataFrame | Mapping):
        if walls.count:
            raise InputError("boundary", "", "a periodic cell replaces the walls: give one of them")
        table = as_table("boundary", as_frame("boundary", boundary), CELL_COLUMNS)
        walls = replace(walls, cell=arrange_cell(table, tracks.frame_count))
        check_cell("boundary", tracks, walls)
        assert walls.cell is not None
        return replace(tracks, position=unwrap(tracks.position, walls.cell)), walls
    if not isinstance(boundary, Iterable):
        raise InputError("boundary", repr(boundary), f'must be ids, the columns of a cell, or "{OUTER}"')
    table = as_table("boundary", pd.DataFrame({"id": list(boundary)}), ("id",))
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
        names, endpoints = arrange_walls(as_table("walls", as_frame("walls", walls), WALL_COLUMNS), frame_count)
    side = None
    if arcs is not None:
        table = as_frame("arcs", arcs)
        columns = (*ARC_COLUMNS, "theta") if "theta" in table else ARC_COLUMNS
        circles, ends, arc_side = arrange_arcs(as_table("arcs", table, columns), frame_count, others=names)
        side = np.concatenate([np.full(len(names), STRAIGHT, np.int8), arc_side])
        names, endpoints = names + circles, np.concatenate([endpoints, ends], axis=1)
    given = as_mapping("pressure", pressure, 'walls to pascals, such as {"top": 50e3}')
    given = {str(name): value for name, value in given.items()}  # names of a table are texts
    for name, value in given.items():
        if name not in names:
            raise InputError("pressure", repr(name), f"is not the name of a wall: there are {', '.join(names)}")
        if not (is_number(value) and PRESSURES[0] <= value <= PRESSURES[1]):
            limits = "{:g} to {:g}".format(*PRESSURES)
            raise InputError("pressure", f"{name} = {value!r}", f"is not a number of pascals from {limits}")
    pressed = np.array([given.get(name, np.nan) for name in names], np.float64)
    measured = None
    if load is not None:
        measured = arrange_loads(as_table("load", as_frame("load", load), LOAD_COLUMNS), names, frame_count, pressed)
    return WallTracks(names, endpoints, pressed, side=side, load=measured)


def _check_constant(frame: pd.DataFrame, by: str, column: str) -> None:
    """Raise InputError unless each value of `by` has a single value of `column`."""
    counts = frame.groupby(by)[column].nunique(dropna=False)
    changing = counts.index[np.asarray(counts) > 1]
    if len(changing):
        raise InputError("tracks", f"{by} = {changing[0]}", f"has more than one {column}")
