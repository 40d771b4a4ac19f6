"""Files of the trackers of the published experiments: `dic_out_N.txt` and `CONFNNNN`, one per photograph.

Both count pixels with y pointing down. `dic_out`: the number of rows, then 13 columns: reference x, y (whole pixels)
and rotation, radius, displacement dx, dy, rotation since the reference, the same three since the former photograph,
and three correlations: before and after the rescue, and at the sub-pixel step. A point (X, Y) of a grain moves to
x + dx + cos·X + sin·Y, y + dy − sin·X + cos·Y, so that rotations are counter-clockwise as seen. `CONF`: the number of
rows, then x, y, rotation, radius, then sections that begin with #. Rows of radius 1 and 2 are no grains: they mark
corners and fixed points.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from solver.bodies.grains import Array

from ..atomic import write_atomically
from ..errors import InputError
from ..experiment.reading.input_files import ordinary
from ..experiment.units import Scale
from ..tracks import Tracks

COLUMNS = 13
MARKERS = (1.0, 2.0)  # radii of rows that are no grains


@dataclass(frozen=True, slots=True)
class DicSequence:
    """Grains of all files, in pixels, y down, rotations counter-clockwise as seen."""

    row: np.ndarray  # (n,) of the grain in its files
    radius: Array  # (n,) [px]
    x: Array  # (f, n) [px], NaN where lost
    y: Array  # (f, n) [px]
    rotation: Array  # (f, n) [rad]
    zncc: Array  # (f, n), NaN where the files have none
    number: tuple[int, ...]  # (f,) of the files


def read_sequence(folder: Path) -> DicSequence:
    """Read the dic_out files of a folder, or else its CONF files, by their numbers. Raises InputError."""
    for pattern, read in ((r"dic_out_(\d+)\.txt", _read_dic), (r"CONF(\d+)", _read_conf)):
        found = sorted(
            (int(match[1]), file) for file in folder.iterdir() if (match := re.fullmatch(pattern, file.name))
        ) if folder.is_dir() else []  # fmt: skip
        if found:
            return _stack([(number, file, read(file)) for number, file in found])
    raise InputError(folder, "", "holds neither dic_out_N.txt nor CONFNNNN files")


def write_sequence(tracks: Tracks, scale: Scale, folder: Path) -> list[Path]:
    """Write tracks as dic_out_0.txt, dic_out_1.txt, …; returns the files.

    A grain without a pose has correlations 0 and stays where it was last seen. Where a pose carries no correlation,
    1 is written. Grains that frame 0 does not have are left out: the format refers to it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    kept = np.flatnonzero(tracks.present[0])
    pixels, rotation = scale.to_pixels(tracks.position[:, kept]), tracks.rotation[:, kept].copy()
    present = tracks.present[:, kept]
    for frame in range(1, tracks.frame_count):
        gone = ~present[frame]
        pixels[frame, gone], rotation[frame, gone] = pixels[frame - 1, gone], rotation[frame - 1, gone]
    reference, start = np.rint(pixels[0]), rotation[0]
    radius = tracks.radius[kept] / scale.pixel_size
    files = []
    for frame in range(tracks.frame_count):
        former = max(frame - 1, 0)
        zncc = np.where(np.isfinite(tracks.zncc[frame, kept]), tracks.zncc[frame, kept], 1.0)
        zncc = np.where(present[frame], zncc, 0.0)
        table = np.column_stack(
            [
                reference, start, radius, pixels[frame] - reference, rotation[frame] - start,
                pixels[frame] - pixels[former], rotation[frame] - rotation[former], zncc, zncc, zncc,
            ]
        )  # fmt: skip
        lines = [str(len(kept)), *(" ".join(map(repr, row)) for row in table.tolist()), ""]
        files.append(folder / f"dic_out_{frame}.txt")
        write_atomically(files[-1], "\n".join(lines).encode())
    return files


def _stack(parts: list[tuple[int, Path, Array]]) -> DicSequence:
    _, first, table = parts[0]
    grains = np.flatnonzero(~np.isin(table[:, 3], MARKERS))
    if len(grains) == 0:
        raise InputError(first, "", "holds no grain: all radii are 1 or 2")
    for _, file, other in parts[1:]:
        if len(other) != len(table):
            raise InputError(file, "row 1", f"has {len(other)} rows, {first.name} has {len(table)}")
        changed = np.flatnonzero(other[grains, 3] != table[grains, 3])
        if len(changed):
            row = int(grains[changed[0]])
            raise InputError(
                file, f"row {row + 2}", f"radius {other[row, 3]:g}, in {first.name} it is {table[row, 3]:g}"
            )
    stack = np.stack([other[grains] for _, _, other in parts])
    return DicSequence(
        grains, table[grains, 3], stack[:, :, 0], stack[:, :, 1], stack[:, :, 2], stack[:, :, 4],
        tuple(number for number, _, _ in parts),
    )  # fmt: skip


def _read_dic(file: Path) -> Array:
    """x, y, rotation, radius, correlation (n, 5); lost grains are NaN."""
    table, _ = _numbers(file, COLUMNS)
    reference = np.rint(table[:, 0:2])
    place, rotation = reference + table[:, 4:6], table[:, 2] + table[:, 6]
    zncc = table[:, 12].copy()
    unmatched = np.all(table[:, 10:13] == 0.0, axis=1)
    if unmatched.all():  # the reference itself: nothing was correlated
        zncc[:] = np.nan
    else:
        grains = ~np.isin(table[:, 3], MARKERS)
        lost = unmatched & grains
        place[lost], rotation[lost], zncc[lost] = np.nan, np.nan, np.nan
    return np.column_stack([place, rotation, table[:, 3], zncc])


def _read_conf(file: Path) -> Array:
    table, _ = _numbers(file, 4)
    return np.column_stack([table, np.full(len(table), np.nan)])


def _numbers(file: Path, columns: int) -> tuple[Array, list[str]]:
    """The rows that the first line counts (n, columns), and the lines after them."""
    try:
        lines = ordinary(file).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(file, "", f"cannot be read ({error})") from None
    try:
        count = int(lines[0].split()[0])
    except (IndexError, ValueError):
        raise InputError(file, "row 1", "does not say how many grains there are") from None
    if count < 1 or len(lines) < count + 1:
        raise InputError(file, "row 1", f"says {count} grains, but there are {max(len(lines) - 1, 0)} rows")
    table = np.empty((count, columns))
    for row in range(count):
        cells = lines[row + 1].split()
        if len(cells) < columns:
            raise InputError(file, f"row {row + 2}", f"has {len(cells)} numbers, not {columns}")
        try:
            table[row] = [float(cell) for cell in cells[:columns]]
        except ValueError:
            raise InputError(file, f"row {row + 2}", f"{lines[row + 1]!r} is not {columns} numbers") from None
        if not np.isfinite(table[row]).all():
            raise InputError(file, f"row {row + 2}", "has a number that is not finite")
    return table, lines[count + 1 :]
