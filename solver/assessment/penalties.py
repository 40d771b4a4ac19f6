"""Trust of a frame with its reasons in words, the worst first, each with its cure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..convex.friction_check import COVERAGE_FACTOR, FrictionCheck
from ..frame_forces import FrameForces, FrameStatus
from ..part_settings import REFERENCE_STEP
from ..statistics.sliding import contact_state, sliding_probability_at
from .evidence import Evidence
from .expected_correlation import contradict, losses
from .intervals.force_intervals import correlation_by_intervals, widen_for_friction
from .reasons import join_reasons
from .trust import Assessment, interior_limit, motion_assessment, unseen_penalty

SOFT_CHAIN_LOSS = 0.15  # where a single chain treats soft grains as hard
BEYOND_WALL_LOSS = 12.0  # for each grain beyond a wall, per grain
# Where boundary grains inside the packing bear more than LEAST_REACTION of all forces: of T of `pins`, `stepped_pins`,
# `tilted_pins`, `cycles_pins` of seeds 62 to 64 with varied parameters, of which a sixth was above r by more than .03
INNER_BOUNDARY_LOSS, LEAST_REACTION = 0.04, 1e-3
STEP_SHOWN_BY = ("previous_residual", "force_change")  # evidence that too large a step explains
FEW_PHOTOGRAPHS, TRUST_OF_FEW = 3, 0.28  # of a test, below which the trust is at most the second
TRUST_WITHOUT_LOAD = 0.28  # of a packing with one open side and neither load nor weight: r .3 to .65 in two of them
LEFT_BY_INTERVALS = 2.5, 0.4  # of `most_by_intervals`
LITTLE_KNOWN = frozenset({"undetermined", "noise", "few_interior"})  # measures that contradict nothing
BY_NOISE = frozenset({"disagreement_of_positions", "disagreement_with_either"})  # the same where noise hides overlaps
REPORTED = 0.04  # fraction of the trust above which a penalty is reported in words


class Penalty(NamedTuple):
    """One reason to trust a frame less."""

    fraction: float  # of the trust that is lost
    words: str  # the cause; the cure
    counted: bool = False  # in `trust.motion_trust` already
    little_known: bool = False  # the data show little, which contradicts nothing


NO_PENALTY = Penalty(0.0, "")


def assess(evidence: Evidence, penalties: Sequence[Penalty] | None = None) -> Assessment:
    """Assess a frame.

    Parameters
    ----------
    evidence : Evidence
        Of the reported field.
    penalties : sequence of Penalty, optional
        Those of the evidence, if they are known already.

    Returns
    -------
    Assessment
        Expected correlation with the true f_n and its lower bound T in [0, 1]; NaN where not assessed.
    """
    expected, bound = motion_assessment(evidence)
    for each in find_penalties(evidence) if penalties is None else penalties:
        if not each.counted:
            kept = max(1.0 - each.fraction, 0.0)
            expected, bound = kept * expected, kept * bound
    return Assessment(expected, bound)


def find_penalties(evidence: Evidence) -> list[Penalty]:
    """All penalties of a frame, the largest first."""
    found = [
        _boundary(evidence),
        _inner_boundary(evidence),
        _missing_force(evidence),
        _softness(evidence),
        _unseen(evidence),
        _size(evidence),
        *_contradictions(evidence),
    ]
    return sorted((each for each in found if each is not None and each.fraction > 0.0), reverse=True)


def describe_penalties(penalties: Sequence[Penalty]) -> str:
    """Penalties of at least REPORTED in words, in their order; empty where there is none."""
    return join_reasons(*(each.words for each in penalties if each.fraction >= REPORTED))


def penalise_friction(frame: FrameForces, check: FrictionCheck | None, *, measured: bool = False) -> FrameForces:
    """Apply the friction check of the whole sequence to one frame.

    Parameters
    ----------
    frame : FrameForces
        As solved.
    check : FrictionCheck or None
        Friction coefficient that the motion of all frames shows.
    measured : bool
        Whether the coefficient was measured from the motion: its interval then enters the standard deviations.

    Returns
    -------
    FrameForces
        With reasons, sliding probabilities and standard deviations after the check.
    """
    if check is None or frame.status is FrameStatus.FAILED:
        return frame
    if check.agrees:
        return widen_for_friction(frame, check.low, check.measured, 1.0 / COVERAGE_FACTOR) if measured else frame
    words = (
        f"the motion fits a friction of {check.measured:.2f} ({check.low:.2f} to {check.high:.2f}) better than the "
        f"given {check.given:g}, and smooth walls, a base with friction or a wrong step look the same"
    )
    # last: it widens the intervals, and the trust contains the power gap that it follows from
    penalised = replace(frame, trust_penalties=join_reasons(frame.trust_penalties, words))
    if frame.sliding_probability is not None:
        slides = sliding_probability_at(
            frame.sliding_probability, check.given, check.measured, 1.0 - frame.position_weight
        )
        penalised = replace(penalised, sliding_probability=slides, state=contact_state(frame.fn, slides))
    return widen_for_friction(penalised, check.given, check.measured)


def penalise_contradiction(frame: FrameForces, words: str) -> FrameForces:
    """Trust a frame less whose input contradicts itself, by evidence of the whole sequence.

    Parameters
    ----------
    frame : FrameForces
    words : str
        What was found, stated first.

    Returns
    -------
    FrameForces
        With trust and expected correlation of `expected_correlation.contradict`; a frame that failed stays as it is.
    """
    if frame.status is FrameStatus.FAILED:
        return frame
    return replace(
        frame,
        trust=contradict(frame.trust),
        expected_correlation=contradict(frame.expected_correlation),
        trust_penalties=join_reasons(words, frame.trust_penalties),
    )


def limit_for_few_photographs(frame: FrameForces, count: int) -> FrameForces:
    """Limit trust and expected correlation in a test of so few photographs that no motion confirms that of another.

    Parameters
    ----------
    frame : FrameForces
    count : int
        Photographs of the whole test.
    """
    words = describe_few_photographs(count)
    return limit_trust(frame, TRUST_OF_FEW, TRUST_OF_FEW, words) if words else frame


def limit_for_missing_load(frame: FrameForces) -> FrameForces:
    """Limit trust and expected correlation where nothing is known that presses the grains together."""
    return limit_trust(frame, TRUST_WITHOUT_LOAD, TRUST_WITHOUT_LOAD, "")


def limit_by_intervals(frame: FrameForces) -> FrameForces:
    """Limit trust and expected correlation of hard grains to what the error bars of the forces leave."""
    most = most_by_intervals(frame)
    words = "the error bars are as large as the forces: look for a rod that others or walls seem to clamp"
    return limit_trust(frame, most, most, words)


def most_by_intervals(frame: FrameForces) -> float:
    """Return the greatest trust that the error bars leave; 1 of soft grains, whose error bars are wide.

    Notes
    -----
    2.5 R − .4 with R of `correlation_by_intervals`: 1 from R = .56 on, where the error bars are 1.5 times the standard
    deviation of the forces. In frames of little motion R falls to .45 although r is above .9; below .4 a few forces are
    undetermined and large, as those of a rod that others clamp.
    """
    expected = 1.0 if frame.soft else correlation_by_intervals(frame)
    if math.isnan(expected):
        return 1.0
    slope, least = LEFT_BY_INTERVALS
    return min(max(slope * expected - least, 0.0), 1.0)


def limit_trust(frame: FrameForces, most: float, expected: float, words: str) -> FrameForces:
    """Limit trust and expected correlation for a reason, stated first; frames of less trust stay as they are."""
    if not frame.trust > most:
        return frame
    return replace(
        frame,
        trust=most,
        expected_correlation=min(frame.expected_correlation, expected),
        trust_penalties=join_reasons(words, frame.trust_penalties),
    )


def describe_few_photographs(count: int) -> str:
    """State that a test of so many photographs has too few of them; empty: it has enough."""
    if count >= FEW_PHOTOGRAPHS:
        return ""
    if count == 1:
        return "the test has only 1 photograph: no motion confirms the forces; take more"
    return f"the test has only {count} photographs: one motion alone is not confirmed by another; take more"


def describe_few_grains(evidence: Evidence) -> str:
    """State that a packing has too few interior grains; empty: it has enough."""
    if interior_limit(evidence) >= 1.0:
        return ""
    grains = "1 grain has" if evidence.interior == 1 else f"{evidence.interior} grains have"
    return (
        f"only {grains} neighbours all around: too few to judge their forces; photograph a larger part of the packing"
    )


def _contradictions(evidence: Evidence) -> list[Penalty]:
    """What the expected correlation loses to each measure of the evidence."""
    if math.isnan(evidence.disagreement) or not evidence.assessed:
        return []
    found = evidence.information
    moved = (
        f"rods moved as by {math.degrees(evidence.shear):.2g}° of shear since the photograph before: take photographs "
        "more often, every .25°"
    )
    lost = losses(evidence)
    coarse = dict.fromkeys(STEP_SHOWN_BY, "")  # the step is named once, where it costs most
    if evidence.shear > REFERENCE_STEP and not lost.get("coarse_step", 0.0) >= REPORTED:
        coarse[max(STEP_SHOWN_BY, key=lambda name: lost.get(name, 0.0))] = f": {moved}"
    noisy = lost.get("noise", 0.0) > REPORTED
    hidden = f"a noise of {1e6 * found.noise:.3g} µm hides the overlaps" if noisy else ""
    words = {
        "disagreement_of_estimates": f"forces from the motion and from the positions agree by {evidence.agreement:.2f} "
        "only: camera, radii, walls or friction are wrong, or the packing does what this model lacks",
        "disagreement_with_either": "forces from the motion agree neither with those from the positions nor with the "
        f"overlaps by more than {np.fmax(evidence.agreement, evidence.overlap_agreement):.2f}: "
        + (hidden or "radii or walls are wrong, or noise hides the overlaps"),
        "correction": f"the forces correct the measured motion by ε = {evidence.correction:.2g}: tracks, friction, a "
        "missing contact",
        "previous_residual": f"the previous forces leave a residual of ū = {evidence.old_unbalance:.2g}: the packing "
        f"rearranges, or walls and photographs do not belong together{coarse['previous_residual']}",
        "disagreement_of_members": f"the methods disagree by {100.0 * evidence.disagreement:.0f} % of the forces: "
        f"noise of {1e6 * found.noise:.3g} µm against {1e6 * found.motion:.3g} µm that neighbours move in a step",
        "gap_error": f"gaps of strong contacts deviate by {1e6 * found.gap_error:.3g} µm beyond noise: radii or "
        "centres are wrong, or grains soft; measure radii, or let calibration find them",
        "disagreement_of_positions": "forces from the positions and from the balance of overlaps agree by "
        f"{evidence.position_agreement:.2f} only: "
        + (hidden or "radii, centres or the camera are wrong, or noise hides the overlaps"),
        "closed_overlap": f"gaps were corrected by {1e6 * evidence.corrected_gap:.3g} µm as errors of single rods, and "
        "overlaps with them: little is left that shows forces where nothing slides; measure centres and radii",
        "power_gap": f"{100.0 * evidence.power_gap:.0f} % of the power of friction at its limit is missing from the "
        "measured sliding: the friction of rods, walls or base, rotations, or the order of the photographs",
        "hidden_sliding": f"contacts slide by {found.slide_signal:.2g} times the noise of a slide only: use a step "
        "with more shear, or more exact positions",
        "load_mismatch": f"the mean stress is {evidence.load_fraction:.2f} of the load: walls, loads or contacts "
        "are wrong",
        "force_residual": f"a grain is out of balance by {evidence.unbalance:.2g} of the mean force, since forces in "
        "balance are far from those that motion and positions show: contacts, walls or friction are not as stated",
        "inertial_number": f"the inertial number is {evidence.inertial_number:.2g}: part of the forces accelerates "
        "grains; load more slowly, or photograph at rest",
        "coarse_step": moved,
        "undetermined": f"no load is known, and balance leaves {100.0 * found.undetermined:.0f} % of the components of "
        "forces open: photograph the walls, and state the load on one",
        "noise": f"a noise of {1e6 * found.noise:.3g} µm hides overlaps, and no load is known: state one, or measure "
        "positions more exactly",
        "few_interior": f"no load is known, and only {evidence.interior:g} grains have neighbours all around: "
        "photograph a larger part of the packing, or its walls",
        "force_change": f"{100.0 * evidence.force_change:.0f} % of the force pattern is new{coarse['force_change']}",
    }
    little = LITTLE_KNOWN | BY_NOISE if noisy else LITTLE_KNOWN
    return [Penalty(loss, words[name], counted=True, little_known=name in little) for name, loss in lost.items()]


def _boundary(evidence: Evidence) -> Penalty | None:
    beyond = evidence.information.beyond
    words = f"{beyond} grains are beyond a wall, which carries no force there: correct the walls' ends or their place"
    return Penalty(BEYOND_WALL_LOSS * beyond / max(evidence.grains, 1), words)


def _inner_boundary(evidence: Evidence) -> Penalty | None:
    borne = evidence.boundary_reaction
    words = (
        f"grains of the boundary inside the packing bear {100.0 * borne:.1f} % of all forces, which nothing states: "
        "take those that are free from the boundary"
    )
    return Penalty(INNER_BOUNDARY_LOSS, words) if borne > LEAST_REACTION else None


def _missing_force(evidence: Evidence) -> Penalty | None:
    """What is left of r if only the forces were missing that would hold the grains: 1/√(1 + x), x their fraction."""
    missing = evidence.missing_force
    words = (
        f"grains that nothing holds lack forces of {100.0 * math.sqrt(missing):.0f} % of all others (rms): find the "
        "contact, the wall or the rod that holds them"
    )
    return Penalty(1.0 - 1.0 / math.sqrt(1.0 + missing), words) if missing > 0.0 else None


def _softness(evidence: Evidence) -> Penalty | None:
    if not (evidence.information.soft and math.isnan(evidence.disagreement)):
        return None
    return Penalty(
        SOFT_CHAIN_LOSS, "the grains are soft, which a single chain cannot use: the ensemble reads their overlaps"
    )


def _size(evidence: Evidence) -> Penalty | None:
    words = describe_few_grains(evidence)
    return Penalty(1.0 - interior_limit(evidence), words, counted=True) if words else None


def _unseen(evidence: Evidence) -> Penalty | None:
    words = f"rods that were inferred: {evidence.inferred}"
    return Penalty(unseen_penalty(evidence), f"{words} (grains are unseen: find them in the photographs)", counted=True)
