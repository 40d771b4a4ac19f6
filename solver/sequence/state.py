"""State between frames: with it a sequence continues where it stopped, bit for bit."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..assessment.evidence import Evidence
from ..bodies.grains import Array
from ..bodies.motion import LastSeen
from ..bodies.packing import Packing
from ..contacts.pairs import Keys
from ..nlgs.force_memory import ForceMemory
from .ensemble import EnsembleState

NO_EVIDENCE = Evidence(True, np.nan, np.nan, np.nan, np.nan, np.nan, np.nan, 0.0, 0)


@dataclass(frozen=True, slots=True)
class SequenceState:
    """State after a frame."""

    members: EnsembleState
    age_key: Keys  # (m,) contacts of the last frame, ascending
    age: NDArray[np.int32]  # (m,) frames
    seen: LastSeen
    time: float  # [s] of the last frame
    endpoints: Array  # (w, 2, 2) [m] of the last frame
    pressure: float  # [Pa] mean stress of the last frame, NaN: none
    sound_pressure: float  # [Pa] of the last frame that was not suspect
    evidence: Evidence  # of the last frame
    frames_since_reset: int
    frames_since_event: int
    reported: ForceMemory  # forces reported of the last frame
    cell: Array | None = None  # (2, 2) [m] of the last frame
    overlap_unit: float = np.nan  # [m] overlap of soft grains per unit of force, where no load fixes it; NaN: none yet

    @classmethod
    def first(cls, packing: Packing) -> SequenceState:
        walls = len(packing.pressure)
        return cls(
            EnsembleState.first(), np.empty(0, np.int64), np.empty(0, np.int32), LastSeen.never(packing.grains.count),
            np.nan, np.full((walls, 2, 2), np.nan), np.nan, np.nan, NO_EVIDENCE, 0, 0, ForceMemory.empty(),
        )  # fmt: skip

    def with_history(self, earlier: SequenceState) -> SequenceState:
        """The state after the last frame, with members and motion continued from an earlier frame's state."""
        return replace(
            self, members=earlier.members, seen=earlier.seen, time=earlier.time, endpoints=earlier.endpoints,
            cell=earlier.cell,
        )  # fmt: skip

    def without_forces(self) -> SequenceState:
        """The same history of the motion without previous forces to start from."""
        return replace(self, members=EnsembleState.first())
