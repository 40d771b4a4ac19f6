"""The forces of a small packing by an earlier version, from given poses, with both estimators.

60 rods in 4 photographs of a simulated shear, with noise, one of them lost in one photograph: the run covers all
stages from poses to statistics in a few seconds. Input and output are in forces.npz.

TOLERANCE: on one machine the bits are identical, since the sweeps are sequential and the convex programs run on one
thread. Another processor or BLAS sums in another order, which changed the forces of the sample by 2e-11 of their mean.
A change of mechanics gives more than 1e-6.

To renew, after an intended change of the forces that CHANGELOG.md states:
    python -c "from tests.golden.forces import renew; renew()"
"""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from rodsight.solver.assessment.intervals.statistic_intervals import CONSTANT
from rodsight.solver.bodies.grains import Grains
from rodsight.solver.bodies.motion import Snapshot
from rodsight.solver.bodies.packing import Material, Packing
from rodsight.solver.dem.dem_truth import DemSettings, DemTruth
from rodsight.solver.dem.shear_cell import shear_photographs
from rodsight.solver.detection.touch_probability import ContactProbabilitySettings
from rodsight.solver.frame_forces import FrameForces
from rodsight.solver.nlgs.chain import ChainSettings
from rodsight.solver.sequence.frames import solve_sequence
from rodsight.solver.sequence.settings import EnsembleSettings, SequenceSettings
from rodsight.solver.statistics.frame_statistics import ContactProbabilities, FrameStatistics, frame_statistics
from rodsight.synthetic.dense_packing import prepare_packing

STORED = Path(__file__).with_name("forces.npz")
TOLERANCE = 1e-9  # of the greatest value of a column
RODS, FRAMES, NOISE = 60, 4, 8e-6
LOST = (2, 25)  # frame, rod
PRESSURE, LENGTH = 50e3, 0.06  # [Pa], [m]

CHAIN = ChainSettings(sweeps=60, spin_up=4, substeps=3)
SETTINGS = {
    "nlgs": SequenceSettings(estimator="nlgs", chain=CHAIN, overlap=5e-6),
    # Draws of a sampler differ permanently if another processor rounds one of them differently.
    "ensemble": SequenceSettings(
        chain=CHAIN,
        overlap=5e-6,
        positions="never",
        ensemble=EnsembleSettings(probability=ContactProbabilitySettings(overlap=5e-6)),
    ),
}
COLUMNS = (
    "fn", "ft", "nlgs_fn", "nlgs_ft", "un", "ut", "state", "age", "source", "probability", "fn_sd", "ft_sd",
)  # fmt: skip
SCALARS = (
    "status", "sweeps", "natural_map", "unbalance", "kappa", "correction", "old_unbalance", "trust",
    "frames_since_reset", "start_difference", "unseen_grains", "hidden_fraction",
)  # fmt: skip


def solve_stored() -> dict[str, np.ndarray]:
    """Solve the stored poses again; return every column as estimator/name."""
    return solve(stored_poses())


def stored_poses() -> dict[str, np.ndarray]:
    with np.load(STORED) as stored:
        return {name: stored[name] for name in stored.files if name.startswith("poses/")}


def stored() -> dict[str, np.ndarray]:
    with np.load(STORED) as arrays:
        return {name: arrays[name] for name in arrays.files if not name.startswith("poses/")}


def difference(now: np.ndarray, then: np.ndarray) -> float:
    """Return the greatest difference over the greatest stored magnitude; infinite if shapes or NaNs differ."""
    now, then = now.astype(np.float64), then.astype(np.float64)
    if now.shape != then.shape or not np.array_equal(np.isnan(now), np.isnan(then)):
        return np.inf
    known = ~np.isnan(then)
    size = np.abs(then[known]).max(initial=0.0)
    return float(np.abs(now - then)[known].max(initial=0.0) / (size if size > 0 else 1.0))


def renew(truth: DemTruth | None = None) -> None:
    """Solve and store the stored poses again, or those of another simulation."""
    poses = stored_poses() if truth is None else poses_of(truth)
    np.savez_compressed(STORED, **poses, **solve(poses))


def simulate() -> DemTruth:
    """Simulate the packing of the stored poses, for renew(simulate())."""
    settings = DemSettings(pressure=PRESSURE, length=LENGTH)
    cell = prepare_packing(RODS, np.random.default_rng(3), settings)
    angles = np.deg2rad(2.0 + 0.25 * np.arange(FRAMES))
    return DemTruth.of_frames(cell.grains.radius, list(shear_photographs(cell, angles)), settings)


def poses_of(truth: DemTruth) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(11)
    position = truth.position + NOISE * rng.standard_normal(truth.position.shape)
    rotation = truth.rotation + NOISE / truth.radius * rng.standard_normal(truth.rotation.shape)
    return {
        "poses/radius": truth.radius,
        "poses/position": position,
        "poses/rotation": rotation,
        "poses/endpoints": truth.endpoints,
    }


def packing_of(poses: dict[str, np.ndarray]) -> tuple[Packing, list[Snapshot]]:
    grains = Grains.of_rods(poses["poses/radius"], density=2700.0, length=LENGTH)
    packing = Packing(grains, LENGTH, Material(0.25, 0.2), np.array([np.nan, np.nan, PRESSURE, np.nan]))
    snapshots = []
    for k in range(len(poses["poses/position"])):
        present = np.ones(grains.count, bool)
        if k == LOST[0]:
            present[LOST[1]] = False
        snapshots.append(
            Snapshot(
                50.0 * k,
                poses["poses/position"][k],
                poses["poses/rotation"][k],
                present,
                poses["poses/endpoints"][k],
                NOISE,
            )
        )
    return packing, snapshots


def solve(poses: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    packing, snapshots = packing_of(poses)
    found: dict[str, np.ndarray] = {}
    for name, settings in SETTINGS.items():
        frames = [frame for frame, _ in solve_sequence(packing, snapshots, settings)]
        statistics = [_statistics(packing, snapshots[k], frame) for k, frame in enumerate(frames)]
        found |= {f"{name}/{column}": values for column, values in _columns(frames, statistics).items()}
    return found


def _statistics(packing: Packing, snapshot: Snapshot, frame: FrameForces) -> FrameStatistics:
    assert frame.bearing_probability is not None
    assert frame.sliding_probability is not None
    probabilities = ContactProbabilities(frame.bearing_probability, frame.sliding_probability)
    return frame_statistics(frame.contacts, frame.fn, frame.ft, probabilities, snapshot, packing)


def _columns(frames: list[FrameForces], statistics: list[FrameStatistics]) -> dict[str, np.ndarray]:
    columns: dict[str, Any] = {"count": np.array([frame.contacts.count for frame in frames])}
    for name in ("i", "j"):
        columns[name] = np.concatenate([getattr(frame.contacts, name) for frame in frames])
    for name in COLUMNS:
        columns[name] = np.concatenate([getattr(frame, name) for frame in frames])
    for name in SCALARS:
        columns[name] = np.array([float(getattr(frame, name)) for frame in frames])
    for each in fields(FrameStatistics):
        if each.name in {f"{name}_sd" for name in CONSTANT}:  # set once a frame's trust is known
            continue
        columns[f"statistics/{each.name}"] = np.stack([np.asarray(getattr(s, each.name), float) for s in statistics])
    return columns
