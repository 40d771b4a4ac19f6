"""Readers of MercuryDPM's text files: particles (.data, 8 or 14 columns) and forces between them (.fstat).

A block of .data begins with number, time and box; its rows are x y vx vy r angle ω info, or the same in three
dimensions. A block of .fstat begins with three lines of #; its rows are time, particle, other body, contact point,
overlap, tangential overlap, f_n, |f_t|, normal and tangent, each contact once for either particle; a negative other
body is a wall, whose normal is reversed. Particles are named by their row, from 0.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from ....experiment.reading.tables import Table
from ....process.errors import InputError
from ....solver.bodies.grains import Array
from ..foreign_table import read_text
from ..observations import AXES, Observations, layer_remarks, read_axes, turned_to_observer

FSTAT = ".fstat"
FORCE_CELLS = 16
SAME_TIME = 1e-6  # relative to the time between blocks


def read_mercury(source: Path, columns: Mapping[str, str]) -> Observations:
    """Read a .data file; columns: `x` and `y` may name other axes, such as y=z. Raises InputError."""
    *axes, third = all_axes = read_axes(columns, "MercuryDPM")
    frames, names, times, position, radius, depth, angle, spin, lines = [], [], [], [], [], [], [], [], []
    for frame, (line, time, table) in enumerate(_blocks(source)):
        flat = table.shape[1] == 8
        if flat and axes != ["x", "y"]:
            raise InputError("--columns", ",".join(axes), "does not apply: the file has the axes x and y alone")
        k = [AXES.index(axis) for axis in axes]
        frames.append(np.full(len(table), frame, np.int64))
        names += [str(row) for row in range(len(table))]
        times.append(np.full(len(table), time))
        position.append(table[:, k])
        depth.append(np.zeros(len(table)) if flat else table[:, AXES.index(third)])
        radius.append(table[:, 4 if flat else 6])
        out = AXES.index(third)
        angle.append(table[:, 5 if flat else 7 + out])
        spin.append(table[:, 6 if flat else 10 + out])
        lines += range(line, line + len(table))
    if not frames:
        raise InputError(source, "", "contains no particles")
    joined = np.concatenate
    rotation, remarks = _rotation(angle, spin)
    rotation = turned_to_observer(rotation, all_axes)
    remarks += layer_remarks(third, joined(depth), joined(radius))
    return Observations(
        Table(source, {"id": names}, lines), "id", joined(frames), tuple(names), joined(position), rotation,
        joined(radius), time=joined(times), remarks=tuple(remarks),
    )  # fmt: skip


def read_fstat(
    source: Path, columns: Mapping[str, str], times: Sequence[float], wall: str
) -> tuple[list[int], list[str], list[str], Array]:
    """Read the forces of .fstat at the times of the particles.

    Parameters
    ----------
    source : Path
    columns : mapping of str to str
        `x` and `y` may name other axes.
    times : sequence of float
        Times of the frames [s]; forces at other times are left out.
    wall : str
        Name for every wall.

    Returns
    -------
    frame, i, j : list
        Frame and names of both bodies of every contact, once.
    force : array (m, 2)
        Force that j exerts on i [N].

    Raises
    ------
    InputError
        A row is not valid, or no time is that of a frame.
    """
    k = [AXES.index(columns.get(role, role)) for role in "xy"]
    known, close = np.asarray(times), SAME_TIME * float(np.min(np.diff(times), initial=np.inf))
    frame, first, second, force = [], [], [], []
    at, seen, met = None, set(), False
    for number, line in enumerate(read_text(source).splitlines(), start=1):
        cells = line.split()
        if not cells:
            continue
        try:
            if cells[0] == "#":
                if len(cells) == 3:  # the first of the three lines: time and a mark of the form
                    nearest = int(np.argmin(np.abs(known - float(cells[1]))))
                    at = nearest if abs(known[nearest] - float(cells[1])) <= max(close, 1e-12) else None
                    seen, met = set(), met or at is not None
                continue
            if at is None:
                continue
            values = [float(cell) for cell in cells]
            if len(values) < FORCE_CELLS:
                raise ValueError
        except ValueError:
            raise InputError(source, f"row {number}", f"{line[:60]!r} is not a row of forces") from None
        i, j = int(values[1]), int(values[2])
        if (j, i) in seen and j >= 0:
            continue
        seen.add((i, j))
        vector = values[8] * np.array(values[10:13]) + values[9] * np.array(values[13:16])
        frame.append(at)
        first.append(str(i))
        second.append(wall if j < 0 else str(j))
        force.append((-vector if j < 0 else vector)[k])
    if not met:
        raise InputError(source, "", "has no forces at a time of the particles")
    return frame, first, second, np.array(force).reshape(-1, 2)


def _blocks(source: Path) -> Iterator[tuple[int, float, Array]]:
    """Yield line, time and rows of every block of a .data file."""
    lines = read_text(source).splitlines()
    at = 0
    while at < len(lines):
        head = lines[at].split()
        if not head:
            at += 1
            continue
        try:
            count, time = int(head[0]), float(head[1])
            if len(head) not in (6, 8) or count < 0:
                raise ValueError
        except (ValueError, IndexError):
            raise InputError(source, f"row {at + 1}", f"{lines[at][:60]!r} is not number, time and box") from None
        wide = 8 if len(head) == 6 else 14
        rows = []
        for number in range(at + 1, at + 1 + count):
            try:
                rows.append([float(cell) for cell in lines[number].split()][:wide])
                if len(rows[-1]) < wide:
                    raise ValueError
            except (ValueError, IndexError):
                raise InputError(source, f"row {number + 1}", f"does not have {wide} numbers") from None
        yield at + 2, time, np.array(rows).reshape(-1, wide)
        at += 1 + count


def _rotation(angle: list[Array], spin: list[Array]) -> tuple[Array, list[str]]:
    """Return rotations [rad] in the sense of the angular velocities, whose sign is certain; NaN where all are zero."""
    if len({len(each) for each in angle}) == 1 and len(angle) > 1:
        turned = np.diff(np.unwrap(np.array(angle), axis=0), axis=0)
        agreement = float((turned * np.array(spin)[1:]).sum())
    else:
        agreement = float(any(each.any() for each in angle))
    if agreement == 0.0:
        return np.full(sum(map(len, angle)), np.nan), ["The file gives no rotations."]
    if agreement < 0.0:
        return -np.concatenate(angle), ["Angles are reversed, so that they follow the angular velocities."]
    return np.concatenate(angle), []
