"""One frame: posed, estimated from what the one before left behind, judged and reported."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from solver.bodies.bridging import bridge_lost
from solver.bodies.motion import motion_from, motion_to, no_motion
from solver.contacts.verdicts import NO_VERDICTS, Verdicts
from solver.detection.refinement import RefinedBlock
from solver.detection.touch_probability import window_of
from solver.nlgs.warm_start import ForceMemory
from solver.sequence.estimate import Estimate, estimate_frame, mean_stress
from solver.sequence.frame_forces import FrameForces, FrameStatus
from solver.sequence.frame_problem import FrameProblem, SequenceProblem
from solver.sequence.frame_report import find_ages, report_frame
from solver.sequence.judging.changes import find_changes
from solver.sequence.judging.judgement import Evidence, Standing, judge
from solver.sequence.state import SequenceState
from solver.statistics.agreement import relative_change

EVENTFUL = (FrameStatus.RESET, FrameStatus.SUSPECT, FrameStatus.REARRANGING, FrameStatus.FAILED)


def pose_frame(
    sequence: SequenceProblem,
    k: int,
    state: SequenceState,
    refined: RefinedBlock | None = None,
    verdicts: Verdicts = NO_VERDICTS,
) -> FrameProblem:
    """Pose frame k as it follows the state; the first frame takes the motion that follows it.

    refined: the block that frame k belongs to; the ensemble needs it, None: a single chain.
    """
    snapshots = sequence.snapshots
    window = window_of(k, len(snapshots))
    snapshot, bridged = bridge_lost([snapshots[f] for f in window], k - window.start)
    if np.isfinite(state.time):
        motion = motion_to(snapshot, state.seen, state.time, state.endpoints, state.cell)
    else:
        motion = motion_from(snapshot, snapshots[k + 1]) if k + 1 < len(snapshots) else no_motion(snapshot)
    return FrameProblem(sequence, k, snapshot, bridged, motion, refined, verdicts)


def solve_frame(problem: FrameProblem, state: SequenceState) -> tuple[FrameForces, SequenceState]:
    """Solve a frame from the state that the frame before it left behind; gives the state after it."""
    if _reset_asked(problem):
        state = state.without_forces()
    estimate, evidence = estimate_frame(problem, state)
    standing = _judge_as_told(problem, evidence)
    if _goes_back_to_zero(problem, standing.status):
        carried = estimate
        estimate, renewed = estimate_frame(problem, state.without_forces())
        evidence = replace(renewed, old_unbalance=evidence.old_unbalance)
        standing = Standing(FrameStatus.RESET, f"{_cost_of_reset(carried, estimate)}: {standing.reason}")
    eventful = standing.status in EVENTFUL
    if problem.verdicts.ignored:  # no event of the packing: the frames after it do not settle anew
        told = "a reviewer had this photograph ignored: solved on positions between its neighbours; "
        standing = Standing(FrameStatus.SUSPECT, told + standing.reason)
    since_reset = 0 if standing.status is FrameStatus.RESET else state.frames_since_reset + 1
    ages = find_ages(estimate.contacts, state)
    frame, evidence = report_frame(problem, estimate, evidence, standing, ages)
    frame = _compare_with_former(problem, replace(frame, frames_since_reset=since_reset), state)
    pressure = mean_stress(problem, estimate) if problem.motion.spans else np.nan
    return frame, SequenceState(
        members=estimate.members,
        age_key=estimate.contacts.key,
        age=ages,
        seen=state.seen.renewed(problem.snapshot),
        time=problem.snapshot.time,
        endpoints=problem.snapshot.endpoints,
        cell=problem.snapshot.cell,
        pressure=pressure,
        sound_pressure=state.sound_pressure if standing.status is FrameStatus.SUSPECT else pressure,
        evidence=evidence,
        frames_since_reset=since_reset,
        frames_since_event=0 if eventful else state.frames_since_event + 1,
        reported=ForceMemory(frame.contacts.key, np.column_stack([frame.fn, frame.ft])),
    )


def _compare_with_former(problem: FrameProblem, frame: FrameForces, state: SequenceState) -> FrameForces:
    """Say how the frame differs from the one before; the first differs from nothing."""
    if not np.isfinite(state.time):
        return replace(frame, gained_count=0.0, parted_count=0.0)
    if state.frames_since_event == 0 and len(state.reported.key) == 0:
        return frame  # the frame before it failed
    changes = find_changes(state.reported, frame.contacts, frame.fn, problem.seen)
    return replace(frame, similarity=changes.similarity, gained_count=changes.gained, parted_count=changes.parted)


def _reset_asked(problem: FrameProblem) -> bool:
    return problem.verdicts.reset or problem.k in problem.settings.reset_frames


def _goes_back_to_zero(problem: FrameProblem, status: FrameStatus) -> bool:
    """The paper's reset, where it is asked for."""
    settings = problem.settings
    return status is FrameStatus.REARRANGING and settings.reset_to_zero and problem.k not in settings.kept_frames


def _judge_as_told(problem: FrameProblem, evidence: Evidence) -> Standing:
    """The status by the evidence, save where people know better."""
    status, why = judge(evidence)
    if problem.verdicts.rearrangement and status is not FrameStatus.RESET:
        status, why = FrameStatus.REARRANGING, "a reviewer saw a rearrangement here; " + why
    if _reset_asked(problem):
        who = "a reviewer" if problem.verdicts.reset else "the experiment"
        status, why = FrameStatus.RESET, f"{who} asked for a reset here; " + why
    return Standing(status, why)


def _cost_of_reset(carried: Estimate, anew: Estimate) -> str:
    change = 100.0 * relative_change(carried.contacts.key, carried.force, anew.contacts.key, anew.force)
    return f"reset to zero forces, as asked for at a rearrangement, which changed the forces by {change:.0f} %"
