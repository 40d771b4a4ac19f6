"""Read the walls of an experiment from tables: bars by their ends, circles, corner discs, loads by sensors."""

from __future__ import annotations

from dataclasses import replace
from difflib import get_close_matches

import numpy as np
from numpy.typing import NDArray

from ..process.errors import InputError
from ..solver.bodies.grains import Array
from ..solver.bodies.wall_shapes import IN, OUT, STRAIGHT, circle_ends
from ..tracks import BAR, CORNER, UNSPECIFIED, WallTracks
from .config.input_sections import WallsSection
from .experiment import CELL_COLUMNS, Experiment, arrange_cell
from .reading.corners import CORNER_COLUMNS, FrameCorners, arrange_corners, bar_of_each_corner, bars_of_corners
from .reading.tables import Table, check_frame_count, check_frames, check_unique

ENDS = {"bar": BAR, "corner": CORNER, "auto": UNSPECIFIED}
SIDES = {"in": IN, "out": OUT}
FORCE_COLUMNS = ("frame", "wall", "fx", "fy")
WALL_COLUMNS = ("frame", "wall", "x1", "y1", "x2", "y2")
ARC_COLUMNS, LOAD_COLUMNS = ("frame", "wall", "x", "y", "radius", "side"), ("frame", "wall", "force")


def read_walls(experiment: Experiment, frame_count: int) -> WallTracks | None:
    """Return the walls in every frame, bars before circles; None where the packing has no boundary.

    Endpoints are NaN where they are to be tracked in the photographs: with `walls.track`, wherever the table has no
    row; without it, where the table ends with frame 0. Of the circles, corner discs given in frame 0 alone are tracked,
    unless `walls.track` is false, and with them the bars through their centres.
    """
    section = experiment.config.walls
    if section is None:
        return None if experiment.config.boundary is None else _no_walls(experiment, frame_count)
    names, endpoints, side = _read_bars(experiment, section, frame_count)
    bar_count = len(names)
    if section.arcs is not None:
        table = experiment.table(section.arcs, ARC_COLUMNS, optional=("theta",))
        circles, ends, its_side = arrange_arcs(table, frame_count, others=names)
        names, side = names + circles, np.concatenate([side, its_side])
        endpoints = np.concatenate([endpoints, ends], axis=1)
    tables = " or ".join(name for name in (section.file, section.arcs, section.corners) if name is not None)
    for unknown in section.plates.keys() - set(names):
        near = get_close_matches(unknown.lower(), [each.lower() for each in names], n=1)
        meant = [each for each in names if near and each.lower() == near[0]]
        hint = f": write [walls.{meant[0]}]" if meant else f": there are {', '.join(names)}"
        raise InputError(experiment.file, f"key walls.{unknown}", f"there is no such wall in {tables}{hint}")
    pressure = np.array([section.plates[n].pressure if n in section.plates else None for n in names], np.float64)
    end_kind = np.array([ENDS[section.plates[n].ends] if n in section.plates else UNSPECIFIED for n in names], np.int8)
    load = None
    if section.load is not None:
        load = arrange_loads(experiment.table(section.load, LOAD_COLUMNS), names, frame_count, pressure)
    plate = None
    if section.corners is not None:
        if section.file is None:  # bars between corners end where they meet
            end_kind[:bar_count] = np.where(end_kind[:bar_count] == UNSPECIFIED, CORNER, end_kind[:bar_count])
        measured = np.zeros(bar_count, np.bool_) if load is None else np.isfinite(load[:, :bar_count]).any(axis=0)
        loaded = np.isfinite(pressure[:bar_count]) | measured
        discs, ends, plate = _read_corners(experiment, section, names, endpoints[:, :bar_count], loaded)
        added = len(discs)
        names, side = names + discs, np.concatenate([side, np.full(added, OUT, np.int8)])
        endpoints = np.concatenate([endpoints, ends], axis=1)
        pressure = np.concatenate([pressure, np.full(added, np.nan)])
        end_kind = np.concatenate([end_kind, np.full(added, UNSPECIFIED, np.int8)])
        if load is not None:
            load = np.concatenate([load, np.full((frame_count, added), np.nan)], axis=1)
    forces = _read_wall_forces(experiment, section, names, frame_count)
    return WallTracks(
        names,
        endpoints,
        pressure,
        forces,
        end_kind=end_kind,
        side=None if section.arcs is None and section.corners is None else side,
        load=load,
        plate=plate,
    )


def place_corners(experiment: Experiment, walls: WallTracks, centre: Array, angle: Array) -> WallTracks:
    """Return the walls with corner discs, and the bars through their centres, where they were found in photographs.

    Parameters
    ----------
    experiment : Experiment
        With `walls.corners`.
    walls : WallTracks
        Of f frames; the discs are the last ones.
    centre : (f, c, 2)
        Centres of the discs [m]; NaN: not found.
    angle : (f, c)
        Their rotations since frame 0 [rad].
    """
    section = experiment.config.walls
    assert section is not None
    assert section.corners is not None
    table = experiment.table(section.corners, CORNER_COLUMNS, optional=("theta",))
    given = arrange_corners(table, len(walls.endpoints), followed=True)
    corners = FrameCorners(given.name, centre, given.radius, np.nan_to_num(given.angle[:1]) + angle)
    endpoints = walls.endpoints.copy()
    if section.file is None and section.arcs is None:
        _, bars = bars_of_corners(table.file, corners)
        endpoints[:, : bars.shape[1]] = bars
    endpoints[:, walls.count - len(corners.name) :] = circle_ends(
        centre, np.broadcast_to(corners.radius, angle.shape), corners.angle
    )
    return replace(walls, endpoints=endpoints)


def follows_corners(experiment: Experiment) -> bool:
    """Return whether corner discs that are given in frame 0 alone are tracked in photographs."""
    section = experiment.config.walls
    return experiment.config.photographs is not None and section is not None and section.track is not False


def _no_walls(experiment: Experiment, frame_count: int) -> WallTracks:
    """Return tracks without walls, with the periodic cell where there is one."""
    section = experiment.config.boundary
    cell = None
    if section is not None and section.periodic is not None:
        cell = arrange_cell(experiment.table(section.periodic, CELL_COLUMNS), frame_count)
    return WallTracks((), np.empty((frame_count, 0, 2, 2)), np.empty(0), cell=cell)


def arrange_walls(table: Table, frame_count: int, *, followed: bool = False) -> tuple[tuple[str, ...], Array]:
    """Return names (w,) and endpoints (f, w, 2, 2) [m] from a table frame,wall,x1,y1,x2,y2.

    A wall that is given in frame 0 alone does not move. followed: frame 0 is enough, and endpoints are NaN where the
    table has no row.
    """
    frame, names, row = _named_rows(table)
    found = int(frame.max()) + 1 if followed and frame.min() == 0 else check_frames(table, frame)
    if found > frame_count or (found > 1 and not followed):
        check_frame_count(table, "walls", found, frame_count)
    endpoints = np.full((frame_count, len(names), 2, 2), np.nan)
    endpoints[frame, row] = np.column_stack([table.numbers(c) for c in WALL_COLUMNS[2:]]).reshape(-1, 2, 2)
    if not followed:
        still = _given_in_frame_0_alone(frame, row, len(names))
        endpoints[:, still] = endpoints[0, still]
    absent = np.argwhere(np.isnan(endpoints[: 1 if followed else None, :, 0, 0]))
    if len(absent):
        raise InputError(table.file, f"frame {absent[0][0]}", f"has no row of wall {names[absent[0][1]]!r}")
    point = np.flatnonzero(np.all(endpoints[frame, row, 0] == endpoints[frame, row, 1], axis=1))
    if len(point):
        raise table.error(int(point[0]), "wall", "has no length: its two ends are the same point")
    return names, endpoints


def describe_walls_at_rest(experiment: Experiment, frame_count: int) -> list[str]:
    """Name the bars that are taken as at rest because the table gives them in frame 0 alone, in a sentence; or none."""
    section = experiment.config.walls
    if section is None or section.file is None or frame_count < 2:
        return []
    frame, names, row = _named_rows(experiment.table(section.file, WALL_COLUMNS))
    still = [names[w] for w in np.flatnonzero(_given_in_frame_0_alone(frame, row, len(names))).tolist()]
    if not still or _follows_bars(experiment, section, frame):
        return []
    return [
        f"{section.file} gives {', '.join(still)} in frame 0 alone: taken as at rest in all {frame_count} frames, "
        "unless the rods that touch them show that they move."
    ]


def _given_in_frame_0_alone(frame: NDArray[np.int64], row: NDArray[np.int64], count: int) -> NDArray[np.bool_]:
    last = np.full(count, -1, np.int64)
    np.maximum.at(last, row, frame)
    return last == 0


def _follows_bars(experiment: Experiment, section: WallsSection, frame: NDArray[np.int64]) -> bool:
    """Whether bars are tracked in photographs; frame: of every row of their table."""
    if section.track is None:
        return experiment.config.photographs is not None and not np.any(frame > 0)
    return section.track


def arrange_arcs(
    table: Table, frame_count: int, *, others: tuple[str, ...] = ()
) -> tuple[tuple[str, ...], Array, NDArray[np.int8]]:
    """Return circular walls from a table frame,wall,x,y,radius,side and perhaps theta [rad].

    A circle that is given in frame 0 alone does not move. Without theta a circle does not rotate.

    Parameters
    ----------
    table
        The table of circles.
    frame_count
        Number of frames f.
    others
        Names of the straight walls.

    Returns
    -------
    tuple
        Names (w,), ends of a diameter (f, w, 2, 2) [m] and sides (w,).
    """
    frame, names, row = _named_rows(table)
    for at, wall in enumerate(row):
        if names[wall] in others:
            raise table.error(at, "wall", "is the name of a straight wall, too: every wall is given once")
    text = table.text("side")
    for at, each in enumerate(text):
        if each not in SIDES:
            raise table.error(at, "side", "is neither in (the packing is inside the circle) nor out (outside it)")
    radius, angle = table.numbers("radius"), np.nan_to_num(table.optional_numbers("theta"))
    for at in np.flatnonzero(radius <= 0.0).tolist():
        raise table.error(at, "radius", "is not positive")
    for at in np.flatnonzero((frame < 0) | (frame >= frame_count)).tolist():
        raise table.error(at, "frame", f"is not one of the {frame_count} frames, which count from 0")
    sides = np.array([SIDES[each] for each in text], np.int8)
    side = np.array([sides[row == wall][0] for wall in range(len(names))], np.int8)
    for at in np.flatnonzero(sides != side[row]).tolist():
        raise table.error(
            at, "side", f"differs from an earlier row: wall {names[row[at]]!r} has the packing on one side"
        )
    given = np.full((frame_count, len(names), 4), np.nan)
    given[frame, row] = np.column_stack([table.numbers("x"), table.numbers("y"), radius, angle])
    still = _given_in_frame_0_alone(frame, row, len(names))
    given[:, still] = given[0, still]
    for wall, name in enumerate(names):
        for k in np.flatnonzero(np.isnan(given[:, wall, 0])).tolist():
            raise InputError(
                table.file, f"frame {k}", f"has no row of wall {name!r}: give it in all frames, or in frame 0 alone"
            )
    return names, circle_ends(given[..., :2], given[..., 2], given[..., 3]), side


def arrange_loads(table: Table, names: tuple[str, ...], frame_count: int, pressure: Array) -> Array:
    """Return the measured normal force on the walls (f, w) [N] from a table frame,wall,force, NaN on other walls.

    Parameters
    ----------
    table
        The table of loads.
    names
        Names of the walls (w,).
    frame_count
        Number of frames f.
    pressure
        Pressure on the walls (w,) [Pa], NaN on walls without one. A wall with a load must have none.
    """
    frame, force = table.integers("frame"), table.numbers("force")
    wall = _wall_rows(table, names, frame, frame_count)
    for at in np.flatnonzero(np.isfinite(pressure[wall])).tolist():
        raise table.error(at, "wall", f"has a pressure of {pressure[wall[at]]:g} Pa, too: give one of them")
    for at in np.flatnonzero(force < 0.0).tolist():
        raise table.error(at, "force", "is negative: a positive force presses the wall against the packing")
    load = np.full((frame_count, len(names)), np.nan)
    load[frame, wall] = force
    for w in np.unique(wall).tolist():
        for k in np.flatnonzero(np.isnan(load[:, w])).tolist():
            raise InputError(table.file, f"frame {k}", f"has no row of wall {names[w]!r}: give loads in all frames")
    if not np.isfinite(pressure).any():
        for k in np.flatnonzero(np.nansum(load, axis=1) == 0.0).tolist():
            raise InputError(
                table.file, f"frame {k}", "has loads of 0 N alone: the scale of the forces is undetermined"
            )
    return load


def _read_bars(
    experiment: Experiment, section: WallsSection, frame_count: int
) -> tuple[tuple[str, ...], Array, NDArray[np.int8]]:
    if section.track and experiment.config.photographs is None:
        raise InputError(experiment.file, "key walls.track = true", "walls can be tracked in photographs only")
    if section.file is None and section.corners is not None and section.arcs is None:
        table = experiment.table(section.corners, CORNER_COLUMNS, optional=("theta",))
        corners = arrange_corners(table, frame_count, followed=follows_corners(experiment))
        names, endpoints = bars_of_corners(table.file, corners)
        return names, endpoints, np.full(len(names), STRAIGHT, np.int8)
    if section.file is None:
        return (), np.empty((frame_count, 0, 2, 2)), np.empty(0, np.int8)
    table = experiment.table(section.file, WALL_COLUMNS)
    followed = _follows_bars(experiment, section, table.integers("frame"))
    names, endpoints = arrange_walls(table, frame_count, followed=followed)
    return names, endpoints, np.full(len(names), STRAIGHT, np.int8)


def _read_corners(
    experiment: Experiment, section: WallsSection, others: tuple[str, ...], bars: Array, loaded: NDArray[np.bool_]
) -> tuple[tuple[str, ...], Array, NDArray[np.int32]]:
    """Return names (c,), ends of diameters (f, c, 2, 2) [m] and the plate of every wall (w + c,), −1: its own."""
    assert section.corners is not None
    table = experiment.table(section.corners, CORNER_COLUMNS, optional=("theta",))
    corners = arrange_corners(table, len(bars), followed=follows_corners(experiment))
    for at, each in enumerate(table.text("corner")):
        if each in others:
            raise table.error(at, "corner", "is the name of a wall, too: every wall and corner has a name of its own")
    bar = bar_of_each_corner(corners, bars, loaded)
    plate = np.full(len(others) + len(bar), -1, np.int32)
    on_plate = (bar >= 0) & np.append(loaded, np.False_)[bar]
    plate[len(others) :][on_plate] = bar[on_plate]
    return corners.name, corners.endpoints(bar, bars), plate


def _read_wall_forces(
    experiment: Experiment, section: WallsSection, names: tuple[str, ...], frame_count: int
) -> Array | None:
    """Return the recorded forces on the walls (f, w, 2) [N], NaN where there is none; None without a table."""
    if section.forces is None:
        return None
    table = experiment.table(section.forces, FORCE_COLUMNS)
    frame = table.integers("frame")
    wall = _wall_rows(table, names, frame, frame_count)
    force = np.full((frame_count, len(names), 2), np.nan)
    force[frame, wall] = np.column_stack([table.numbers("fx"), table.numbers("fy")])
    return force


def _named_rows(table: Table) -> tuple[NDArray[np.int64], tuple[str, ...], NDArray[np.int64]]:
    """Return the frame of every row, the names of the walls in order of appearance, and the wall of every row."""
    frame, name = table.integers("frame"), table.text("wall")
    names = tuple(dict.fromkeys(name))
    row = np.array([names.index(each) for each in name])
    check_unique(table, "wall", frame, row)
    return frame, names, row


def _wall_rows(table: Table, names: tuple[str, ...], frame: NDArray[np.int64], frame_count: int) -> NDArray[np.int64]:
    """Return the wall of every row, once in every frame. Raises InputError for unknown walls and frames."""
    for row, (k, each) in enumerate(zip(frame, table.text("wall"), strict=True)):
        if each not in names:
            raise table.error(row, "wall", "is not the name of a wall")
        if not 0 <= k < frame_count:
            raise table.error(row, "frame", f"is not one of the {frame_count} frames")
    wall = np.array([names.index(each) for each in table.text("wall")])
    check_unique(table, "wall", frame, wall)
    return wall
