"""Motion and load of the rods of a frame for the layers of the page: displacement, strain, rotation, pressure."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...experiment.units import Scale
from ...reviewing.rounding import rounded
from ...solver.bodies.cell import Cell
from ...solver.bodies.grains import Array
from ...solver.frame_forces import FrameStatus
from ...solver.kinematics.local_motion import measure_local_motion
from ...solver.kinematics.sequence_kinematics import SequenceKinematics
from ...solver.statistics.balance import sum_on_grains
from ...solver.statistics.stress import grain_stresses
from .run_data import RunData

PERCENT = 100.0


class _Values(NamedTuple):
    """Motion of all rods (n,) between two frames."""

    fluctuation: Array | None  # (n, 2) [m] displacement less the mean field, where it is stored
    shear: Array
    volume: Array
    d2min: Array  # [m²]
    rotation: Array  # [rad]


def grain_motion(data: RunData, photograph: int, since: int | None, scale: Scale, length: float) -> dict[str, Any]:
    """Describe how the rods of a photograph have moved since another one, and what they carry.

    Parameters
    ----------
    data : RunData
        The run.
    photograph : int
        The photograph.
    since : int or None
        The photograph from which motion is measured; None: over the window of the results, by their own kinematics,
        or from the photograph before where the run has none.
    scale : Scale
        From pixels to metres.
    length : float
        Length of the rods [m].

    Returns
    -------
    dict
        One value per rod that is seen, in the order of `list_rods`: displacement and its departure from the mean
        deformation [px, y down], rotation [°] (over the window of the results: against the local field), shear strain
        and volume strain [%], √D²min over the mean diameter [%], pressure [kPa], contacts that bear force, sums of
        the normal forces by fringes and by forces. None where it is unknown. pixel: [m], at the middle. window:
        photographs of the window of the results; None: measured here.

    Notes
    -----
    With the logarithmic strain ε of a rod's neighbourhood, its principal values ε₁ ≥ ε₂ give the shear strain ε₁ − ε₂
    and the volume strain ε₁ + ε₂ (extension positive). The mean deformation is the affine map that fits all
    displacements best.
    """
    tracks, frame = data.tracks, photograph - data.first
    stored = None
    if data.results is not None and since is None:
        stored = data.results.kinematics_of(slice(frame, frame + 1))
    window = None if stored is None else stored.window
    start = max(frame - (window or 1), 0) if since is None else since - data.first
    here = np.flatnonzero(tracks.present_in(frame))
    before, after = tracks.position[start], tracks.position[frame]
    values = _measured(data, start, frame) if stored is None else _stored(stored)
    moved = _pixels_moved(scale, before[here], after[here])
    if values.fluctuation is None:
        fluctuation = moved - _affine(after[here], moved)
    else:
        fluctuation = _pixels_moved(scale, after[here] - values.fluctuation[here], after[here])
    pressure, coordination = _loads(data, frame, length)
    middle = scale.to_pixels(np.nanmean(after, axis=0)[None])
    return {
        "frame": photograph, "since": start + data.first, "window": window, "pixel": float(scale.size_at(middle)[0]),
        **_pairs("d", moved), **_pairs("f", fluctuation),
        "rotation": rounded(np.degrees(values.rotation[here])),
        "shear": rounded(PERCENT * values.shear[here]),
        "volume": rounded(PERCENT * values.volume[here]),
        "d2min": rounded(PERCENT * np.sqrt(values.d2min[here]) / (2.0 * tracks.radius.mean())),
        "fringes": _fringes(data, frame, here),
        "pressure": rounded(1e-3 * pressure[here]), "coordination": rounded(coordination[here]),
    }  # fmt: skip


def _fringes(data: RunData, frame: int, here: NDArray[np.intp]) -> dict[str, Any] | None:
    """Sums of the normal forces on the discs by fringes and by forces, over the mean; None without fringes."""
    found = None if data.results is None else data.results.fringes
    if found is None:
        return None
    sums = {"measured": found.measured, "inferred": found.inferred, "residual": found.residual}
    return {name: rounded(values[frame, here] / found.mean) for name, values in sums.items()}


def _stored(kinematics: SequenceKinematics) -> _Values:
    """The kinematics of one frame as they are in the results."""
    return _Values(
        kinematics.fluctuation[0], kinematics.shear_strain[0], kinematics.volumetric_strain[0],
        kinematics.d2min[0], kinematics.rotation[0],
    )  # fmt: skip


def _measured(data: RunData, start: int, frame: int) -> _Values:
    """The same between any two frames."""
    tracks = data.tracks
    cell = None if data.walls is None else data.walls.cell
    cells = None if cell is None else (Cell.at_rest(cell[start]), Cell.at_rest(cell[frame]))
    motion = measure_local_motion(tracks.position[start], tracks.position[frame], tracks.radius, cells)
    strained = np.isfinite(motion.strain).all(axis=(1, 2))
    principal = np.full((len(tracks.id), 2), np.nan)
    principal[strained] = np.linalg.eigvalsh(motion.strain[strained])
    rotation = tracks.rotation[frame] - tracks.rotation[start]
    return _Values(None, principal[:, 1] - principal[:, 0], principal.sum(axis=1), motion.d2min, rotation)


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
    contacts = forces.contacts
    total = sum_on_grains(contacts, forces.bearing)
    radius = np.full(contacts.grain_count, data.tracks.radius.mean())
    radius[:n] = data.tracks.radius
    stress = grain_stresses(contacts, forces.fn, forces.ft, radius, length)[:n]
    return 0.5 * np.trace(stress, axis1=1, axis2=2), total[:n]
