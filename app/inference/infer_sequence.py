"""The road from tracks to forces: correct the sequence, solve frame after frame, then use what all frames know.

`infer_sequence` is the only way from tracks to forces. The command, the Python interface, live following, robustness
studies and what-if analyses call it, so a number has one source.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from ..process.progress import Progress, no_progress
from ..results.hdf5.lazy_sequences import LazySequence
from ..results.results import Results
from ..solver.assessment.penalties import penalise_friction
from ..solver.assessment.statistic_intervals import widen_for_friction, with_sd
from ..solver.convex.friction_check import FrictionCheck
from ..solver.frame_forces import FrameForces, FrameStatus
from ..solver.parallel import prefetch
from ..solver.sequence.failure import describe_error, failed_frame
from ..solver.sequence.frames import solve_first_frame, solve_sequence
from ..solver.statistics.frame_statistics import ContactProbabilities, FrameStatistics, frame_statistics, no_statistics
from .corrected_sequence import CorrectedSequence
from .correction.correct_sequence import correct_sequence
from .correction.friction import check_sequence_friction
from .first_frame import estimate_first_frame
from .frame_store import FrameStore, MemoryStore, SolvedFrame
from .inputs import Inputs

FIRST_FRAME = "first photograph"  # stage in which the first frame is estimated from all others


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


def infer_sequence(
    inputs: Inputs,
    observer: InferenceObserver | None = None,
    store: FrameStore | None = None,
    *,
    complete: bool = True,
) -> Results:
    """Infer the contact forces of all frames from tracks.

    Parameters
    ----------
    inputs : Inputs
        Tracks, walls, material, settings, verdicts.
    observer : InferenceObserver, optional
        Receives the corrected sequence, every solved frame, and failures.
    store : FrameStore, optional
        Keeps solved frames; frames that it holds already are not solved again. Default: in memory.
    complete : bool
        Whether all photographs are there. Without it the estimate of the first frame from all others and the friction
        check are left out.

    Returns
    -------
    Results
        Without name and configuration. With a store on disk, frames are read when they are accessed.

    Raises
    ------
    UndeterminedError
        A requested friction coefficient or coordination number cannot be determined.
    """
    observer = InferenceObserver() if observer is None else observer
    store = MemoryStore() if store is None else store
    sequence = correct_sequence(inputs)
    observer.corrected(sequence)
    _solve_missing_frames(sequence, store, observer)
    frames, statistics = store.sequences(len(sequence.snapshots))
    unsolved = sequence.unsolved_results()
    if not complete or all(each.status is FrameStatus.FAILED for each in frames):
        return replace(unsolved, frames=frames, statistics=statistics)
    frames, statistics = _with_first_frame(sequence, frames, statistics, observer)
    check = check_sequence_friction(sequence, frames)
    count, measured = len(frames), sequence.friction_measured
    assessed = LazySequence(count, lambda k: penalise_friction(frames[k], check, measured=measured))
    widened = LazySequence(count, lambda k: _widen_statistics(sequence, statistics[k], assessed[k], check))
    return replace(unsolved, frames=assessed, statistics=widened, friction_check=check)


def _solve_missing_frames(sequence: CorrectedSequence, store: FrameStore, observer: InferenceObserver) -> None:
    """Solve the frames that the store lacks, each from the state of the one before it."""
    total = len(sequence.snapshots)
    done = min(store.finished(), total)
    span = sequence.settings.used_span
    states = [store.load(k).state for k in range(max(done - span, 0), done)]
    observer.restored(store, done)
    observer.progress("solving", done, total)
    if done == total:
        return
    solved = solve_sequence(
        sequence.packing, sequence.snapshots, sequence.settings,
        state=states[-1] if states else None, earlier=states[:-1], first=done, verdicts=sequence.verdicts,
        failed=sequence.failed, observer=partial(observer.failed, "solving"), ahead=True,
    )  # fmt: skip
    for forces, state in prefetch(solved, sequence.settings.workers):
        try:
            statistics = _summarise(sequence, forces)
        except MemoryError:  # no fault of the frame
            raise
        except Exception as error:
            observer.failed("statistics", forces.frame, error)
            n, w = sequence.packing.grains.count, len(sequence.packing.pressure)
            reason = f"its statistics could not be computed ({describe_error(error)})"
            members = sequence.settings.keep_members
            forces, statistics = failed_frame(forces.frame, reason, n, w, with_members=members), no_statistics(w)
        frame = SolvedFrame(_with_noise_remark(sequence, forces), statistics, state)
        store.save(frame)
        observer.solved(frame)
        observer.progress("solving", forces.frame + 1, total)


def _with_first_frame(
    sequence: CorrectedSequence,
    frames: Sequence[FrameForces],
    statistics: Sequence[FrameStatistics],
    observer: InferenceObserver,
) -> tuple[Sequence[FrameForces], Sequence[FrameStatistics]]:
    """Replace the first frame by its estimate from all frames; it stays as it was where that fails."""
    try:
        found = estimate_first_frame(sequence, frames)
        if found is None:
            return frames, statistics
        posterior, reason = found
        forces, _ = solve_first_frame(
            sequence.packing, sequence.snapshots, sequence.settings, posterior, reason,
            verdicts=sequence.verdicts, failed=sequence.failed,
        )  # fmt: skip
        forces = _limit_by_second(_with_noise_remark(sequence, forces), frames)
        summary = _summarise(sequence, forces)
    except MemoryError:  # no fault of the frame
        raise
    except Exception as error:
        observer.failed(FIRST_FRAME, 0, error)
        return frames, statistics
    return (
        LazySequence(len(frames), lambda k: forces if k == 0 else frames[k]),
        LazySequence(len(frames), lambda k: summary if k == 0 else statistics[k]),
    )


def _limit_by_second(forces: FrameForces, frames: Sequence[FrameForces]) -> FrameForces:
    """Limit the trust of the first frame to that of the second, whose motion is evidence against wrong input."""
    if len(frames) < 2 or not frames[1].trust < forces.trust:
        return forces
    second = frames[1]
    words = f"the next photograph has a trust of {second.trust:.2f}, and this one no motion of its own"
    return replace(
        forces, trust=second.trust, expected_correlation=min(forces.expected_correlation, second.expected_correlation),
        trust_penalties="; ".join(filter(None, (words, forces.trust_penalties))),
    )  # fmt: skip


def _with_noise_remark(sequence: CorrectedSequence, forces: FrameForces) -> FrameForces:
    """Report the measured noise of all frames with the first."""
    if forces.frame != 0 or not sequence.noise_remark:
        return forces
    return replace(forces, reason=f"{sequence.noise_remark}; {forces.reason}")


def _summarise(sequence: CorrectedSequence, forces: FrameForces) -> FrameStatistics:
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


def _widen_statistics(
    sequence: CorrectedSequence, statistics: FrameStatistics, assessed: FrameForces, check: FrictionCheck | None
) -> FrameStatistics:
    """Statistics after the friction check: with another coefficient other contacts slide."""
    if check is None or check.agrees or assessed.status is FrameStatus.FAILED:
        return statistics
    return widen_for_friction(_summarise(sequence, assessed), check.given, check.measured)
