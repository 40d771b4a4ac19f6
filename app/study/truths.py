"""Simulated truths for studies: simulated once, kept in a folder, observed with noise."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.bodies.packing import Packing
from solver.bodies.rods import RodMaterial
from solver.contacts.contacts import Contacts
from solver.contacts.pairs import Keys, make_keys
from solver.dem.simulation import DemSettings, DemTruth, shear_photographs
from solver.nlgs.chain import ChainSettings
from solver.sequence.frame_forces import FrameForces
from solver.sequence.settings import SequenceSettings
from solver.statistics.agreement import Agreement, compare_forces

from ..inference.inference import Inputs
from ..inference.settings import InferenceSettings
from ..progress import Progress, silent
from ..synthetic.dense_packing import prepare_packing
from ..synthetic.worlds.making import load_truth, save_truth
from ..tracks import Tracks, TrackStatus, WallTracks

STEP = 0.25  # [°] of shear between photographs
TURN = 15.0  # [°] at which the shear turns back
INTERVAL = 52.0  # [s] between photographs at the real test's rate
FINEST = 1e-6  # [m] precision claimed of exact positions


def simulate(seed: int, *, grains: int, folder: Path, turn: float = TURN, progress: Progress = silent) -> DemTruth:
    """One loading cycle of a packing, a photograph every 0.25° (f = 2 turn / 0.25 + 1); from the folder if there."""
    file = folder / f"truth_{grains}_{turn:g}_{seed}.npz"
    settings = DemSettings()
    if file.exists():
        return load_truth(file, settings)
    up = np.arange(round(turn / STEP) + 1)
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
    """The mechanics of a truth, the top a plate under pressure."""
    return _material_of(truth).pack(truth.radius, _pressure_of(truth))


def observe(
    truth: DemTruth, photographs: range, noise: float, rng: np.random.Generator, *, estimator: str = "ensemble"
) -> Inputs:
    """Photographs of a truth, tracked with Gaussian noise [m] on positions and noise / R [rad] on rotations.

    Solved as `rodsight run` would, but for the estimator, and without calibration: nothing constant is wrong.
    """
    n, shape = len(truth.radius), (len(photographs), len(truth.radius))
    position, rotation = np.empty((*shape, 2)), np.empty(shape)
    for row, k in enumerate(photographs):
        position[row] = truth.position[k] + noise * rng.standard_normal((n, 2))
        rotation[row] = truth.rotation[k] + noise / truth.radius * rng.standard_normal(n)
    tracks = Tracks(
        np.arange(n), truth.radius, INTERVAL * np.array(photographs), position, rotation,
        np.full(shape, max(noise, FINEST)), np.full(shape, np.nan), np.full(shape, TrackStatus.GIVEN, np.uint8),
    )  # fmt: skip
    walls = WallTracks(truth.wall_names, truth.endpoints[photographs], _pressure_of(truth))
    sequence = SequenceSettings(estimator=estimator, chain=ChainSettings(keep="none"))  # type: ignore[arg-type]
    return Inputs(tracks, walls, _material_of(truth), InferenceSettings(sequence, calibration=None))


def with_imposed_walls(inputs: Inputs) -> Inputs:
    """The same photographs with the measured motion of all walls imposed: no plate carries a pressure."""
    pressure = np.full_like(inputs.walls.pressure, np.nan)
    return replace(inputs, walls=replace(inputs.walls, pressure=pressure))


def _material_of(truth: DemTruth) -> RodMaterial:
    return RodMaterial(truth.settings.density, truth.settings.length, truth.settings.friction)


def _pressure_of(truth: DemTruth) -> Array:
    pressure = np.full(len(truth.wall_names), np.nan)
    pressure[truth.wall_names.index("top")] = truth.settings.pressure
    return pressure


def true_forces(truth: DemTruth, frame: int) -> tuple[NDArray[np.int64], Array]:
    """Keys (t,) and forces (t, 2) [N] of one frame's true contacts."""
    rows = slice(truth.offset[frame], truth.offset[frame + 1])
    bodies = len(truth.radius) + len(truth.wall_names)
    return make_keys(truth.i[rows], truth.j[rows], bodies), np.column_stack([truth.fn[rows], truth.ft[rows]])


def agreement_of(forces: FrameForces, truth: DemTruth, frame: int) -> Agreement:
    """Agreement of inferred forces with the truth's photograph `frame`; those of inferred rods are left out."""
    key, seen = truth_keys(forces.contacts, truth)
    return compare_forces(key, np.column_stack([forces.fn, forces.ft])[seen], *true_forces(truth, frame))


def truth_keys(contacts: Contacts, truth: DemTruth) -> tuple[Keys, NDArray[np.bool_]]:
    """Keys of the contacts as the truth counts bodies, and which contacts (c,) have one.

    Rods that were inferred come after all others, before the walls; which of the truth's they are is not asked.
    """
    rods = len(truth.radius)
    wall = contacts.with_wall
    seen = (contacts.i < rods) & (wall | (contacts.j < rods))
    j = np.where(wall, contacts.j - contacts.grain_count + rods, contacts.j)
    return make_keys(contacts.i[seen], j[seen], rods + len(truth.wall_names)), seen


def starts_of(truth: DemTruth, length: int) -> tuple[int, ...]:
    """First photographs of two windows of `length`: one on the way up, one on the way back."""
    turn = truth.position.shape[0] // 2
    up = max(1, turn // 4)
    if up + length > turn or turn + up + length > len(truth.position):
        raise ValueError(f"windows of {length} photographs do not fit into {len(truth.position)}")
    return up, turn + up
