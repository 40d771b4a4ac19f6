"""Reader of YADE's exports: text (export.text, export.textExt: x, y, z, r and more) or VTK (exportSpheres).

One file per step, in the natural order of their names; a sphere is named by its row, or by a column id. In metres.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ....experiment.reading.photograph_order import natural_key
from ....experiment.reading.tables import Table
from ....process.errors import InputError
from ....solver.bodies.grains import Array
from ..foreign_table import read_text
from ..observations import AXES, Observations, layer_remarks, read_axes

PLAIN = "x_y_z_r"


def read_yade(source: Path, columns: Mapping[str, str]) -> Observations:
    """Read a file or a folder of files; columns: `x` and `y` may name other axes. Raises InputError."""
    *axes, third = read_axes(columns, "YADE")
    files = (
        sorted((each for each in source.iterdir() if each.is_file()), key=natural_key) if source.is_dir() else [source]
    )
    if not files:
        raise InputError(source, "", "is an empty folder")
    frames, names, position, radius, lines, left = [], [], [], [], [], set()
    depth: list[Array] = []
    for frame, file in enumerate(files):
        text = read_text(file)
        found, line = _read_vtk(file, text) if text.startswith("# vtk") else _read_text(file, text)
        count = len(found["r"])
        frames.append(np.full(count, frame, np.int64))
        names += [f"{value:.17g}" for value in found.get("id", np.arange(count, dtype=np.float64))]
        position.append(np.column_stack([found[axis] for axis in axes]))
        depth.append(found[third])
        radius.append(found["r"])
        lines += line
        left |= found.keys() - {"x", "y", "z", "r", "id"}
    remarks = layer_remarks(third, np.concatenate(depth), np.concatenate(radius))
    if left:
        remarks.append(f"Left out: {', '.join(sorted(left))}.")
    table = Table(files[0], {"id": names}, lines)
    points = np.concatenate(position)
    return Observations(
        table, "id", np.concatenate(frames), tuple(names), points, np.full(len(points), np.nan),
        np.concatenate(radius), remarks=tuple(remarks),
    )  # fmt: skip


def _read_text(file: Path, text: str) -> tuple[dict[str, Array], list[int]]:
    """Return the columns of a text export by name, and the line numbers of its rows."""
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
                raise InputError(file, f"row {number}", f"{each[:60]!r} has cells that are not numbers") from None
            if len(rows[-1]) < 4 or len(rows[-1]) != len(rows[0]):
                raise InputError(file, f"row {number}", f"has {len(cells)} numbers instead of {'_'.join(names)}")
            line.append(number)
    if not rows:
        raise InputError(file, "", "contains no spheres")
    table = np.array(rows)
    if not {"x", "y", "z", "r"} <= set(names):
        raise InputError(file, f"#format {'_'.join(names)}", "does not name x, y, z and r")
    return {name: table[:, k] for k, name in enumerate(names) if k < table.shape[1]}, line


def _read_vtk(file: Path, text: str) -> tuple[dict[str, Array], list[int]]:
    """Return points and scalars of a legacy VTK file in ASCII, and their line numbers."""
    text_lines = text.splitlines()
    if len(text_lines) < 3 or text_lines[2].strip() != "ASCII":
        raise InputError(file, "row 3", "is not ASCII: binary VTK is not supported")
    found: dict[str, Array] = {}
    at, line, count = 3, [], 0
    while at < len(text_lines):
        head = text_lines[at].split()
        try:
            if head[:1] == ["POINTS"]:
                count, line = int(head[1]), list(range(at + 2, at + 2 + int(head[1])))
                points, at = _read_numbers(text_lines, at + 1, 3 * count)
                found |= dict(zip(AXES, points.reshape(-1, 3).T, strict=True))
            elif head[:1] == ["SCALARS"]:
                values, at = _read_numbers(text_lines, at + 2, count)  # after LOOKUP_TABLE
                found["r" if head[1] == "radius" else head[1]] = values
            else:
                at += 1
        except (ValueError, IndexError):
            raise InputError(file, f"row {at + 1}", f"{text_lines[at][:40]!r} is not followed by its numbers") from None
    if "x" not in found or "r" not in found:
        raise InputError(file, "", "has no POINTS with SCALARS radius")
    return found, line


def _read_numbers(lines: list[str], at: int, count: int) -> tuple[Array, int]:
    """Read `count` numbers from line `at` on; also return the line after them."""
    values: list[float] = []
    while len(values) < count:
        values += [float(cell) for cell in lines[at].split()]
        at += 1
    if len(values) != count:
        raise ValueError
    return np.array(values), at
