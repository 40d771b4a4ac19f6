"""Frames in order: each is solved from what the one before it left behind, and judged."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from solver.bodies.bridging import bridge_lost
from solver.bodies.grains import Array
from solver.bodies.holes import find_holes
from solver.bodies.motion import FrameMotion, LastSeen, Snapshot, motion_from, motion_to, no_motion, shear_over
from solver.bodies.packing import Packing
from solver.contacts.contacts import Contacts, ContactState, detect_contacts
from solver.contacts.kinematics import relative_motion
from solver.contacts.pairs import are_among, recall
from solver.contacts.verdicts import NO_VERDICTS, Verdicts, sources, without_ignored
from solver.detection.networks import NearPairs
from solver.detection.precision import believed_precision, measure_precision, with_precision
from solver.detection.refinement import RefinedBlock, block_of, refine
from solver.detection.touch_probability import window_of
from solver.nlgs.chain import ChainSettings, ChainStep, advance_chain
from solver.nlgs.warm_start import ForceMemory
from solver.sequence.ensemble import EnsembleSettings, EnsembleState, solve_ensemble
from solver.sequence.frame_forces import FrameForces, FrameStatus
from solver.sequence.frame_report import show_forbidden, without_bridged
from solver.sequence.judgement import (
    Evidence,
    free_standard_deviation,
    is_suspect,
    judge,
    tangential_standard_deviation,
    trust,
)
from solver.statistics.agreement import relative_change
from solver.statistics.balance import worst_unbalance
from solver.statistics.stress import love_weber_stress, packing_area

NOTHING_KNOWN = Evidence(True, np.nan, np.nan, np.nan, np.nan, np.nan, np.nan, 0.0, 0)
NEGLIGIBLE_KAPPA = 1e-5  # below it measured motion has no influence on the forces
WIDER = 1.5  # threshold of the second attempt at a suspect frame
SLIDING_TOLERANCE = 1e-6  # of μ f_n


@dataclass(frozen=True, slots=True)
class SequenceSettings:
    estimator: Literal["ensemble", "nlgs"] = "ensemble"
    chain: ChainSettings = field(default_factory=ChainSettings)  # nlgs: the estimator; ensemble: its first member
    ensemble: EnsembleSettings = field(default_factory=EnsembleSettings)
    keep_members: bool = False  # ensemble: keep the field of every member
    measure_precision: bool = True  # from the gaps, where they contradict what is stated
    measure_overlap: bool = True  # likewise
    overlap: float = 0.0  # [m] typical overlap or roughness of touching surfaces
    threshold_sigmas: float = 6.0  # nlgs: gap threshold in standard deviations of a position, overlap included
    threshold: float | None = None  # [m], instead of threshold_sigmas
    reset_to_zero: bool = False  # the paper's reset at a rearrangement
    reset_frames: frozenset[int] = frozenset()  # frames that start from zero forces whatever is found
    kept_frames: frozenset[int] = frozenset()  # frames that never do


@dataclass(frozen=True, slots=True)
class SequenceState:
    """What one frame hands to the next: with it a sequence goes on where it stopped, bit for bit."""

    members: EnsembleState
    age_key: NDArray[np.int64]  # (m,) contacts of the last frame, ascending
    age: NDArray[np.int32]  # (m,) frames
    seen: LastSeen
    time: float  # [s] of the last frame
    endpoints: Array  # (w, 2, 2) [m] of the last frame
    pressure: float  # [Pa] mean stress of the last frame, NaN: none
    sound_pressure: float  # [Pa] of the last frame that was not suspect
    evidence: Evidence  # what the last frame was judged by
    frames_since_reset: int
    frames_since_event: int

    @classmethod
    def first(cls, packing: Packing) -> SequenceState:
        walls = len(packing.pressure)
        return cls(
            EnsembleState.first(), np.empty(0, np.int64), np.empty(0, np.int32), LastSeen.never(packing.grains.count),
            np.nan, np.full((walls, 2, 2), np.nan), np.nan, np.nan, NOTHING_KNOWN, 0, 0,
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Estimate:
    """One attempt at a frame: the chain, and the field to be reported on its contacts."""

    step: ChainStep
    fn: Array  # (c,) [N]
    ft: Array  # (c,) [N]
    probability: Array  # (c,), NaN where not computed
    members: EnsembleState
    forbidden: Contacts  # detected, but left out for people forbade them
    forbidden_probability: Array  # (m,)
    remark: str = ""
    spread_fn: Array | None = None  # (c,) [N] among the members, None of a single chain
    spread_ft: Array | None = None  # (c,) [N]
    member_force: Array | None = None  # (c, m, 2) [N]
    start_difference: float = np.nan  # H

    @property
    def force(self) -> Array:
        return np.column_stack([self.fn, self.ft])


def solve_sequence(
    packing: Packing,
    snapshots: Sequence[Snapshot],
    settings: SequenceSettings,
    *,
    state: SequenceState | None = None,
    first: int = 0,
    verdicts: Mapping[int, Verdicts] | None = None,
) -> Iterator[tuple[FrameForces, SequenceState]]:
    """Solve the frames first, first + 1, … one after the other; yields each frame with the state after it.

    The motion that leads to a frame is that since the frame before. Nothing leads to frame 0: it takes the motion
    that follows it. After it a single chain starts afresh, the ensemble from what its convex members read of frame 0.
    verdicts: what people said of frames, by frame.
    """
    state = SequenceState.first(packing) if state is None else state
    verdicts = {} if verdicts is None else verdicts
    snapshots = without_ignored(snapshots, verdicts)
    snapshots, settings, remark = _with_measured_precision(packing, snapshots, settings)
    refined, number = None, -1
    for k in range(first, len(snapshots)):
        if settings.estimator == "ensemble" and len(snapshots) > 1 and block_of(k, len(snapshots))[0] != number:
            number, start, end = block_of(k, len(snapshots))
            refined = refine(packing.grains, snapshots[start:end], settings.ensemble.probability, start=start)
        frame, state = solve_frame(packing, snapshots, k, state, settings, refined, verdicts.get(k, NO_VERDICTS))
        if remark and k == 0:
            frame = replace(frame, reason=f"{remark}; {frame.reason}")
        yield frame, state


def _with_measured_precision(
    packing: Packing, snapshots: Sequence[Snapshot], settings: SequenceSettings
) -> tuple[Sequence[Snapshot], SequenceSettings, str]:
    """Put what the gaps say of the precision in the place of what is stated, and say so."""
    found = measure_precision(packing.grains, snapshots) if settings.measure_precision else None
    if found is None:
        return snapshots, settings, ""
    factor, overlap = believed_precision(found, [each.sigma for each in snapshots], settings.overlap)
    if settings.estimator == "nlgs":  # its threshold is all that it has against errors that stay
        factor = max(factor, 1.0)
    remark = ""
    if factor != 1.0:
        told = f"{1e6 * found.sigma:.2g} µm from photograph to photograph, {factor:.2g} times the stated precision"
        remark = f"positions scatter by {told}, as the gaps of touching rods show"
        snapshots = with_precision(snapshots, factor)
    if settings.measure_overlap:
        ensemble = settings.ensemble
        probability = replace(ensemble.probability, overlap=overlap)
        settings = replace(settings, ensemble=replace(ensemble, probability=probability))
    return snapshots, settings, remark


def solve_frame(
    packing: Packing,
    snapshots: Sequence[Snapshot],
    k: int,
    state: SequenceState,
    settings: SequenceSettings,
    refined: RefinedBlock | None = None,
    verdicts: Verdicts = NO_VERDICTS,
) -> tuple[FrameForces, SequenceState]:
    """Solve frame k from the state that the frame before it left behind.

    refined: the block that frame k belongs to; the ensemble needs it, None: a single chain.
    """
    asked = verdicts.reset or k in settings.reset_frames
    if asked:
        state = replace(state, members=EnsembleState.first())
    window = window_of(k, len(snapshots))
    snapshot, bridged = bridge_lost([snapshots[f] for f in window], k - window.start)
    if np.isfinite(state.time):
        motion = motion_to(snapshot, state.seen, state.time, state.endpoints)
    else:
        motion = motion_from(snapshot, snapshots[k + 1]) if k + 1 < len(snapshots) else no_motion(snapshot)

    def estimate_from(former: SequenceState) -> tuple[_Estimate, Evidence]:
        if refined is not None:
            return _estimate_by_ensemble(packing, snapshots, k, snapshot, motion, former, settings, refined, verdicts)
        return _estimate_by_chain(packing, snapshot, motion, former, settings, verdicts)

    estimate, evidence = estimate_from(state)
    status, why = judge(evidence)
    if not motion.spans:
        why = "no motion leads to the first frame: its forces are a guess, and their trust is not assessed"
    if verdicts.rearrangement and status is not FrameStatus.RESET:
        status, why = FrameStatus.REARRANGING, "a reviewer saw a rearrangement here; " + why
    if asked:
        who = "a reviewer" if verdicts.reset else "the experiment"
        status, why = FrameStatus.RESET, f"{who} asked for a reset here; " + why
    if status is FrameStatus.REARRANGING and settings.reset_to_zero and k not in settings.kept_frames:
        carried = estimate
        estimate, renewed = estimate_from(replace(state, members=EnsembleState.first()))
        evidence = replace(renewed, old_unbalance=evidence.old_unbalance)
        change = 100.0 * relative_change(
            carried.step.contacts.key, carried.force, estimate.step.contacts.key, estimate.force
        )
        asked_for = f"reset to zero forces, as asked for at a rearrangement, which changed the forces by {change:.0f} %"
        status, why = FrameStatus.RESET, f"{asked_for}: {why}"
    eventful = status in (FrameStatus.RESET, FrameStatus.SUSPECT, FrameStatus.REARRANGING, FrameStatus.FAILED)
    if verdicts.ignored:  # no event of the packing: the frames after it do not settle anew
        status = FrameStatus.SUSPECT
        why = "a reviewer had this photograph ignored: solved on positions between its neighbours; " + why
    since_reset = 0 if status is FrameStatus.RESET else state.frames_since_reset + 1
    age = _age(estimate.step.contacts, state)
    reason = "; ".join(part for part in (estimate.remark, why, estimate.step.solution.stop.value) if part)
    frame = _describe(packing, k, motion, estimate, evidence, status, reason, since_reset, age)
    frame = _with_verdicts(frame, packing, motion, estimate, verdicts)
    if bridged.any():
        frame = without_bridged(frame, bridged)
    pressure = _pressure(packing, motion, estimate.step, estimate.fn, estimate.ft) if motion.spans else np.nan
    return frame, SequenceState(
        members=estimate.members,
        age_key=estimate.step.contacts.key,
        age=age,
        seen=state.seen.renewed(snapshot),
        time=snapshot.time,
        endpoints=snapshot.endpoints,
        pressure=pressure,
        sound_pressure=state.sound_pressure if status is FrameStatus.SUSPECT else pressure,
        evidence=evidence,
        frames_since_reset=since_reset,
        frames_since_event=0 if eventful else state.frames_since_event + 1,
    )


def _estimate_by_chain(
    packing: Packing,
    snapshot: Snapshot,
    motion: FrameMotion,
    state: SequenceState,
    settings: SequenceSettings,
    verdicts: Verdicts,
) -> tuple[_Estimate, Evidence]:
    threshold = settings.threshold
    if threshold is None:  # the gap of a touching pair scatters by √2 σ and by the overlap
        threshold = settings.threshold_sigmas * float(np.hypot(snapshot.sigma, settings.overlap / np.sqrt(2.0)))
    memory, remark = state.members.soft, ""
    step = advance_chain(packing, motion, memory, settings.chain, NearPairs(threshold, verdicts))
    evidence = _evidence(packing, motion, step, step.solution.fn, step.solution.ft, state, threshold=threshold)
    if is_suspect(evidence):
        wider = advance_chain(packing, motion, memory, settings.chain, NearPairs(WIDER * threshold, verdicts))
        wider_evidence = _evidence(
            packing, motion, wider, wider.solution.fn, wider.solution.ft, state, threshold=WIDER * threshold
        )
        if wider_evidence.correction < evidence.correction:
            step, evidence = wider, wider_evidence
            remark = f"solved again with a gap threshold {WIDER} times as wide"
    near = detect_contacts(packing.grains, snapshot.position, snapshot.present, step.walls, threshold)
    only_people_saw = are_among(step.contacts.key, verdicts.forced) & ~are_among(step.contacts.key, near.key)
    unknown = np.where(only_people_saw, 0.0, np.nan)
    forbidden = near.select(are_among(near.key, verdicts.forbidden))
    members = replace(state.members, soft=step.memory if motion.spans else ForceMemory.empty())
    return _Estimate(
        step, step.solution.fn, step.solution.ft, unknown, members, forbidden, np.full(forbidden.count, np.nan), remark
    ), evidence  # fmt: skip


def _estimate_by_ensemble(
    packing: Packing,
    snapshots: Sequence[Snapshot],
    k: int,
    snapshot: Snapshot,
    motion: FrameMotion,
    state: SequenceState,
    settings: SequenceSettings,
    refined: RefinedBlock,
    verdicts: Verdicts,
) -> tuple[_Estimate, Evidence]:
    found = solve_ensemble(
        packing, snapshots, k, motion, state.members, settings.chain, settings.ensemble,
        snapshot=snapshot, refined=refined, verdicts=verdicts,
    )  # fmt: skip
    evidence = _evidence(
        packing, motion, found.step, found.fn, found.ft, state, found.disagreement, found.start_difference
    )
    return _Estimate(
        found.step, found.fn, found.ft, found.probability, found.state, found.forbidden, found.forbidden_probability,
        found.remark, found.spread_fn, found.spread_ft, found.member_force if settings.keep_members else None,
        found.start_difference,
    ), evidence  # fmt: skip


def _evidence(
    packing: Packing, motion: FrameMotion, step: ChainStep, fn: Array, ft: Array, state: SequenceState,
    disagreement: float = np.nan, start_difference: float = np.nan, threshold: float = 0.0,
) -> Evidence:  # fmt: skip
    """Evidence on the reported field fn, ft (c,) [N]; ε and ū are the chain's."""
    pressure = _pressure(packing, motion, step, fn, ft)
    # Back from a faulty frame is no jump.
    former = [p for p in (state.pressure, state.sound_pressure) if p > 0]
    jump = min((abs(pressure - p) / p for p in former), default=np.nan)
    plates = np.isfinite(packing.pressure)
    load = float(packing.pressure[plates].mean()) if plates.any() else 0.0
    return Evidence(
        reset=len(state.members.soft.key) == 0,
        # Inertia alone corrects nothing that could be measured: there is no ε then.
        correction=step.solution.mean_unbalance / step.kappa if step.kappa > NEGLIGIBLE_KAPPA else np.nan,
        disagreement=disagreement,
        old_unbalance=step.old_unbalance,
        pressure_jump=jump,
        load_share=pressure / load if load > 0 and not any(packing.material.gravity) else np.nan,
        unbalance=worst_unbalance(step.contacts, fn, ft, packing.weight, motion.grains.present),
        shear=shear_over(motion),
        frames_since_event=state.frames_since_event + 1,
        start_difference=start_difference,
        holes=len(find_holes(packing.grains, motion.grains.position, motion.grains.present, step.walls)),
        grains=int(motion.grains.present.sum()),
        reach=threshold / (2.0 * float(packing.grains.radius.mean())),
    )


def _pressure(packing: Packing, motion: FrameMotion, step: ChainStep, fn: Array, ft: Array) -> float:
    position = motion.grains.position
    area = packing_area(step.walls, position[motion.grains.present])
    stress = love_weber_stress(step.contacts, fn, ft, position, area, packing.length)
    return 0.5 * float(np.trace(stress))


def _age(contacts: Contacts, state: SequenceState) -> NDArray[np.int32]:
    return recall(contacts.key, state.age_key, state.age, fill=-1) + np.int32(1)


def _with_verdicts(
    frame: FrameForces, packing: Packing, motion: FrameMotion, estimate: _Estimate, verdicts: Verdicts
) -> FrameForces:
    """Mark what people added, and list what they forbade."""
    frame = replace(frame, source=sources(frame.contacts, estimate.probability, verdicts))
    if estimate.forbidden.count == 0:
        return frame
    grains = motion.grains
    un, ut = relative_motion(
        estimate.forbidden, packing.grains.radius, grains.velocity, grains.spin, estimate.step.walls
    )
    return show_forbidden(frame, estimate.forbidden, estimate.forbidden_probability, un, ut)


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
    estimate: _Estimate,
    evidence: Evidence,
    status: FrameStatus,
    reason: str,
    since_reset: int,
    age: NDArray[np.int32],
) -> FrameForces:
    step, fn, ft = estimate.step, estimate.fn, estimate.ft
    contacts = step.contacts
    un, ut = relative_motion(contacts, packing.grains.radius, motion.grains.velocity, motion.grains.spin, step.walls)
    return FrameForces(
        frame=k,
        contacts=contacts,
        fn=fn,
        ft=ft,
        nlgs_fn=step.solution.fn,
        nlgs_ft=step.solution.ft,
        un=un,
        ut=ut,
        state=contact_state(packing, contacts, fn, ft),
        age=age,
        source=sources(contacts, estimate.probability, NO_VERDICTS),
        probability=estimate.probability,
        fn_sd=free_standard_deviation(fn, estimate.spread_fn),
        ft_sd=tangential_standard_deviation(fn, packing.material.friction, estimate.spread_ft),
        status=status,
        reason=reason,
        sweeps=step.sweeps,
        natural_map=step.solution.natural_map,
        unbalance=evidence.unbalance,
        kappa=step.kappa,
        correction=evidence.correction,
        old_unbalance=evidence.old_unbalance,
        trust=trust(evidence) if motion.spans else np.nan,
        start_difference=evidence.start_difference,
        unseen_grains=evidence.holes,
        frames_since_reset=since_reset,
        history=step.history,
        member_force=estimate.member_force,
    )
