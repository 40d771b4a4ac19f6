"""CONFNNNN files of the programs of the published experiments, one per photograph, in all their forms.

They differ in the first line, the columns, the unit and the direction of y:

- x, y, rotation, radius in pixels, y down, without the number of rows; corners are rows of radius 1;
- the number of rows, x, y, rotation, radius in pixels, sections #CORNERS, #FIX_PTS, #SCALES_, #FILES__; positions in
  metres and y up where the scale is not 1;
- x, y, radius, rotation, perhaps with two correlations; then the corners, counter-clockwise, after a line "0 - …", and
  the scale [m/px] after a line "2 - …"; metres, or pixels where the scale is 1; y up.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..experiment.reading.input_files import regular
from ..process.errors import InputError
from ..solver.bodies.grains import Array

ROTATION_THIRD, RADIUS_THIRD = "x y rotation radius", "x y radius rotation"
WIDTHS = (4, 6)  # columns, with two correlations
GREATEST_IN_METRES = 0.5  # radius of a rod [m]; in pixels radii are above 2
GREATEST_ANGLE = 2.0 * np.pi  # [rad] of a column that may be a rotation where the other cannot be one
RADIUS_CHANGE = 0.02  # relative, of a radius over the photographs, at most; scales of photographs differ


@dataclass(frozen=True, slots=True)
class PoseTable:
    """Rows of one file: grains, corners and markers, in its own unit and axes."""

    file: Path
    x: Array  # (n,)
    y: Array
    rotation: Array  # [rad]
    radius: Array
    zncc: Array  # NaN: the file has none; lost grains are NaN in all but the radius
    in_metres: bool = False
    y_down: bool = True
    scale: float | None = None  # [m/px] given by the file
    begin: int = 1  # lines before the first row


@dataclass(frozen=True, slots=True)
class _Raw:
    """Numbers of one file as written."""

    file: Path
    rows: Array  # (n, 4 or 6)
    corners: Array  # (c, 2 or 3) after the rows
    scale: float | None
    form: str | None  # where its sections determine it
    begin: int  # lines before the first row


def read_conf_files(files: Sequence[Path], radius_column: int | None = None) -> list[PoseTable]:
    """Read files of one sequence.

    Parameters
    ----------
    files
        In the order of the photographs.
    radius_column : int, optional
        3 or 4: the column of the radius; None: recognised.

    Raises
    ------
    InputError
        A file is damaged, or both columns can be the radius.
    """
    raw = [_read(file) for file in files]
    form = _form(raw, radius_column)
    return [_pose_table(each, form) for each in raw]


def _form(raw: Sequence[_Raw], radius_column: int | None) -> str:
    """Recognise the order of the columns from the sections of the files, else from their numbers."""
    if radius_column is not None:
        return RADIUS_THIRD if radius_column == 3 else ROTATION_THIRD
    stated = {each.form for each in raw} - {None}
    if len(stated) == 1:
        return stated.pop() or ROTATION_THIRD
    columns = {RADIUS_THIRD: 2, ROTATION_THIRD: 3}
    possible = {form for form, column in columns.items() if _is_positive(raw, column)}
    for test in (_is_constant, _is_large):  # an angle is small, a radius in pixels is not
        if len(possible) == 2:
            possible = {form for form in possible if test(raw, columns[form])} or possible
    if len(possible) == 1:
        return possible.pop()
    names = f"{raw[0].file.name} … {raw[-1].file.name}" if len(raw) > 1 else raw[0].file.name
    problem = (
        "both columns 3 and 4 can be the radius" if possible else "neither column 3 nor column 4 can be the radius"
    )
    raise InputError(
        raw[0].file.parent, names, f"{problem} (positive, the same in all files): give --columns radius=3 for "
        f"{RADIUS_THIRD!r}, or radius=4 for {ROTATION_THIRD!r}"
    )  # fmt: skip


def _is_positive(raw: Sequence[_Raw], column: int) -> bool:
    return all(bool((each.rows[:, column] > 0.0).all()) for each in raw)


def _is_constant(raw: Sequence[_Raw], column: int) -> bool:
    first = raw[0].rows[:, column]
    return all(
        len(each.rows) == len(first) and bool(np.all(np.abs(each.rows[:, column] - first) <= RADIUS_CHANGE * first))
        for each in raw
    )


def _is_large(raw: Sequence[_Raw], column: int) -> bool:
    return float(np.median(raw[0].rows[:, column])) > GREATEST_ANGLE


def _pose_table(raw: _Raw, form: str) -> PoseTable:
    radius, rotation = (2, 3) if form == RADIUS_THIRD else (3, 2)
    rows = raw.rows
    zncc = np.full(len(rows), np.nan)
    if rows.shape[1] == max(WIDTHS):
        unmatched = np.all(rows[:, 4:6] == 0.0, axis=1)
        zncc = np.full(len(rows), np.nan) if unmatched.all() else np.where(unmatched, np.nan, rows[:, 5])
        rows = np.where(unmatched[:, None] & ~unmatched.all() & (np.arange(6) != radius), np.nan, rows)
    size = rows[:, radius]
    scaled = raw.scale is not None and raw.scale != 1.0
    if raw.form == ROTATION_THIRD and scaled:
        size = size * (raw.scale or 1.0)  # this form keeps radii in pixels
    in_metres = bool(scaled or np.median(size) < GREATEST_IN_METRES)
    found = PoseTable(
        raw.file, rows[:, 0], rows[:, 1], rows[:, rotation], size, zncc, in_metres,
        y_down=not in_metres and raw.form != RADIUS_THIRD, scale=raw.scale if scaled else None, begin=raw.begin,
    )  # fmt: skip
    if not len(raw.corners):
        return found
    angle = raw.corners[:, 2] if raw.corners.shape[1] > 2 else np.full(len(raw.corners), np.nan)
    return replace(
        found,
        x=np.append(found.x, raw.corners[:, 0]), y=np.append(found.y, raw.corners[:, 1]),
        rotation=np.append(found.rotation, angle), radius=np.append(found.radius, np.ones(len(angle))),
        zncc=np.append(found.zncc, np.full(len(angle), np.nan)),
    )  # fmt: skip


def _read(file: Path) -> _Raw:
    lines = read_lines(file)
    first = lines[0].split() if lines else []
    if len(first) in WIDTHS and _are_numbers(first):
        count = next((k for k, line in enumerate(lines) if not line.strip() or not _are_numbers(line.split())), None)
        begin, count = 0, len(lines) if count is None else count
    else:
        begin, count = 1, read_count(file, lines)
    width = len(lines[begin].split())
    width = max(each for each in WIDTHS if each <= max(width, min(WIDTHS)))
    return _read_sections(file, read_rows(file, lines, begin, count, width), lines, begin)


def _read_sections(file: Path, rows: Array, lines: list[str], begin: int) -> _Raw:
    """Read corners and scale from the lines after the rows."""
    corners, scale, section = [], None, ""
    stated = None if rows.shape[1] == min(WIDTHS) else RADIUS_THIRD
    for number in range(begin + len(rows), len(lines)):
        text = lines[number].strip()
        title = re.match(r"(#[A-Z_]+)|([0-9]) *-(?=[^0-9.]|$)", text)
        if title:
            section = title[1].strip("#_") if title[1] else {"0": "CORNERS", "2": "SCALES"}.get(title[2], "")
            stated = ROTATION_THIRD if title[1] else RADIUS_THIRD
            continue
        cells = text.split()
        if section == "CORNERS" and len(cells) > 1:
            corners.append(read_numbers(file, number, cells[:3]))
        elif section == "SCALES" and cells:
            scale = float(read_numbers(file, number, cells[:1])[0])
            section = ""
    if len({len(each) for each in corners}) > 1:
        raise InputError(file, "corners", "have rows of different lengths")
    if scale is not None and not scale > 0.0:
        raise InputError(file, "scale", f"{scale:g} is not positive")
    return _Raw(file, rows, np.array(corners) if corners else np.empty((0, 2)), scale, stated, begin)


def _are_numbers(cells: list[str]) -> bool:
    try:
        return all(np.isfinite(float(cell)) for cell in cells)
    except ValueError:
        return False


def read_lines(file: Path) -> list[str]:
    """Read the lines of a text file. Raises InputError."""
    try:
        return regular(file).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(file, "", f"cannot be read ({error})") from None


def read_count(file: Path, lines: list[str]) -> int:
    """Read the number of rows from the first line. Raises InputError."""
    try:
        count = int(lines[0].split()[0])
    except (IndexError, ValueError):
        raise InputError(file, "row 1", "is not the number of grains") from None
    if count < 1 or len(lines) < count + 1:
        raise InputError(file, "row 1", f"states {count} grains, but there are {max(len(lines) - 1, 0)} rows")
    return count


def read_rows(file: Path, lines: list[str], begin: int, count: int, columns: int) -> Array:
    """Read the first columns of rows (count, columns). Raises InputError."""
    table = np.empty((count, columns))
    for row in range(count):
        cells = lines[begin + row].split()
        if len(cells) < columns:
            raise InputError(file, f"row {begin + row + 1}", f"has {len(cells)} numbers, not {columns}")
        table[row] = read_numbers(file, begin + row, cells[:columns])
    return table


def read_numbers(file: Path, line: int, cells: list[str]) -> list[float]:
    """Read finite numbers of a line. Raises InputError."""
    try:
        numbers = [float(cell) for cell in cells]
    except ValueError:
        raise InputError(file, f"row {line + 1}", f"{' '.join(cells)!r} is not {len(cells)} numbers") from None
    if not np.isfinite(numbers).all():
        raise InputError(file, f"row {line + 1}", "has a number that is not finite")
    return numbers
