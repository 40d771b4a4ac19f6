"""Frames in order: each is solved from what the one before it left behind, and judged.

Whatever goes wrong in one frame, the frames around it are solved: it is reported as failed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from solver.bodies.bridging import bridge_frames
from solver.bodies.motion import Snapshot
from solver.bodies.packing import Packing
from solver.contacts.verdicts import NO_VERDICTS, Verdicts, find_ignored
from solver.detection.precision import believed_precision, describe_contradiction, measure_precision, with_precision
from solver.detection.refinement import BLOCK, RefinedBlock, block_of, refine
from solver.detection.touch_probability import AHEAD
from solver.mixture.positions import Positions
from solver.posterior.frame_posterior import FramePosterior
from solver.sequence.failure import describe_error, failed_frame, find_fault, find_unseen, forget_forces
from solver.sequence.frame import pose_frame, solve_frame
from solver.sequence.frame_forces import FrameForces
from solver.sequence.frame_problem import SequenceProblem
from solver.sequence.settings import SequenceSettings
from solver.sequence.state import SequenceState
from solver.together import one_ahead


def solve_sequence(
    packing: Packing,
    snapshots: Sequence[Snapshot],
    settings: SequenceSettings,
    *,
    state: SequenceState | None = None,
    first: int = 0,
    verdicts: Mapping[int, Verdicts] | None = None,
    failed: Mapping[int, str] | None = None,
    observer: Callable[[int, Exception], None] | None = None,
    ahead: bool = False,
) -> Iterator[tuple[FrameForces, SequenceState]]:
    """Solve the frames first, first + 1, … one after the other; yields each frame with the state after it.

    The motion that leads to a frame is that since the last frame that was solved. Nothing leads to frame 0: it takes
    the motion that follows it. After it a single chain starts afresh, the ensemble from what its convex members read
    of frame 0.
    verdicts: what people said of frames, by frame. failed: frames that are not to be solved, and why; others that
    show nothing, or cannot be solved, join them. observer: hears what a frame could not be solved for. ahead: all
    frames will be asked for, so that what the next ones share is prepared meanwhile.
    Raises ValueError where times do not ascend.
    """
    verdicts = {} if verdicts is None else verdicts
    ready = _prepare(packing, snapshots, settings, verdicts, failed)
    state = SequenceState.first(packing) if state is None else state
    blocks = _Blocks(ready.sequence, ahead=ahead)
    for k in range(first, len(snapshots)):
        frame = following = None
        reason = ready.failed.get(k, "")
        if not reason:
            try:
                problem = pose_frame(ready.sequence, k, state, blocks.find(k), verdicts.get(k, NO_VERDICTS))
                frame, following = solve_frame(problem, state)
                reason = find_fault(frame)
            except MemoryError:  # not the frame's fault
                raise
            except Exception as error:
                reason = f"it could not be solved ({describe_error(error)})"
                if observer is not None:
                    observer(k, error)
        if frame is None or following is None or reason:
            n, w = packing.grains.count, len(packing.pressure)
            frame = failed_frame(k, reason, n, w, with_members=settings.keep_members)
            following = forget_forces(state)
        if ready.remark and k == 0:
            frame = replace(frame, reason=f"{ready.remark}; {frame.reason}")
        state = following
        yield frame, state


def solve_first_again(
    packing: Packing,
    snapshots: Sequence[Snapshot],
    settings: SequenceSettings,
    positions: FramePosterior,
    why: str,
    *,
    verdicts: Mapping[int, Verdicts] | None = None,
    failed: Mapping[int, str] | None = None,
) -> tuple[FrameForces, SequenceState]:
    """Solve frame 0 once more, with what is told of it now that the frames after it are known; why: its reason says.

    Arguments as of `solve_sequence`. Raises what a frame raises that cannot be solved.
    """
    verdicts = {} if verdicts is None else verdicts
    ready = _prepare(packing, snapshots, settings, verdicts, failed, {0: positions})
    refined = _Blocks(ready.sequence).find_first()
    problem = pose_frame(ready.sequence, 0, SequenceState.first(packing), refined, verdicts.get(0, NO_VERDICTS))
    frame, state = solve_frame(problem, SequenceState.first(packing))
    told = [ready.remark, why, frame.reason]
    return replace(frame, reason="; ".join(each for each in told if each)), state


@dataclass(frozen=True, slots=True)
class _Ready:
    """A sequence that is ready to be solved."""

    sequence: SequenceProblem
    failed: Mapping[int, str]
    remark: str


def _prepare(
    packing: Packing,
    snapshots: Sequence[Snapshot],
    settings: SequenceSettings,
    verdicts: Mapping[int, Verdicts],
    failed: Mapping[int, str] | None,
    told: Mapping[int, FramePosterior] | None = None,
) -> _Ready:
    """Bridge what cannot be believed, measure the precision; told: what the positions of some frames say already."""
    _check_times(snapshots)
    failed = find_unseen(snapshots) | dict(failed or {})
    settings, remark = settings.for_radii(packing.grains.radius), ""
    known = int(np.any([each.present for each in snapshots], axis=0).sum()) if snapshots else 0
    unbelieved = find_ignored(verdicts) | failed.keys()
    if unbelieved.issuperset(range(len(snapshots))):
        failed = dict.fromkeys(range(len(snapshots)), "no frame is believed that it could be solved beside") | failed
    else:
        snapshots = bridge_frames(snapshots, unbelieved)
        snapshots, settings, remark = _with_measured_precision(packing, snapshots, settings)
    asked = settings.asks_positions and len(snapshots) > 1
    positions = None
    if asked:
        positions = Positions(
            packing, snapshots, settings.posterior, settings.workers, told, first_again=settings.first_again
        )
    return _Ready(SequenceProblem(packing, snapshots, settings, packing.inferred, positions, known), failed, remark)


def _check_times(snapshots: Sequence[Snapshot]) -> None:
    for before, after in pairwise(snapshots):
        if not after.time > before.time:
            raise ValueError(f"the time of a frame ({after.time} s) is not after that of the frame before it")


class _Blocks:
    """The blocks of frames that are refined together; ahead: each while the frames of the one before it are solved."""

    def __init__(self, sequence: SequenceProblem, *, ahead: bool = False) -> None:
        self._sequence = sequence
        self._workers = sequence.settings.workers if ahead else 1
        self._coming: Iterator[RefinedBlock] = iter(())
        self._number: int | None = None  # of the block that is there
        self._block: RefinedBlock | None = None

    def find(self, k: int) -> RefinedBlock | None:
        """The block that frame k belongs to; None where a single chain solves it."""
        snapshots = self._sequence.snapshots
        if self._sequence.settings.estimator != "ensemble" or len(snapshots) < 2:
            return None
        number, _, _ = block_of(k, len(snapshots))
        if number != self._number:
            if self._number is None or number != self._number + 1:
                self._coming = one_ahead(self._refine_from(k), self._workers)
            self._number = None  # until it is there: where it cannot be made, the next frame tries again
            self._block, self._number = next(self._coming), number
        return self._block

    def _refine_from(self, k: int) -> Iterator[RefinedBlock]:
        """Refine the block of frame k, and those after it."""
        count = len(self._sequence.snapshots)
        for first in range(k, count, BLOCK):
            _, start, end = block_of(first, count)
            yield self._refine(start, end)

    def find_first(self) -> RefinedBlock | None:
        """What frame 0 alone is solved from: the window after it, for the rest of its block tells it nothing more."""
        if self._sequence.settings.estimator != "ensemble" or len(self._sequence.snapshots) < 2:
            return None
        return self._refine(0, AHEAD + 1)

    def _refine(self, start: int, end: int) -> RefinedBlock:
        probability = self._sequence.settings.ensemble.probability
        return refine(self._sequence.packing.grains, self._sequence.snapshots[start:end], probability, start=start)


def _with_measured_precision(
    packing: Packing, snapshots: Sequence[Snapshot], settings: SequenceSettings
) -> tuple[Sequence[Snapshot], SequenceSettings, str]:
    """Put what the gaps say of the precision in the place of what is stated, and say so."""
    found = measure_precision(packing.grains, snapshots) if settings.measure_precision else None
    if found is None:
        return snapshots, settings, ""
    assert settings.overlap is not None
    factor, overlap = believed_precision(found, [each.sigma for each in snapshots], settings.overlap)
    if settings.estimator == "nlgs":  # its threshold is all that it has against errors that stay
        factor = max(factor, 1.0)
    remark = ""
    if factor != 1.0:
        remark = describe_contradiction(found, factor)
        snapshots = with_precision(snapshots, factor)
    if settings.measure_overlap:
        ensemble = settings.ensemble
        probability = replace(ensemble.probability, overlap=overlap)
        settings = replace(settings, ensemble=replace(ensemble, probability=probability))
    return snapshots, settings, remark
