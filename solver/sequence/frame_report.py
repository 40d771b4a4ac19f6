"""What is reported of a solved frame: contacts of stand-ins dropped, forbidden ones listed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.bodies.quantity import columns
from solver.bodies.strain import displacement_gradient, logarithmic_strain, shear_of
from solver.contacts.contacts import Contacts, ContactSource, ContactState
from solver.contacts.kinematics import relative_motion
from solver.contacts.pairs import are_among, are_there, recall
from solver.contacts.verdicts import sources
from solver.nlgs.starts import measure_starts
from solver.sequence.estimate import Estimate
from solver.sequence.frame_forces import FrameForces
from solver.sequence.frame_problem import FrameProblem
from solver.sequence.judging.doubts import lower_bound, tell_doubts
from solver.sequence.judging.intervals import calibrate_deviations
from solver.sequence.judging.judgement import (
    Evidence,
    Standing,
    free_standard_deviation,
    hidden_share,
    tangential_standard_deviation,
    unseen_doubt,
)
from solver.sequence.state import SequenceState
from solver.statistics.balance import grain_unbalance
from solver.statistics.bearing import bearing_probability
from solver.statistics.force_statistics import mean_normal_force, mobilisation
from solver.statistics.sliding import SlidingSigns, contact_state, sliding_probability


def report_frame(
    problem: FrameProblem, estimate: Estimate, evidence: Evidence, standing: Standing, ages: NDArray[np.int32]
) -> tuple[FrameForces, Evidence]:
    """Report an estimate that was judged; gives the evidence as completed by what the report hides.

    ages (c,) of the estimate's contacts.
    """
    frame = _show_forbidden(problem, _describe(problem, estimate, evidence, standing, ages), estimate)
    if problem.bridged.any():
        frame = _without_bridged(frame, problem.bridged)
        evidence = replace(evidence, hidden_share=frame.hidden_share)
    unbalance = grain_unbalance(
        frame.contacts, frame.fn, frame.ft, problem.packing.weight, problem.seen & problem.packing.grains.free
    )
    told = replace(frame, trust=lower_bound(evidence), doubt=tell_doubts(evidence), grain_unbalance=unbalance)
    first = problem.k == 0 and estimate.mixture is not None
    if estimate.spread_fn is not None and (problem.motion.spans or first):  # of other fields no truth has told enough
        told = calibrate_deviations(told)
    return told, evidence


def find_ages(contacts: Contacts, state: SequenceState) -> NDArray[np.int32]:
    """Frames since every contact was last absent (c,)."""
    return recall(contacts.key, state.age_key, state.age, fill=-1) + np.int32(1)


def _odds(problem: FrameProblem, estimate: Estimate) -> tuple[Array, Array]:
    """P(bears force) and P(slides, if it does) of the contacts (c,)."""
    contacts, fn, ft = estimate.contacts, estimate.fn, estimate.ft
    people_saw = estimate.probability == 0.0  # detected is only what has more
    bears = bearing_probability(fn, np.where(people_saw, 1.0, estimate.probability))
    friction = problem.packing.material.friction_at(contacts.with_wall)
    return bears, sliding_probability(mobilisation(fn, ft, friction), _signs(problem, estimate, friction))


def _signs(problem: FrameProblem, estimate: Estimate, friction: Array) -> SlidingSigns | None:
    """What tells whether contacts slide; friction (c,)."""
    if estimate.cone_share is None or estimate.seen_slip is None:
        return None
    fn, ft, mean = estimate.fn, estimate.ft, mean_normal_force(estimate.fn)
    weight = _heavier(estimate.contacts, problem.packing.weight)
    limit = float(friction @ np.maximum(fn, 0.0))
    borne = float(np.abs(ft).sum()) / limit if limit > 0 else 0.0
    return SlidingSigns(
        estimate.cone_share, -estimate.seen_slip.over_noise * np.sign(ft), estimate.seen_slip.over_scale,
        weight / mean if mean > 0 else np.zeros_like(fn),
        0.0 if estimate.mixture is None else estimate.mixture.share, problem.settings.soft,
        borne if problem.k == 0 else None,
    )  # fmt: skip


def _heavier(contacts: Contacts, weight: Array) -> Array:
    """Weight of the heavier grain of every contact (c,) [N]; weight (n, 2) [N]."""
    size = np.append(np.linalg.norm(weight, axis=1), 0.0)
    return np.maximum(size[contacts.i], size[np.minimum(contacts.j, len(weight))])


def _describe(
    problem: FrameProblem, estimate: Estimate, evidence: Evidence, standing: Standing, ages: NDArray[np.int32]
) -> FrameForces:
    """All that the estimate says, its trust not yet drawn."""
    material, contacts, step = problem.packing.material, estimate.contacts, estimate.step
    fn, ft = estimate.fn, estimate.ft
    un, ut = _measured_motion(problem, contacts, estimate)
    starts = measure_starts(step)
    bears, slides = _odds(problem, estimate)
    strain = _strain_since_start(problem)
    reason = (estimate.remark, standing.reason, step.solution.stop.value)
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
        fn_sd=free_standard_deviation(fn, estimate.spread_fn),
        ft_sd=tangential_standard_deviation(fn, material.friction, estimate.spread_ft),
        status=standing.status,
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
        strain=strain,
        shear=shear_of(strain),
        shear_step=evidence.shear if problem.motion.spans else 0.0,
        warm_residual=starts.warm,
        cold_residual=starts.cold,
        sweeps_saved=starts.saved,
        bearing_probability=bears,
        sliding_probability=slides,
        overlap=estimate.overlap,
        positions_share=0.0 if estimate.mixture is None else estimate.mixture.share,
        soft=int(problem.settings.soft),
        unseen_doubt=unseen_doubt(evidence),
    )


def _sources(problem: FrameProblem, estimate: Estimate) -> NDArray[np.uint8]:
    source = sources(estimate.contacts, estimate.probability, problem.verdicts)
    demanded = are_among(estimate.contacts.key, estimate.demand.key) & (source == ContactSource.DETECTED)
    source[demanded] = ContactSource.DEMANDED
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
    """Drop the contacts of grains (n,) that only stood in: they were not seen, so nothing is reported of them."""
    contacts, history = frame.contacts, frame.history
    keep = are_there(contacts.key, ~bridged, contacts.body_count)
    return replace(
        frame,
        hidden_share=hidden_share(frame.fn, keep),
        contacts=contacts.select(keep),
        history=replace(history, fn=history.fn[:, keep], ft=history.ft[:, keep]),
        reason=f"{bridged.sum()} lost grains were bridged, and nothing is shown of their contacts; {frame.reason}",
        **{name: value[keep] for name, value in _columns(frame).items()},
    )


def _show_forbidden(problem: FrameProblem, frame: FrameForces, estimate: Estimate) -> FrameForces:
    """List contacts that were detected but forbidden, without force and marked as such."""
    forbidden, contacts, history = estimate.forbidden, frame.contacts, frame.history
    if forbidden.count == 0:
        return frame
    un, ut = _measured_motion(problem, forbidden, estimate)
    order = np.argsort(np.concatenate([contacts.key, forbidden.key]), kind="stable")
    known = {
        "state": np.full(forbidden.count, ContactState.OPEN),
        "source": np.full(forbidden.count, ContactSource.FORBIDDEN_BY_REVIEWER),
        "probability": estimate.forbidden_probability, "un": un, "ut": ut,
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
    """What the frame says of every contact, by the name of the field."""
    return {name: value for name in columns(FrameForces, "contact") if (value := getattr(frame, name)) is not None}


def _rows_of(column: NDArray, count: int, told: NDArray | None) -> NDArray:
    """Rows to add to a column: what is told, or zeros."""
    rows = np.zeros((count, *column.shape[1:])) if told is None else told
    return np.asarray(rows, column.dtype)
