"""Walls of an imported packing: a table, the faces of a box, or bars proposed at the outermost grains."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...experiment.reading.tables import check_unique
from ...experiment.walls import WALL_COLUMNS
from ...process.errors import InputError
from ...solver.bodies.grains import Array
from ...tracks import Tracks
from .foreign_table import read_foreign
from .observations import Convention, ImportedTracks
from .simulations.lammps_dump import DumpData

SIDES = ("bottom", "right", "top", "left")
SIZES = (0.05, 50.0)  # of all walls together over that of the packing
NEXT_TO_BAR = 5  # grains that show on which side of a bar the packing lies


@dataclass(frozen=True, slots=True)
class Walls:
    """Bars by name."""

    name: tuple[str, ...]  # (w,)
    endpoints: Array  # (f, w, 2, 2) [m], the packing to their left
    remark: str  # on their source


def propose_box(tracks: Tracks) -> Walls:
    """Propose two vertical and two horizontal bars that touch the packing in every frame."""
    radius = tracks.radius[None, :, None]
    low = np.nanmin(tracks.position - radius, axis=1)  # (f, 2)
    high = np.nanmax(tracks.position + radius, axis=1)
    corner = np.stack(
        [low, np.column_stack([high[:, 0], low[:, 1]]), high, np.column_stack([low[:, 0], high[:, 1]])], axis=1
    )
    return Walls(
        SIDES,
        np.stack([corner, np.roll(corner, -1, axis=1)], axis=2),
        "PROPOSED, NOT MEASURED: four bars at the outermost grains of every frame. Replace them by the real ones.",
    )


def bars_of_cell(dump: DumpData, unit: float) -> Walls | None:
    """Return the faces of a box that are not periodic as bars; None without any. unit: [m] of the dump."""
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


def periodic_cell(dump: DumpData, unit: float) -> Array | None:
    """Return vectors (f, 2, 2) [m] of a box with two periodic directions; None of any other. unit: [m] of the dump."""
    return dump.cell * unit if all(dump.periodic) else None


def read_foreign_walls(file: Path, imported: ImportedTracks, convention: Convention) -> Walls:
    """Read frame,wall,x1,y1,x2,y2 in the unit, axes and frame numbers of the grains.

    Ends are exchanged if the packing would lie to their right; walls given in a single frame do not move.
    """
    table = read_foreign(file, WALL_COLUMNS)
    number, text = table.integers("frame"), table.text("wall")
    names = tuple(dict.fromkeys(text))
    ends = np.column_stack([table.numbers(name) for name in WALL_COLUMNS[2:]]).reshape(-1, 2, 2)
    if convention.y_down:
        ends[..., 1] = imported.floor - ends[..., 1]
    ends *= convention.unit
    check_unique(table, "wall", number, np.unique(text, return_inverse=True)[1])
    numbers = imported.number if len(set(number.tolist())) > 1 else number[:1]
    endpoints = np.full((len(numbers), len(names), 2, 2), np.nan)
    for row, (k, name) in enumerate(zip(number, text, strict=True)):
        at = np.flatnonzero(numbers == k)
        if len(at):
            endpoints[at[0], names.index(name)] = ends[row]
    absent = np.argwhere(np.isnan(endpoints[:, :, 0, 0]))
    if len(absent):
        raise InputError(file, f"frame {numbers[absent[0][0]]}", f"has no row of wall {names[absent[0][1]]!r}")
    _check_size(file, endpoints, imported.tracks, convention)
    endpoints = np.broadcast_to(endpoints, (len(imported.number), *endpoints.shape[1:])).copy()
    for places, bars in zip(imported.tracks.position, endpoints, strict=True):
        for k, bar in enumerate(bars):
            bars[k] = bar[::-1] if _grains_lie_right(bar, places) else bar
    return Walls(names, endpoints, f"From {file.name}.")


def _grains_lie_right(bar: Array, places: Array) -> bool:
    """Whether the grains (n, 2) next to a bar (2, 2) lie to its right.

    Those between its ends count: a face of a body inside the packing, as of a footing, may have its grains on the side
    that faces away from the middle of the packing. All grains count where a bar has none between its ends.
    """
    along, place = bar[1] - bar[0], places - bar[0]
    left = along[0] * place[:, 1] - along[1] * place[:, 0]
    reached = place @ along / (along @ along)
    between = np.flatnonzero((reached >= 0.0) & (reached <= 1.0))
    nearest = between[np.argsort(np.abs(left[between]))[:NEXT_TO_BAR]]
    return bool(np.nanmean(left[nearest] if len(nearest) else left) < 0.0)


def _check_size(file: Path, endpoints: Array, tracks: Tracks, convention: Convention) -> None:
    """Raise InputError where walls (f, w, 2, 2) [m] are much smaller or larger than the packing: another unit."""
    places = endpoints[0].reshape(-1, 2), tracks.position[0, tracks.present[0]]
    walls, packing = (float(np.hypot(*np.ptp(each, axis=0))) for each in places)
    if SIZES[0] * packing <= walls <= SIZES[1] * packing:
        return
    in_metres = SIZES[0] * packing <= walls / convention.unit <= SIZES[1] * packing
    raise InputError(
        file, "", f"makes the walls {walls:.3g} m wide, and the grains are {packing:.3g} m apart: give walls in the "
        "unit of the grains" + (", not in metres" if in_metres else ""),
    )  # fmt: skip
