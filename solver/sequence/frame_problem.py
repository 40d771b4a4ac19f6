"""One frame to be solved: positions of the bodies, the motion that leads there, contacts and verdicts given."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..bodies.grains import Array
from ..bodies.motion import FrameMotion, Snapshot
from ..bodies.packing import Packing
from ..bodies.walls import Walls
from ..contacts.contacts import Contacts
from ..contacts.verdicts import NO_VERDICTS, Verdicts
from ..detection.refinement import RefinedBlock
from ..mixture.position_estimates import PositionEstimates
from .settings import SequenceSettings


@dataclass(frozen=True, slots=True)
class SequenceProblem:
    """A whole sequence: data that all frames share."""

    packing: Packing
    snapshots: Sequence[Snapshot]
    settings: SequenceSettings
    inferred: int = 0  # grains that no photograph shows
    positions: PositionEstimates | None = None  # position-only estimates; None: not used
    # Balance of the overlaps of a frame, on its contacts; None: positions are not used.
    overlap_balance: Callable[[int], tuple[Contacts, Array]] | None = None
    known: int = 0  # grains that any frame shows
    reversed_at: NDArray[np.bool_] | None = None  # (f,) whether the loading reverses there; None: not examined


@dataclass(frozen=True, slots=True)
class FrameProblem:
    """One frame of a sequence."""

    sequence: SequenceProblem
    k: int  # which frame
    snapshot: Snapshot  # of the frame, with stand-ins for lost grains
    bridged: NDArray[np.bool_]  # (n,) which grains only stand in
    motion: FrameMotion  # that leads to the frame
    walls: Walls  # at the frame, at rest and under their loads
    refined: RefinedBlock | None = None  # that the frame belongs to; None: solved by a single chain
    verdicts: Verdicts = NO_VERDICTS  # on the frame

    @property
    def packing(self) -> Packing:
        return self.sequence.packing

    @property
    def settings(self) -> SequenceSettings:
        return self.sequence.settings

    @property
    def follows_overlap(self) -> bool:
        """Whether only the overlaps of soft grains show how the scale of the forces changes from frame to frame."""
        return self.settings.soft and not self.packing.scale_is_known

    @property
    def scale_is_open(self) -> bool:
        """Whether nothing shows the scale of the forces, nor how it changes from frame to frame."""
        return not (self.packing.scale_is_known or self.settings.soft or self.snapshot.fringes is not None)

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Which grains the photograph shows (n,)."""
        return self.sequence.snapshots[self.k].present

    @property
    def intervals_read(self) -> float:
        """Intervals between photographs that the motion covers."""
        if self.settings.used_span == 1 or self.k == 0:
            return 1.0  # the motion since the last solved frame, whether frames between them failed or not
        return self.motion.interval / (self.snapshot.time - self.sequence.snapshots[self.k - 1].time)
