"""Sequence of frames: each is solved from the state of the previous one.

A frame that cannot be solved is reported as failed; the frames around it are solved.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..baselines.motion_free import overlap_balance
from ..bodies.grains import Array
from ..bodies.interpolation import interpolate_ignored_frames
from ..bodies.motion import Snapshot
from ..bodies.packing import Packing
from ..contacts.contacts import Contacts
from ..contacts.verdicts import NO_VERDICTS, Verdicts, find_ignored
from ..detection.displacement import find_reversals
from ..detection.precision import corrected_precision, describe_contradiction, measure_precision, scale_precision
from ..detection.refinement import BLOCK, RefinedBlock, block_of, refine
from ..detection.touch_probability import AHEAD
from ..frame_forces import FrameForces
from ..mixture.position_estimates import PositionEstimates
from ..parallel import prefetch
from ..posterior.frame_posterior import FramePosterior
from .failure import describe_error, failed_frame, find_fault, find_unseen, forget_forces
from .frame import pose_frame, solve_frame
from .frame_problem import SequenceProblem
from .settings import SequenceSettings
from .state import SequenceState


@dataclass(frozen=True, slots=True)
class SequencePart:
    """Frames to be solved: from the first on, as far as they are requested."""

    first: int = 0
    # After the frames before the first, in order: of as many as the span of the settings; empty: nothing is solved yet.
    states: Sequence[SequenceState] = ()
    whole: bool = False  # all will be requested, so that the next block can be prepared concurrently


def solve_sequence(
    packing: Packing,
    snapshots: Sequence[Snapshot],
    settings: SequenceSettings,
    part: SequencePart | None = None,
    *,
    verdicts: Mapping[int, Verdicts] | None = None,
    failed: Mapping[int, str] | None = None,
    observer: Callable[[int, Exception], None] | None = None,
) -> Iterator[tuple[FrameForces, SequenceState]]:
    """Solve frames one after the other.

    The motion that leads to a frame is that since the last solved frame. Where the settings read sliding over a span of
    m photographs, it is that since frame k − m, whose forces the frame continues, but not from before a reset or a
    reversal of the loading. No motion leads to frame 0: it is solved with the motion that follows it. After it a single
    chain starts from zero; the ensemble continues from the convex members' forces.

    Parameters
    ----------
    packing : Packing
    snapshots : sequence of Snapshot
        Of all frames, with ascending times.
    settings : SequenceSettings
    part : SequencePart, optional
        Frames to be solved; default: all, as far as they are requested.
    verdicts : mapping of int to Verdicts, optional
        Of reviewers, by frame.
    failed : mapping of int to str, optional
        Frames that are not to be solved, with the reason; unusable ones are added.
    observer : callable, optional
        Called with frame and exception where a frame cannot be solved.

    Yields
    ------
    FrameForces
    SequenceState
        After the frame.

    Raises
    ------
    ValueError
        Times do not ascend.
    """
    verdicts, part = {} if verdicts is None else verdicts, part or SequencePart()
    ready = _prepare(packing, snapshots, settings, verdicts, failed)
    history = _History(ready.sequence, [*part.states] or [SequenceState.first(packing)])
    blocks = _Blocks(ready.sequence, ahead=part.whole)
    for k in range(part.first, len(snapshots)):
        frame = following = None
        state = history.before(k)
        reason = ready.failed.get(k, "")
        if not reason:
            try:
                problem = pose_frame(ready.sequence, k, state, blocks.find(k), verdicts.get(k, NO_VERDICTS))
                frame, following = solve_frame(problem, state)
                reason = find_fault(frame)
            except MemoryError:  # no fault of the frame
                raise
            except Exception as error:
                reason = f"it could not be solved ({describe_error(error)})"
                if observer is not None:
                    observer(k, error)
        if frame is None or following is None or reason:
            n, w = packing.grains.count, len(packing.pressure)
            frame = failed_frame(k, reason, n, w, with_members=settings.keep_members)
            following = forget_forces(history.last)
        if ready.remark and k == 0:
            frame = replace(frame, reason=f"{ready.remark}; {frame.reason}")
        history.add(following)
        yield frame, following


def solve_first_frame(
    packing: Packing,
    snapshots: Sequence[Snapshot],
    settings: SequenceSettings,
    positions: FramePosterior,
    why: str,
    *,
    verdicts: Mapping[int, Verdicts] | None = None,
    failed: Mapping[int, str] | None = None,
) -> tuple[FrameForces, SequenceState]:
    """Solve frame 0 with a given posterior in place of its position-only estimate; why: becomes part of its reason.

    Parameters as of `solve_sequence`. Raises whatever makes the frame unsolvable.
    """
    verdicts = {} if verdicts is None else verdicts
    ready = _prepare(packing, snapshots, settings, verdicts, failed, {0: positions})
    refined = _Blocks(ready.sequence).find_first()
    problem = pose_frame(ready.sequence, 0, SequenceState.first(packing), refined, verdicts.get(0, NO_VERDICTS))
    frame, state = solve_frame(problem, SequenceState.first(packing))
    reasons = [ready.remark, why, frame.reason]
    return replace(frame, reason="; ".join(each for each in reasons if each)), state


@dataclass(frozen=True, slots=True)
class _Ready:
    """A sequence ready to be solved."""

    sequence: SequenceProblem
    failed: Mapping[int, str]
    remark: str


def _prepare(
    packing: Packing,
    snapshots: Sequence[Snapshot],
    settings: SequenceSettings,
    verdicts: Mapping[int, Verdicts],
    failed: Mapping[int, str] | None,
    posteriors: Mapping[int, FramePosterior] | None = None,
) -> _Ready:
    """Interpolate unusable frames and measure the precision; posteriors: given instead of position-only estimates."""
    _check_times(snapshots)
    failed = find_unseen(snapshots) | dict(failed or {})
    settings, remark = settings.for_radii(packing.grains.radius), ""
    known = int(np.any([each.present for each in snapshots], axis=0).sum()) if snapshots else 0
    excluded = find_ignored(verdicts) | failed.keys()
    if excluded.issuperset(range(len(snapshots))):
        failed = dict.fromkeys(range(len(snapshots)), "no frame is usable beside it") | failed
    else:
        snapshots = interpolate_ignored_frames(snapshots, excluded)
        snapshots, settings, remark = _with_measured_precision(packing, snapshots, settings)
    positions = balance = None
    if settings.uses_positions and len(snapshots) > 1:
        positions = PositionEstimates(
            packing, snapshots, settings.posterior, settings.workers, posteriors, alike=settings.alike,
            alone=settings.soft and all(each.fringes is None for each in snapshots),
        )  # fmt: skip
        assert settings.overlap is not None
        # Photographs alike request that of the same frame.
        balance = lru_cache(maxsize=1)(partial(_balance_overlaps, packing, snapshots, settings.overlap))
    sequence = SequenceProblem(
        packing, snapshots, settings, packing.inferred, positions, balance, known, _find_reversals(snapshots, settings)
    )
    return _Ready(sequence, failed, remark)


def _balance_overlaps(
    packing: Packing, snapshots: Sequence[Snapshot], overlap: float, k: int
) -> tuple[Contacts, Array]:
    """Balance the overlaps of frame k; overlap [m]: typical one, surfaces are no smoother than that."""
    return overlap_balance(packing.at_frame(snapshots, k), snapshots, k, float(np.hypot(snapshots[k].sigma, overlap)))


def _find_reversals(snapshots: Sequence[Snapshot], settings: SequenceSettings) -> NDArray[np.bool_] | None:
    if not snapshots or settings.estimator != "ensemble":
        return None
    position = np.stack([np.where(s.present[:, None], s.position, np.nan) for s in snapshots])
    bounds = np.stack([s.endpoints if s.cell is None else s.cell[None] for s in snapshots])
    return find_reversals(bounds, position)


class _History:
    """The states after the last frames, from which the next ones continue."""

    def __init__(self, sequence: SequenceProblem, states: Sequence[SequenceState]) -> None:
        span = sequence.settings.used_span
        reversed_at = sequence.reversed_at
        self._reversals = np.empty(0, np.intp) if reversed_at is None else np.flatnonzero(reversed_at)
        self._states = deque(states[-span:], maxlen=span)

    @property
    def last(self) -> SequenceState:
        """The state after the last frame."""
        return self._states[-1]

    def add(self, state: SequenceState) -> None:
        """Add the state after the next frame."""
        self._states.append(state)

    def before(self, k: int) -> SequenceState:
        """Return the state from which frame k continues: forces and motion of the frame where its interval begins."""
        last = self.last
        reversals = self._reversals[self._reversals < k]
        earliest = max(
            k - len(self._states), k - 1 - last.frames_since_reset, int(reversals[-1]) if len(reversals) else 0
        )
        begin = self._states[min(earliest, k - 1) - k]
        return last if begin is last else last.with_history(begin)


def _check_times(snapshots: Sequence[Snapshot]) -> None:
    for before, after in pairwise(snapshots):
        if not after.time > before.time:
            raise ValueError(f"the time of a frame ({after.time} s) is not after that of the previous frame")


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
        number, _, _ = block_of(k, len(snapshots), self._sequence.settings.used_span)
        if number != self._number:
            if self._number is None or number != self._number + 1:
                self._coming = prefetch(self._refine_from(k), self._workers)
            self._number = None  # until it is there: where it cannot be made, the next frame tries again
            self._block, self._number = next(self._coming), number
        return self._block

    def _refine_from(self, k: int) -> Iterator[RefinedBlock]:
        """Refine the block of frame k, and those after it."""
        count = len(self._sequence.snapshots)
        for first in range(k, count, BLOCK):
            _, start, end = block_of(first, count, self._sequence.settings.used_span)
            yield self._refine(start, end)

    def find_first(self) -> RefinedBlock | None:
        """Refine the window that frame 0 depends on."""
        if self._sequence.settings.estimator != "ensemble" or len(self._sequence.snapshots) < 2:
            return None
        return self._refine(0, max(AHEAD, 2 * self._sequence.settings.used_span) + 1)

    def _refine(self, start: int, end: int) -> RefinedBlock:
        probability = self._sequence.settings.ensemble.probability
        return refine(self._sequence.packing.grains, self._sequence.snapshots[start:end], probability, start=start)


def _with_measured_precision(
    packing: Packing, snapshots: Sequence[Snapshot], settings: SequenceSettings
) -> tuple[Sequence[Snapshot], SequenceSettings, str]:
    """Replace the stated precision by the measured one where they contradict; returns a remark."""
    found = measure_precision(packing.grains, snapshots) if settings.measure_precision else None
    if found is None:
        return snapshots, settings, ""
    assert settings.overlap is not None
    factor, overlap = corrected_precision(found, [each.sigma for each in snapshots], settings.overlap)
    if settings.estimator == "nlgs":  # its only protection from constant errors is the threshold
        factor = max(factor, 1.0)
    remark = ""
    if factor != 1.0:
        remark = describe_contradiction(found, factor)
        snapshots = scale_precision(snapshots, factor)
    if settings.measure_overlap:
        ensemble = settings.ensemble
        probability = replace(ensemble.probability, overlap=overlap)
        settings = replace(settings, ensemble=replace(ensemble, probability=probability))
    return snapshots, settings, remark
