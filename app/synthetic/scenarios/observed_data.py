"""The data that an experiment folder of a scenario holds: everything measured, correct or wrong."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...solver.bodies.grains import Array, Grains
from ...solver.bodies.wall_shapes import STRAIGHT, Sides, all_sides
from ...solver.dem.dem_truth import DemTruth
from ...solver.dem.simulation import RAMP
from .. import experiment_files
from ..experiment_files import FINEST_PRECISION, StatedInputs

INTERVAL = 52.0  # [s] between photographs, as at the real test's rate


@dataclass(frozen=True, slots=True)
class ObservedData:
    """Tracks, walls and the experiment file's numbers."""

    id: NDArray[np.int64]  # (n,)
    radius: Array  # (n,) [m]
    position: Array  # (f, n, 2) [m]
    rotation: Array | None  # (f, n) [rad], None: unknown
    endpoints: Array  # (f, w, 2, 2) [m]
    wall_names: tuple[str, ...]  # (w,)
    precision: float  # [m]
    known: StatedInputs
    cell: Array | None = None  # (f, 2, 2) [m] vectors of the periodic cell, in place of walls
    outer: bool = False  # the outermost grains are the boundary
    boundary: NDArray[np.int64] | None = None  # (b,) ids of grains that are the boundary beside the walls; None: none
    side: Sides = None  # (w,) which walls are circles; None: none
    measured: tuple[str, ...] = ()  # walls whose loads sensors measure
    load: Array = field(default_factory=lambda: np.empty((0, 0)))  # (f, loads) [N] on them
    shown: NDArray[np.int64] | None = None  # (f,) photographs of the truth in their stated order; None: as they are
    lost: NDArray[np.bool_] | None = None  # (f, n) poses without a row in the table; None: none
    interval: float = INTERVAL  # [s] between photographs


def observe_truth(
    truth: DemTruth,
    plates: tuple[str, ...],
    noise: float,
    rng: np.random.Generator,
    measured: tuple[str, ...] = (),
) -> ObservedData:
    """Measure a truth with Gaussian noise, without systematic error.

    Parameters
    ----------
    truth : DemTruth
    plates : tuple of str
        Walls under the simulation's pressure.
    noise : float
        Standard deviation of a position component [m]; that of a rotation is noise / radius [rad].
    rng : numpy.random.Generator
    measured : tuple of str
        Walls whose normal forces sensors measure.

    Returns
    -------
    ObservedData
    """
    position = truth.position + noise * rng.standard_normal(truth.position.shape)
    rotation = truth.rotation + noise / truth.radius * rng.standard_normal(truth.rotation.shape)
    return ObservedData(
        np.arange(len(truth.radius)), truth.radius, position, rotation, truth.endpoints, truth.wall_names,
        max(noise, FINEST_PRECISION), StatedInputs.of(truth.settings, plates=plates), truth.cell, side=truth.side,
        measured=measured, load=_normal_forces(truth, measured), interval=_interval_of(truth),
    )  # fmt: skip


def _interval_of(truth: DemTruth) -> float:
    """True time between photographs of a packing that is photographed while it moves [s]; at rest INTERVAL."""
    if not truth.settings.moving:
        return INTERVAL
    given = truth.settings
    mass = Grains.of_rods(truth.radius, density=given.density, length=given.length).mass.mean()
    rate = (1.0 - RAMP) * given.inertial_number / float(np.sqrt(mass / (given.pressure * given.length)))
    return float(np.abs(np.diff(truth.shear)).mean()) / rate


def _normal_forces(truth: DemTruth, walls: tuple[str, ...]) -> Array:
    """Sum the normal forces on walls (f, w) [N]."""
    frame = np.repeat(np.arange(truth.frame_count), np.diff(truth.offset))
    force = np.zeros((truth.frame_count, len(walls)))
    for w, name in enumerate(walls):
        on_it = truth.j == len(truth.radius) + truth.wall_names.index(name)
        np.add.at(force[:, w], frame[on_it], truth.fn[on_it])
    return force


def write_observed(folder: Path, observed: ObservedData, truth: DemTruth, remark: str) -> None:
    """Write an experiment with its truth into an existing, empty folder."""
    files = experiment_files
    files.write_tracks(folder / "tracks.csv", observed.id, observed.position, observed.rotation, observed.lost)
    files.write_grains(folder / "grains.csv", observed.id, observed.radius)
    files.write_times(folder / "times.csv", observed.interval * np.arange(len(observed.position), dtype=np.float64))
    truth = truth.frames(0, len(observed.position)) if observed.shown is None else truth.take(observed.shown)
    tables = ""
    if observed.wall_names:
        tables = _write_walls(folder, observed)
    else:
        truth = truth.without_walls()
    if observed.cell is not None:
        files.write_cell(folder / "cell.csv", observed.cell)
    if observed.boundary is not None:
        files.write_boundary(folder / "boundary.csv", observed.boundary)
    if observed.known.pressure:
        files.write_wall_forces(folder / "wall_forces.csv", truth)
    files.write_truth_contacts(folder / "truth_contacts.csv", truth)
    files.write_tracks(folder / "truth_tracks.csv", np.arange(len(truth.radius)), truth.position, truth.rotation)
    source = f"""[tracks]
positions = "tracks.csv"
grains = "grains.csv"
times = "times.csv"
precision = {observed.precision:g}
"""
    # Written last, so that an unfinished folder is not an experiment.
    files.write_experiment(
        folder / "experiment.toml", name=folder.resolve().name, remark=remark, source=source, known=observed.known,
        boundary=_boundary(observed), walls=tables,
    )  # fmt: skip


def _boundary(observed: ObservedData) -> str:
    """Return the [boundary] table of the experiment file, empty where walls alone are the boundary."""
    if observed.cell is not None:
        return '[boundary]\nperiodic = "cell.csv"\n'
    if observed.boundary is not None:
        return '[boundary]\ngrains = "boundary.csv"\n'
    return '[boundary]\ngrains = "outer"\n' if observed.outer else ""


def _write_walls(folder: Path, observed: ObservedData) -> str:
    """Write the tables of the walls; return the keys of [walls] that name them."""
    side, names, lines = all_sides(observed.side, len(observed.wall_names)), np.array(observed.wall_names), []
    for straight in (True, False):
        which = np.flatnonzero((side == STRAIGHT) == straight)
        if not len(which):
            continue
        if straight:
            experiment_files.write_walls(folder / "walls.csv", names[which].tolist(), observed.endpoints[:, which])
        else:
            experiment_files.write_arcs(
                folder / "arcs.csv", names[which].tolist(), observed.endpoints[:, which], side[which]
            )
        lines.append('file = "walls.csv"\n' if straight else 'arcs = "arcs.csv"\n')
    if observed.measured:
        experiment_files.write_loads(folder / "load.csv", observed.measured, observed.load)
        lines.append('load = "load.csv"\n')
    return "".join(lines)
