"""Estimate of one frame, by the ensemble or by a single chain, and the evidence for its assessment."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import ConvexHull

from ..assessment.evidence import Evidence
from ..assessment.expected_correlation import expect_correlation
from ..assessment.mixture_trust import LEAST_WEIGHT, evident_position_weight, motion_reliability
from ..assessment.motion_information import MotionInformation, measure_motion_information, motion_scale
from ..assessment.status import is_suspect
from ..bodies.grains import Array
from ..bodies.holes import find_holes
from ..bodies.motion import shear_over
from ..bodies.strain import inertial_time
from ..contacts.contacts import Contacts, detect_contacts
from ..contacts.pairs import align, are_among
from ..convex.ensemble_members import NormalisedSlip
from ..convex.program import Balance
from ..detection.contact_networks import ThresholdNetwork
from ..mixture.equilibrium_mixture import FrameBalance, mix_in_equilibrium
from ..mixture.estimate_agreement import with_agreements, with_former_agreements
from ..mixture.frame_mixture import ForceEstimate, Mixture, Softness, limit_by_fringes, motion_weight, overlap_scale
from ..nlgs.chain import ChainStep, advance_chain
from ..nlgs.force_memory import ForceMemory
from ..posterior.frame_posterior import FramePosterior
from ..statistics.agreement import pearson
from ..statistics.balance import ForceResidual, measure_force_residual
from ..statistics.packing_area import packing_area
from ..statistics.stress import love_weber_stress
from .boundary_load import inner_reaction, scale_to_load
from .ensemble import EnsembleState, solve_ensemble
from .frame_problem import FrameProblem, PositionEstimates
from .missing_contacts import NO_MISSING, MissingContacts
from .state import SequenceState

NEGLIGIBLE_KAPPA = 1e-5  # below it the measured motion does not influence the forces
# A frame is steady where so much is expected of it; agreements then hold for so many frames.
STEADY = 0.97
STEADY_FRAMES = 4
FULL_WEIGHT = 0.4  # of the position-only estimate, from which on its draws are not shortened
MIN_OF_HULL = 3  # points that a convex hull needs more than
WIDER = 1.5  # threshold of the second attempt at a suspect frame


@dataclass(frozen=True, slots=True)
class Estimate:
    """The recorded chain, and the field to be reported on its contacts."""

    step: ChainStep
    fn: Array  # (c,) [N]
    ft: Array  # (c,) [N]
    probability: Array  # (c,), NaN where not computed
    members: EnsembleState
    forbidden: Contacts  # detected, but excluded by a reviewer
    forbidden_probability: Array  # (m,)
    remark: str = ""
    fn_sd: Array | None = None  # (c,) [N] among the members, None of a single chain
    ft_sd: Array | None = None  # (c,) [N]
    member_force: Array | None = None  # (c, m, 2) [N]
    # (c, 2) fractions of the convex members and of the chains on the Coulomb cone; None: no members
    cone_fraction: Array | None = None
    seen_slip: NormalisedSlip | None = None  # None: no members
    disagreement: float = np.nan  # D
    start_difference: float = np.nan  # H
    power_gap: float = np.nan  # of the convex members
    motion: ForceEstimate | None = None  # the motion estimate, where it was mixed
    mixture: Mixture | None = None  # with the position-only estimate; None: not computed
    overlap: float = np.nan  # [m] per mean force, by the position-only estimate
    threshold: float = 0.0  # [m] of the gap, of a single chain
    missing: MissingContacts = NO_MISSING  # pairs that were not detected but that the balance shows
    balance: Balance | None = None  # of the ensemble; None: of a single chain
    scale_disagreement: float = np.nan  # relative standard deviation of the sum of f_n among the members

    @property
    def contacts(self) -> Contacts:
        return self.step.contacts

    @property
    def force(self) -> Array:
        return np.column_stack([self.fn, self.ft])

    def scaled(self, factor: float) -> Estimate:
        """The same with all reported forces multiplied; those of the chain and of the members stay."""
        assert self.fn_sd is not None
        assert self.ft_sd is not None
        return replace(
            self, fn=factor * self.fn, ft=factor * self.ft, fn_sd=factor * self.fn_sd, ft_sd=factor * self.ft_sd
        )


def estimate_frame(problem: FrameProblem, state: SequenceState) -> tuple[Estimate, Evidence]:
    """Solve a frame from the state of the previous frame."""
    if problem.refined is None:
        return _estimate_by_chain(problem, state)
    positions = problem.sequence.positions
    if positions is None:
        return _motion_estimate(problem, state)
    if not _always_uses_positions(problem):
        alone, evidence = _motion_estimate(problem, state)
        return _combine(problem, positions, alone, evidence, state) if alone.fn.any() else (alone, evidence)
    posterior = positions.at(problem.k, problem.verdicts)
    if posterior is not None and posterior.fn.any():
        offered = _estimate_by_ensemble(problem, state, posterior)
        if offered.fn.any():
            evidence = gather_evidence(problem, offered, state)
            evidence = _with_agreements(problem, evidence, offered, posterior)
            reliability = limit_by_fringes(motion_reliability(evidence), offered.contacts, offered.fn, posterior)
            hard = not (problem.settings.soft or np.isnan(reliability) or posterior.fringes is not None)
            weight = evident_position_weight(evidence) if hard else None
            mixed = _mix(problem, offered, posterior, reliability, position_weight=weight)
            if posterior.fringes is not None and np.isfinite(posterior.fringes.scale):
                total = float(mixed.fn.sum())
                mixed = mixed.scaled(
                    float(posterior.fn.sum()) / total / posterior.fringes.scale if total > 0.0 else 1.0
                )
            elif problem.follows_overlap:
                factor = overlap_scale(posterior, float(mixed.fn.sum()), state.overlap_unit)
                mixed = mixed.scaled(factor)
            return mixed, _evidence_of_mixture(problem, mixed, evidence, state)
    return _motion_estimate(problem, state)


def _combine(
    problem: FrameProblem, positions: PositionEstimates, alone: Estimate, evidence: Evidence, state: SequenceState
) -> tuple[Estimate, Evidence]:
    """Compare the motion estimate of hard grains with the position-only estimate; mix both as the evidence weighs them.

    In steady frames the agreements of the last few frames hold: the position-only estimate takes as long as the frame.
    Fewer draws of it suffice unless its forces count much.
    """
    before = state.evidence
    if not np.isnan(before.agreement) and before.agreement_age + 1 < STEADY_FRAMES:
        carried = with_former_agreements(evidence, before)
        weight = evident_position_weight(carried)
        if weight < LEAST_WEIGHT and expect_correlation(carried) > STEADY and before.position_weight == 0.0:
            return alone, carried
    brief = before.position_weight < FULL_WEIGHT
    posterior = (positions.compared if brief else positions.at)(problem.k, problem.verdicts)
    if posterior is None or not posterior.fn.any():
        return alone, evidence
    evidence = _with_agreements(problem, evidence, alone, posterior)
    if brief and evident_position_weight(evidence) >= FULL_WEIGHT:
        full = positions.at(problem.k, problem.verdicts)
        assert full is not None  # of the same pairs
        posterior, evidence = full, _with_agreements(problem, evidence, alone, full)
    weight = evident_position_weight(evidence)
    if weight < LEAST_WEIGHT:
        return alone, evidence
    mixed = _mix(problem, alone, posterior, motion_reliability(evidence), position_weight=weight)
    return mixed, _evidence_of_mixture(problem, mixed, evidence, state)


def _evidence_of_mixture(problem: FrameProblem, mixed: Estimate, alone: Evidence, state: SequenceState) -> Evidence:
    """Evidence of the mixed field: that of the motion estimate, but for what depends on the reported forces."""
    assert mixed.mixture is not None
    residual = _force_residual(problem, mixed)
    return replace(
        alone,
        unbalance=residual.worst,
        missing_force=residual.missing,
        mixed_trust=mixed.mixture.trust,
        position_weight=mixed.mixture.position_weight,
        information=_motion_information(problem, mixed),
        boundary_reaction=inner_reaction(problem.packing.grains, mixed.contacts, mixed.fn, mixed.ft),
        force_change=_force_change(mixed, state),
    )


def _with_agreements(
    problem: FrameProblem, evidence: Evidence, estimate: Estimate, posterior: FramePosterior
) -> Evidence:
    """Add how far the estimates of a frame agree."""
    sequence = problem.sequence
    assert sequence.positions is not None
    assert sequence.overlap_balance is not None
    contacts, force = sequence.overlap_balance(sequence.positions.frame_of(problem.k, problem.verdicts))
    motion, balance = (estimate.contacts.key, estimate.fn), (contacts.key, force[:, 0])
    return with_agreements(evidence, motion, posterior, balance, problem.snapshot.sigma)


def _motion_estimate(problem: FrameProblem, state: SequenceState) -> tuple[Estimate, Evidence]:
    estimate = _estimate_by_ensemble(problem, state, None)
    return estimate, gather_evidence(problem, estimate, state)


def _always_uses_positions(problem: FrameProblem) -> bool:
    """Whether the position-only estimate is used whatever the motion shows."""
    settings = problem.settings
    if settings.positions == "always" or settings.soft or not problem.motion.ends_here:
        return True
    if problem.snapshot.fringes is not None:  # evidence on every contact, which only that estimate uses
        return True
    # Loading without sliding looks like agreement, and no load contradicts it.
    return not problem.packing.scale_is_known


def _mix(
    problem: FrameProblem,
    estimate: Estimate,
    positions: FramePosterior,
    reliability: float,
    position_weight: float | None = None,
) -> Estimate:
    """Mix the motion estimate with the position-only estimate, and project the mixture onto equilibrium.

    reliability: of the motion estimate, NaN where no motion leads to the frame; position_weight: None: from it.
    """
    contacts = estimate.contacts
    assert estimate.fn_sd is not None
    assert estimate.ft_sd is not None
    assert estimate.balance is not None
    field = ForceEstimate(estimate.fn, estimate.ft, estimate.fn_sd, estimate.ft_sd)
    softness = None
    if problem.settings.soft:
        seen = problem.settings.measured_overlap
        weight = motion_weight(positions.overlap, motion_scale(problem.motion, problem.snapshot.sigma)) if seen else 0.0
        softness = Softness(problem.settings.soft_trust, weight)
    frame = FrameBalance(
        contacts, problem.snapshot.position, estimate.balance, problem.settings.ensemble.convex,
        problem.packing.scale_is_known, any(problem.packing.material.gravity),
    )  # fmt: skip
    mixture = mix_in_equilibrium(
        frame, field, positions, reliability, softness=softness, position_weight=position_weight
    )
    members = estimate.members
    if not problem.motion.ends_here:  # no member has a history of its own yet
        force = np.column_stack([mixture.fn, mixture.ft])
        members = members.updated(contacts, force, problem.snapshot.present)
    remark = f"the position-only estimate has a weight of {100 * mixture.position_weight:.0f} %"
    return replace(
        estimate, fn=mixture.fn, ft=mixture.ft, members=members, fn_sd=mixture.fn_sd, ft_sd=mixture.ft_sd,
        motion=field, mixture=mixture, overlap=positions.overlap,
        remark="; ".join(part for part in (estimate.remark, remark) if part),
    )  # fmt: skip


def mean_stress(problem: FrameProblem, estimate: Estimate) -> float:
    """Half the trace of the stress of the motion estimate [Pa] under the load, comparable from frame to frame."""
    field, place = estimate if estimate.motion is None else estimate.motion, problem.snapshot.position
    area = packing_area(estimate.step.walls, place, problem.snapshot.present, problem.packing.grains.boundary)
    stress = love_weber_stress(estimate.contacts, field.fn, field.ft, place, area, problem.packing.length)
    return 0.5 * float(np.trace(stress)) * load_scale(problem, estimate)


def load_scale(problem: FrameProblem, estimate: Estimate) -> float:
    """Factor by which the forces agree with the load on a plate."""
    return scale_to_load(problem, estimate.step.walls, estimate.contacts, estimate.fn, estimate.ft)


def gather_evidence(problem: FrameProblem, estimate: Estimate, state: SequenceState) -> Evidence:
    """Gather the evidence of the reported field; ε and ū are those of the recorded chain."""
    packing, snapshot, step = problem.packing, problem.snapshot, estimate.step
    pressure, load = mean_stress(problem, estimate), packing.mean_pressure(snapshot)
    # A return from a faulty frame is no jump, nor a change of the loads; without a load, the mean stress may jump.
    ratio = packing.load_ratio(snapshot, problem.sequence.snapshots[max(problem.k - 1, 0)])
    former = (state.pressure, state.sound_pressure) if load > 0 else ()
    residual = _force_residual(problem, estimate)
    jump = min((abs(pressure - ratio * p) / (ratio * p) for p in former if p > 0), default=np.nan)
    return Evidence(
        reset=len(state.members.soft.key) == 0,
        # Inertia alone makes no measurable correction: ε is undefined then.
        correction=step.solution.mean_unbalance / step.kappa if step.kappa > NEGLIGIBLE_KAPPA else np.nan,
        disagreement=estimate.disagreement,
        old_unbalance=step.old_unbalance,
        pressure_jump=jump,
        load_fraction=pressure / load if load > 0 and not any(packing.material.gravity) else np.nan,
        unbalance=residual.worst,
        missing_force=residual.missing,
        shear=shear_over(problem.motion),
        frames_since_event=state.frames_since_event + 1,
        start_difference=estimate.start_difference,
        inferred=problem.sequence.inferred,
        corrected_gap=problem.settings.corrected_gap,
        centres_by_forces=problem.settings.centres_by_forces,
        start_forgotten=estimate.members.start_forgotten,
        holes=len(find_holes(packing.grains, snapshot.position, snapshot.present, step.walls)),
        grains=int(snapshot.present.sum()),
        interior=_count_interior(problem, estimate),
        reach=estimate.threshold / (2.0 * float(packing.grains.radius.mean())),
        assessed=problem.motion.ends_here,
        unseen_fraction=1.0 - float(problem.seen.sum()) / max(problem.sequence.known, 1),
        information=_motion_information(problem, estimate),
        boundary_reaction=inner_reaction(packing.grains, estimate.contacts, estimate.fn, estimate.ft),
        force_change=_force_change(estimate, state),
        inertial_number=_inertial_number(problem, load),
        power_gap=estimate.power_gap,
        scale_disagreement=estimate.scale_disagreement if not load > 0.0 and packing.scale_is_known else np.nan,
        loaded=packing.is_loaded,
        sought=problem.settings.unseen_sought,
    )


def _force_residual(problem: FrameProblem, estimate: Estimate) -> ForceResidual:
    """What is left of the equilibrium of all free grains, of the reported field."""
    packing, balanced = problem.packing, problem.snapshot.present & problem.packing.grains.free
    return measure_force_residual(estimate.contacts, estimate.fn, estimate.ft, packing.weight, balanced)


def _motion_information(problem: FrameProblem, estimate: Estimate) -> MotionInformation:
    return measure_motion_information(
        problem.packing, problem.snapshot, problem.motion, estimate.contacts, estimate.fn, estimate.step.walls,
        soft=problem.settings.soft,
    )  # fmt: skip


def _inertial_number(problem: FrameProblem, load: float) -> float:
    """Inertial number by the mean pressure of the loads [Pa]; NaN without one."""
    motion, packing = problem.motion, problem.packing
    if not (load > 0.0 and motion.interval > 0.0 and motion.ends_here):
        return np.nan
    time = inertial_time(float(packing.grains.mass[problem.snapshot.present].mean()), load, packing.length)
    return shear_over(motion) / motion.interval * time


def _count_interior(problem: FrameProblem, estimate: Estimate) -> int:
    """Number of free grains that neither touch a wall nor are vertices of the convex hull."""
    packing, snapshot, contacts = problem.packing, problem.snapshot, estimate.contacts
    inside = snapshot.present & packing.grains.free
    if estimate.step.walls.cell is not None:
        return int(inside.sum())
    inside[contacts.i[contacts.with_wall]] = False
    here = np.flatnonzero(snapshot.present)
    if len(here) > MIN_OF_HULL:
        inside[here[ConvexHull(snapshot.position[here]).vertices]] = False
    return int(inside.sum())


def _force_change(estimate: Estimate, state: SequenceState) -> float:
    """1 − correlation of f_n with that of the previous frame; a contact that only one has counts as zero."""
    if len(state.reported.key) == 0:
        return np.nan
    _, now, then = align(estimate.contacts.key, estimate.fn, state.reported.key, state.reported.force[:, 0])
    return 1.0 - pearson(now, then)


def _estimate_by_chain(problem: FrameProblem, state: SequenceState) -> tuple[Estimate, Evidence]:
    settings, sigma = problem.settings, problem.snapshot.sigma
    threshold = settings.threshold
    if threshold is None:
        assert settings.overlap is not None
        # The gap of a touching pair varies by √2 σ and by the overlap.
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
    """Advance a single chain on pairs nearer than `reach` [m]; threshold [m]: gap up to which a pair is detected."""
    packing, snapshot, verdicts = problem.packing, problem.snapshot, problem.verdicts
    memory, chain = state.members.soft, problem.settings.chain
    step = advance_chain(packing, problem.motion, memory, chain, ThresholdNetwork(reach, verdicts))
    near = detect_contacts(packing.grains, snapshot.position, snapshot.present, step.walls, threshold)
    only_reviewed = are_among(step.contacts.key, verdicts.forced) & ~are_among(step.contacts.key, near.key)
    forbidden = near.select(are_among(near.key, verdicts.forbidden))
    return Estimate(
        step,
        step.solution.fn,
        step.solution.ft,
        np.where(only_reviewed, 0.0, np.nan),
        replace(state.members, soft=step.memory if problem.motion.ends_here else ForceMemory.empty()),
        forbidden,
        np.full(forbidden.count, np.nan),
        threshold=reach,
    )


def _estimate_by_ensemble(problem: FrameProblem, state: SequenceState, positions: FramePosterior | None) -> Estimate:
    found = solve_ensemble(problem, state.members, positions)
    friction = problem.packing.material.friction_at(found.step.contacts.with_wall)
    return Estimate(
        found.step, found.fn, found.ft, found.probability, found.state, found.forbidden, found.forbidden_probability,
        found.remark, found.fn_sd, found.ft_sd, found.member_force if problem.settings.keep_members else None,
        found.cone_fraction(friction), found.seen_slip, found.disagreement, found.start_difference,
        missing=found.missing, power_gap=found.power_gap, balance=found.balance,
        scale_disagreement=found.scale_disagreement,
    )  # fmt: skip
