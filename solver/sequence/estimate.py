"""One attempt at a frame, by the ensemble or by a single chain, and the evidence that it is judged by."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.bodies.grains import Array
from solver.bodies.holes import find_holes
from solver.bodies.motion import shear_over
from solver.contacts.contacts import Contacts, detect_contacts
from solver.contacts.pairs import are_among
from solver.detection.networks import NearPairs
from solver.nlgs.chain import ChainStep, advance_chain
from solver.nlgs.warm_start import ForceMemory
from solver.sequence.ensemble import EnsembleState, solve_ensemble
from solver.sequence.frame_problem import FrameProblem
from solver.sequence.judgement import Evidence, is_suspect
from solver.sequence.state import SequenceState
from solver.statistics.balance import worst_unbalance
from solver.statistics.stress import love_weber_stress, packing_area

NEGLIGIBLE_KAPPA = 1e-5  # below it measured motion has no influence on the forces
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
    disagreement: float = np.nan  # D
    start_difference: float = np.nan  # H
    threshold: float = 0.0  # [m] of the gap, of a single chain

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
    estimate = _estimate_by_ensemble(problem, state)
    return estimate, gather_evidence(problem, estimate, state)


def mean_stress(problem: FrameProblem, estimate: Estimate) -> float:
    """Half the trace of the stress of the reported field [Pa]."""
    position, walls = problem.snapshot.position, estimate.step.walls
    area = packing_area(walls, position[problem.snapshot.present])
    stress = love_weber_stress(estimate.contacts, estimate.fn, estimate.ft, position, area, problem.packing.length)
    return 0.5 * float(np.trace(stress))


def gather_evidence(problem: FrameProblem, estimate: Estimate, state: SequenceState) -> Evidence:
    """Evidence on the reported field; ε and ū are the chain's."""
    packing, snapshot, step = problem.packing, problem.snapshot, estimate.step
    pressure = mean_stress(problem, estimate)
    # Back from a faulty frame is no jump.
    former = [p for p in (state.pressure, state.sound_pressure) if p > 0]
    jump = min((abs(pressure - p) / p for p in former), default=np.nan)
    plates = np.isfinite(packing.pressure)
    load = float(packing.pressure[plates].mean()) if plates.any() else 0.0
    return Evidence(
        reset=len(state.members.soft.key) == 0,
        # Inertia alone corrects nothing that could be measured: there is no ε then.
        correction=step.solution.mean_unbalance / step.kappa if step.kappa > NEGLIGIBLE_KAPPA else np.nan,
        disagreement=estimate.disagreement,
        old_unbalance=step.old_unbalance,
        pressure_jump=jump,
        load_share=pressure / load if load > 0 and not any(packing.material.gravity) else np.nan,
        unbalance=worst_unbalance(step.contacts, estimate.fn, estimate.ft, packing.weight, snapshot.present),
        shear=shear_over(problem.motion),
        frames_since_event=state.frames_since_event + 1,
        start_difference=estimate.start_difference,
        holes=len(find_holes(packing.grains, snapshot.position, snapshot.present, step.walls)),
        grains=int(snapshot.present.sum()),
        reach=estimate.threshold / (2.0 * float(packing.grains.radius.mean())),
        assessed=problem.motion.spans,
    )


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


def _estimate_by_ensemble(problem: FrameProblem, state: SequenceState) -> Estimate:
    found = solve_ensemble(problem, state.members)
    return Estimate(
        found.step, found.fn, found.ft, found.probability, found.state, found.forbidden, found.forbidden_probability,
        found.remark, found.spread_fn, found.spread_ft, found.member_force if problem.settings.keep_members else None,
        found.disagreement, found.start_difference,
    )  # fmt: skip
