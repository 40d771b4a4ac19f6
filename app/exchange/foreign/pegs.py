"""Photoelastic tests solved by PeGS: where its discs are, and the forces that their fringes tell, from either side.

Two ways of writing. By photograph, as the rigidity library reads it: NAME_ParticleData.dlm (id, x, y, radius, more)
with NAME_NormWeightedAdjacencyMatrix.dlm and NAME_TanWeighted…, whose row i, column j is the force on their contact as
disc i's fringes tell it, or NAME_bonds.txt (rows of i and j from 0, sliding, f_t, f_n). All at once, as PeGS 2 writes
it: particle_positions.txt (frame, id, x, y, radius, edge) with Adjacency_list.txt (frame, i, j, f_t, f_n), where a
contact stands once for either disc and j is −1 at a wall. Pixels, y down; f_n > 0 presses. No rotations.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from numpy.typing import NDArray

from solver.bodies.grains import Array

from ...errors import InputError
from ...experiment.reading.tables import Table
from .foreign_table import read_text
from .observations import Arranged, Observations

DISCS, BONDS = "_ParticleData.dlm", "_bonds.txt"
APART, ALIKE = 0.1, 0.12  # of the mean: between sizes of discs, and within one
MOST_SIZES, FEWEST_DISCS = 4, 10
NORMAL, TANGENTIAL = "_NormWeightedAdjacencyMatrix.dlm", "_TanWeightedAdjacencyMatrix.dlm"
POSITIONS, CONTACTS = "particle_positions.txt", "Adjacency_list.txt"


Bonds = tuple[NDArray[np.integer], NDArray[np.integer], Array, Array]  # (b,) teller, other, f_n, f_t


@dataclass(frozen=True, slots=True)
class Side:
    """Forces of contacts as one of their two discs tells them; one row per contact and telling disc."""

    frame: Int[np.ndarray, " s"]
    teller: Int[np.ndarray, " s"]  # id of the disc whose fringes were read
    other: Int[np.ndarray, " s"]
    fn: Float[Array, " s"]  # [N]
    ft: Float[Array, " s"]  # [N], of a sign that only the program knows


def read_pegs(folder: Path) -> tuple[Observations, Side]:
    """Read a folder in either way of writing. Raises InputError naming file, row and value."""
    if not folder.is_dir():
        raise InputError(folder, "", "is no folder")
    discs = sorted(folder.glob(f"*{DISCS}"), key=_natural)
    if discs:
        return _read_by_photograph(discs)
    if (folder / POSITIONS).exists():
        return _read_all(folder)
    raise InputError(folder, "", f"holds neither *{DISCS} nor {POSITIONS}")


def true_contacts(told: Side, arranged: Arranged) -> dict[str, list[object]]:
    """Columns of a table of true forces: both sides' f_n beside their mean, or the only side there is.

    A tangential force changes its sign where y does.
    """
    row = {int(number): k for k, number in enumerate(arranged.number)}
    sides: dict[tuple[int, int, int], list[tuple[float, float] | None]] = {}
    for frame, teller, other, fn, ft in zip(told.frame, told.teller, told.other, told.fn, told.ft, strict=True):
        if int(frame) not in row:
            continue
        low, high = sorted((int(teller), int(other)))
        both = sides.setdefault((row[int(frame)], low, high), [None, None])
        both[int(teller != low)] = (float(fn), float(ft))
    columns: dict[str, list[object]] = {name: [] for name in ("frame", "i", "j", "fn", "ft", "fn_i", "fn_j")}
    for (frame, low, high), both in sorted(sides.items()):
        known = [side for side in both if side is not None]
        mean = np.mean(known, axis=0)
        values = (frame, low, high, float(mean[0]), -float(mean[1]), *("" if s is None else s[0] for s in both))
        for name, value in zip(columns, values, strict=True):
            columns[name].append(value)
    return columns


def _read_by_photograph(files: list[Path]) -> tuple[Observations, Side]:
    frames, parts, lines = [], [], []
    sides: list[Side] = []
    for frame, file in enumerate(files):
        discs = _numbers(file, 4)
        stem = file.name.removesuffix(DISCS)
        parts.append(discs[:, :4])
        frames.append(np.full(len(discs), frame, np.int64))
        lines += range(1, len(discs) + 1)
        ids = _ids(file, discs[:, 0])
        found = _read_matrices(file.parent, stem, len(ids))
        if found is None:
            found = _read_bonds(file.parent / f"{stem}{BONDS}", len(ids))
        if found is not None:
            teller, other, fn, ft = found
            sides.append(Side(np.full(len(fn), frame, np.int64), ids[teller], ids[other], fn, ft))
    remarks = () if sides else (f"No forces are there: neither *{NORMAL} nor *{BONDS}.",)
    table = np.concatenate(parts)
    return _observe(files[0].parent, np.concatenate(frames), table, lines, remarks), _side(sides)


def _read_all(folder: Path) -> tuple[Observations, Side]:
    file = folder / POSITIONS
    table = _numbers(file, 5)
    contacts = _numbers(folder / CONTACTS, 5) if (folder / CONTACTS).exists() else np.empty((0, 5))
    if table.shape[1] == 5:  # of one photograph: id, x, y, radius, edge
        number = np.unique(contacts[:, 0])
        if len(number) > 1:
            raise InputError(file, "", f"does not say which of {len(number)} frames it is of: six columns are expected")
        table = np.column_stack([np.full(len(table), number[0] if len(number) else 1.0), table])
    frame = _whole_numbers(file, table[:, 0], "frame")
    remarks = []
    at_wall = contacts[:, 2] < 0
    if at_wall.any():
        remarks.append(f"{int(at_wall.sum())} forces on walls are left out: the file does not say which wall.")
    contacts = contacts[~at_wall]
    known = np.isin(contacts[:, 1], table[:, 1]) & np.isin(contacts[:, 2], table[:, 1])
    if not known.all():
        remarks.append(f"{int((~known).sum())} forces are left out: they are of discs that have no position.")
    whole = _whole_numbers(folder / CONTACTS, contacts[known, :3].ravel(), "frame, i or j").reshape(-1, 3)
    side = Side(whole[:, 0], whole[:, 1], whole[:, 2], contacts[known, 4], contacts[known, 3])
    return _observe(file, frame, table[:, 1:5], list(range(1, len(table) + 1)), tuple(remarks)), side


def _observe(
    file: Path, frame: NDArray[np.int64], discs: Array, line: list[int], remarks: tuple[str, ...]
) -> Observations:
    name = tuple(f"{value:.17g}" for value in discs[:, 0])
    radius, classes = _cut_sizes(discs[:, 0], discs[:, 3])
    if classes:
        sizes = " and ".join(f"{each:.4g}" for each in classes)
        remarks = (*remarks, f"Discs are cut in sizes: radii are the means of {sizes} px, not what each was read as.")
    return Observations(
        Table(file, {"id": list(name)}, line), "id", frame, name, discs[:, 1:3].copy(),
        np.full(len(discs), np.nan), radius, remarks=remarks,
    )  # fmt: skip


def _cut_sizes(ids: Array, radius: Array) -> tuple[Array, list[float]]:
    """Radii (m,) [px] as their sizes have them, and the sizes; as they were read where no sizes stand apart.

    Found circles are whole or half pixels, and wrong by what light a disc has: a size is known better than a disc.
    """
    which, row = np.unique(ids, return_inverse=True)
    mean = np.bincount(row, radius) / np.bincount(row)
    order = np.argsort(mean)
    parted = np.flatnonzero(np.diff(mean[order]) > APART * mean.mean())
    groups = np.split(order, parted + 1)
    wide = any(np.ptp(mean[group]) > ALIKE * mean[group].mean() for group in groups)
    if len(groups) > MOST_SIZES or wide or len(which) < FEWEST_DISCS:
        return radius.copy(), []
    size = np.empty(len(which))
    for group in groups:
        size[group] = mean[group].mean()
    return size[row], [float(mean[group].mean()) for group in groups]


def _read_matrices(folder: Path, stem: str, count: int) -> Bonds | None:
    """Rows of the discs that tell, of the others, f_n and f_t; None where there are no matrices."""
    files = folder / f"{stem}{NORMAL}", folder / f"{stem}{TANGENTIAL}"
    if not files[0].exists():
        return None
    normal = _numbers(files[0], 1)
    tangential = _numbers(files[1], 1) if files[1].exists() else np.zeros_like(normal)
    for file, matrix in zip(files, (normal, tangential), strict=True):
        if matrix.shape != (count, count):
            raise InputError(file, "", f"is {matrix.shape[0]} by {matrix.shape[1]}, but there are {count} discs")
    teller, other = np.nonzero(normal)
    return teller, other, normal[teller, other], tangential[teller, other]


def _read_bonds(file: Path, count: int) -> Bonds | None:
    if not file.exists():
        return None
    bonds = _numbers(file, 5)
    pair = _whole_numbers(file, bonds[:, :2].ravel(), "i or j").reshape(-1, 2)
    beyond = np.flatnonzero((pair < 0).any(axis=1) | (pair >= count).any(axis=1))
    if len(beyond):
        raise InputError(file, f"row {beyond[0] + 1}", f"names disc {pair[beyond[0]].max()} of {count}, from 0")
    return pair[:, 0], pair[:, 1], bonds[:, 4], bonds[:, 3]


def _side(parts: list[Side]) -> Side:
    if not parts:
        none = np.empty(0, np.int64)
        return Side(none, none, none, np.empty(0), np.empty(0))
    frame, teller, other, fn, ft = (
        np.concatenate([getattr(part, each.name) for part in parts]) for each in fields(Side)
    )
    return Side(frame, teller, other, fn, ft)


def _numbers(file: Path, least: int) -> Array:
    """All numbers of a file without header (m, at least `least`), with commas or blanks between."""
    rows = []
    for number, text in enumerate(read_text(file).splitlines(), start=1):
        if not text.strip():
            continue
        cells = text.replace(",", " ").split()
        try:
            rows.append([float(cell) for cell in cells])
        except ValueError:
            raise InputError(file, f"row {number}", f"{text.strip()[:60]!r} is not numbers") from None
        if len(cells) < least or len(cells) != len(rows[0]):
            raise InputError(file, f"row {number}", f"has {len(cells)} numbers, not {max(least, len(rows[0]))}")
    table = np.array(rows, np.float64).reshape(len(rows), -1 if rows else least)
    bad = np.argwhere(~np.isfinite(table))
    if len(bad):
        raise InputError(file, f"row {bad[0][0] + 1}", "has a number that is not finite")
    if not len(table):
        raise InputError(file, "", "has no rows")
    return table


def _ids(file: Path, values: Array) -> NDArray[np.int64]:
    return _whole_numbers(file, values, "id")


def _whole_numbers(file: Path, values: Array, what: str) -> NDArray[np.int64]:
    broken = np.flatnonzero(values != np.rint(values))
    if len(broken):
        raise InputError(file, f"{what} = {values[broken[0]]:g}", "is not a whole number")
    return values.astype(np.int64)


def _natural(file: Path) -> list[tuple[int, str]]:
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", file.name)]
