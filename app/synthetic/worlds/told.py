"""What an experiment folder tells of a world: everything measured, right or wrong."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.bodies.wall_shapes import STRAIGHT, Sides, all_sides
from solver.dem.simulation import DemTruth

from .. import experiment_files
from ..experiment_files import Known

INTERVAL = 52.0  # [s] between photographs, as at the real test's rate
FINEST_PRECISION = 1e-6  # [m], claimed of tracks without noise: tables are rounded, rods are elastic


@dataclass(frozen=True, slots=True)
class Told:
    """Tracks, walls and the experiment file's numbers."""

    id: NDArray[np.int64]  # (n,)
    radius: Array  # (n,) [m]
    position: Array  # (f, n, 2) [m]
    rotation: Array | None  # (f, n) [rad], None: unknown
    endpoints: Array  # (f, w, 2, 2) [m]
    wall_names: tuple[str, ...]  # (w,)
    precision: float  # [m]
    known: Known
    cell: Array | None = None  # (f, 2, 2) [m] vectors of the periodic cell, in place of walls
    outer: bool = False  # the outermost grains are the boundary
    side: Sides = None  # (w,) which walls are circles; None: none
    measured: tuple[str, ...] = ()  # walls whose loads sensors tell
    load: Array = field(default_factory=lambda: np.empty((0, 0)))  # (f, loads) [N] on them


def observe_truth(
    truth: DemTruth,
    plates: tuple[str, ...],
    noise: float,
    rng: np.random.Generator,
    measured: tuple[str, ...] = (),
) -> Told:
    """What careful work would tell of a truth: positions with Gaussian noise [m], rotations with noise / radius [rad].

    plates: the walls that carry the simulation's pressure; measured: those whose normal forces sensors measure.
    """
    position = truth.position + noise * rng.standard_normal(truth.position.shape)
    rotation = truth.rotation + noise / truth.radius * rng.standard_normal(truth.rotation.shape)
    return Told(
        np.arange(len(truth.radius)), truth.radius, position, rotation, truth.endpoints, truth.wall_names,
        max(noise, FINEST_PRECISION), Known.of(truth.settings, plates=plates), truth.cell, side=truth.side,
        measured=measured, load=_normal_forces(truth, measured),
    )  # fmt: skip


def _normal_forces(truth: DemTruth, walls: tuple[str, ...]) -> Array:
    """Sums of the normal forces on walls (f, w) [N]."""
    frame = np.repeat(np.arange(truth.frame_count), np.diff(truth.offset))
    force = np.zeros((truth.frame_count, len(walls)))
    for w, name in enumerate(walls):
        on_it = truth.j == len(truth.radius) + truth.wall_names.index(name)
        np.add.at(force[:, w], frame[on_it], truth.fn[on_it])
    return force


def write_told(folder: Path, told: Told, truth: DemTruth, remark: str) -> None:
    """Write an experiment folder (there, and empty) with its whole truth."""
    files = experiment_files
    files.write_tracks(folder / "tracks.csv", told.id, told.position, told.rotation)
    files.write_grains(folder / "grains.csv", told.id, told.radius)
    files.write_times(folder / "times.csv", INTERVAL * np.arange(len(told.position), dtype=np.float64))
    truth = truth.frames(0, len(told.position))
    tables = ""
    if told.wall_names:
        tables = _write_walls(folder, told)
    else:
        truth = truth.without_walls()
    if told.cell is not None:
        files.write_cell(folder / "cell.csv", told.cell)
    if told.known.pressure:
        files.write_wall_forces(folder / "wall_forces.csv", truth)
    files.write_truth_contacts(folder / "truth_contacts.csv", truth)
    files.write_tracks(folder / "truth_tracks.csv", np.arange(len(truth.radius)), truth.position, truth.rotation)
    source = f"""[tracks]
positions = "tracks.csv"
grains = "grains.csv"
times = "times.csv"
precision = {told.precision:g}
"""
    # Last, so that a folder that was left unfinished is not an experiment.
    files.write_experiment(
        folder / "experiment.toml", name=folder.resolve().name, remark=remark, source=source, known=told.known,
        boundary=_boundary(told), walls=tables,
    )  # fmt: skip


def _boundary(told: Told) -> str:
    """What of the experiment file says what bounds the packing."""
    if told.cell is not None:
        return '[boundary]\nperiodic = "cell.csv"\n'
    return '[boundary]\ngrains = "outer"\n' if told.outer else ""


def _write_walls(folder: Path, told: Told) -> str:
    """Write the tables of the walls; what the experiment file says of them."""
    side, names, lines = all_sides(told.side, len(told.wall_names)), np.array(told.wall_names), []
    for straight in (True, False):
        which = np.flatnonzero((side == STRAIGHT) == straight)
        if not len(which):
            continue
        if straight:
            experiment_files.write_walls(folder / "walls.csv", names[which].tolist(), told.endpoints[:, which])
        else:
            experiment_files.write_arcs(
                folder / "arcs.csv", names[which].tolist(), told.endpoints[:, which], side[which]
            )
        lines.append('file = "walls.csv"\n' if straight else 'arcs = "arcs.csv"\n')
    if told.measured:
        experiment_files.write_loads(folder / "load.csv", told.measured, told.load)
        lines.append('load = "load.csv"\n')
    return "".join(lines)
