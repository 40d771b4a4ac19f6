"""One attempt at a frame, by the ensemble or by a single chain, and the evidence that it is judged by."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.bodies.grains import Array
from solver.bodies.holes import find_holes
from solver.bodies.motion import shear_over
from solver.contacts.contacts import Contacts, detect_contacts
from solver.contacts.pairs import align, are_among
from solver.convex.members import SeenSlip
from solver.detection.networks import NearPairs
from solver.mixture.balancing import bring_into_balance
from solver.mixture.mixing import Field, Mixture, mix_on, worth_of_motion
from solver.nlgs.chain import ChainStep, advance_chain
from solver.nlgs.warm_start import ForceMemory
from solver.posterior.frame_posterior import FramePosterior
from solver.sequence.demand import NO_DEMAND, Demand
from solver.sequence.ensemble import EnsembleState, assemble_frame_balance, solve_ensemble
from solver.sequence.frame_problem import FrameProblem
from solver.sequence.judging.information import measure_information, motion_scale
from solver.sequence.judging.judgement import Evidence, is_suspect, trust
from solver.sequence.state import SequenceState
from solver.statistics.agreement import pearson
from solver.statistics.balance import worst_unbalance
from solver.statistics.stress import love_weber_stress, packing_area

NEGLIGIBLE_KAPPA = 1e-5  # below it measured motion has no influence on the forces
# Trust of the motion's field from which on positions alone are not asked: between .9 and .92 they add .011 to the
# correlation with the truth, between .92 and .94 .006, beyond .94 nothing (worlds of 300 rods, seed 0).
MOTION_SUFFICES = 0.93
WIDER = 1.5  # threshold of the second attempt at a suspect frame


@dataclass(frozen=True, slots=True)
class Estimate:
    """The chain, and the field to be reported on its contacts."""

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
    cone_share: Array | None = (
        None  # (c, 2) of the convex members and of the chains on the Coulomb cone; None: no members
    )
    seen_slip: SeenSlip | None = None  # None: no members
    disagreement: float = np.nan  # D
    start_difference: float = np.nan  # H
    motion: Field | None = None  # what the motion alone says, where it was mixed
    mixture: Mixture | None = None  # with what positions alone say; None: they were not asked
    overlap: float = np.nan  # [m] per mean force, as the positions show it
    threshold: float = 0.0  # [m] of the gap, of a single chain
    demand: Demand = NO_DEMAND  # pairs that were not detected, but that the balance demands

    @property
    def contacts(self) -> Contacts:
        return self.step.contacts

    @property
    def force(self) -> Array:
        return np.column_stack([self.fn, self.ft])


def estimate_frame(problem: FrameProblem, state: SequenceState) -> tuple[Estimate, Evidence]:
    """Solve a frame from the state that the frame before it left behind."""
    if problem.refined is None:
        return _estimate_by_chain(problem, state)
    alone = None
    if not _ask_whatever_is_found(problem):
        alone = _by_motion_alone(problem, state)
        estimate, evidence = alone
        if problem.sequence.positions is None or not _says_little(problem, evidence) or not estimate.fn.any():
            return alone
    assert problem.sequence.positions is not None
    positions = problem.sequence.positions.at(problem.k, problem.verdicts)
    if positions is not None and positions.fn.any():
        offered = _estimate_by_ensemble(problem, state, positions, NO_DEMAND if alone is None else alone[0].demand)
        if offered.fn.any():
            told = trust(gather_evidence(problem, offered, state))
            mixed = _mix(problem, offered, positions, told)
            return mixed, gather_evidence(problem, mixed, state)
    return _by_motion_alone(problem, state) if alone is None else alone


def _by_motion_alone(problem: FrameProblem, state: SequenceState) -> tuple[Estimate, Evidence]:
    estimate = _estimate_by_ensemble(problem, state, None, NO_DEMAND)
    return estimate, gather_evidence(problem, estimate, state)


def _ask_whatever_is_found(problem: FrameProblem) -> bool:
    """Whether positions are asked whatever the motion says: its field without them then need not be known."""
    settings = problem.settings
    if problem.sequence.positions is None:
        return False
    if settings.positions == "always" or settings.soft or not problem.motion.spans:
        return True
    # Loading without sliding looks like agreement, and no load contradicts it.
    return not problem.packing.scale_is_known


def _says_little(problem: FrameProblem, evidence: Evidence) -> bool:
    """Whether the motion says so little of this frame that positions alone are to be asked, too."""
    # That rods were inferred lowers the trust, but positions know nothing better of them.
    return not trust(replace(evidence, inferred=0)) >= MOTION_SUFFICES


def _mix(problem: FrameProblem, estimate: Estimate, positions: FramePosterior, motion_trust: float) -> Estimate:
    """The motion's field mixed with what positions say, and brought into balance."""
    contacts = estimate.contacts
    assert estimate.spread_fn is not None
    assert estimate.spread_ft is not None
    field = Field(estimate.fn, estimate.ft, estimate.spread_fn, estimate.spread_ft)
    known, soft = problem.packing.scale_is_known, problem.settings.soft_trust if problem.settings.soft else None
    worth = 1.0
    if problem.settings.soft:
        seen = problem.settings.overlap_seen
        worth = worth_of_motion(positions.overlap, motion_scale(problem)) if seen else 0.0
    mixture = mix_on(contacts, field, positions, motion_trust, own_scale=known, soft_trust=soft, worth=worth)
    balance = assemble_frame_balance(problem, contacts, estimate.step)
    convex = problem.settings.ensemble.convex
    polished = bring_into_balance(
        balance, mixture.fn, mixture.ft, mixture.spread_fn, convex, hardness=worth
    )  # fmt: skip
    fn, ft = (polished.fn, polished.ft) if polished.converged else (mixture.fn, mixture.ft)
    members = estimate.members
    if not problem.motion.spans:  # no member has a history of its own yet
        members = members.renewed(contacts, np.column_stack([fn, ft]), problem.snapshot.present)
    told = f"positions alone count {100 * mixture.share:.0f} % here"
    return replace(
        estimate, fn=fn, ft=ft, members=members, spread_fn=mixture.spread_fn, spread_ft=mixture.spread_ft,
        motion=field, mixture=mixture, overlap=positions.overlap,
        remark="; ".join(part for part in (estimate.remark, told) if part),
    )  # fmt: skip


def mean_stress(problem: FrameProblem, estimate: Estimate) -> float:
    """Half the trace of the stress of the motion's field [Pa], which is comparable from frame to frame."""
    fn, ft = (estimate.fn, estimate.ft) if estimate.motion is None else (estimate.motion.fn, estimate.motion.ft)
    position, walls = problem.snapshot.position, estimate.step.walls
    area = packing_area(walls, position[problem.snapshot.present])
    stress = love_weber_stress(estimate.contacts, fn, ft, position, area, problem.packing.length)
    return 0.5 * float(np.trace(stress))


def gather_evidence(problem: FrameProblem, estimate: Estimate, state: SequenceState) -> Evidence:
    """Evidence on the reported field; ε and ū are the chain's."""
    packing, snapshot, step = problem.packing, problem.snapshot, estimate.step
    pressure = mean_stress(problem, estimate)
    load = packing.mean_pressure(snapshot)
    # Back from a faulty frame is no jump, nor is what the measured loads did.
    before = packing.mean_pressure(problem.sequence.snapshots[max(problem.k - 1, 0)])
    risen = load / before if before > 0 and load > 0 else 1.0
    former = [risen * p for p in (state.pressure, state.sound_pressure) if p > 0]
    jump = min((abs(pressure - p) / p for p in former), default=np.nan)
    return Evidence(
        reset=len(state.members.soft.key) == 0,
        # Inertia alone corrects nothing that could be measured: there is no ε then.
        correction=step.solution.mean_unbalance / step.kappa if step.kappa > NEGLIGIBLE_KAPPA else np.nan,
        disagreement=estimate.disagreement,
        old_unbalance=step.old_unbalance,
        pressure_jump=jump,
        load_share=pressure / load if load > 0 and not any(packing.material.gravity) else np.nan,
        unbalance=worst_unbalance(
            step.contacts, estimate.fn, estimate.ft, packing.weight, snapshot.present & packing.grains.free
        ),
        shear=shear_over(problem.motion),
        frames_since_event=state.frames_since_event + 1,
        start_difference=estimate.start_difference,
        inferred=problem.sequence.inferred,
        start_forgotten=estimate.members.start_forgotten,
        holes=len(find_holes(packing.grains, snapshot.position, snapshot.present, step.walls)),
        grains=int(snapshot.present.sum()),
        reach=estimate.threshold / (2.0 * float(packing.grains.radius.mean())),
        assessed=problem.motion.spans,
        mixed_trust=np.nan if estimate.mixture is None else estimate.mixture.trust,
        positions_share=0.0 if estimate.mixture is None else estimate.mixture.share,
        unseen_share=1.0 - float(problem.seen.sum()) / max(problem.sequence.known, 1),
        information=measure_information(problem, estimate.contacts, estimate.fn, step.walls),
        force_change=_force_change(estimate, state),
    )


def _force_change(estimate: Estimate, state: SequenceState) -> float:
    """1 − correlation of f_n with that of the frame before, a contact that only one has counting as zero."""
    if len(state.reported.key) == 0:
        return np.nan
    _, now, then = align(estimate.contacts.key, estimate.fn, state.reported.key, state.reported.force[:, 0])
    return 1.0 - pearson(now, then)


def _estimate_by_chain(problem: FrameProblem, state: SequenceState) -> tuple[Estimate, Evidence]:
    settings, sigma = problem.settings, problem.snapshot.sigma
    threshold = settings.threshold
    if threshold is None:
        assert settings.overlap is not None
        # The gap of a touching pair scatters by √2 σ and by the overlap.
        threshold = settings.threshold_sigmas * float(np.hypot(sigma, settings.overlap / np.sqrt(2.0)))
    estimate = _advance_chain(problem, state, threshold, threshold)
    evidence = gather_evidence(problem, estimate, state)
    if is_suspect(evidence):
        wider = _advance_chain(problem, state, WIDER * threshold, threshold)
        wider_evidence = gather_evidence(problem, wider, state)
        if wider_evidence.correction < evidence.correction:
            remark = f"solved again with a gap threshold {WIDER} times as wide"
            return replace(wider, remark=remark), wider_evidence
    return estimate, evidence


def _advance_chain(problem: FrameProblem, state: SequenceState, reach: float, threshold: float) -> Estimate:
    """One attempt of a single chain, on pairs nearer than `reach` [m]; threshold [m]: what counts as detected."""
    packing, snapshot, verdicts = problem.packing, problem.snapshot, problem.verdicts
    memory, chain = state.members.soft, problem.settings.chain
    step = advance_chain(packing, problem.motion, memory, chain, NearPairs(reach, verdicts))
    near = detect_contacts(packing.grains, snapshot.position, snapshot.present, step.walls, threshold)
    only_people_saw = are_among(step.contacts.key, verdicts.forced) & ~are_among(step.contacts.key, near.key)
    forbidden = near.select(are_among(near.key, verdicts.forbidden))
    return Estimate(
        step,
        step.solution.fn,
        step.solution.ft,
        np.where(only_people_saw, 0.0, np.nan),
        replace(state.members, soft=step.memory if problem.motion.spans else ForceMemory.empty()),
        forbidden,
        np.full(forbidden.count, np.nan),
        threshold=reach,
    )


def _estimate_by_ensemble(
    problem: FrameProblem, state: SequenceState, positions: FramePosterior | None, demand: Demand
) -> Estimate:
    found = solve_ensemble(problem, state.members, positions, demand)
    friction = problem.packing.material.friction_at(found.step.contacts.with_wall)
    return Estimate(
        found.step, found.fn, found.ft, found.probability, found.state, found.forbidden, found.forbidden_probability,
        found.remark, found.spread_fn, found.spread_ft, found.member_force if problem.settings.keep_members else None,
        found.cone_share(friction), found.seen_slip, found.disagreement, found.start_difference, demand=found.demand,
    )  # fmt: skip
