"""Frames in order: each is solved from what the one before it left behind, and judged."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from solver.chain import ChainSettings, ChainStep, Packing, advance_chain
from solver.contacts import Contacts
from solver.frame_forces import ContactSource, ContactState, FrameForces, FrameStatus
from solver.grains import Array
from solver.judgement import Evidence, free_standard_deviation, is_suspect, judge, trust
from solver.kinematics import relative_motion
from solver.network import NearPairs
from solver.motion import FrameMotion, LastSeen, Snapshot, motion_from, motion_to, no_motion, shear_over
from solver.stress import love_weber_stress, packing_area
from solver.warm_start import ForceMemory

WIDER = 1.5  # threshold of the second attempt at a suspect frame
SLIDING_TOLERANCE = 1e-6  # of μ f_n


@dataclass(frozen=True, slots=True)
class SequenceSettings:
    chain: ChainSettings = field(default_factory=ChainSettings)
    threshold_sigmas: float = 6.0  # gap threshold in standard deviations of a position
    threshold: float | None = None  # [m], instead of threshold_sigmas
    reset_to_zero: bool = False  # the paper's reset at a rearrangement


@dataclass(frozen=True, slots=True)
class SequenceState:
    """What one frame hands to the next: with it a sequence goes on where it stopped, bit for bit."""

    memory: ForceMemory
    age_key: NDArray[np.int64]  # (m,) contacts of the last frame, ascending
    age: NDArray[np.int32]  # (m,) frames
    seen: LastSeen
    time: float  # [s] of the last frame
    endpoints: Array  # (w, 2, 2) [m] of the last frame
    pressure: float  # [Pa] mean stress of the last frame, NaN: none
    frames_since_reset: int
    frames_since_event: int

    @classmethod
    def first(cls, packing: Packing) -> SequenceState:
        walls = len(packing.pressure)
        return cls(
            ForceMemory.empty(), np.empty(0, np.int64), np.empty(0, np.int32), LastSeen.never(packing.grains.count),
            np.nan, np.full((walls, 2, 2), np.nan), np.nan, 0, 0,
        )  # fmt: skip


def solve_sequence(
    packing: Packing,
    snapshots: Sequence[Snapshot],
    settings: SequenceSettings,
    *,
    state: SequenceState | None = None,
    first: int = 0,
) -> Iterator[tuple[FrameForces, SequenceState]]:
    """Solve the frames first, first + 1, … one after the other; yields each frame with the state after it.

    The motion that leads to a frame is that since the frame before. Nothing leads to frame 0: it takes the motion
    that follows it, and the frame after it starts afresh.
    """
    state = SequenceState.first(packing) if state is None else state
    for k in range(first, len(snapshots)):
        following = snapshots[k + 1] if k == 0 and len(snapshots) > 1 else None
        frame, state = solve_frame(packing, k, snapshots[k], state, settings, following=following)
        yield frame, state


def solve_frame(
    packing: Packing,
    k: int,
    snapshot: Snapshot,
    state: SequenceState,
    settings: SequenceSettings,
    *,
    following: Snapshot | None = None,
) -> tuple[FrameForces, SequenceState]:
    """Solve frame k from the state that the frame before it left behind."""
    if np.isfinite(state.time):
        motion = motion_to(snapshot, state.seen, state.time, state.endpoints)
    else:
        motion = motion_from(snapshot, following) if following is not None else no_motion(snapshot)
    threshold = settings.threshold_sigmas * snapshot.sigma if settings.threshold is None else settings.threshold
    memory = state.memory
    step = advance_chain(packing, motion, memory, settings.chain, NearPairs(threshold))
    evidence = _evidence(packing, motion, step, state, memory)
    remark = ""
    if is_suspect(evidence):
        wider = advance_chain(packing, motion, memory, settings.chain, NearPairs(WIDER * threshold))
        wider_evidence = _evidence(packing, motion, wider, state, memory)
        if wider_evidence.correction < evidence.correction:
            step, evidence = wider, wider_evidence
            remark = f"solved again with a gap threshold {WIDER} times as wide; "
    status, why = judge(evidence)
    if not motion.spans:
        why = "no motion leads to the first frame: its forces are a guess, and their trust is not assessed"
    if status is FrameStatus.REARRANGING and settings.reset_to_zero:
        memory = ForceMemory.empty()
        step = advance_chain(packing, motion, memory, settings.chain, NearPairs(threshold))
        evidence = replace(_evidence(packing, motion, step, state, memory), old_unbalance=evidence.old_unbalance)
        status, why = FrameStatus.RESET, "reset to zero forces, as asked for at a rearrangement: " + why
    eventful = status in (FrameStatus.RESET, FrameStatus.SUSPECT, FrameStatus.REARRANGING, FrameStatus.FAILED)
    since_reset = 0 if status is FrameStatus.RESET else state.frames_since_reset + 1
    age = _age(step.contacts, state)
    frame = _describe(packing, k, motion, step, evidence, status, f"{remark}{why}", since_reset, age)
    return frame, SequenceState(
        memory=step.memory if motion.spans else ForceMemory.empty(),
        age_key=step.contacts.key,
        age=age,
        seen=state.seen.renewed(snapshot),
        time=snapshot.time,
        endpoints=snapshot.endpoints,
        pressure=_pressure(packing, motion, step) if motion.spans else np.nan,
        frames_since_reset=since_reset,
        frames_since_event=0 if eventful else state.frames_since_event + 1,
    )


def _evidence(
    packing: Packing, motion: FrameMotion, step: ChainStep, state: SequenceState, memory: ForceMemory
) -> Evidence:
    pressure = _pressure(packing, motion, step)
    jump = abs(pressure - state.pressure) / state.pressure if state.pressure > 0 else np.nan
    return Evidence(
        reset=len(memory.key) == 0,
        correction=step.solution.mean_unbalance / step.kappa,
        old_unbalance=step.old_unbalance,
        pressure_jump=jump,
        shear=shear_over(motion),
        frames_since_event=state.frames_since_event + 1,
    )


def _pressure(packing: Packing, motion: FrameMotion, step: ChainStep) -> float:
    position = motion.grains.position
    area = packing_area(step.walls, position[motion.grains.present])
    stress = love_weber_stress(step.contacts, step.solution.fn, step.solution.ft, position, area, packing.length)
    return 0.5 * float(np.trace(stress))


def _age(contacts: Contacts, state: SequenceState) -> NDArray[np.int32]:
    age = np.zeros(contacts.count, np.int32)
    _, here, there = np.intersect1d(contacts.key, state.age_key, assume_unique=True, return_indices=True)
    age[here] = state.age[there] + 1
    return age


def contact_state(packing: Packing, contacts: Contacts, fn: Array, ft: Array) -> NDArray[np.uint8]:
    """ContactState of forces (c,) [N]."""
    friction = np.where(contacts.with_wall, packing.material.wall_friction, packing.material.friction)
    state = np.full(contacts.count, ContactState.STICKING, np.uint8)
    state[np.abs(ft) >= friction * fn * (1.0 - SLIDING_TOLERANCE)] = ContactState.SLIDING
    state[fn <= 0] = ContactState.OPEN
    return state


def _describe(
    packing: Packing,
    k: int,
    motion: FrameMotion,
    step: ChainStep,
    evidence: Evidence,
    status: FrameStatus,
    why: str,
    since_reset: int,
    age: NDArray[np.int32],
) -> FrameForces:
    contacts, fn, ft = step.contacts, step.solution.fn, step.solution.ft
    un, ut = relative_motion(contacts, packing.grains.radius, motion.grains.velocity, motion.grains.spin, step.walls)
    return FrameForces(
        frame=k,
        contacts=contacts,
        fn=fn,
        ft=ft,
        nlgs_fn=fn,
        nlgs_ft=ft,
        un=un,
        ut=ut,
        state=contact_state(packing, contacts, fn, ft),
        age=age,
        source=np.full(contacts.count, ContactSource.DETECTED, np.uint8),
        probability=np.full(contacts.count, np.nan),
        fn_sd=free_standard_deviation(fn),
        ft_sd=packing.material.friction * free_standard_deviation(fn),
        status=status,
        reason=f"{why}; {step.solution.stop.value}",
        sweeps=step.sweeps,
        natural_map=step.solution.natural_map,
        unbalance=step.solution.unbalance,
        kappa=step.kappa,
        correction=evidence.correction,
        old_unbalance=evidence.old_unbalance,
        trust=trust(evidence.correction) if motion.spans else np.nan,
        frames_since_reset=since_reset,
        history=step.history,
    )
