"""Walls of another program's packing: its own table, or bars proposed where the outermost grains are."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from solver.bodies.grains import Array

from ...errors import InputError
from ...experiment.walls import WALL_COLUMNS
from ...tracks import Tracks
from .foreign_table import read_foreign
from .lammps_dump import Dump
from .observations import Arranged, Convention

SIDES = ("bottom", "right", "top", "left")


@dataclass(frozen=True, slots=True)
class Walls:
    """Bars by name."""

    name: tuple[str, ...]  # (w,)
    endpoints: Array  # (f, w, 2, 2) [m], the packing to their left
    remark: str  # how they were come by


def propose_box(tracks: Tracks) -> Walls:
    """Four bars upright and level, as near to the packing in every frame as its grains let them."""
    radius = tracks.radius[None, :, None]
    low = np.nanmin(tracks.position - radius, axis=1)  # (f, 2)
    high = np.nanmax(tracks.position + radius, axis=1)
    corner = np.stack(
        [low, np.column_stack([high[:, 0], low[:, 1]]), high, np.column_stack([low[:, 0], high[:, 1]])], axis=1
    )
    return Walls(
        SIDES,
        np.stack([corner, np.roll(corner, -1, axis=1)], axis=2),
        "PROPOSED, NOT MEASURED: four bars at the outermost grains of every frame. Put the real ones in their place.",
    )


def bars_of_cell(dump: Dump, unit: float) -> Walls | None:
    """The faces of a simulation's box that are not periodic, as bars; None without any. unit [m] of the dump."""
    low, cell = dump.low, dump.cell
    corner = np.stack([low, low + cell[:, 0], low + cell[:, 0] + cell[:, 1], low + cell[:, 1]], axis=1) * unit
    ends = np.stack([corner, np.roll(corner, -1, axis=1)], axis=2)
    across_x, across_y = dump.periodic
    kept = [k for k, side in enumerate(SIDES) if not (across_y if side in ("bottom", "top") else across_x)]
    if not kept:
        return None
    remark = "The faces of the simulation's box that are not periodic."
    if dump.shrinking:
        remark = f"PROPOSED, NOT MEASURED: {remark[0].lower()}{remark[1:-1]}, some of which follow the grains (m, s)."
    return Walls(tuple(SIDES[k] for k in kept), ends[:, kept], remark)


def periodic_cell(dump: Dump, unit: float) -> Array | None:
    """Vectors (f, 2, 2) [m] of a box that is periodic both ways; None of any other. unit [m] of the dump."""
    return dump.cell * unit if all(dump.periodic) else None


def read_foreign_walls(file: Path, arranged: Arranged, convention: Convention) -> Walls:
    """Read frame,wall,x1,y1,x2,y2 in the grains' own unit, axes and numbers of frames.

    Ends are exchanged where the packing would lie to their right; walls of a single frame stay where they are.
    """
    table = read_foreign(file, WALL_COLUMNS)
    number, text = table.integers("frame"), table.text("wall")
    names = tuple(dict.fromkeys(text))
    ends = np.column_stack([table.numbers(name) for name in WALL_COLUMNS[2:]]).reshape(-1, 2, 2)
    if convention.y_down:
        ends[..., 1] = arranged.floor - ends[..., 1]
    ends *= convention.unit
    wanted = arranged.number if len(set(number.tolist())) > 1 else number[:1]
    endpoints = np.full((len(wanted), len(names), 2, 2), np.nan)
    for row, (k, name) in enumerate(zip(number, text, strict=True)):
        at = np.flatnonzero(wanted == k)
        if len(at):
            endpoints[at[0], names.index(name)] = ends[row]
    absent = np.argwhere(np.isnan(endpoints[:, :, 0, 0]))
    if len(absent):
        raise InputError(file, f"frame {wanted[absent[0][0]]}", f"has no row of wall {names[absent[0][1]]!r}")
    endpoints = np.broadcast_to(endpoints, (len(arranged.number), *endpoints.shape[1:])).copy()
    centre = np.nanmean(arranged.tracks.position, axis=1)[:, None]
    along, inward = endpoints[:, :, 1] - endpoints[:, :, 0], centre - endpoints[:, :, 0]
    right = along[..., 0] * inward[..., 1] - along[..., 1] * inward[..., 0] < 0.0
    endpoints[right] = endpoints[right][:, ::-1]
    return Walls(names, endpoints, f"From {file.name}.")
