"""Files of the trackers of the published experiments: `dic_out_N.txt` and `CONFNNNN`, one per photograph.

`dic_out` counts pixels with y pointing down: the number of rows, then 13 columns: reference x, y (whole pixels) and
rotation, radius, displacement dx, dy, rotation since the reference, the same three since the previous photograph, and
three correlations: before and after the rescue, and at the sub-pixel step. A point (X, Y) of a grain moves to
x + dx + cos·X + sin·Y, y + dy − sin·X + cos·Y, so that rotations are counter-clockwise as seen. The forms of `CONF` are
described in `conf_files`. Rows of a radius from 1 to 2 are the corners of the frame, rows of a radius from 2 to 2.5
markers that do not move; neither are grains.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from ..experiment.units import Scale
from ..process.atomic import write_atomically
from ..process.errors import InputError
from ..solver.bodies.grains import Array
from ..solver.bodies.wall_shapes import OUT
from ..tracks import Tracks, WallTracks
from .conf_files import RADIUS_CHANGE, PoseTable, read_conf_files, read_count, read_lines, read_rows

COLUMNS = 13
CORNER, MARKER, LEAST = 1.0, 2.0, 2.5  # radii from which on rows are corners, markers, grains [px]


@dataclass(frozen=True, slots=True)
class DicCorners:
    """Corners of the frame, in the unit and axes of the files."""

    x: Float[Array, "f c"]
    y: Float[Array, "f c"]
    rotation: Float[Array, "f c"]  # [rad], NaN: unknown


@dataclass(frozen=True, slots=True)
class DicSequence:
    """Grains of all files, rotations counter-clockwise as seen."""

    row: np.ndarray  # (n,) of the grain in its files
    radius: Array  # (n,) [px]
    x: Array  # (f, n) [px], NaN where lost
    y: Array  # (f, n) [px]
    rotation: Array  # (f, n) [rad]
    zncc: Array  # (f, n), NaN where the files have none
    number: tuple[int, ...]  # (f,) of the files
    corners: DicCorners | None = None
    markers: tuple[float, ...] = ()  # radii of the rows that are neither grains nor corners
    in_metres: bool = False  # lengths are in metres instead of pixels
    y_down: bool = True
    scale: float | None = None  # [m/px] of the first file, where it gives one
    other_form: bool = False  # the folder has CONF files beside dic_out files


def read_sequence(folder: Path, radius_column: int | None = None) -> DicSequence:
    """Read the dic_out files of a folder, or else its CONF files, by their numbers.

    Parameters
    ----------
    folder : Path
    radius_column : int, optional
        Column of the radius in CONF files, 3 or 4; None: recognised.

    Raises
    ------
    InputError
        Naming file and row.
    """
    outputs, configurations = (_numbered(folder, each) for each in (r"dic_out_(\d+)\.txt", r"CONF(\d+)"))
    if outputs:
        tables = [_read_dic(file) for _, file in outputs]
        return _stack([number for number, _ in outputs], tables, other_form=bool(configurations))
    if configurations:
        tables = read_conf_files([file for _, file in configurations], radius_column)
        return _stack([number for number, _ in configurations], tables)
    raise InputError(folder, "", "contains neither dic_out_N.txt nor CONFNNNN files")


def _numbered(folder: Path, pattern: str) -> list[tuple[int, Path]]:
    if not folder.is_dir():
        return []
    return sorted((int(match[1]), file) for file in folder.iterdir() if (match := re.fullmatch(pattern, file.name)))


def write_sequence(tracks: Tracks, scale: Scale, folder: Path, walls: WallTracks | None = None) -> list[Path]:
    """Write tracks as dic_out_0.txt, dic_out_1.txt, …; return the files.

    Corners of the frame, discs where bars meet, are rows of radius 1 after the grains. A grain without a pose has
    correlations 0 and its last known pose. A pose without a correlation gets 1. Grains missing from frame 0, the
    reference of the format, are left out.
    """
    folder.mkdir(parents=True, exist_ok=True)
    kept = np.flatnonzero(tracks.present[0])
    pixels, rotation = scale.to_pixels(tracks.position[:, kept]), tracks.rotation[:, kept].copy()
    present = tracks.present[:, kept]
    for frame in range(1, tracks.frame_count):
        absent = ~present[frame]
        pixels[frame, absent], rotation[frame, absent] = pixels[frame - 1, absent], rotation[frame - 1, absent]
    reference, start = np.rint(pixels[0]), rotation[0]
    radius = tracks.radius[kept] / scale.pixel_size
    centre, angle = _corner_poses(walls)
    if centre.shape[1]:
        pixels = np.concatenate([pixels, scale.to_pixels(centre)], axis=1)
        rotation = np.concatenate([rotation, angle], axis=1)
        reference, start = np.rint(pixels[0]), rotation[0]
        radius = np.concatenate([radius, np.full(centre.shape[1], CORNER)])
        present = np.concatenate([present, np.ones((tracks.frame_count, centre.shape[1]), np.bool_)], axis=1)
    files = []
    for frame in range(tracks.frame_count):
        previous = max(frame - 1, 0)
        measured = np.append(tracks.zncc[frame, kept], np.full(centre.shape[1], np.nan))
        zncc = np.where(np.isfinite(measured), measured, 1.0)
        zncc = np.where(present[frame], zncc, 0.0)
        table = np.column_stack(
            [
                reference, start, radius, pixels[frame] - reference, rotation[frame] - start,
                pixels[frame] - pixels[previous], rotation[frame] - rotation[previous], zncc, zncc, zncc,
            ]
        )  # fmt: skip
        lines = [str(len(table)), *(" ".join(map(repr, row)) for row in table.tolist()), ""]
        files.append(folder / f"dic_out_{frame}.txt")
        write_atomically(files[-1], "\n".join(lines).encode())
    return files


def _corner_poses(walls: WallTracks | None) -> tuple[Array, Array]:
    """Return centres (f, c, 2) [m] and rotations (f, c) [rad] of the discs that stand where bars end."""
    if walls is None or walls.side is None or walls.centre is None or walls.radius is None:
        return np.empty((0, 0, 2)), np.empty((0, 0))
    ends = walls.endpoints[0, walls.side == 0].reshape(-1, 2)
    discs = [
        w for w in np.flatnonzero(walls.side == OUT).tolist()
        if np.count_nonzero(np.linalg.norm(ends - walls.centre[0, w], axis=1) <= walls.radius[0, w]) > 1
    ]  # fmt: skip
    along = walls.endpoints[:, discs, 1] - walls.endpoints[:, discs, 0]
    return walls.centre[:, discs], np.unwrap(np.arctan2(along[..., 1], along[..., 0]), axis=0)


def _stack(number: list[int], tables: list[PoseTable], *, other_form: bool = False) -> DicSequence:
    first = tables[0]
    corner = (first.radius >= CORNER) & (first.radius < MARKER)
    marker = (first.radius >= MARKER) & (first.radius < LEAST)
    grains, corners = np.flatnonzero(~(corner | marker)), np.flatnonzero(corner)
    if len(grains) == 0:
        raise InputError(first.file, "", "contains no grain: all radii are from 1 to 2.5")
    for each in tables[1:]:
        if len(each.radius) != len(first.radius):
            problem = f"has {len(each.radius)} rows, {first.file.name} has {len(first.radius)}"
            raise InputError(each.file, "row 1", problem)
        if each.in_metres != first.in_metres:
            units = ("pixels", "metres")
            problem = f"is in {units[each.in_metres]}, {first.file.name} in {units[first.in_metres]}"
            raise InputError(each.file, "", problem)
        change = np.abs(each.radius[grains] - first.radius[grains])
        changed = np.flatnonzero(change > (RADIUS_CHANGE if each.in_metres else 0.0) * first.radius[grains])
        if len(changed):
            row = int(grains[changed[0]])
            problem = f"radius {each.radius[row]:g}, in {first.file.name} it is {first.radius[row]:g}"
            raise InputError(each.file, f"row {each.begin + row + 1}", problem)
    x, y, rotation, zncc = (
        np.stack([getattr(each, name) for each in tables]) for name in ("x", "y", "rotation", "zncc")
    )
    return DicSequence(
        grains, np.median([each.radius[grains] for each in tables], axis=0), x[:, grains], y[:, grains],
        rotation[:, grains], zncc[:, grains], tuple(number),
        DicCorners(x[:, corners], y[:, corners], rotation[:, corners]) if len(corners) else None,
        tuple(first.radius[marker].tolist()), first.in_metres, first.y_down, first.scale, other_form,
    )  # fmt: skip


def _read_dic(file: Path) -> PoseTable:
    lines = read_lines(file)
    table = read_rows(file, lines, 1, read_count(file, lines), COLUMNS)
    reference = np.rint(table[:, 0:2])
    position, rotation = reference + table[:, 4:6], table[:, 2] + table[:, 6]
    zncc = table[:, 12].copy()
    unmatched = np.all(table[:, 10:13] == 0.0, axis=1)
    if unmatched.all():  # the reference itself, without correlations
        zncc[:] = np.nan
    else:
        lost = unmatched & (table[:, 3] >= LEAST)
        position[lost], rotation[lost], zncc[lost] = np.nan, np.nan, np.nan
    return PoseTable(file, position[:, 0], position[:, 1], rotation, table[:, 3], zncc)
