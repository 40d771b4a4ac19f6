"""Text dumps of LAMMPS and LIGGGHTS: ITEM: TIMESTEP, NUMBER OF ATOMS, BOX BOUNDS, ATOMS, again and again.

Rotations come from quaternions where they are dumped, or else from angular velocities, summed up in time. Where the box
is periodic the cell's vectors are kept, where it is fixed its faces are walls.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from solver.bodies.grains import Array

from ...errors import InputError
from ...experiment.reading.tables import Table
from .foreign_table import read_text
from .observations import Observations

PLACES = {  # names of a coordinate, the best first; the last are shares of the box
    "x": ("x", "xu", "xs", "xsu"), "y": ("y", "yu", "ys", "ysu"), "z": ("z", "zu", "zs", "zsu"),
}  # fmt: skip
SCALED = ("s", "su")
QUATERNIONS = (("c_q[1]", "c_q[2]", "c_q[3]", "c_q[4]"), ("quatw", "quati", "quatj", "quatk"))
FLAT = 0.5  # of a mean diameter: centres within it are a layer
SPINS = {"z": "omegaz", "y": "omegay", "x": "omegax"}


@dataclass(frozen=True, slots=True)
class Dump:
    """What the dumps tell beside their particles."""

    seen: Observations
    low: Float[Array, "f 2"]  # of the box, in the dump's unit
    cell: Float[Array, "f 2 2"]  # its edges, along the first axis and along the second, if it is not tilted
    periodic: tuple[bool, bool]  # across x, across y
    shrinking: bool = False  # some faces follow the outermost grains (s, m): nothing stands there


@dataclass(frozen=True, slots=True)
class _Step:
    file: Path
    line: int  # of its first particle
    number: int
    low: Array  # (3,) corner of the box
    edges: Array  # (3, 3) from there, a row each
    ends: tuple[str, ...]  # (3,) what the faces are: pp, ff, …
    columns: list[str]
    rows: list[list[str]]


def read_lammps(source: Path, columns: Mapping[str, str], interval: float) -> Dump:
    """Read one file of many steps, or a folder of dumps; interval [s] of one step, for angular velocities.

    columns: `x` and `y` may name other axes, such as y=z. Raises InputError naming file, row and value.
    """
    files = _files(source)
    steps = {step.number: step for file in files for step in _steps(file)}
    if not steps:
        raise InputError(source, "", "holds no ITEM: TIMESTEP")
    ordered = [steps[number] for number in sorted(steps)]
    axes = tuple(columns.get(role, role) for role in "xy")
    for axis in axes:
        if axis not in PLACES:
            raise InputError("--columns", axis, "is not an axis of a dump: x, y or z")
    third = next(axis for axis in "xyz" if axis not in axes)
    frames, names, lines, place, radius, angle, spin, depth = [], [], [], [], [], [], [], []
    for step in ordered:
        find = _Finder(step)
        frames.append(np.full(len(step.rows), step.number, np.int64))
        names += find.text("id")
        lines += range(step.line, step.line + len(step.rows))
        place.append(np.column_stack([find.place(axis) for axis in axes]))
        depth.append(find.place(third) if find.has_place(third) else np.zeros(len(step.rows)))
        radius.append(find.radius())
        turn = find.angle(third)
        angle.append(turn)
        spin.append(find.numbers(SPINS[third]) if SPINS[third] in step.columns else np.full(len(step.rows), np.nan))
    joined = np.concatenate
    turned, how = joined(angle), []
    summed = bool(np.isnan(turned).all() and np.isfinite(joined(spin)).any())
    if summed:
        turned = _sum_up(
            [step.number for step in ordered], [_Finder(step).text("id") for step in ordered], spin, interval
        )
        how.append(
            f"Rotations are {SPINS[third]} summed up over the steps dumped: coarse, if grains turned in between."
        )
    if (axes[0], axes[1]) in (("x", "z"), ("y", "x"), ("z", "y")):
        turned = -turned  # the third axis points away from the eye
    known = joined(radius)
    spread = float(np.ptp(joined(depth)))
    if np.isfinite(known).any() and spread > FLAT * 2.0 * float(np.nanmean(known)):
        how.append(f"{third} goes over {spread:g}: this is no layer of rods, and {third} is left out.")
    k = ["xyz".index(axis) for axis in axes]
    periodic = (ordered[0].ends[k[0]] == "pp", ordered[0].ends[k[1]] == "pp")
    if periodic[0] != periodic[1]:
        how.append(
            f"The box is periodic across {axes[0] if periodic[0] else axes[1]} alone, which no experiment can be: "
            "contacts through these edges are lost, and grains that went through them jump."
        )
    left = sorted(set(ordered[0].columns) & {"fx", "fy", "fz", "vx", "vy", "vz"})
    if left:
        how.append(f"Left out: {', '.join(left)}.")
    table = Table(ordered[0].file, {"id": names}, lines)
    seen = Observations(
        table, "id", joined(frames), tuple(names), joined(place), turned, known, remarks=tuple(how), counted=summed
    )
    low = np.array([step.low[k] for step in ordered])
    cell = np.array([step.edges[np.ix_(k, k)] for step in ordered])
    shrinking = any(set(ordered[0].ends[each]) & {"s", "m"} for each in k)
    return Dump(seen, low, cell, periodic, shrinking)


class _Finder:
    """Columns of one step by what they mean."""

    def __init__(self, step: _Step) -> None:
        self._step = step

    def text(self, name: str) -> list[str]:
        if name not in self._step.columns:
            there = " ".join(self._step.columns)
            raise InputError(self._step.file, f"step {self._step.number}", f"has no column {name} (there are: {there})")
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

    def has_place(self, axis: str) -> bool:
        return any(name in self._step.columns for name in PLACES[axis])

    def place(self, axis: str) -> Array:
        name = next((each for each in PLACES[axis] if each in self._step.columns), axis)
        values = self.numbers(name)
        if not name.endswith(SCALED):
            return values
        if np.any(self._step.edges != np.diag(np.diag(self._step.edges))):
            where = f"step {self._step.number}"
            raise InputError(self._step.file, where, f"{name} is a share of a tilted box: dump x y z, or xu yu zu")
        k = "xyz".index(axis)
        return self._step.low[k] + values * self._step.edges[k, k]

    def radius(self) -> Array:
        if "radius" in self._step.columns:
            return self.numbers("radius")
        if "diameter" in self._step.columns:
            return 0.5 * self.numbers("diameter")
        return np.full(len(self._step.rows), np.nan)

    def angle(self, axis: str) -> Array:
        """About an axis [rad], of quaternions; NaN without any."""
        for names in QUATERNIONS:
            if all(name in self._step.columns for name in names):
                return 2.0 * np.arctan2(self.numbers(names[1 + "xyz".index(axis)]), self.numbers(names[0]))
        return np.full(len(self._step.rows), np.nan)


def _files(source: Path) -> list[Path]:
    if not source.is_dir():
        return [source]
    found = [file for file in source.iterdir() if file.is_file() and _is_dump(file)]
    if not found:
        raise InputError(source, "", "holds no file that begins with ITEM: TIMESTEP")
    return sorted(found, key=lambda file: [int(part) for part in re.findall(r"\d+", file.name)])


def _is_dump(file: Path) -> bool:
    with file.open("rb") as stream:
        return stream.read(5) == b"ITEM:"


def _steps(file: Path) -> Iterator[_Step]:
    lines = read_text(file).splitlines()
    at, number, count = 0, None, None
    low, edges, ends = np.zeros(3), np.zeros((3, 3)), ("ff", "ff", "ff")
    while at < len(lines):
        head = lines[at].split()
        if not head:
            at += 1
            continue
        if head[0] != "ITEM:":
            raise InputError(file, f"row {at + 1}", f"{lines[at][:60]!r} stands where ITEM: is expected")
        item = " ".join(head[1:])
        try:
            if item == "TIMESTEP":
                number, at = int(lines[at + 1]), at + 2
            elif item == "NUMBER OF ATOMS":
                count, at = int(lines[at + 1]), at + 2
            elif item.startswith("BOX BOUNDS"):
                low, edges = _box([lines[at + k].split() for k in (1, 2, 3)], general="abc" in head)
                ends = tuple(each for each in head[3:] if len(each) == 2 and set(each) <= set("pfsm")) or ends
                at += 4
            elif item.startswith("ATOMS"):
                if number is None or count is None:
                    raise InputError(file, f"row {at + 1}", "comes before ITEM: TIMESTEP or ITEM: NUMBER OF ATOMS")
                columns, first = head[2:], at + 1
                rows = [line.split() for line in lines[first : first + count]]
                short = [k for k, row in enumerate(rows) if len(row) != len(columns)]
                if short or len(rows) < count:
                    row = short[0] if short else len(rows)
                    raise InputError(file, f"row {first + row + 1}", f"is not the {len(columns)} cells of a particle")
                yield _Step(file, first + 1, number, low, edges, ends, columns, rows)
                at = first + count
            else:  # UNITS, TIME, …
                at += 2
        except (ValueError, IndexError):
            raise InputError(file, f"row {at + 2}", f"does not follow from ITEM: {item}") from None


def _box(rows: list[list[str]], *, general: bool) -> tuple[Array, Array]:
    """Corner (3,) and edges (3, 3); of a tilted box LAMMPS tells the bounds of what surrounds it.

    general: every row is an edge and a coordinate of the corner, as OVITO and later versions of LAMMPS write.
    """
    values = [[float(cell) for cell in row] for row in rows]
    if general:
        told = np.array([row[:4] for row in values])
        return told[:, 3], told[:, :3]
    bounds = np.array([row[:2] for row in values])
    xy, xz, yz = ((row[2] if len(row) > 2 else 0.0) for row in values)
    bounds[0] -= min(0.0, xy, xz, xy + xz), max(0.0, xy, xz, xy + xz)
    bounds[1] -= min(0.0, yz), max(0.0, yz)
    edges = np.diag(bounds[:, 1] - bounds[:, 0])
    edges[1, 0], edges[2, 0], edges[2, 1] = xy, xz, yz
    return bounds[:, 0], edges


def _sum_up(number: list[int], names: list[list[str]], spin: list[Array], interval: float) -> Array:
    """Rotations of all rows [rad] from angular velocities [rad/s], by the mean of a grain's two ends of an interval."""
    last: dict[str, tuple[int, float, float]] = {}
    found = []
    for step, ids, rates in zip(number, names, spin, strict=True):
        turned = np.zeros(len(ids))
        for row, (name, rate) in enumerate(zip(ids, rates, strict=True)):
            if name in last:
                before, former, angle = last[name]
                turned[row] = angle + 0.5 * (former + rate) * (step - before) * interval
            last[name] = (step, float(rate), float(turned[row]))
        found.append(turned)
    return np.concatenate(found)
