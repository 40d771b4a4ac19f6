"""Photoelastic tests solved by PeGS: positions of discs, and contact forces read from the fringes of either disc.

There are two formats. By photograph, for the rigidity library: NAME_ParticleData.dlm (id, x, y, radius, more) with
NAME_NormWeightedAdjacencyMatrix.dlm and NAME_TanWeighted…, whose row i, column j is the force on their contact read
from the fringes of disc i, or NAME_bonds.txt (rows of i and j from 0, sliding, f_t, f_n). All photographs together, by
PeGS 2: particle_positions.txt (frame, id, x, y, radius, edge) with Adjacency_list.txt (frame, i, j, f_t, f_n), where a
contact has one row for either disc and j is −1 at a wall. Pixels, y down; f_n > 0 is compression. No rotations.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from numpy.typing import NDArray

from ...experiment.reading.photograph_order import natural_key
from ...experiment.reading.tables import Table
from ...process.counts import state_count
from ...process.errors import InputError
from ...solver.bodies.grains import Array
from ...solver.bodies.wall_shapes import wall_distance
from ...solver.boundary.size_classes import group_readings
from .foreign_table import read_text
from .observations import ImportedTracks, Observations
from .proposed_walls import Walls

DISCS, BONDS = "_ParticleData.dlm", "_bonds.txt"
DISTANT = 1.5  # sums of radii between centres, above which discs cannot touch
MOSTLY = 0.5  # of the forces of a frame, above which its ids are wrong
COPY_DIGITS = 1e-6  # relative difference of copies: that of their rounding
LEAST_COPIES = 4  # rows
TRUTH_COLUMNS = ("frame", "i", "j", "fn", "ft", "fn_i", "fn_j")
WALL = -1  # instead of the other disc
NORMAL, TANGENTIAL = "_NormWeightedAdjacencyMatrix.dlm", "_TanWeightedAdjacencyMatrix.dlm"
POSITIONS, CONTACTS = "particle_positions.txt", "Adjacency_list.txt"


Bonds = tuple[NDArray[np.integer], NDArray[np.integer], Array, Array]  # (b,) disc that was read, other disc, f_n, f_t


@dataclass(frozen=True, slots=True)
class ForceReadings:
    """Forces read from one of the two discs of a contact; one row per contact and disc."""

    frame: Int[np.ndarray, " s"]
    disc: Int[np.ndarray, " s"]  # id of the disc whose fringes were read
    other: Int[np.ndarray, " s"]  # WALL: a wall, which the file does not name
    fn: Float[Array, " s"]  # [N]
    ft: Float[Array, " s"]  # [N], in the sign convention of the program

    def select(self, kept: NDArray[np.bool_]) -> ForceReadings:
        """Return some of the readings."""
        return ForceReadings(*(getattr(self, each.name)[kept] for each in fields(ForceReadings)))


def read_pegs(folder: Path) -> tuple[Observations, ForceReadings]:
    """Read a folder in either format. Raises InputError naming file, row and value."""
    if not folder.is_dir():
        raise InputError(folder, "", "is not a folder")
    discs = sorted(folder.glob(f"*{DISCS}"), key=natural_key)
    if discs:
        return _read_by_photograph(discs)
    if (folder / POSITIONS).exists():
        return _read_all(folder)
    raise InputError(folder, "", f"contains neither *{DISCS} nor {POSITIONS}, which PeGS 2 writes (particleTrack)")


def is_pegs(folder: Path) -> bool:
    """Return whether a folder holds files of PeGS in either format."""
    return folder.is_dir() and ((folder / POSITIONS).exists() or any(folder.glob(f"*{DISCS}")))


def has_forces(folder: Path) -> bool:
    """Return whether a folder of PeGS holds forces that were read from fringes."""
    return (folder / CONTACTS).exists() or any(folder.glob(f"*{NORMAL}"))


def read_edge(folder: Path) -> tuple[str, ...]:
    """Return the names of discs whose flag puts them at the edge in most photographs; empty: no flags, or all discs."""
    file = folder / POSITIONS
    if not file.exists() or sorted(folder.glob(f"*{DISCS}")):
        return ()
    table = _numbers(file, 5)
    names, row = np.unique(table[:, -5], return_inverse=True)
    fraction = np.bincount(row, table[:, -1] != 0.0) / np.bincount(row)
    at_edge = names[fraction > 0.5]
    return tuple(f"{each:.17g}" for each in at_edge) if len(at_edge) < len(names) else ()


def without_copies(readings: ForceReadings) -> tuple[ForceReadings, str]:
    """Keep one of two readings of a contact where they are copies of each other; also return a remark, or "".

    Two discs are read independently, so that their forces differ. Files that hold every force twice, from i to j and
    from j to i, have one reading, whose error they do not show.
    """
    low, high = np.minimum(readings.disc, readings.other), np.maximum(readings.disc, readings.other)
    _, contact, count = np.unique(
        np.stack([readings.frame, low, high]), axis=1, return_inverse=True, return_counts=True
    )
    contact = np.ravel(contact)
    total = np.bincount(contact, readings.fn)
    twice = (count[contact] == 2) & (readings.other != WALL)
    differs = np.abs(readings.fn - 0.5 * total[contact]) > COPY_DIGITS * np.abs(readings.fn)
    if twice.sum() < LEAST_COPIES or differs[twice].any():
        return readings, ""
    kept = ~twice | (readings.disc < readings.other)
    return readings.select(kept), (
        f"The forces of {state_count(int(twice.sum()) // 2, 'contact')} are given twice and are equal: copies, not two "
        "readings. Their error is unknown."
    )


def true_contacts(readings: ForceReadings, imported: ImportedTracks) -> dict[str, list[object]]:
    """Return columns of a table of true forces: both readings of f_n and their mean, or the only reading.

    Forces on walls are not among them. Tangential forces change their sign, since y is reversed.
    """
    row = {int(number): k for k, number in enumerate(imported.number)}
    readings_by_contact: dict[tuple[int, int, int], list[tuple[float, float] | None]] = {}
    for frame, disc, other, fn, ft in zip(
        *(getattr(readings, each.name) for each in fields(ForceReadings)), strict=True
    ):
        if int(frame) not in row or other == WALL:
            continue
        low, high = sorted((int(disc), int(other)))
        both = readings_by_contact.setdefault((row[int(frame)], low, high), [None, None])
        both[int(disc != low)] = (float(fn), float(ft))
    columns: dict[str, list[object]] = {name: [] for name in TRUTH_COLUMNS}
    for (frame, low, high), both in sorted(readings_by_contact.items()):
        known = [reading for reading in both if reading is not None]
        mean = np.mean(known, axis=0)
        values = (frame, low, high, float(mean[0]), -float(mean[1]), *("" if s is None else s[0] for s in both))
        for name, value in zip(columns, values, strict=True):
            columns[name].append(value)
    return columns


def without_distant(readings: ForceReadings, imported: ImportedTracks) -> tuple[ForceReadings, str]:
    """Leave out forces between discs that cannot touch, whose ids are wrong; also return a remark, or ""."""
    tracks = imported.tracks
    frame_of = {int(number): k for k, number in enumerate(imported.number)}
    row_of = {int(name): k for k, name in enumerate(tracks.id)}
    frame, i, j = (
        np.array([rows.get(int(value), -1) for value in values], np.int64)
        for rows, values in ((frame_of, readings.frame), (row_of, readings.disc), (row_of, readings.other))
    )
    known = (frame >= 0) & (i >= 0) & (j >= 0) & (readings.other != WALL)
    apart = np.linalg.norm(tracks.position[frame, i] - tracks.position[frame, j], axis=1)
    distant = known & (apart > DISTANT * (tracks.radius[i] + tracks.radius[j]))
    if not distant.any():
        return readings, ""
    count, of = np.bincount(frame[distant]), np.bincount(frame[known])
    wrong = np.flatnonzero(count > MOSTLY * of[: len(count)])
    mostly = f" Most of them are in frames {', '.join(map(str, wrong))}: ids of positions and forces differ there." if (
        len(wrong)) else ""  # fmt: skip
    return readings.select(
        ~distant
    ), f"Left out: {state_count(int(distant.sum()), 'force')} between discs that lie apart.{mostly}"


def true_wall_forces(
    readings: ForceReadings, imported: ImportedTracks, walls: Walls | None
) -> tuple[dict[str, list[object]], str]:
    """Return columns of a table of true forces on walls, and a remark on those that are left out, or "".

    The program names no walls: a force belongs to the wall that is nearest to its disc. Forces of a disc that touches
    two walls in a photograph are ambiguous.
    """
    columns: dict[str, list[object]] = {name: [] for name in TRUTH_COLUMNS}
    at_wall = np.flatnonzero(readings.other == WALL)
    if walls is None or not len(at_wall):
        left = (
            f"Left out, since no walls are given: {state_count(len(at_wall), 'force')} on walls."
            if len(at_wall)
            else ""
        )
        return columns, left
    number = {int(value): k for k, value in enumerate(imported.number)}
    grain = {int(value): k for k, value in enumerate(imported.tracks.id)}
    place = [(number.get(int(readings.frame[s]), -1), grain.get(int(readings.disc[s]), -1)) for s in at_wall]
    count = Counter(place)
    for (frame, row), s in zip(place, at_wall, strict=True):
        if frame < 0 or row < 0 or count[frame, row] > 1:
            continue
        centre = imported.tracks.position[frame, row]
        distance = [float(wall_distance(ends, None, centre)[0]) for ends in walls.endpoints[frame]]
        wall = walls.name[int(np.argmin(distance))]
        fn, ft = float(readings.fn[s]), -float(readings.ft[s])
        for name, value in zip(columns, (frame, int(readings.disc[s]), wall, fn, ft, fn, ""), strict=True):
            columns[name].append(value)
    left = len(at_wall) - len(columns["frame"])
    return columns, f"Left out: {state_count(left, 'force')} on walls of discs that touch two." if left else ""


def _read_by_photograph(files: list[Path]) -> tuple[Observations, ForceReadings]:
    frames, parts, lines = [], [], []
    parts_of_readings: list[ForceReadings] = []
    for frame, file in enumerate(files):
        discs = _numbers(file, 4)
        stem = file.name.removesuffix(DISCS)
        parts.append(discs[:, :4])
        frames.append(np.full(len(discs), frame, np.int64))
        lines += range(1, len(discs) + 1)
        ids = _whole_numbers(file, discs[:, 0], "id")
        found = _read_matrices(file.parent, stem, len(ids))
        if found is None:
            found = _read_bonds(file.parent / f"{stem}{BONDS}", len(ids))
        if found is not None:
            disc, other, fn, ft = found
            parts_of_readings.append(ForceReadings(np.full(len(fn), frame, np.int64), ids[disc], ids[other], fn, ft))
    remarks = [] if parts_of_readings else [f"There are no forces: neither *{NORMAL} nor *{BONDS}."]
    readings = _keep_between_two(_join_readings(parts_of_readings), remarks)
    table = np.concatenate(parts)
    return _observe(files[0].parent, np.concatenate(frames), table, lines, tuple(remarks)), readings


def _read_all(folder: Path) -> tuple[Observations, ForceReadings]:
    file = folder / POSITIONS
    table = _numbers(file, 5)
    contacts = _numbers(folder / CONTACTS, 5) if (folder / CONTACTS).exists() else np.empty((0, 5))
    if table.shape[1] == 5:  # of one photograph: id, x, y, radius, edge
        number = np.unique(contacts[:, 0])
        if len(number) > 1:
            raise InputError(file, "", f"does not name its frame of {len(number)}: six columns are expected")
        table = np.column_stack([np.full(len(table), number[0] if len(number) else 1.0), table])
    frame = _whole_numbers(file, table[:, 0], "frame")
    remarks: list[str] = []
    contacts[contacts[:, 2] < 0, 2] = WALL
    known = np.isin(contacts[:, 1], table[:, 1]) & np.isin(contacts[:, 2], [WALL, *table[:, 1]])
    if not known.all():
        remarks.append(f"Left out: {state_count(int((~known).sum()), 'force')} of discs without a position.")
    whole = _whole_numbers(folder / CONTACTS, contacts[known, :3].ravel(), "frame, i or j").reshape(-1, 3)
    side = ForceReadings(whole[:, 0], whole[:, 1], whole[:, 2], contacts[known, 4], contacts[known, 3])
    side = _keep_between_two(side, remarks)
    return _observe(file, frame, table[:, 1:5], list(range(1, len(table) + 1)), tuple(remarks)), side


def _keep_between_two(readings: ForceReadings, remarks: list[str]) -> ForceReadings:
    """Leave out forces of a disc on itself and copies of readings; what is left out is added to the remarks."""
    own = readings.disc == readings.other
    if own.any():
        remarks.append(f"Left out: {state_count(int(own.sum()), 'force')} of discs on themselves.")
        readings = readings.select(~own)
    readings, remark = without_copies(readings)
    remarks += [remark] if remark else []
    return readings


def _observe(
    file: Path, frame: NDArray[np.int64], discs: Array, line: list[int], remarks: tuple[str, ...]
) -> Observations:
    name = tuple(f"{value:.17g}" for value in discs[:, 0])
    radius, classes = _group_radii(discs[:, 0], discs[:, 3])
    if classes:
        sizes = " and ".join(f"{each:.4g}" for each in classes)
        remarks = (*remarks, f"Discs have nominal sizes: radii are the means {sizes} px, not the single readings.")
    return Observations(
        Table(file, {"id": list(name)}, line), "id", frame, name, discs[:, 1:3].copy(),
        np.full(len(discs), np.nan), radius, remarks=remarks,
    )  # fmt: skip


def _group_radii(ids: Array, radius: Array) -> tuple[Array, list[float]]:
    """Replace radii (m,) [px] by the mean of their size class; also return the sizes, empty without distinct classes.

    Detected radii are whole or half pixels and depend on the light; the mean of a class is more precise.
    """
    row = np.unique(ids, return_inverse=True)[1]
    mean = np.bincount(row, radius) / np.bincount(row)
    size_class = group_readings(mean)
    if size_class is None:
        return radius.copy(), []
    size = np.bincount(size_class, mean) / np.bincount(size_class)
    return size[size_class][row], size.tolist()


def _read_matrices(folder: Path, stem: str, count: int) -> Bonds | None:
    """Return rows of the discs that were read, of the others, f_n and f_t; None without matrices."""
    files = folder / f"{stem}{NORMAL}", folder / f"{stem}{TANGENTIAL}"
    if not files[0].exists():
        return None
    normal = _numbers(files[0], 1)
    tangential = _numbers(files[1], 1) if files[1].exists() else np.zeros_like(normal)
    for file, matrix in zip(files, (normal, tangential), strict=True):
        if matrix.shape != (count, count):
            raise InputError(
                file, "", f"is {matrix.shape[0]} by {matrix.shape[1]}, but there are {state_count(count, 'disc')}"
            )
    disc, other = np.nonzero(normal)
    return disc, other, normal[disc, other], tangential[disc, other]


def _read_bonds(file: Path, count: int) -> Bonds | None:
    if not file.exists():
        return None
    bonds = _numbers(file, 5)
    pair = _whole_numbers(file, bonds[:, :2].ravel(), "i or j").reshape(-1, 2)
    beyond = np.flatnonzero((pair < 0).any(axis=1) | (pair >= count).any(axis=1))
    if len(beyond):
        raise InputError(file, f"row {beyond[0] + 1}", f"names disc {pair[beyond[0]].max()} of {count}, from 0")
    return pair[:, 0], pair[:, 1], bonds[:, 4], bonds[:, 3]


def _join_readings(parts: list[ForceReadings]) -> ForceReadings:
    if not parts:
        none = np.empty(0, np.int64)
        return ForceReadings(none, none, none, np.empty(0), np.empty(0))
    return ForceReadings(
        *(np.concatenate([getattr(part, each.name) for part in parts]) for each in fields(ForceReadings))
    )


def _numbers(file: Path, least: int) -> Array:
    """Read the numbers of a file without header (m, at least `least`), separated by commas or blanks."""
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


def _whole_numbers(file: Path, values: Array, what: str) -> NDArray[np.int64]:
    violations = np.flatnonzero(values != np.rint(values))
    if len(violations):
        raise InputError(file, f"{what} = {values[violations[0]]:g}", "is not a whole number")
    return values.astype(np.int64)
