"""Quantities of single grains for tables: stress, coordination number, motion since the frame before, D²min."""

from __future__ import annotations

import tomllib

import numpy as np

from ..results.results import Results
from ..solver.bodies.cell import Cell
from ..solver.bodies.grains import Array
from ..solver.frame_forces import FrameStatus
from ..solver.kinematics.local_motion import measure_local_motion
from ..solver.statistics.balance import sum_on_grains
from ..solver.statistics.stress import grain_stresses

# Units and meanings of the columns.
GRAIN_COLUMNS = {
    "coordination_number": ("", "expected number of contacts that bear force, those with walls included"),
    **{
        f"stress_{row}{column}": ("Pa", "stress over the grain's own volume, compression positive")
        for row in "xy"
        for column in "xy"
    },
    "pressure": ("Pa", "half the trace of the grain's stress"),
    "displacement_x": ("m", "displacement since the frame before, to the right"),
    "displacement_y": ("m", "displacement since the frame before, upward"),
    "rotation": ("rad", "rotation since the frame before, counter-clockwise"),
    "strain_xx": ("", "local logarithmic strain since the frame before, extension positive"),
    "strain_xy": ("", "local logarithmic strain since the frame before, half the shear angle"),
    "strain_yy": ("", "local logarithmic strain since the frame before, extension positive"),
    "D2min": ("m2", "mean squared departure of the neighbours from the local strain, Falk & Langer 1998"),
}


def measure_grains(results: Results) -> dict[str, Array]:
    """Measure the quantities of GRAIN_COLUMNS.

    Returns
    -------
    dict of str to (f · n,) arrays
        One row per frame and grain, NaN where a quantity is unknown: forces of frames that could not be solved, motion
        in frame 0 and of lost grains.
    """
    tracks = results.tracks
    shape = (tracks.frame_count, tracks.grain_count)
    columns = {name: np.full(shape, np.nan) for name in GRAIN_COLUMNS}
    columns["displacement_x"][1:], columns["displacement_y"][1:] = np.moveaxis(np.diff(tracks.position, axis=0), 2, 0)
    columns["rotation"][1:] = np.diff(tracks.rotation, axis=0)
    length = rod_length(results)
    for k in range(tracks.frame_count):
        _measure_forces(results, k, length, columns)
        if k:
            _measure_motion(results, k, columns)
    return {name: each.ravel() for name, each in columns.items()}


def _measure_forces(results: Results, frame: int, length: float, columns: dict[str, Array]) -> None:
    forces, tracks = results.frames[frame], results.tracks
    if forces.status is FrameStatus.FAILED:
        return
    contacts, n, present = forces.contacts, tracks.grain_count, tracks.present[frame]
    total = sum_on_grains(contacts, forces.bearing)
    columns["coordination_number"][frame] = np.where(present, total[:n], np.nan)
    stress = grain_stresses(contacts, forces.fn, forces.ft, results.grains.radius, length)[:n]
    stress[~present] = np.nan
    for a, row in enumerate("xy"):
        for b, column in enumerate("xy"):
            columns[f"stress_{row}{column}"][frame] = stress[:, a, b]
    columns["pressure"][frame] = 0.5 * np.trace(stress, axis1=1, axis2=2)


def _measure_motion(results: Results, frame: int, columns: dict[str, Array]) -> None:
    tracks, cell = results.tracks, results.walls.cell
    cells = None if cell is None else (Cell.at_rest(cell[frame - 1]), Cell.at_rest(cell[frame]))
    motion = measure_local_motion(tracks.position[frame - 1], tracks.position[frame], tracks.radius, cells)
    for name, (a, b) in {"strain_xx": (0, 0), "strain_xy": (0, 1), "strain_yy": (1, 1)}.items():
        columns[name][frame] = motion.strain[:, a, b]
    columns["D2min"][frame] = motion.d2min


def rod_length(results: Results) -> float:
    """Return the length of the rods [m] that the run was solved with; NaN where its configuration does not give it."""
    length = tomllib.loads(results.configuration).get("material", {}).get("length", np.nan)
    return float(length) if isinstance(length, int | float) else float("nan")
