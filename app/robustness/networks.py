"""Inputs of the runs of a study, and solved sequences reduced to the quantities that are compared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..inference.infer_sequence import infer_sequence
from ..inference.inputs import Inputs
from ..results.finding import Finding
from ..solver.bodies.grains import Array
from ..solver.frame_forces import FrameForces
from ..solver.statistics.frame_statistics import FrameStatistics


@dataclass(frozen=True, slots=True, kw_only=True)
class VariedInputs(Inputs):
    """Inputs of a run of a study, before calibration."""

    noise: Array  # (f, n) [m] best estimate of the standard deviation of positions
    frames: NDArray[np.int64]  # (f,) these photographs in the nominal run
    diagnosis: tuple[Finding, ...] = ()  # of the nominal run

    @classmethod
    def of(cls, given: Inputs, noise: Array, diagnosis: tuple[Finding, ...] = ()) -> VariedInputs:
        """Given inputs without variation; noise (f, n) [m]; causes of wrong forces that the nominal run named."""
        frames = np.arange(given.tracks.frame_count)
        return cls(
            given.tracks, given.walls, given.material, given.settings, given.verdicts, noise=noise, frames=frames,
            diagnosis=diagnosis,
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Networks:
    """Forces of f photographs, concatenated: the contacts of row k are offset[k] : offset[k + 1]."""

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
    """Reduce a solved sequence; frame (f,): its photographs in the nominal run."""
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


def infer(inputs: VariedInputs) -> Networks:
    """Infer the forces of varied inputs with the settings of a run; what the nominal run named holds for them, too."""
    results = infer_sequence(replace(inputs, settings=inputs.settings.without_sweeps()), diagnosis=inputs.diagnosis)
    return gather(inputs.frames, list(results.frames), list(results.statistics))
