"""One frame: its problem, its estimate from the state of the previous frame, its status and report."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..assessment.changes import find_changes
from ..assessment.evidence import Evidence
from ..assessment.status import StatusDecision, decide_status
from ..bodies.interpolation import interpolate_lost_grains
from ..bodies.motion import motion_from, motion_to, no_motion
from ..contacts.verdicts import NO_VERDICTS, Verdicts
from ..detection.refinement import RefinedBlock
from ..detection.touch_probability import window_of
from ..frame_forces import FrameForces, FrameStatus
from ..nlgs.force_memory import ForceMemory
from ..statistics.agreement import relative_change
from ..statistics.force_statistics import mean_normal_force
from .estimate import Estimate, estimate_frame, load_scale, mean_stress
from .frame_problem import FrameProblem, SequenceProblem
from .frame_report import find_ages, report_frame
from .state import SequenceState

EVENTFUL = (FrameStatus.RESET, FrameStatus.SUSPECT, FrameStatus.REARRANGING, FrameStatus.FAILED)


def pose_frame(
    sequence: SequenceProblem,
    k: int,
    state: SequenceState,
    refined: RefinedBlock | None = None,
    verdicts: Verdicts = NO_VERDICTS,
) -> FrameProblem:
    """Set up frame k after a state; for the first frame, with the motion that follows it.

    refined: the block that frame k belongs to, needed by the ensemble; None: a single chain.
    """
    snapshots = sequence.snapshots
    window = window_of(k, len(snapshots))
    sequence = replace(sequence, packing=sequence.packing.at_frame(snapshots, k))
    snapshot, bridged = interpolate_lost_grains([snapshots[f] for f in window], k - window.start)
    if np.isfinite(state.time):
        motion = motion_to(snapshot, state.seen, state.time, state.endpoints, state.cell)
    else:
        motion = motion_from(snapshot, snapshots[k + 1]) if k + 1 < len(snapshots) else no_motion(snapshot)
    walls = sequence.packing.walls_of(snapshot)
    return FrameProblem(sequence, k, snapshot, bridged, motion, walls, refined, verdicts)


def solve_frame(problem: FrameProblem, state: SequenceState) -> tuple[FrameForces, SequenceState]:
    """Solve a frame from the state of the previous frame; returns its report and the state after it."""
    if _reset_requested(problem):
        state = state.without_forces()
    estimate, evidence = estimate_frame(problem, state)
    decision = _decide_with_verdicts(problem, evidence)
    if _resets_to_zero(problem, decision.status):
        carried = estimate
        estimate, updated = estimate_frame(problem, state.without_forces())
        evidence = replace(updated, old_unbalance=evidence.old_unbalance)
        decision = StatusDecision(FrameStatus.RESET, f"{_cost_of_reset(carried, estimate)}: {decision.reason}")
    eventful = decision.status in EVENTFUL
    if problem.verdicts.ignored:  # no event of the packing: the frames after it are settled
        remark = "a reviewer excluded this photograph: solved on positions between its neighbours; "
        decision = StatusDecision(FrameStatus.SUSPECT, remark + decision.reason)
    since_reset = 0 if decision.status is FrameStatus.RESET else state.frames_since_reset + 1
    ages = find_ages(estimate.contacts, state)
    frame, evidence = report_frame(problem, estimate, evidence, decision, ages)
    frame = _compare_with_former(problem, replace(frame, frames_since_reset=since_reset), state)
    mean = mean_normal_force(frame.fn)
    if problem.scale_is_open and mean > 0.0:  # that of the chain differs from frame to frame without a cause
        frame = frame.scaled(1.0 / mean)
    elif (factor := load_scale(problem, estimate)) != 1.0:
        frame = frame.scaled(factor)
    pressure = mean_stress(problem, estimate) if problem.motion.ends_here else np.nan
    return frame, SequenceState(
        members=estimate.members,
        age_key=estimate.contacts.key,
        age=ages,
        seen=state.seen.updated(problem.snapshot),
        time=problem.snapshot.time,
        endpoints=problem.snapshot.endpoints,
        cell=problem.snapshot.cell,
        pressure=pressure,
        sound_pressure=state.sound_pressure if decision.status is FrameStatus.SUSPECT else pressure,
        evidence=evidence,
        frames_since_reset=since_reset,
        frames_since_event=0 if eventful else state.frames_since_event + 1,
        reported=ForceMemory(frame.contacts.key, np.column_stack([frame.fn, frame.ft])),
        overlap_unit=state.overlap_unit if np.isfinite(state.overlap_unit) else _overlap_unit(problem, estimate),
    )


def _overlap_unit(problem: FrameProblem, estimate: Estimate) -> float:
    """Overlap [m] per unit of force of the first frame that shows one, to which later frames are scaled; NaN: none."""
    return estimate.overlap if problem.follows_overlap and estimate.overlap > 0.0 else np.nan


def _compare_with_former(problem: FrameProblem, frame: FrameForces, state: SequenceState) -> FrameForces:
    """Add the changes since the previous frame, if there is one."""
    if not np.isfinite(state.time):
        return replace(frame, new_contact_count=0.0, lost_contact_count=0.0)
    if state.frames_since_event == 0 and len(state.reported.key) == 0:
        return frame  # the previous frame failed
    changes = find_changes(state.reported, frame.contacts, frame.fn, problem.seen)
    return replace(frame, similarity=changes.similarity, new_contact_count=changes.new, lost_contact_count=changes.lost)


def _reset_requested(problem: FrameProblem) -> bool:
    """Whether a reviewer or the experiment requests a reset here."""
    return problem.verdicts.reset or problem.k in problem.settings.reset_frames


def _resets_to_zero(problem: FrameProblem, status: FrameStatus) -> bool:
    """Whether the paper's reset is requested here."""
    settings = problem.settings
    return status is FrameStatus.REARRANGING and settings.reset_to_zero and problem.k not in settings.kept_frames


def _decide_with_verdicts(problem: FrameProblem, evidence: Evidence) -> StatusDecision:
    """Decide the status from the evidence and the reviewers' verdicts."""
    status, why = decide_status(evidence)
    if problem.verdicts.rearrangement and status is not FrameStatus.RESET:
        status, why = FrameStatus.REARRANGING, "a reviewer saw a rearrangement here; " + why
    if _reset_requested(problem):
        who = "a reviewer" if problem.verdicts.reset else "the experiment"
        status, why = FrameStatus.RESET, f"{who} requested a reset here; " + why
    return StatusDecision(status, why)


def _cost_of_reset(carried: Estimate, anew: Estimate) -> str:
    change = 100.0 * relative_change(carried.contacts.key, carried.force, anew.contacts.key, anew.force)
    return f"reset to zero forces, as requested at a rearrangement, which changed the forces by {change:.0f} %"
