"""Why a frame's forces are not to be trusted more: every reason in words, with what to do about it.

`judgement.trust` is what the methods themselves expect of their forces. A lower bound must also count what they cannot
see: that nothing slides, that noise hides what slides, that radii are wrong, that rods are beyond the walls. Agreement
of all methods is no information there.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

from solver.convex.friction_check import INTERVAL, FrictionCheck
from solver.sequence.frame_forces import FrameForces, FrameStatus
from solver.sequence.judging.intervals import widen_for_friction
from solver.sequence.judging.judgement import (
    TRUST_CORRECTION,
    TRUST_DISAGREEMENT,
    Evidence,
    find_faults,
    trust,
    unseen_doubt,
)
from solver.sequence.settings import SURFACE
from solver.statistics.sliding import contact_state, slides_at

SUSPECT_TRUST = 0.6  # T of a suspect frame at most
STILL = (0.8, 0.25)  # rms sliding over its noise below which the motion tells less, and what is lost without any
NOISY = 0.5  # noise over the displacement between neighbours beyond which it hides sliding …
NOISE_LOSS = 0.25  # … and what is lost for each unit more
GROSS = 0.003  # of a diameter: noise that hides overlaps, too
SOFT_CHAIN = 0.15  # lost where a single chain takes soft grains for hard
COARSE = math.radians(0.25)  # [rad] shear of a step beyond which forces are not followed
COARSE_LOSS = 0.02  # for each such step more
UNEXPLAINED = (
    1.5,
    0.05,
)  # scatter of gaps over noise, or over the surfaces' own, beyond which radii or centres are wrong; loss per unit
BEYOND = 12.0  # share lost for each grain per grain that is beyond a wall
FRICTION_LOSS = (0.3, 0.1)  # for each e-fold by which the friction was told too low, too high
NAMED = 0.04  # share of the trust from which on a reason is worth words


class Doubt(NamedTuple):
    """One reason."""

    share: float  # of the trust that it takes
    words: str  # what is wrong; what to do about it
    counted: bool = False  # in `judgement.trust` already


def lower_bound(evidence: Evidence) -> float:
    """T in [0, 1]: the correlation with the true f_n is below it in one frame of twenty; NaN: not assessed."""
    bound = trust(evidence)
    for each in find_doubts(evidence):
        if not each.counted:
            bound *= max(1.0 - each.share, 0.0)
    return min(bound, SUSPECT_TRUST) if find_faults(evidence) else bound


def find_doubts(evidence: Evidence) -> list[Doubt]:
    """All reasons that take something off, the worst first."""
    found = [
        _stillness(evidence), _noise(evidence), _spacing(evidence), _radii(evidence), _boundary(evidence),
        _softness(evidence), _unseen(evidence), _disagreement(evidence), _correction(evidence),
    ]  # fmt: skip
    return sorted((each for each in found if each is not None and each.share > 0.0), reverse=True)


def tell_doubts(evidence: Evidence) -> str:
    """The reasons that are worth words, the worst first; empty: none is."""
    return "; ".join(each.words for each in find_doubts(evidence) if each.share >= NAMED)


def _stillness(evidence: Evidence) -> Doubt | None:
    """Where nothing slides nothing contradicts any forces; positions that were asked make up for it."""
    found = evidence.information
    if math.isnan(found.slide_signal):
        return None
    enough, most = STILL
    share = most * max(1.0 - found.slide_signal / enough, 0.0) * _motion_share(evidence) ** 2
    slide = f"{100.0 * found.sliding:.0f} % of the contacts slide by more than noise"
    if found.sliding < 0.01:
        slide = "nothing slides by more than noise"
    return Doubt(share, f"{slide}, and forces are read from sliding: shear more between photographs")


def _noise(evidence: Evidence) -> Doubt | None:
    """Noise hides the sliding from the motion and the overlaps from the positions."""
    found = evidence.information
    if not found.motion > 0.0:
        return None
    hidden = max(found.noise / found.motion - NOISY, 0.0)
    share = NOISE_LOSS * hidden * min(found.noise / (GROSS * found.diameter), 1.0)
    told = f"noise of {1e6 * found.noise:.3g} µm against {1e6 * found.motion:.3g} µm that neighbours move in a step"
    return Doubt(share, f"{told}: larger steps, sharper photographs, or more of them")


def _spacing(evidence: Evidence) -> Doubt | None:
    steps = evidence.shear / COARSE - 1.0
    if not steps > 0.0:
        return None
    words = f"photographs are {math.degrees(evidence.shear):.2g}° of shear apart: take them every .25°"
    return Doubt(COARSE_LOSS * steps * _motion_share(evidence), words)


def _radii(evidence: Evidence) -> Doubt | None:
    found = evidence.information
    if math.isnan(found.gap_error) or found.soft or not found.noise > 0.0:
        return None
    ratio = found.gap_error / max(found.noise, SURFACE * found.diameter)
    words = (
        f"gaps of strong contacts scatter by {1e6 * found.gap_error:.3g} µm beyond noise: radii or centres are wrong, "
        "or grains soft; measure radii, or let calibration find them"
    )
    return Doubt(UNEXPLAINED[1] * max(ratio - UNEXPLAINED[0], 0.0), words)


def _boundary(evidence: Evidence) -> Doubt | None:
    beyond = evidence.information.beyond
    words = f"{beyond} grains are beyond a wall, which bears nothing there: mend the walls' ends or their place"
    return Doubt(BEYOND * beyond / max(evidence.grains, 1), words)


def _softness(evidence: Evidence) -> Doubt | None:
    if not (evidence.information.soft and math.isnan(evidence.disagreement)):
        return None
    return Doubt(
        SOFT_CHAIN, "the grains are soft, which a single chain does not know: the ensemble asks their overlaps"
    )


def _unseen(evidence: Evidence) -> Doubt | None:
    share = unseen_doubt(evidence)
    words = "; ".join(filter(None, (
        f"holes that would fit a rod: {evidence.holes}" if evidence.holes else "",
        f"rods that were inferred: {evidence.inferred}" if evidence.inferred else "",
    )))  # fmt: skip
    return Doubt(share, f"{words} (grains are unseen: find them in the photographs)", counted=True)


def _disagreement(evidence: Evidence) -> Doubt | None:
    if math.isnan(evidence.disagreement):
        return None
    share = TRUST_DISAGREEMENT[0] * evidence.disagreement ** TRUST_DISAGREEMENT[1] * _motion_share(evidence)
    return Doubt(share, f"the methods disagree by {100.0 * evidence.disagreement:.0f} % of the forces", counted=True)


def _correction(evidence: Evidence) -> Doubt | None:
    correction = evidence.correction
    if math.isnan(correction):
        return None
    share = TRUST_CORRECTION[0] * max(correction, 0.0) ** TRUST_CORRECTION[1] * _motion_share(evidence)
    words = f"the forces correct the measured motion by ε = {correction:.2g}: tracks, friction, a missing contact"
    return Doubt(share, words, counted=True)


def _motion_share(evidence: Evidence) -> float:
    """How much the motion counts in the reported field."""
    return 1.0 - evidence.positions_share


def doubt_friction(frame: FrameForces, check: FrictionCheck | None, *, measured: bool = False) -> FrameForces:
    """The frame as it is to be believed once the motion of all frames has contradicted the friction, if it has.

    measured: the friction was not told, but read from the motion: how exactly, counts in the forces' deviations.
    """
    if check is None or frame.status is FrameStatus.FAILED:
        return frame
    if check.agrees:
        return widen_for_friction(frame, check.low, check.measured, 1.0 / INTERVAL) if measured else frame
    excess = math.log(check.measured / check.given)
    share = min(max(FRICTION_LOSS[0] * excess, -FRICTION_LOSS[1] * excess), 1.0) * (1.0 - frame.positions_share)
    words = (
        f"the motion contradicts the friction: {check.measured:.2f} ({check.low:.2f} to {check.high:.2f}) for "
        f'{check.given:g}; measure it, or set friction = "measured"'
    )
    told = replace(frame, trust=frame.trust * (1.0 - share), doubt="; ".join(filter(None, (words, frame.doubt))))
    if frame.sliding_probability is not None:
        slides = slides_at(frame.sliding_probability, check.given, check.measured, 1.0 - frame.positions_share)
        told = replace(told, sliding_probability=slides, state=contact_state(frame.fn, slides))
    return widen_for_friction(told, check.given, check.measured)
