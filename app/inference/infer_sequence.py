"""The road from tracks to forces: correct the sequence, solve frame after frame, then use what all frames know.

`infer_sequence` is the only way from tracks to forces. The command, the Python interface, live following, robustness
studies and what-if analyses call it, so a number has one source.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..process.machine.free_memory import release_free_memory
from ..process.machine.linear_algebra import one_thread_each
from ..results.finding import Finding
from ..results.hdf5.lazy_sequences import LazySequence
from ..results.results import Results
from ..solver.assessment.fringe_pressures import FringePressures, compare_with_fringes
from ..solver.assessment.intervals.force_intervals import widen_scale
from ..solver.assessment.intervals.scale_sd import FIRST_BY_SECOND
from ..solver.assessment.intervals.statistic_intervals import widen_for_friction
from ..solver.assessment.intervals.wall_sensors import scale_error
from ..solver.assessment.penalties import (
    limit_by_intervals,
    limit_for_few_photographs,
    limit_for_missing_load,
    penalise_contradiction,
    penalise_friction,
)
from ..solver.assessment.reasons import join_reasons
from ..solver.bodies.motion import Snapshot
from ..solver.convex.friction_check import FrictionCheck
from ..solver.frame_forces import FrameForces, FrameStatus
from ..solver.kinematics.sequence_kinematics import SequenceKinematics, measure_kinematics
from ..solver.sequence.frames import solve_first_frame
from ..solver.statistics.frame_statistics import FrameStatistics
from .assumption_trials import correct_by_trial
from .corrected_sequence import CorrectedSequence
from .correction.correct_sequence import correct_sequence
from .correction.friction import check_sequence_friction
from .correction.hard_grain_errors import correct_hard_grains
from .diagnosis.causes import uncorrected
from .diagnosis.diagnose import diagnose_solved
from .diagnosis.smoothed_tracks import find_smoothing, limit_for_smoothing
from .first_frame import estimate_first_frame
from .frame_store import FrameStore, MemoryStore
from .inputs import Inputs
from .solve_frames import InferenceObserver, solve_frames, summarise_frame, with_remarks

FIRST_FRAME = "first photograph"  # stage in which the first frame is estimated from all others


@one_thread_each
def infer_sequence(
    inputs: Inputs,
    observer: InferenceObserver | None = None,
    store: FrameStore | None = None,
    *,
    complete: bool = True,
    diagnosis: Sequence[Finding] | None = None,
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
        Whether all photographs are there. Without it the trials of assumptions, the errors of hard rods by forces, the
        estimate of the first frame from all others, the friction check and the diagnosis are left out.
    diagnosis : sequence of Finding, optional
        Causes of wrong forces that are known; None: they are sought.

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
    beginning = None
    if complete:
        inputs, sequence = correct_by_trial(inputs, observer.progress)
        sequence, beginning = correct_hard_grains(sequence, observer)
    else:
        sequence = correct_sequence(inputs)
    release_free_memory()  # of equations of all photographs
    observer.corrected(sequence)
    solve_frames(sequence, store, observer, beginning)
    frames, statistics = store.sequences(len(sequence.snapshots))
    unsolved = replace(
        sequence.unsolved_results(), base_friction=sequence.packing.material.base_drag / sequence.base_gravity
    )
    if not complete or all(each.status is FrameStatus.FAILED for each in frames):
        return replace(unsolved, frames=frames, statistics=statistics)
    frames, statistics = _with_first_frame(sequence, frames, statistics, observer)
    check = check_sequence_friction(sequence, frames)
    count, measured = len(frames), sequence.friction_measured
    smoothed = find_smoothing(inputs.tracks) is not None

    ratio = replace(unsolved, frames=frames, statistics=statistics).wall_force_ratio()

    def assess(k: int) -> FrameForces:
        frame = limit_by_intervals(penalise_friction(frames[k], check, measured=measured))
        frame = limit_for_few_photographs(frame, count)
        contradicted = scale_error(ratio, frame.scale_sd)
        frame = widen_scale(frame, contradicted) if contradicted else frame
        return limit_for_smoothing(frame) if smoothed else frame

    assessed = LazySequence(count, assess)
    widened = _widen_statistics(sequence, statistics, assessed, check)
    kinematics = _measure_kinematics(sequence)
    results = replace(
        unsolved,
        frames=assessed,
        statistics=widened,
        friction_check=check,
        read_kinematics=lambda: kinematics,
        fringes=_compare_with_fringes(sequence, assessed),
    )
    if diagnosis is None:
        release_free_memory()
        diagnosis = diagnose_solved(inputs, results, observer.progress, undisturbed=sequence.undisturbed)
    words = "; ".join(f"{each.cause.replace('_', ' ')}: {each.cure}" for each in uncorrected(diagnosis))
    loaded = all(each.cause != "load_missing" for each in diagnosis)

    def penalise(k: int) -> FrameForces:
        frame = penalise_contradiction(assessed[k], words)
        return frame if loaded else limit_for_missing_load(frame)

    penalised = LazySequence(count, penalise) if words else assessed
    return replace(results, diagnosis=tuple(diagnosis), frames=penalised)


def _measure_kinematics(sequence: CorrectedSequence) -> SequenceKinematics | None:
    """Measure the motion of the corrected tracks; grains that are not present are not seen."""
    tracks = sequence.tracks
    position = np.where(tracks.present[..., None], tracks.position, np.nan)
    return measure_kinematics(position, tracks.rotation, tracks.radius, tracks.sigma, sequence.walls.cell)


def _compare_with_fringes(sequence: CorrectedSequence, frames: Sequence[FrameForces]) -> FringePressures | None:
    """Compare the forces with the fringes of the discs that need to be in equilibrium; None without fringes."""
    tracks = sequence.tracks
    if tracks.fringes is None:
        return None
    used = tracks.present if tracks.boundary is None else tracks.present & ~tracks.boundary
    return compare_with_fringes(tracks.fringes, used, frames)


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
            sequence.packing, _at_rest(sequence.snapshots), sequence.settings, posterior, reason,
            verdicts=sequence.verdicts, failed=sequence.failed,
        )  # fmt: skip
        fringed = sequence.tracks.fringes is not None  # they determine the scale of every frame by themselves
        if sequence.settings.soft and not sequence.packing.scale_is_known and not fringed:
            forces = _on_scale_of(frames[0], forces)
        forces = _widen_by_second(_limit_by_second(with_remarks(sequence, forces), frames), frames)
        summary = summarise_frame(sequence, forces)
    except MemoryError:  # no fault of the frame
        raise
    except Exception as error:
        observer.failed(FIRST_FRAME, 0, error)
        return frames, statistics
    return (
        LazySequence(len(frames), lambda k: forces if k == 0 else frames[k]),
        LazySequence(len(frames), lambda k: summary if k == 0 else statistics[k]),
    )


def _at_rest(snapshots: Sequence[Snapshot]) -> Sequence[Snapshot]:
    """A single photograph as two of the same packing at rest, so that its positions count; others as they are."""
    if len(snapshots) != 1:
        return snapshots
    only = snapshots[0]
    return only, replace(only, time=only.time + 1.0)


def _on_scale_of(former: FrameForces, forces: FrameForces) -> FrameForces:
    """The estimate of a frame on the scale of its former estimate, to which the forces of later frames refer."""
    ratio = forces.overlap / former.overlap if former.overlap > 0.0 else np.nan
    return forces.scaled(ratio) if ratio > 0.0 else forces


def _limit_by_second(forces: FrameForces, frames: Sequence[FrameForces]) -> FrameForces:
    """Limit the trust of the first frame to that of the second, whose motion is evidence against wrong input."""
    if len(frames) < 2 or not frames[1].trust < forces.trust:
        return forces
    second = frames[1]
    words = f"the next photograph has a trust of {second.trust:.2f}, and this one no motion of its own"
    return replace(
        forces, trust=second.trust, expected_correlation=min(forces.expected_correlation, second.expected_correlation),
        trust_penalties=join_reasons(words, forces.trust_penalties),
    )  # fmt: skip


def _widen_by_second(forces: FrameForces, frames: Sequence[FrameForces]) -> FrameForces:
    """Add the uncertain scale of the second frame to that of the first."""
    uncertain = FIRST_BY_SECOND * frames[1].scale_sd if len(frames) > 1 else np.nan
    return widen_scale(forces, uncertain) if np.isfinite([uncertain, forces.scale_sd]).all() else forces


def _widen_statistics(
    sequence: CorrectedSequence,
    statistics: Sequence[FrameStatistics],
    assessed: Sequence[FrameForces],
    check: FrictionCheck | None,
) -> Sequence[FrameStatistics]:
    """Statistics after the friction check: with another coefficient other contacts slide."""
    if check is None or check.agrees:
        return statistics

    def widen(k: int) -> FrameStatistics:
        frame = assessed[k]
        if frame.status is FrameStatus.FAILED:
            return statistics[k]
        return widen_for_friction(summarise_frame(sequence, frame), check.given, check.measured)

    return LazySequence(len(statistics), widen)
