"""Simulated truths for studies: simulated once, cached in a folder, observed with noise."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..inference.inference_settings import InferenceSettings
from ..inference.inputs import Inputs
from ..process.progress import Progress, no_progress
from ..solver.bodies.grains import Array
from ..solver.bodies.packing import Packing
from ..solver.bodies.rods import RodMaterial
from ..solver.contacts.contacts import Contacts
from ..solver.contacts.pairs import Keys, make_keys
from ..solver.dem.dem_truth import DemSettings, DemTruth
from ..solver.dem.shear_cell import shear_photographs
from ..solver.frame_forces import FrameForces
from ..solver.nlgs.chain import ChainSettings
from ..solver.sequence.settings import SequenceSettings
from ..solver.statistics.agreement import Agreement, compare_forces
from ..synthetic.dense_packing import prepare_packing
from ..synthetic.experiment_files import FINEST_PRECISION
from ..synthetic.scenarios.scenario_folder import load_truth, save_truth
from ..tracks import Tracks, TrackStatus, WallTracks

STEP = 0.25  # [°] of shear between photographs
REVERSAL_ANGLE = 15.0  # [°] of shear at which the direction is reversed
INTERVAL = 52.0  # [s] between photographs at the real test's rate
WINDOW = 12  # photographs of one sequence
NOISES = (0.0, 1e-5, 2e-5, 4e-5)  # [m] of positions
NEGLIGIBLE = 1e-3  # over the mean f_n: contacts whose inferred and true forces are below it are left out of errors


def simulate(
    seed: int, *, grains: int, folder: Path, reversal_angle: float = REVERSAL_ANGLE, progress: Progress = no_progress
) -> DemTruth:
    """Load or simulate one loading cycle of a packing, a photograph every 0.25°.

    Parameters
    ----------
    seed, grains : int
    folder : Path
        Cache of simulated truths.
    reversal_angle : float
        Shear at which the direction is reversed [°]; the truth has 2 reversal_angle / 0.25 + 1 frames.
    progress : Progress
    """
    file = folder / f"truth_{grains}_{reversal_angle:g}_{seed}.npz"
    settings = DemSettings()
    if file.exists():
        return load_truth(file, settings)
    up = np.arange(round(reversal_angle / STEP) + 1)
    angles = np.deg2rad(STEP) * np.concatenate([up, up[-2::-1]])
    cell = prepare_packing(grains, np.random.default_rng(seed), settings)
    frames = []
    for frame in shear_photographs(cell, angles):
        frames.append(frame)
        progress(f"truth {seed}", len(frames), len(angles))
    truth = DemTruth.of_frames(cell.grains.radius, frames, settings)
    save_truth(file, truth)
    return truth


def packing_of(truth: DemTruth) -> Packing:
    """Return the packing of a truth, with the top wall a plate under pressure."""
    return _material_of(truth).pack(truth.radius, _pressure_of(truth))


def observe(
    truth: DemTruth, photographs: range, noise: float, rng: np.random.Generator, *, estimator: str = "ensemble"
) -> Inputs:
    """Return the inputs of a run: tracks of a truth with Gaussian noise.

    The settings are those of `rodsight run` except the estimator, without calibration, since there are no constant
    errors.

    Parameters
    ----------
    truth : DemTruth
    photographs : range
        Frames of the truth.
    noise : float
        Standard deviation of a position component [m]; that of a rotation is noise / R [rad].
    rng : numpy.random.Generator
    estimator : {'ensemble', 'nlgs'}
    """
    n, shape = len(truth.radius), (len(photographs), len(truth.radius))
    position, rotation = np.empty((*shape, 2)), np.empty(shape)
    for row, k in enumerate(photographs):
        position[row] = truth.position[k] + noise * rng.standard_normal((n, 2))
        rotation[row] = truth.rotation[k] + noise / truth.radius * rng.standard_normal(n)
    tracks = Tracks(
        np.arange(n), truth.radius, INTERVAL * np.array(photographs), position, rotation,
        np.full(shape, max(noise, FINEST_PRECISION)), np.full(shape, np.nan),
        np.full(shape, TrackStatus.GIVEN, np.uint8),
    )  # fmt: skip
    walls = WallTracks(truth.wall_names, truth.endpoints[photographs], _pressure_of(truth))
    sequence = SequenceSettings(estimator=estimator, chain=ChainSettings(keep="none"))  # type: ignore[arg-type]
    return Inputs(tracks, walls, _material_of(truth), InferenceSettings(sequence, calibration=None))


def with_imposed_walls(inputs: Inputs) -> Inputs:
    """Replace all pressures by imposed measured motion of the walls."""
    pressure = np.full_like(inputs.walls.pressure, np.nan)
    return replace(inputs, walls=replace(inputs.walls, pressure=pressure))


def _material_of(truth: DemTruth) -> RodMaterial:
    return RodMaterial(truth.settings.density, truth.settings.length, truth.settings.friction)


def _pressure_of(truth: DemTruth) -> Array:
    pressure = np.full(len(truth.wall_names), np.nan)
    pressure[truth.wall_names.index("top")] = truth.settings.pressure
    return pressure


def true_forces(truth: DemTruth, frame: int) -> tuple[NDArray[np.int64], Array]:
    """Return keys (t,) and forces (t, 2) [N] of the true contacts of one frame."""
    rows = slice(truth.offset[frame], truth.offset[frame + 1])
    bodies = len(truth.radius) + len(truth.wall_names)
    return make_keys(truth.i[rows], truth.j[rows], bodies), np.column_stack([truth.fn[rows], truth.ft[rows]])


def agreement_of(forces: FrameForces, truth: DemTruth, frame: int) -> Agreement:
    """Compare inferred forces with frame `frame` of the truth, leaving out contacts of inferred rods."""
    key, seen = truth_keys(forces.contacts, truth)
    return compare_forces(key, np.column_stack([forces.fn, forces.ft])[seen], *true_forces(truth, frame))


def truth_keys(contacts: Contacts, truth: DemTruth) -> tuple[Keys, NDArray[np.bool_]]:
    """Return the keys of contacts in the numbering of the truth, and a mask (c,) of the contacts that have one.

    Inferred rods are numbered after all others, before the walls; they have no counterpart in the truth.
    """
    rods = len(truth.radius)
    wall = contacts.with_wall
    seen = (contacts.i < rods) & (wall | (contacts.j < rods))
    j = np.where(wall, contacts.j - contacts.grain_count + rods, contacts.j)
    return make_keys(contacts.i[seen], j[seen], rods + len(truth.wall_names)), seen


def window_starts(truth: DemTruth, length: int) -> tuple[int, ...]:
    """Return the first photographs of two windows of `length` frames: loading and unloading."""
    reversal = truth.position.shape[0] // 2
    up = max(1, reversal // 4)
    if up + length > reversal or reversal + up + length > len(truth.position):
        raise ValueError(f"windows of {length} photographs do not fit into {len(truth.position)}")
    return up, reversal + up
