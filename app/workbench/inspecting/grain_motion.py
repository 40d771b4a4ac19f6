"""Motion and load of the rods of a frame for the layers of the page: displacement, strain, rotation, pressure."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...experiment.units import Scale
from ...reviewing.rounding import rounded
from ...solver.bodies.cell import Cell
from ...solver.bodies.grains import Array
from ...solver.frame_forces import FrameStatus
from ...solver.kinematics.local_motion import measure_local_motion
from ...solver.statistics.stress import grain_stresses
from .run_data import RunData

PERCENT = 100.0


def grain_motion(data: RunData, photograph: int, since: int, scale: Scale, length: float) -> dict[str, Any]:
    """Describe how the rods of a photograph have moved since another one, and what they carry.

    Parameters
    ----------
    data : RunData
        The run.
    photograph, since : int
        The photograph, and the one from which motion is measured.
    scale : Scale
        From pixels to metres.
    length : float
        Length of the rods [m].

    Returns
    -------
    dict
        One value per rod that is seen, in the order of `list_rods`: displacement and its departure from the mean
        deformation [px, y down], rotation [°], largest shear strain and volume strain [%], √D²min over the mean
        diameter [%], pressure [kPa], contacts that bear force. None where it is unknown. pixel: [m], at the middle.

    Notes
    -----
    With the logarithmic strain ε of a rod's neighbourhood, its principal values ε₁ ≥ ε₂ give the shear strain ε₁ − ε₂
    and the volume strain ε₁ + ε₂ (extension positive). The mean deformation is the affine map that fits all
    displacements best.
    """
    tracks, frame, start = data.tracks, photograph - data.first, since - data.first
    here = np.flatnonzero(tracks.present[frame])
    before, after = tracks.position[start], tracks.position[frame]
    cell = None if data.walls is None else data.walls.cell
    cells = None if cell is None else (Cell.at_rest(cell[start]), Cell.at_rest(cell[frame]))
    motion = measure_local_motion(before, after, tracks.radius, cells)
    strained = np.isfinite(motion.strain).all(axis=(1, 2))
    principal = np.full((len(tracks.id), 2), np.nan)
    principal[strained] = np.linalg.eigvalsh(motion.strain[strained])
    moved = _pixels_moved(scale, before[here], after[here])
    pressure, coordination = _loads(data, frame, length)
    middle = scale.to_pixels(np.nanmean(after, axis=0)[None])
    return {
        "frame": photograph, "since": since, "pixel": float(scale.size_at(middle)[0]),
        **_pairs("d", moved), **_pairs("f", moved - _affine(after[here], moved)),
        "rotation": rounded(np.degrees(tracks.rotation[frame, here] - tracks.rotation[start, here])),
        "shear": rounded(PERCENT * (principal[here, 1] - principal[here, 0])),
        "volume": rounded(PERCENT * principal[here].sum(axis=1)),
        "d2min": rounded(PERCENT * np.sqrt(motion.d2min[here]) / (2.0 * tracks.radius.mean())),
        "pressure": rounded(1e-3 * pressure[here]), "coordination": rounded(coordination[here]),
    }  # fmt: skip


def _pixels_moved(scale: Scale, before: Array, after: Array) -> Array:
    return scale.to_pixels(after) - scale.to_pixels(before)


def _pairs(name: str, values: Array) -> dict[str, Any]:
    return {f"{name}{axis}": rounded(values[:, k]) for k, axis in enumerate("xy")}


def _affine(place: Array, moved: Array) -> Array:
    """Return the affine displacement field (n, 2) that fits the known displacements best; NaN where too few are."""
    known = np.isfinite(np.hstack([place, moved])).all(axis=1)
    if known.sum() < 3:
        return np.full_like(moved, np.nan)
    design = np.column_stack([place - place[known].mean(axis=0), np.ones(len(place))])
    return design @ np.linalg.lstsq(design[known], moved[known], rcond=None)[0]


def _loads(data: RunData, frame: int, length: float) -> tuple[Array, Array]:
    """Pressure [Pa] and number of contacts that bear force of every rod; NaN where the frame has no forces."""
    forces, n = data.frames[frame], data.tracks.grain_count
    if forces.status is FrameStatus.FAILED:
        return np.full(n, np.nan), np.full(n, np.nan)
    contacts, between = forces.contacts, ~forces.contacts.with_wall
    bears = forces.bearing_probability
    bears = (forces.fn > 0.0).astype(np.float64) if bears is None else np.nan_to_num(bears)
    ends = np.concatenate([contacts.i, contacts.j[between]])
    total = np.zeros(contacts.grain_count)
    np.add.at(total, ends, np.concatenate([bears, bears[between]]))
    radius = np.full(contacts.grain_count, data.tracks.radius.mean())
    radius[:n] = data.tracks.radius
    stress = grain_stresses(contacts, forces.fn, forces.ft, radius, length)[:n]
    return 0.5 * np.trace(stress, axis1=1, axis2=2), total[:n]
