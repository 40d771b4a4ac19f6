"""Stores of solved frames: in memory, or one file each in the folder of a run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

from ..results.checkpoint import Checkpoint
from ..solver.frame_forces import FrameForces
from ..solver.sequence.state import SequenceState
from ..solver.statistics.frame_statistics import FrameStatistics


@dataclass(frozen=True, slots=True)
class SolvedFrame:
    """Forces and statistics of one frame, and the state that the next frame starts from."""

    forces: FrameForces
    statistics: FrameStatistics
    state: SequenceState


class FrameStore(Protocol):
    """Solved frames, from which an interrupted sequence continues bit for bit."""

    def finished(self) -> int:
        """Number of frames that are stored, from the first on."""
        ...

    def save(self, frame: SolvedFrame) -> None:
        """Store a frame; they come in order."""
        ...

    def load(self, frame: int) -> SolvedFrame:
        """Read a stored frame with its state."""
        ...

    def sequences(self, count: int) -> tuple[Sequence[FrameForces], Sequence[FrameStatistics]]:
        """Forces and statistics of the first `count` frames."""
        ...


@dataclass(slots=True)
class MemoryStore:
    """Solved frames in memory."""

    frames: list[SolvedFrame] = field(default_factory=list)

    def finished(self) -> int:
        return len(self.frames)

    def save(self, frame: SolvedFrame) -> None:
        self.frames.append(frame)

    def load(self, frame: int) -> SolvedFrame:
        return self.frames[frame]

    def sequences(self, count: int) -> tuple[Sequence[FrameForces], Sequence[FrameStatistics]]:
        return [each.forces for each in self.frames[:count]], [each.statistics for each in self.frames[:count]]


@dataclass(frozen=True)
class CheckpointStore:
    """Solved frames on disk, one file each; they are read when they are accessed.

    open_checkpoint : called at the first access, so that nothing is written before the input proved usable.
    """

    open_checkpoint: Callable[[], Checkpoint]

    @cached_property
    def checkpoint(self) -> Checkpoint:
        return self.open_checkpoint()

    def finished(self) -> int:
        return self.checkpoint.finished()

    def save(self, frame: SolvedFrame) -> None:
        self.checkpoint.save(frame.forces.frame, frame.forces, frame.statistics, frame.state)

    def load(self, frame: int) -> SolvedFrame:
        return SolvedFrame(*self.checkpoint.load(frame, FrameForces, FrameStatistics, SequenceState))

    def sequences(self, count: int) -> tuple[Sequence[FrameForces], Sequence[FrameStatistics]]:
        frames, statistics = self.checkpoint.lazy_sequences(count, FrameForces, FrameStatistics)
        return frames, statistics
