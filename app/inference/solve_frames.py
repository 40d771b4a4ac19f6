"""Solution of the frames of a corrected sequence, one after the other, into a store."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain, islice

import numpy as np

from ..process.counts import state_count
from ..process.progress import Progress, no_progress
from ..solver.assessment.intervals.statistic_intervals import with_sd
from ..solver.contacts.contacts import ContactSource
from ..solver.frame_forces import FrameForces, FrameStatus
from ..solver.parallel import prefetch
from ..solver.sequence.failure import describe_error, failed_frame
from ..solver.sequence.frames import SequencePart, solve_sequence
from ..solver.statistics.frame_statistics import ContactProbabilities, FrameStatistics, frame_statistics, no_statistics
from ..tracks import TrackStatus
from .corrected_sequence import CorrectedSequence
from .frame_store import FrameStore, SolvedFrame

MANY_UNRELIABLE = 0.1  # fraction of the poses of a photograph that is reported


class InferenceObserver:
    """Receives the events of an inference; the default ignores all of them."""

    def __init__(self, progress: Progress = no_progress) -> None:
        self.progress = progress  # called after every frame of stage "solving"

    def corrected(self, sequence: CorrectedSequence) -> None:
        """The sequence is corrected and will be solved."""

    def solved(self, frame: SolvedFrame) -> None:
        """A frame is solved and stored."""

    def restored(self, store: FrameStore, count: int) -> None:
        """The first `count` frames are in the store and are not solved again."""

    def failed(self, stage: str, frame: int, error: Exception) -> None:
        """A frame failed in a stage; the others continue."""


@dataclass(frozen=True, slots=True)
class Beginning:
    """The first frames of a sequence, solved to judge it, and the others, which are solved as they are read."""

    frames: tuple[SolvedFrame, ...]
    others: Iterator[SolvedFrame]


def solve_beginning(sequence: CorrectedSequence, count: int, observer: InferenceObserver | None = None) -> Beginning:
    """Solve up to `count` first frames as `solve_frames` does, which may continue with the others."""
    solved = _solve(sequence, SequencePart(whole=True), InferenceObserver() if observer is None else observer)
    return Beginning(tuple(islice(solved, count)), solved)


def solve_frames(
    sequence: CorrectedSequence, store: FrameStore, observer: InferenceObserver, beginning: Beginning | None = None
) -> None:
    """Solve the frames that the store lacks, each from the state of the one before it.

    Parameters
    ----------
    sequence : CorrectedSequence
    store : FrameStore
    observer : InferenceObserver
    beginning : Beginning, optional
        Of the same sequence; an empty store receives its frames.
    """
    total = len(sequence.snapshots)
    done = min(store.finished(), total)
    observer.restored(store, done)
    observer.progress("solving", done, total)
    if done == total:
        return
    if done == 0 and beginning is not None:
        solved = chain(beginning.frames, beginning.others)
    else:
        span = sequence.settings.used_span
        states = [store.load(k).state for k in range(max(done - span, 0), done)]
        solved = _solve(sequence, SequencePart(done, states, whole=True), observer)
    for frame in solved:
        store.save(frame)
        observer.solved(frame)
        observer.progress("solving", frame.forces.frame + 1, total)


def _solve(sequence: CorrectedSequence, part: SequencePart, observer: InferenceObserver) -> Iterator[SolvedFrame]:
    """Solve frames one after the other, with their statistics."""
    solved = solve_sequence(
        sequence.packing, sequence.snapshots, sequence.settings, part,
        verdicts=sequence.verdicts, failed=sequence.failed, observer=partial(observer.failed, "solving"),
    )  # fmt: skip
    for forces, state in prefetch(solved, sequence.settings.workers):
        try:
            statistics = summarise_frame(sequence, forces)
        except MemoryError:  # no fault of the frame
            raise
        except Exception as error:
            observer.failed("statistics", forces.frame, error)
            n, w = sequence.packing.grains.count, len(sequence.packing.pressure)
            reason = f"its statistics could not be computed ({describe_error(error)})"
            members = sequence.settings.keep_members
            forces, statistics = failed_frame(forces.frame, reason, n, w, with_members=members), no_statistics(w)
        yield SolvedFrame(with_remarks(sequence, forces), statistics, state)


def with_remarks(sequence: CorrectedSequence, forces: FrameForces) -> FrameForces:
    """Report corrections of all frames with the first, unreliable poses, and which contacts have interpolated rods."""
    tracks = sequence.tracks.frame(forces.frame)
    if forces.frame == 0 and sequence.remark:
        forces = replace(forces, reason=f"{sequence.remark}; {forces.reason}")
    unreliable, shown = int((tracks.status == TrackStatus.SUSPECT).sum()), int(tracks.present.sum())
    if unreliable > MANY_UNRELIABLE * shown:
        words = f"{unreliable} of {shown} poses are unreliable: the photograph may be blurred, dark or covered"
        forces = replace(forces, reason=f"{words}; {forces.reason}")
    interpolated = tracks.interpolated[0]
    if not interpolated.any():
        return forces
    contacts, padded = forces.contacts, np.append(interpolated, False)
    theirs = padded[contacts.i] | padded[np.minimum(contacts.j, len(interpolated))]
    theirs &= forces.source == ContactSource.DETECTED
    source = np.where(theirs, np.uint8(ContactSource.INTERPOLATED), forces.source)
    return replace(
        forces,
        source=source,
        reason=f"{state_count(int(interpolated.sum()), 'lost rod')} interpolated; {forces.reason}",
    )


def summarise_frame(sequence: CorrectedSequence, forces: FrameForces) -> FrameStatistics:
    """Compute the statistics of a solved frame, with their standard deviations."""
    packing, snapshot = sequence.packing, sequence.snapshots[forces.frame]
    if forces.status is FrameStatus.FAILED:
        return no_statistics(len(packing.pressure))
    assert forces.bearing_probability is not None
    assert forces.sliding_probability is not None
    statistics = frame_statistics(
        forces.contacts, forces.fn, forces.ft,
        ContactProbabilities(forces.bearing_probability, forces.sliding_probability), snapshot, packing,
    )  # fmt: skip
    return with_sd(statistics, forces, scale_is_known=packing.scale_is_known, moved=forces.frame > 0)
