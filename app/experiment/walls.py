"""The walls of an experiment as tables tell them: bars by their ends, circles by their radius, loads by sensors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.bodies.wall_shapes import IN, OUT, STRAIGHT, circle_ends

from ..errors import InputError
from ..tracks import BAR, CORNER, NOT_TOLD, WallTracks
from .config.input_sections import WallsSection
from .experiment import CELL_COLUMNS, Experiment, arrange_cell
from .reading.tables import Table, check_frames, check_unique

ENDS = {"bar": BAR, "corner": CORNER, "auto": NOT_TOLD}
SIDES = {"in": IN, "out": OUT}
FORCE_COLUMNS = ("frame", "wall", "fx", "fy")
WALL_COLUMNS = ("frame", "wall", "x1", "y1", "x2", "y2")
ARC_COLUMNS, LOAD_COLUMNS = ("frame", "wall", "x", "y", "radius", "side"), ("frame", "wall", "force")


def read_walls(experiment: Experiment, frame_count: int) -> WallTracks | None:
    """The walls in every frame, bars before circles; None where nothing bounds the packing.

    Endpoints are NaN where they are to be followed in the photographs: with `walls.track`, wherever the table has no
    row; without it, where the table ends with frame 0. Circles are not followed.
    """
    section = experiment.config.walls
    if section is None:
        return None if experiment.config.boundary is None else _no_walls(experiment, frame_count)
    names, endpoints, side = _read_bars(experiment, section, frame_count)
    if section.arcs is not None:
        table = experiment.table(section.arcs, ARC_COLUMNS, optional=("theta",))
        circles, ends, its_side = arrange_arcs(table, frame_count, others=names)
        names, side = names + circles, np.concatenate([side, its_side])
        endpoints = np.concatenate([endpoints, ends], axis=1)
    tables = " or ".join(name for name in (section.file, section.arcs) if name is not None)
    for unknown in section.plates.keys() - set(names):
        raise InputError(experiment.file, f"key walls.{unknown}", f"there is no such wall in {tables}")
    pressure = np.array([section.plates[n].pressure if n in section.plates else None for n in names], np.float64)
    told = np.array([ENDS[section.plates[n].ends] if n in section.plates else NOT_TOLD for n in names], np.int8)
    load = None
    if section.load is not None:
        load = arrange_loads(experiment.table(section.load, LOAD_COLUMNS), names, frame_count, pressure)
    forces = _read_wall_forces(experiment, section, names, frame_count)
    return WallTracks(
        names, endpoints, pressure, forces, told=told, side=side if section.arcs is not None else None, load=load
    )


def _no_walls(experiment: Experiment, frame_count: int) -> WallTracks:
    """No walls, but the cell where there is one: grains or the cell bound the packing."""
    section = experiment.config.boundary
    cell = None
    if section is not None and section.periodic is not None:
        cell = arrange_cell(experiment.table(section.periodic, CELL_COLUMNS), frame_count)
    return WallTracks((), np.empty((frame_count, 0, 2, 2)), np.empty(0), cell=cell)


def arrange_walls(table: Table, frame_count: int, *, followed: bool = False) -> tuple[tuple[str, ...], Array]:
    """Names (w,) and endpoints (f, w, 2, 2) [m] of a table frame,wall,x1,y1,x2,y2.

    followed: frame 0 is enough; endpoints are NaN where the table has no row.
    """
    frame, names, row = _named_rows(table)
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


def arrange_arcs(
    table: Table, frame_count: int, *, others: tuple[str, ...] = ()
) -> tuple[tuple[str, ...], Array, NDArray[np.int8]]:
    """Names (w,), diameters (f, w, 2, 2) [m] and sides (w,) of a table frame,wall,x,y,radius,side and perhaps theta.

    A circle that is told in frame 0 alone stays as it is. others: names that bars have. Without theta [rad] a circle
    does not turn.
    """
    frame, names, row = _named_rows(table)
    for at, wall in enumerate(row):
        if names[wall] in others:
            raise table.error(at, "wall", "is the name of a straight wall, too: every wall is told once")
    text = table.text("side")
    for at, each in enumerate(text):
        if each not in SIDES:
            raise table.error(at, "side", "is neither in (the packing is inside the circle) nor out (outside it)")
    radius, turn = table.numbers("radius"), np.nan_to_num(table.numbers_if_told("theta"))
    for at in np.flatnonzero(radius <= 0.0).tolist():
        raise table.error(at, "radius", "is not positive")
    for at in np.flatnonzero((frame < 0) | (frame >= frame_count)).tolist():
        raise table.error(at, "frame", f"is not one of the {frame_count} frames, which count from 0")
    sides = np.array([SIDES[each] for each in text], np.int8)
    side = np.array([sides[row == wall][0] for wall in range(len(names))], np.int8)
    for at in np.flatnonzero(sides != side[row]).tolist():
        raise table.error(at, "side", f"is another than before: wall {names[row[at]]!r} has the packing on one side")
    told = np.full((frame_count, len(names), 4), np.nan)
    told[frame, row] = np.column_stack([table.numbers("x"), table.numbers("y"), radius, turn])
    for wall, name in enumerate(names):
        if np.isfinite(told[0, wall, 0]) and np.isnan(told[1:, wall, 0]).all():
            told[:, wall] = told[0, wall]
        for k in np.flatnonzero(np.isnan(told[:, wall, 0])).tolist():
            raise InputError(
                table.file, f"frame {k}", f"has no row of wall {name!r}: tell it in all frames, or in frame 0 alone"
            )
    return names, circle_ends(told[..., :2], told[..., 2], told[..., 3]), side


def arrange_loads(table: Table, names: tuple[str, ...], frame_count: int, pressure: Array) -> Array:
    """Measured normal force on the walls (f, w) [N], NaN on those that the table frame,wall,force does not name.

    pressure (w,) [Pa], NaN on walls without: none may have both.
    """
    frame, force = table.integers("frame"), table.numbers("force")
    wall = _wall_rows(table, names, frame, frame_count)
    for at in np.flatnonzero(np.isfinite(pressure[wall])).tolist():
        raise table.error(at, "wall", f"has a pressure of {pressure[wall[at]]:g} Pa, too: give one of them")
    for at in np.flatnonzero(force < 0.0).tolist():
        raise table.error(at, "force", "is negative: it presses the wall against the packing")
    load = np.full((frame_count, len(names)), np.nan)
    load[frame, wall] = force
    for w in np.unique(wall).tolist():
        for k in np.flatnonzero(np.isnan(load[:, w])).tolist():
            raise InputError(table.file, f"frame {k}", f"has no row of wall {names[w]!r}: loads are told in all frames")
    if not np.isfinite(pressure).any():
        for k in np.flatnonzero(np.nansum(load, axis=1) == 0.0).tolist():
            raise InputError(table.file, f"frame {k}", "has loads of 0 N alone: nothing tells the size of the forces")
    return load


def _read_bars(
    experiment: Experiment, section: WallsSection, frame_count: int
) -> tuple[tuple[str, ...], Array, NDArray[np.int8]]:
    track = section.track
    if track and experiment.config.photographs is None:
        raise InputError(experiment.file, "key walls.track = true", "walls can be followed in photographs only")
    if section.file is None:
        return (), np.empty((frame_count, 0, 2, 2)), np.empty(0, np.int8)
    table = experiment.table(section.file, WALL_COLUMNS)
    if track is None:
        track = experiment.config.photographs is not None and not np.any(table.integers("frame") > 0)
    names, endpoints = arrange_walls(table, frame_count, followed=track)
    return names, endpoints, np.full(len(names), STRAIGHT, np.int8)


def _read_wall_forces(
    experiment: Experiment, section: WallsSection, names: tuple[str, ...], frame_count: int
) -> Array | None:
    """What sensors recorded on the walls (f, w, 2) [N], NaN where they did not; None without a table."""
    if section.forces is None:
        return None
    table = experiment.table(section.forces, FORCE_COLUMNS)
    frame = table.integers("frame")
    wall = _wall_rows(table, names, frame, frame_count)
    force = np.full((frame_count, len(names), 2), np.nan)
    force[frame, wall] = np.column_stack([table.numbers("fx"), table.numbers("fy")])
    return force


def _named_rows(table: Table) -> tuple[NDArray[np.int64], tuple[str, ...], NDArray[np.int64]]:
    """Frame of every row, the names of the walls in order of appearance, and which of them every row tells of."""
    frame, name = table.integers("frame"), table.text("wall")
    names = tuple(dict.fromkeys(name))
    row = np.array([names.index(each) for each in name])
    check_unique(table, "wall", frame, row)
    return frame, names, row


def _wall_rows(table: Table, names: tuple[str, ...], frame: NDArray[np.int64], frame_count: int) -> NDArray[np.int64]:
    """Which wall every row tells of; every one once in a frame, and in frames that there are."""
    for row, (k, each) in enumerate(zip(frame, table.text("wall"), strict=True)):
        if each not in names:
            raise table.error(row, "wall", "is not the name of a wall")
        if not 0 <= k < frame_count:
            raise table.error(row, "frame", f"is not one of the {frame_count} frames")
    wall = np.array([names.index(each) for each in table.text("wall")])
    check_unique(table, "wall", frame, wall)
    return wall
