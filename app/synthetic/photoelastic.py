"""A synthetic photoelastic test: discs and the forces that their fringes would tell, with the faults of real ones.

Soft discs of two sizes, nearly jammed on a base that rubs, sheared purely. What is written is what PeGS leaves of each
photograph: centres in pixels, y down, with noise and with errors that stay; radii in whole pixels, all too small; no
rotations; on every contact two forces, one as either disc's fringes were read, which differ; weak contacts missing,
some read from one side only; nothing of walls.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from solver.bodies.grains import Array
from solver.dem.simulation import DemTruth

from ..errors import InputError
from ..progress import Progress, silent
from .worlds.making import GRAINS, LEAST_GRAINS, simulate_kept
from .worlds.table import WORLDS

DIAMETER = 50.0  # px, mean
NOISE = 0.3  # px of a centre's coordinate, from photograph to photograph
CENTRE_ERROR = 0.25  # px of a centre's coordinate, the same in all of them
TOO_SMALL = 0.8  # px, by which every radius is read
RADIUS_NOISE = 0.2  # px, before it is rounded
READING = 0.35  # of a force: standard deviation of its reading
BASE_READING = 0.1  # of the mean force: likewise, whatever the force
WEAK, MISSED = 0.3, 0.6  # of the mean force; share of contacts below it that no fringe shows
ONE_SIDED = 0.04  # of the contacts
SHEAR_READING = 0.05  # tangential reading over the normal one: it tells nothing
FIRST = 5000  # number of the first photograph


@dataclass(frozen=True, slots=True)
class MadePhotoelastic:
    """What was written, and what is known about it."""

    folder: Path
    truth: DemTruth
    pixel_size: float  # [m]


def make_photoelastic(
    out: Path, seed: int = 0, *, grains: int | None = None, kept: Path | None = None, progress: Progress = silent
) -> MadePhotoelastic:
    """Write a folder of NAME_ParticleData.dlm with its matrices of forces; the same arguments give the same bytes.

    kept: folder of truths that were simulated before. Raises InputError for a folder that is there and not empty,
    UnbalancedError when the simulation does not come to rest.
    """
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(out, "", "exists already and is not an empty folder")
    grains = GRAINS if grains is None else grains
    if grains < LEAST_GRAINS:
        raise InputError("synth", f"grains = {grains}", f"expected at least {LEAST_GRAINS}")
    truth = simulate_kept(WORLDS["nearly_jammed"].course, grains, seed, kept, progress)
    rng = np.random.default_rng([seed, 3])
    pixel = 2.0 * float(truth.radius.mean()) / DIAMETER
    floor = float(truth.position[..., 1].max()) / pixel + DIAMETER
    centre_error = CENTRE_ERROR * rng.standard_normal((grains, 2))
    out.mkdir(parents=True, exist_ok=True)
    for frame in range(truth.frame_count):
        place = truth.position[frame] / pixel
        place = np.column_stack([place[:, 0], floor - place[:, 1]]) + centre_error
        place += NOISE * rng.standard_normal(place.shape)
        radius = np.rint(truth.radius / pixel - TOO_SMALL + RADIUS_NOISE * rng.standard_normal(grains))
        normal, tangential = _read_forces(truth, frame, rng)
        stem = out / f"DSC{FIRST + 2 * frame:05d}_solved_Tracke"
        discs = np.column_stack([np.arange(1, grains + 1), place, radius, normal.sum(axis=1)])
        np.savetxt(f"{stem}_ParticleData.dlm", discs, fmt=("%d", "%.2f", "%.2f", "%d", "%.5g"), delimiter=",")
        np.savetxt(f"{stem}_NormWeightedAdjacencyMatrix.dlm", normal, fmt="%.5g", delimiter=",")
        np.savetxt(f"{stem}_TanWeightedAdjacencyMatrix.dlm", tangential, fmt="%.5g", delimiter=",")
    return MadePhotoelastic(out, truth, pixel)


def _read_forces(truth: DemTruth, frame: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Normal and tangential force on every contact as the disc of its row tells it (n, n) [N]."""
    n = len(truth.radius)
    rows = slice(int(truth.offset[frame]), int(truth.offset[frame + 1]))
    i, j, fn = truth.i[rows], truth.j[rows], truth.fn[rows]
    between = (j < n) & (fn > 0.0)
    i, j, fn = i[between], j[between], fn[between]
    mean = float(fn.mean()) if len(fn) else 0.0
    seen = (fn > WEAK * mean) | (rng.random(len(fn)) > MISSED)
    i, j, fn = i[seen], j[seen], fn[seen]
    deviation = np.hypot(READING * fn, BASE_READING * mean)
    reading = np.maximum(fn + deviation * rng.standard_normal((2, len(fn))), 0.0)
    alone = rng.random(len(fn)) < ONE_SIDED
    reading[rng.integers(0, 2, len(fn))[alone], np.flatnonzero(alone)] = 0.0
    normal, tangential = np.zeros((n, n)), np.zeros((n, n))
    for value, a, b in ((reading[0], i, j), (reading[1], j, i)):
        normal[a, b] = value
        tangential[a, b] = SHEAR_READING * value * rng.standard_normal(len(value))
    return normal, tangential
