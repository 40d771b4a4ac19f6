"""Report of a solved frame: contacts of bridged grains dropped, excluded contacts listed, trust and intervals added."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..assessment.evidence import Evidence
from ..assessment.intervals.force_intervals import calibrate_sd
from ..assessment.intervals.formula_sd import normal_sd, tangential_sd
from ..assessment.intervals.scale_sd import scale_sd
from ..assessment.penalties import assess, describe_penalties, find_penalties
from ..assessment.status import StatusDecision
from ..assessment.trust import hidden_fraction, unseen_penalty
from ..bodies.grains import Array
from ..bodies.strain import displacement_gradient, logarithmic_strain, shear_strain
from ..contacts.contacts import Contacts, ContactSource, ContactState
from ..contacts.kinematics import relative_motion
from ..contacts.pairs import are_among, are_present, match_values
from ..contacts.verdicts import contact_sources
from ..frame_forces import FrameForces
from ..nlgs.start_residuals import measure_start_residuals
from ..quantity import columns
from ..statistics.balance import grain_unbalance
from ..statistics.bearing import bearing_probability
from ..statistics.force_statistics import mean_normal_force, mobilisation
from ..statistics.sliding import SlidingEvidence, contact_state, sliding_probability
from .estimate import Estimate
from .frame_problem import FrameProblem
from .state import SequenceState


def report_frame(
    problem: FrameProblem, estimate: Estimate, evidence: Evidence, decision: StatusDecision, ages: NDArray[np.int32]
) -> tuple[FrameForces, Evidence]:
    """Report an estimate.

    Parameters
    ----------
    problem : FrameProblem
    estimate : Estimate
    evidence : Evidence
    decision : StatusDecision
    ages : ndarray, shape (c,)
        Frames since every contact was last absent.

    Returns
    -------
    FrameForces
    Evidence
        Completed by the contacts that the report hides.
    """
    frame = _list_excluded(problem, _describe(problem, estimate, evidence, decision, ages), estimate)
    if problem.bridged.any():
        frame = _without_bridged(frame, problem.bridged)
        evidence = replace(evidence, hidden_fraction=frame.hidden_fraction)
    unbalance = grain_unbalance(
        frame.contacts, frame.fn, frame.ft, problem.packing.weight, problem.seen & problem.packing.grains.free
    )
    penalties = find_penalties(evidence)
    assessed = assess(evidence, penalties)
    reported = replace(
        frame, trust=assessed.trust, expected_correlation=assessed.expected_correlation,
        trust_penalties=describe_penalties(penalties), grain_unbalance=unbalance,
        scale_sd=scale_sd(evidence) if problem.packing.scale_is_known else np.nan,
    )  # fmt: skip
    first = problem.k == 0 and estimate.mixture is not None
    # Only these fields were calibrated on packings with known forces.
    if estimate.fn_sd is not None and (problem.motion.ends_here or first):
        reported = calibrate_sd(reported)
    return reported, evidence


def find_ages(contacts: Contacts, state: SequenceState) -> NDArray[np.int32]:
    """Frames since every contact was last absent (c,)."""
    return match_values(contacts.key, state.age_key, state.age, fill=-1) + np.int32(1)


def _contact_probabilities(problem: FrameProblem, estimate: Estimate) -> tuple[Array, Array]:
    """P(bears force) and P(slides, if it does) of the contacts (c,)."""
    contacts, fn, ft = estimate.contacts, estimate.fn, estimate.ft
    reviewed = estimate.probability == 0.0  # detected contacts have more
    bears = bearing_probability(fn, np.where(reviewed, 1.0, estimate.probability))
    friction = problem.packing.material.friction_at(contacts.with_wall)
    return bears, sliding_probability(mobilisation(fn, ft, friction), _signs(problem, estimate, friction))


def _signs(problem: FrameProblem, estimate: Estimate, friction: Array) -> SlidingEvidence | None:
    """Signs of sliding of every contact; friction (c,)."""
    if estimate.cone_fraction is None or estimate.seen_slip is None:
        return None
    fn, ft, mean = estimate.fn, estimate.ft, mean_normal_force(estimate.fn)
    weight = _heavier(estimate.contacts, problem.packing.weight)
    limit = float(friction @ np.maximum(fn, 0.0))
    borne = float(np.abs(ft).sum()) / limit if limit > 0 else 0.0
    return SlidingEvidence(
        estimate.cone_fraction, -estimate.seen_slip.over_noise * np.sign(ft), estimate.seen_slip.over_scale,
        weight / mean if mean > 0 else np.zeros_like(fn),
        0.0 if estimate.mixture is None else estimate.mixture.position_weight, problem.settings.soft,
        borne if problem.k == 0 else None,
    )  # fmt: skip


def _heavier(contacts: Contacts, weight: Array) -> Array:
    """Weight of the heavier grain of every contact (c,) [N]; weight (n, 2) [N]."""
    size = np.append(np.linalg.norm(weight, axis=1), 0.0)
    return np.maximum(size[contacts.i], size[np.minimum(contacts.j, len(weight))])


def _describe(
    problem: FrameProblem, estimate: Estimate, evidence: Evidence, decision: StatusDecision, ages: NDArray[np.int32]
) -> FrameForces:
    """Report without trust and intervals."""
    material, contacts, step = problem.packing.material, estimate.contacts, estimate.step
    fn, ft = estimate.fn, estimate.ft
    un, ut = _measured_motion(problem, contacts, estimate)
    # 512 sweeps, for a curve beside those of the recorded sweeps.
    starts = measure_start_residuals(step, with_cold=problem.settings.chain.keep != "none")
    bears, slides = _contact_probabilities(problem, estimate)
    strain = _strain_since_start(problem)
    # Without a stopping level the number of sweeps is part of the method, and the same in every frame.
    by_level = problem.settings.chain.force_change is not None
    reason = (estimate.remark, decision.reason, step.solution.stop.value if by_level else "")
    return FrameForces(
        frame=problem.k,
        contacts=contacts,
        fn=fn,
        ft=ft,
        nlgs_fn=step.solution.fn,
        nlgs_ft=step.solution.ft,
        un=un,
        ut=ut,
        state=contact_state(fn, slides),
        age=ages,
        source=_sources(problem, estimate),
        probability=estimate.probability,
        fn_sd=normal_sd(fn, estimate.fn_sd),
        ft_sd=tangential_sd(fn, material.friction, estimate.ft_sd),
        status=decision.status,
        reason="; ".join(part for part in reason if part),
        sweeps=step.sweeps,
        natural_map=step.solution.natural_map,
        unbalance=evidence.unbalance,
        kappa=step.kappa,
        correction=evidence.correction,
        old_unbalance=evidence.old_unbalance,
        trust=np.nan,
        start_difference=evidence.start_difference,
        unseen_grains=evidence.holes,
        frames_since_reset=0,
        history=step.history,
        member_force=estimate.member_force,
        force_change=evidence.force_change,
        agreement=evidence.agreement,
        strain=strain,
        shear=shear_strain(strain),
        shear_step=evidence.shear / problem.intervals_read if problem.motion.ends_here else 0.0,
        warm_residual=starts.warm,
        cold_residual=starts.cold,
        sweeps_saved=starts.sweeps_saved,
        bearing_probability=bears,
        sliding_probability=slides,
        overlap=estimate.overlap,
        friction=material.friction_at(contacts.with_wall),
        position_weight=0.0 if estimate.mixture is None else estimate.mixture.position_weight,
        soft=int(problem.settings.soft),
        unseen_penalty=unseen_penalty(evidence),
    )


def _sources(problem: FrameProblem, estimate: Estimate) -> NDArray[np.uint8]:
    source = contact_sources(estimate.contacts, estimate.probability, problem.verdicts)
    missing = are_among(estimate.contacts.key, estimate.missing.key) & (source == ContactSource.DETECTED)
    source[missing] = ContactSource.FROM_BALANCE
    return source


def _strain_since_start(problem: FrameProblem) -> Array:
    """Strain (2, 2) since the first snapshot, of the grains that both show."""
    start, now = problem.sequence.snapshots[0], problem.snapshot
    both = start.present & problem.seen
    gradient = displacement_gradient(start.position, now.position - start.position, both)
    return logarithmic_strain(gradient)


def _measured_motion(problem: FrameProblem, contacts: Contacts, estimate: Estimate) -> tuple[Array, Array]:
    grains = problem.motion.grains
    return relative_motion(contacts, problem.packing.grains.radius, grains.velocity, grains.spin, estimate.step.walls)


def _without_bridged(frame: FrameForces, bridged: NDArray[np.bool_]) -> FrameForces:
    """Drop the contacts of grains (n,) that were bridged: no photograph shows them."""
    contacts, history = frame.contacts, frame.history
    keep = are_present(contacts.key, ~bridged, contacts.body_count)
    return replace(
        frame,
        hidden_fraction=hidden_fraction(frame.fn, keep),
        contacts=contacts.select(keep),
        history=replace(history, fn=history.fn[:, keep], ft=history.ft[:, keep]),
        reason=f"{bridged.sum()} lost grains were bridged, and their contacts are left out; {frame.reason}",
        **{name: value[keep] for name, value in _columns(frame).items()},
    )


def _list_excluded(problem: FrameProblem, frame: FrameForces, estimate: Estimate) -> FrameForces:
    """List contacts that were detected but excluded by a reviewer, without force and marked as such."""
    forbidden, contacts, history = estimate.forbidden, frame.contacts, frame.history
    if forbidden.count == 0:
        return frame
    un, ut = _measured_motion(problem, forbidden, estimate)
    order = np.argsort(np.concatenate([contacts.key, forbidden.key]), kind="stable")
    known = {
        "state": np.full(forbidden.count, ContactState.OPEN),
        "source": np.full(forbidden.count, ContactSource.FORBIDDEN_BY_REVIEWER),
        "probability": estimate.forbidden_probability, "un": un, "ut": ut,
        "friction": problem.packing.material.friction_at(forbidden.with_wall),
        "bearing_probability": np.zeros(forbidden.count), "sliding_probability": np.zeros(forbidden.count),
    }  # fmt: skip
    listed = {
        name: np.concatenate([value, _rows_of(value, forbidden.count, known.get(name))])[order]
        for name, value in _columns(frame).items()
    }
    nothing = np.zeros((len(history.recorded), forbidden.count), np.float32)
    geometry = {
        name: np.concatenate([value, getattr(forbidden, name)])[order]
        for name in columns(Contacts, "contact")
        if (value := getattr(contacts, name)) is not None  # no shift without a periodic cell
    }
    merged = Contacts(**geometry, grain_count=contacts.grain_count, wall_count=contacts.wall_count)
    return replace(
        frame,
        contacts=merged,
        history=replace(
            history,
            fn=np.concatenate([history.fn, nothing], axis=1)[:, order],
            ft=np.concatenate([history.ft, nothing], axis=1)[:, order],
        ),
        **listed,
    )


def _columns(frame: FrameForces) -> dict[str, NDArray]:
    """Columns with a value for every contact, by the name of the field."""
    return {name: value for name in columns(FrameForces, "contact") if (value := getattr(frame, name)) is not None}


def _rows_of(column: NDArray, count: int, given: NDArray | None) -> NDArray:
    """Rows to add to a column: the given ones, or zeros."""
    rows = np.zeros((count, *column.shape[1:])) if given is None else given
    return np.asarray(rows, column.dtype)
