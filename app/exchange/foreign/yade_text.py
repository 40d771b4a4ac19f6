"""What YADE's export writes: text (export.text, export.textExt, of x, y, z, r and more) or VTK (exportSpheres).

One file a step, in the natural order of their names; a sphere is named by its row, or by a column id. In metres.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from solver.bodies.grains import Array

from ...errors import InputError
from ...experiment.reading.tables import Table
from .foreign_table import read_text
from .observations import Observations

PLAIN = "x_y_z_r"
FLAT = 0.5  # of a mean diameter: centres within it are a layer
AXES = ("x", "y", "z")


def read_yade(source: Path, columns: Mapping[str, str]) -> Observations:
    """Read a file or a folder of files; columns: `x` and `y` may name other axes. Raises InputError."""
    axes = tuple(columns.get(role, role) for role in "xy")
    for axis in axes:
        if axis not in AXES:
            raise InputError("--columns", axis, "is not an axis of YADE's: x, y or z")
    files = sorted((each for each in source.iterdir() if each.is_file()), key=_natural) if source.is_dir() else [source]
    if not files:
        raise InputError(source, "", "is an empty folder")
    frames, names, place, radius, lines, left = [], [], [], [], [], set()
    depth: list[Array] = []
    third = next(axis for axis in AXES if axis not in axes)
    for frame, file in enumerate(files):
        text = read_text(file)
        found, line = _read_vtk(file, text) if text.startswith("# vtk") else _read_text(file, text)
        count = len(found["r"])
        frames.append(np.full(count, frame, np.int64))
        names += [f"{value:.17g}" for value in found.get("id", np.arange(count, dtype=np.float64))]
        place.append(np.column_stack([found[axis] for axis in axes]))
        depth.append(found[third])
        radius.append(found["r"])
        lines += line
        left |= found.keys() - {"x", "y", "z", "r", "id"}
    spread, mean = float(np.ptp(np.concatenate(depth))), float(np.concatenate(radius).mean())
    remarks = []
    if spread > FLAT * 2.0 * mean:
        remarks.append(f"{third} goes over {spread:g}: this is no layer of rods, and {third} is left out.")
    if left:
        remarks.append(f"Left out: {', '.join(sorted(left))}.")
    table = Table(files[0], {"id": names}, lines)
    points = np.concatenate(place)
    return Observations(
        table, "id", np.concatenate(frames), tuple(names), points, np.full(len(points), np.nan),
        np.concatenate(radius), remarks=tuple(remarks),
    )  # fmt: skip


def _read_text(file: Path, text: str) -> tuple[dict[str, Array], list[int]]:
    """Columns of a text export by name, as its first line names them, and the rows' lines."""
    names = PLAIN.split("_")
    rows, line = [], []
    for number, each in enumerate(text.splitlines(), start=1):
        cells = each.split()
        if cells and cells[0] == "#format" and len(cells) > 1:
            names = cells[1].split("_")
        elif cells and not cells[0].startswith("#"):
            try:
                rows.append([float(cell) for cell in cells])
            except ValueError:
                raise InputError(file, f"row {number}", f"{each[:60]!r} is not numbers") from None
            if len(rows[-1]) < 4 or len(rows[-1]) != len(rows[0]):
                raise InputError(file, f"row {number}", f"has {len(cells)} numbers, not those of {'_'.join(names)}")
            line.append(number)
    if not rows:
        raise InputError(file, "", "has no spheres")
    table = np.array(rows)
    if not {"x", "y", "z", "r"} <= set(names):
        raise InputError(file, f"#format {'_'.join(names)}", "does not name x, y, z and r")
    return {name: table[:, k] for k, name in enumerate(names) if k < table.shape[1]}, line


def _read_vtk(file: Path, text: str) -> tuple[dict[str, Array], list[int]]:
    """Points and scalars of a legacy VTK file in ASCII, and their lines."""
    words = text.splitlines()
    if len(words) < 3 or words[2].strip() != "ASCII":
        raise InputError(file, "row 3", "is not ASCII: binary VTK is not read")
    found: dict[str, Array] = {}
    at, line, count = 3, [], 0
    while at < len(words):
        head = words[at].split()
        try:
            if head[:1] == ["POINTS"]:
                count, line = int(head[1]), list(range(at + 2, at + 2 + int(head[1])))
                points, at = _take(words, at + 1, 3 * count)
                found |= dict(zip(AXES, points.reshape(-1, 3).T, strict=True))
            elif head[:1] == ["SCALARS"]:
                values, at = _take(words, at + 2, count)  # after LOOKUP_TABLE
                found["r" if head[1] == "radius" else head[1]] = values
            else:
                at += 1
        except (ValueError, IndexError):
            raise InputError(file, f"row {at + 1}", f"{words[at][:40]!r} is not followed by its numbers") from None
    if "x" not in found or "r" not in found:
        raise InputError(file, "", "has no POINTS with SCALARS radius")
    return found, line


def _take(words: list[str], at: int, count: int) -> tuple[Array, int]:
    """The next `count` numbers from line `at` on, and the line after them."""
    values: list[float] = []
    while len(values) < count:
        values += [float(cell) for cell in words[at].split()]
        at += 1
    if len(values) != count:
        raise ValueError
    return np.array(values), at


def _natural(file: Path) -> list[tuple[int, str]]:
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", file.name)]
