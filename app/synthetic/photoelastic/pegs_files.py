"""A synthetic photoelastic test: discs with forces as read from fringes, with the errors of real readings.

Soft discs of two sizes, nearly jammed on a base with friction, in pure shear. The files are those of PeGS for each
photograph: centres in pixels, y down, with noise and with constant errors; radii in whole pixels, all too small; no
rotations; two forces per contact, one read from each disc's fringes, which differ; weak contacts missing, some read
from one side only; no walls.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...process.atomic import replacing_folder
from ...process.progress import Progress, no_progress
from ...solver.bodies.grains import Array
from ...solver.dem.dem_truth import DemTruth
from ..scenarios.scenario_folder import check_output, load_or_simulate
from ..scenarios.scenario_table import SCENARIOS

DIAMETER = 50.0  # px, mean
NOISE = 0.3  # px of a centre's coordinate, from photograph to photograph
CENTRE_ERROR = 0.25  # px of a centre's coordinate, the same in all photographs
RADIUS_DEFICIT = 0.8  # px, by which every radius is read too small
RADIUS_NOISE = 0.2  # px, before rounding
READING_SD = 0.35  # standard deviation of a reading, over the force
BASE_READING_SD = 0.1  # standard deviation of every reading, over the mean force
WEAK, MISSED = 0.3, 0.6  # over the mean force; fraction of the contacts below it that no fringe shows
ONE_SIDED = 0.04  # fraction of the contacts
SHEAR_READING = 0.05  # tangential reading over the normal one: pure noise
FIRST = 5000  # number of the first photograph


@dataclass(frozen=True, slots=True)
class MadePhotoelastic:
    """A folder that was written, its truth and its scale."""

    folder: Path
    truth: DemTruth
    pixel_size: float  # [m]


def make_photoelastic(
    out: Path, seed: int = 0, *, grains: int | None = None, progress: Progress = no_progress
) -> MadePhotoelastic:
    """Write a folder of NAME_ParticleData.dlm with matrices of forces; the same arguments give the same bytes.

    Parameters
    ----------
    out : Path
        Folder to write; must be absent or empty.
    seed : int
    grains : int, optional
    progress : Progress

    Raises
    ------
    InputError
        If the folder is not empty or there are too few grains.
    UnbalancedError
        If the simulation does not come to rest.
    """
    grains = check_output(out, grains)
    truth = load_or_simulate(SCENARIOS["nearly_jammed"].loading, grains, seed, None, progress)
    rng = np.random.default_rng([seed, 3])
    pixel = 2.0 * float(truth.radius.mean()) / DIAMETER
    floor = float(truth.position[..., 1].max()) / pixel + DIAMETER
    centre_error = CENTRE_ERROR * rng.standard_normal((grains, 2))
    with replacing_folder(out) as part:
        for frame in range(truth.frame_count):
            place = truth.position[frame] / pixel
            place = np.column_stack([place[:, 0], floor - place[:, 1]]) + centre_error
            place += NOISE * rng.standard_normal(place.shape)
            radius = np.rint(truth.radius / pixel - RADIUS_DEFICIT + RADIUS_NOISE * rng.standard_normal(grains))
            normal, tangential = _read_forces(truth, frame, rng)
            stem = part / f"DSC{FIRST + 2 * frame:05d}_solved_Tracke"
            discs = np.column_stack([np.arange(1, grains + 1), place, radius, normal.sum(axis=1)])
            np.savetxt(f"{stem}_ParticleData.dlm", discs, fmt=("%d", "%.2f", "%.2f", "%d", "%.5g"), delimiter=",")
            np.savetxt(f"{stem}_NormWeightedAdjacencyMatrix.dlm", normal, fmt="%.5g", delimiter=",")
            np.savetxt(f"{stem}_TanWeightedAdjacencyMatrix.dlm", tangential, fmt="%.5g", delimiter=",")
    return MadePhotoelastic(out, truth, pixel)


def _read_forces(truth: DemTruth, frame: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return the normal and tangential forces (n, n) [N] as read from the disc of each row."""
    n = len(truth.radius)
    rows = slice(int(truth.offset[frame]), int(truth.offset[frame + 1]))
    i, j, fn = truth.i[rows], truth.j[rows], truth.fn[rows]
    between = (j < n) & (fn > 0.0)
    i, j, fn = i[between], j[between], fn[between]
    mean = float(fn.mean()) if len(fn) else 0.0
    seen = (fn > WEAK * mean) | (rng.random(len(fn)) > MISSED)
    i, j, fn = i[seen], j[seen], fn[seen]
    deviation = np.hypot(READING_SD * fn, BASE_READING_SD * mean)
    reading = np.maximum(fn + deviation * rng.standard_normal((2, len(fn))), 0.0)
    alone = rng.random(len(fn)) < ONE_SIDED
    reading[rng.integers(0, 2, len(fn))[alone], np.flatnonzero(alone)] = 0.0
    normal, tangential = np.zeros((n, n)), np.zeros((n, n))
    for value, a, b in ((reading[0], i, j), (reading[1], j, i)):
        normal[a, b] = value
        tangential[a, b] = SHEAR_READING * value * rng.standard_normal(len(value))
    return normal, tangential
