"""One sequence solved from given inputs, reduced to the forces and the few numbers that are compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.contacts.verdicts import Verdicts
from solver.sequence.frame_forces import FrameForces
from solver.sequence.frames import solve_sequence
from solver.statistics.frame_statistics import FrameStatistics

from ..experiment.experiment import Experiment
from ..tracks import Tracks, WallTracks
from .preparation import prepare
from .solver_input import make_snapshots, sequence_settings


@dataclass(frozen=True, slots=True)
class Inputs:
    """What a run starts from, before calibration."""

    experiment: Experiment
    tracks: Tracks
    walls: WallTracks
    noise: Array  # (f, n) [m] standard deviation that positions really have, as far as is known
    frames: NDArray[np.int64]  # (f,) which photographs of the nominal run these are
    verdicts: Mapping[int, Verdicts]  # by row of frames


@dataclass(frozen=True, slots=True)
class Networks:
    """Forces of f photographs, contacts laid end to end: those of row k are offset[k] : offset[k + 1]."""

    frame: NDArray[np.int64]  # (f,) photographs of the nominal run
    offset: NDArray[np.int64]  # (f + 1,)
    key: NDArray[np.int64]  # (c,) of the pair, ascending within a photograph
    force: Array  # (c, 2) [N] f_n and f_t
    friction_angle: Array  # (f,) [rad]
    principal_direction: Array  # (f,) [rad] in (−π/2, π/2]
    pressure: Array  # (f,) [Pa]
    contact_count: NDArray[np.int64]  # (f,) carrying force
    trust: Array  # (f,)

    def at(self, row: int) -> tuple[NDArray[np.int64], Array]:
        """Keys (c,) and forces (c, 2) [N] of one photograph."""
        part = slice(self.offset[row], self.offset[row + 1])
        return self.key[part], self.force[part]


def gather(frame: NDArray[np.int64], forces: Sequence[FrameForces], statistics: Sequence[FrameStatistics]) -> Networks:
    """Reduce a solved sequence; frame (f,): the photographs it shows."""
    return Networks(
        frame=frame,
        offset=np.concatenate([[0], np.cumsum([each.contacts.count for each in forces])]).astype(np.int64),
        key=np.concatenate([each.contacts.key for each in forces]),
        force=np.concatenate([np.column_stack([each.fn, each.ft]) for each in forces]),
        friction_angle=np.array([each.friction_angle for each in statistics]),
        principal_direction=np.array([each.principal_direction for each in statistics]),
        pressure=np.array([each.pressure for each in statistics]),
        contact_count=np.array([each.contact_count for each in statistics], np.int64),
        trust=np.array([each.trust for each in forces]),
    )


def infer(inputs: Inputs) -> Networks:
    """Calibrate, find contacts and solve, as a run does."""
    return gather(inputs.frames, *infer_frames(inputs))


def infer_frames(inputs: Inputs) -> tuple[list[FrameForces], list[FrameStatistics]]:
    """The same, with everything that is known of every photograph but the sweeps' forces."""
    prepared = prepare(inputs.experiment, inputs.tracks, inputs.walls)
    settings = sequence_settings(inputs.experiment.config, prepared.overlap)
    settings = replace(settings, chain=replace(settings.chain, keep="none"))
    snapshots = make_snapshots(prepared.tracks, prepared.walls)
    frames, statistics = [], []
    for forces, _ in solve_sequence(prepared.packing, snapshots, settings, verdicts=inputs.verdicts):
        frames.append(forces)
        statistics.append(prepared.statistics(forces, snapshots[forces.frame]))
    return frames, statistics
