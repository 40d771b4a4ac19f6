"""Text dumps of LAMMPS and LIGGGHTS: repeated ITEM: TIMESTEP, NUMBER OF ATOMS, BOX BOUNDS, ATOMS.

Rotations are read from quaternions, or else integrated from angular velocities. A periodic box gives the vectors of a
cell, a fixed box gives walls at its faces.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from ....experiment.reading.tables import Table
from ....process.errors import InputError
from ....solver.bodies.grains import Array
from ..foreign_table import read_text
from ..observations import Observations, layer_remarks, read_axes, turned_to_observer

COORDINATES = {  # names of a coordinate, the best first; the last two are fractions of the box
    "x": ("x", "xu", "xs", "xsu"), "y": ("y", "yu", "ys", "ysu"), "z": ("z", "zu", "zs", "zsu"),
}  # fmt: skip
SCALED = ("s", "su")
QUATERNIONS = (("c_q[1]", "c_q[2]", "c_q[3]", "c_q[4]"), ("quatw", "quati", "quatj", "quatk"))
ANGULAR_VELOCITIES = {"z": "omegaz", "y": "omegay", "x": "omegax"}


@dataclass(frozen=True, slots=True)
class DumpData:
    """The particles and the box of dumps."""

    observed: Observations
    low: Float[Array, "f 2"]  # of the box, in the dump's unit
    cell: Float[Array, "f 2 2"]  # edges of the box, along the first and the second axis if it is not tilted
    periodic: tuple[bool, bool]  # across x, across y
    shrinking: bool = False  # some faces follow the outermost grains (s, m) and are no walls


@dataclass(frozen=True, slots=True)
class _Step:
    file: Path
    line: int  # of its first particle
    number: int
    low: Array  # (3,) corner of the box
    edges: Array  # (3, 3) from there, a row each
    ends: tuple[str, ...]  # (3,) boundary conditions of the faces: pp, ff, …
    columns: list[str]
    rows: list[list[str]]


def read_lammps(source: Path, columns: Mapping[str, str], interval: float) -> DumpData:
    """Read one file of many steps, or a folder of dumps.

    Parameters
    ----------
    source : Path
    columns : mapping of str to str
        `x` and `y` may name other axes, such as y=z.
    interval : float
        Duration of one step [s], for angular velocities.

    Raises
    ------
    InputError
        Naming file, row and value.
    """
    files = dump_files(source)
    steps = {step.number: step for file in files for step in dump_steps(file)}
    if not steps:
        raise InputError(source, "", "contains no ITEM: TIMESTEP")
    ordered = [steps[number] for number in sorted(steps)]
    *axes, third = all_axes = read_axes(columns, "a dump")
    velocity = ANGULAR_VELOCITIES[third]
    frames, names, lines, position, radius, angle, spin, depth = [], [], [], [], [], [], [], []
    for step in ordered:
        step_columns = StepColumns(step)
        frames.append(np.full(len(step.rows), step.number, np.int64))
        names += step_columns.text("id")
        lines += range(step.line, step.line + len(step.rows))
        position.append(np.column_stack([step_columns.position(axis) for axis in axes]))
        depth.append(step_columns.position(third) if step_columns.has_position(third) else np.zeros(len(step.rows)))
        radius.append(step_columns.radius())
        angle.append(step_columns.angle(third))
        unknown = np.full(len(step.rows), np.nan)
        spin.append(step_columns.numbers(velocity) if velocity in step.columns else unknown)
    joined = np.concatenate
    rotation, remarks = joined(angle), []
    integrated = bool(np.isnan(rotation).all() and np.isfinite(joined(spin)).any())
    if integrated:
        rotation = _integrate_spin(
            [step.number for step in ordered], [StepColumns(step).text("id") for step in ordered], spin, interval
        )
        remarks.append(
            f"Rotations are {velocity} integrated over the dumped steps, which is coarse if grains rotated in between."
        )
    rotation = turned_to_observer(rotation, all_axes)
    known = joined(radius)
    remarks += layer_remarks(third, joined(depth), known)
    k = ["xyz".index(axis) for axis in axes]
    periodic = (ordered[0].ends[k[0]] == "pp", ordered[0].ends[k[1]] == "pp")
    if periodic[0] != periodic[1]:
        remarks.append(
            f"The box is periodic across {axes[0] if periodic[0] else axes[1]} only, which is not supported: contacts "
            "through these edges are lost, and grains that crossed them jump."
        )
    left = sorted(set(ordered[0].columns) & {"fx", "fy", "fz", "vx", "vy", "vz"})
    if left:
        remarks.append(f"Left out: {', '.join(left)}.")
    table = Table(ordered[0].file, {"id": names}, lines)
    observed = Observations(
        table,
        "id",
        joined(frames),
        tuple(names),
        joined(position),
        rotation,
        known,
        remarks=tuple(remarks),
        unwrapped=integrated,
    )
    low = np.array([step.low[k] for step in ordered])
    cell = np.array([step.edges[np.ix_(k, k)] for step in ordered])
    shrinking = any(set(ordered[0].ends[each]) & {"s", "m"} for each in k)
    return DumpData(observed, low, cell, periodic, shrinking)


class StepColumns:
    """Columns of one step by their meaning."""

    def __init__(self, step: _Step) -> None:
        self._step = step

    def text(self, name: str) -> list[str]:
        if name not in self._step.columns:
            names = " ".join(self._step.columns)
            raise InputError(self._step.file, f"step {self._step.number}", f"has no column {name} (columns: {names})")
        at = self._step.columns.index(name)
        return [row[at] for row in self._step.rows]

    def numbers(self, name: str) -> Array:
        values = []
        for row, text in enumerate(self.text(name)):
            try:
                value = float(text)
            except ValueError:
                value = float("nan")
            if not np.isfinite(value):
                raise InputError(self._step.file, f"row {self._step.line + row}, {name} = {text!r}", "is not a number")
            values.append(value)
        return np.array(values)

    def has_position(self, axis: str) -> bool:
        return any(name in self._step.columns for name in COORDINATES[axis])

    def position(self, axis: str) -> Array:
        name = next((each for each in COORDINATES[axis] if each in self._step.columns), axis)
        values = self.numbers(name)
        if not name.endswith(SCALED):
            return values
        if np.any(self._step.edges != np.diag(np.diag(self._step.edges))):
            where = f"step {self._step.number}"
            raise InputError(self._step.file, where, f"{name} is a fraction of a tilted box: dump x y z, or xu yu zu")
        k = "xyz".index(axis)
        return self._step.low[k] + values * self._step.edges[k, k]

    def radius(self) -> Array:
        if "radius" in self._step.columns:
            return self.numbers("radius")
        if "diameter" in self._step.columns:
            return 0.5 * self.numbers("diameter")
        return np.full(len(self._step.rows), np.nan)

    def angle(self, axis: str) -> Array:
        """Return rotations about an axis [rad] from quaternions; NaN without any."""
        for names in QUATERNIONS:
            if all(name in self._step.columns for name in names):
                return 2.0 * np.arctan2(self.numbers(names[1 + "xyz".index(axis)]), self.numbers(names[0]))
        return np.full(len(self._step.rows), np.nan)


def dump_files(source: Path) -> list[Path]:
    if not source.is_dir():
        return [source]
    found = [file for file in source.iterdir() if file.is_file() and is_dump(file)]
    if not found:
        raise InputError(source, "", "contains no file that begins with ITEM: TIMESTEP")
    return sorted(found, key=lambda file: [int(part) for part in re.findall(r"\d+", file.name)])


def is_dump(file: Path) -> bool:
    with file.open("rb") as stream:
        return stream.read(5) == b"ITEM:"


def dump_steps(file: Path, of: str = "ATOMS") -> Iterator[_Step]:
    """Yield the steps of a dump with their rows of atoms, or of other entries."""
    lines = read_text(file).splitlines()
    at, number, count = 0, None, None
    low, edges, ends = np.zeros(3), np.zeros((3, 3)), ("ff", "ff", "ff")
    while at < len(lines):
        head = lines[at].split()
        if not head:
            at += 1
            continue
        if head[0] != "ITEM:":
            raise InputError(file, f"row {at + 1}", f"{lines[at][:60]!r} is in the place of ITEM:")
        item = " ".join(head[1:])
        try:
            if item == "TIMESTEP":
                number, at = int(lines[at + 1]), at + 2
            elif item == f"NUMBER OF {of}":
                count, at = int(lines[at + 1]), at + 2
            elif item.startswith("BOX BOUNDS"):
                low, edges = _box([lines[at + k].split() for k in (1, 2, 3)], general="abc" in head)
                ends = tuple(each for each in head[3:] if len(each) == 2 and set(each) <= set("pfsm")) or ends
                at += 4
            elif item.startswith(of):
                if number is None or count is None:
                    raise InputError(file, f"row {at + 1}", f"comes before ITEM: TIMESTEP or ITEM: NUMBER OF {of}")
                columns, first = head[2:], at + 1
                rows = [line.split() for line in lines[first : first + count]]
                short = [k for k, row in enumerate(rows) if len(row) != len(columns)]
                if short or len(rows) < count:
                    row = short[0] if short else len(rows)
                    raise InputError(file, f"row {first + row + 1}", f"does not have {len(columns)} cells")
                yield _Step(file, first + 1, number, low, edges, ends, columns, rows)
                at = first + count
            elif item.split()[0] in ("ATOMS", "ENTRIES"):
                raise InputError(file, f"row {at + 1}", f"holds {item.split()[0]}, where ITEM: {of} is expected")
            else:  # UNITS, TIME, …
                at += 2
        except (ValueError, IndexError):
            raise InputError(file, f"row {at + 2}", f"is not valid after ITEM: {item}") from None


def _box(rows: list[list[str]], *, general: bool) -> tuple[Array, Array]:
    """Return corner (3,) and edges (3, 3) of a box; for a tilted one LAMMPS writes the bounds of its bounding box.

    general: every row is an edge and a coordinate of the corner, as in OVITO and later versions of LAMMPS.
    """
    values = [[float(cell) for cell in row] for row in rows]
    if general:
        table = np.array([row[:4] for row in values])
        return table[:, 3], table[:, :3]
    bounds = np.array([row[:2] for row in values])
    xy, xz, yz = ((row[2] if len(row) > 2 else 0.0) for row in values)
    bounds[0] -= min(0.0, xy, xz, xy + xz), max(0.0, xy, xz, xy + xz)
    bounds[1] -= min(0.0, yz), max(0.0, yz)
    edges = np.diag(bounds[:, 1] - bounds[:, 0])
    edges[1, 0], edges[2, 0], edges[2, 1] = xy, xz, yz
    return bounds[:, 0], edges


def _integrate_spin(number: list[int], names: list[list[str]], spin: list[Array], interval: float) -> Array:
    """Integrate angular velocities [rad/s] to rotations of all rows [rad] by the trapezoidal rule for each grain."""
    last: dict[str, tuple[int, float, float]] = {}
    found = []
    for step, ids, rates in zip(number, names, spin, strict=True):
        rotation = np.zeros(len(ids))
        for row, (name, rate) in enumerate(zip(ids, rates, strict=True)):
            if name in last:
                previous_step, previous_rate, angle = last[name]
                rotation[row] = angle + 0.5 * (previous_rate + rate) * (step - previous_step) * interval
            last[name] = (step, float(rate), float(rotation[row]))
        found.append(rotation)
    return np.concatenate(found)
