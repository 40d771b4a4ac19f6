"""Forces between the grains of a simulation as the truth of an experiment.

Read are `dump local` of LAMMPS and LIGGGHTS, .fstat of MercuryDPM, and tables with one row per pair, as scripts of YADE
and others write them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ....process.counts import state_count
from ....process.errors import InputError
from ....solver.bodies.cell import Cell
from ....solver.bodies.grains import Array
from ..foreign_table import column_names, read_foreign
from ..observations import ImportedTracks
from ..proposed_walls import Walls
from .lammps_dump import StepColumns, dump_files, dump_steps, is_dump
from .mercury_files import FSTAT, read_fstat

WALL = "wall"  # name of a body that is a wall, which one follows from its distance
# Usual names of the columns of pairs, the best first.
PAIR_COLUMNS = {
    "i": ("id1", "patom1", "itag", "id_i"), "j": ("id2", "patom2", "jtag", "id_j"),
    "frame": ("step", "timestep", "iter"),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class PairForces:
    """Forces between pairs of grains in a simulation, in newtons."""

    step: list[int]  # (m,)
    i: list[str]  # (m,) names
    j: list[str]
    force: Array  # (m, 2) [N] that j exerts on i, along the first and the second axis


def read_pair_forces(source: Path, columns: Mapping[str, str], times: Sequence[float]) -> PairForces:
    """Read pair forces: `dump local` of LAMMPS and LIGGGHTS (ITEM: ENTRIES), .fstat, or a table with one row per pair.

    Parameters
    ----------
    source : Path
        A file, or a folder of dumps.
    columns : mapping of str to str
        Columns of the roles i, j, fx, fy (frame, in a table); `x` and `y` may name other axes, such as y=z. Defaults
        are the names in PAIR_COLUMNS, the first that exists.
    times : sequence of float
        Times of the particles [s], by which .fstat is read.

    Raises
    ------
    InputError
        Naming file, row and value.
    """
    if source.suffix == FSTAT:
        return PairForces(*read_fstat(source, columns, times, WALL))
    axes = tuple(columns.get(role, role) for role in "xy")
    wanted = {"i": "i", "j": "j", **{f"f{role}": f"f{axis}" for role, axis in zip("xy", axes, strict=True)}}
    if not source.is_dir() and not is_dump(source):
        return _pair_table(source, columns, wanted)
    found = PairForces([], [], [], np.empty((0, 2)))
    parts: list[Array] = []
    for file in dump_files(source):
        for step in dump_steps(file, "ENTRIES"):
            cells = StepColumns(step)
            name = {role: columns.get(role) or _known_name(role, default, step.columns)
                    for role, default in wanted.items()}  # fmt: skip
            found.step.extend([step.number] * len(step.rows))
            found.i.extend(_as_names(cells.text(name["i"])))
            found.j.extend(_as_names(cells.text(name["j"])))
            parts.append(np.column_stack([cells.numbers(name["fx"]), cells.numbers(name["fy"])]))
    if not parts:
        raise InputError(source, "", "contains no ITEM: ENTRIES, as dump local writes them")
    return PairForces(found.step, found.i, found.j, np.concatenate(parts))


def _pair_table(file: Path, columns: Mapping[str, str], wanted: Mapping[str, str]) -> PairForces:
    header = column_names(file)
    name = {role: columns.get(role) or _known_name(role, default, header)
            for role, default in {"frame": "frame", **wanted}.items()}  # fmt: skip
    table = read_foreign(file, list(name.values()))
    force = np.column_stack([table.numbers(name["fx"]), table.numbers(name["fy"])])
    step = table.integers(name["frame"]).tolist()
    return PairForces(step, _as_names(table.text(name["i"])), _as_names(table.text(name["j"])), force)


def _known_name(role: str, default: str, present: Sequence[str]) -> str:
    """Return the first existing one of the usual names of a role; else its default, which the reader names missing."""
    return next((each for each in (default, *PAIR_COLUMNS.get(role, ())) if each in present), default)


def _as_names(texts: Sequence[str]) -> list[str]:
    """Return names of grains without the decimals that computed columns have: 12.0 is 12."""
    return [re.sub(r"\.0*$", "", each.strip()) for each in texts]


def contacts_of_pairs(
    forces: PairForces, imported: ImportedTracks, walls: Walls | None, cell: Array | None, *, upside_down: bool
) -> tuple[dict[str, list[object]], list[str]]:
    """Return columns of a table of true forces from pair forces, and remarks on what they lack.

    A body that is no grain is the wall of that name; the name `wall`, or a negative number, is the nearest wall.

    Notes
    -----
    With the unit normal n from i to j, n rotated by +90° as t, and the force F that j exerts on i: f_n = −F·n and
    f_t = −F·t.
    """
    tracks = imported.tracks
    frame_of = {int(number): k for k, number in enumerate(imported.number)}
    row_of = {name: row for row, name in enumerate(imported.name)}
    columns: dict[str, list[object]] = {name: [] for name in ("frame", "i", "j", "fn", "ft")}
    left_out = 0
    for step, first, second, force in zip(forces.step, forces.i, forces.j, forces.force, strict=True):
        if step not in frame_of or not force.any():
            continue
        k, on_i = frame_of[step], force * np.array([1.0, -1.0]) if upside_down else force
        if first not in row_of and second in row_of:
            first, second, on_i = second, first, -on_i
        i, j = row_of.get(first), row_of.get(second)
        if i is None or i == j:
            left_out += 1
            continue
        place, other = tracks.position[k, i], second
        if j is None:
            found = _normal_of_wall(walls, second, k, place)
            if found is None:
                left_out += 1
                continue
            other, normal = found
        else:
            other = str(tracks.id[j])
            branch = tracks.position[k, j] - place
            if cell is not None:
                branch = branch + Cell.at_rest(cell[k]).shift(branch[None])[0]
            normal = branch / np.linalg.norm(branch)
        if not np.isfinite(normal).all():
            left_out += 1
            continue
        tangent = np.array([-normal[1], normal[0]])
        values = (k, int(tracks.id[i]), other, -float(on_i @ normal), -float(on_i @ tangent))
        for name, value in zip(columns, values, strict=True):
            columns[name].append(value)
    remarks = []
    if left_out:
        remarks.append(
            f"Left out: {state_count(left_out, 'pair force')} naming neither a grain of the frame nor a wall."
        )
    if walls is not None and columns["j"] and not set(columns["j"]) & set(walls.name):
        remarks.append("No pair force is at a wall: scores count the inferred forces at walls as absent in the truth.")
    return columns, remarks


def _normal_of_wall(walls: Walls | None, name: str, frame: int, place: Array) -> tuple[str, Array] | None:
    """Return a wall's name and the unit normal towards it from a place (2,) [m]; None where there is no such wall."""
    if walls is None:
        return None
    along = walls.endpoints[frame, :, 1] - walls.endpoints[frame, :, 0]
    outward = np.stack([along[:, 1], -along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]
    if name in walls.name:
        row = walls.name.index(name)
    elif name == WALL or re.fullmatch(r"-\d+", name):
        row = int(np.argmin(np.abs(((walls.endpoints[frame, :, 0] - place) * outward).sum(axis=1))))
    else:
        return None
    return walls.name[row], outward[row]
