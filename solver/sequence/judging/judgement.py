"""How far a frame's forces may be trusted, and its status, from quantities that need no truth.

The constants were fitted on discrete-element truths (`app.study.report.status.refit_status` prints them anew). Two
quantities speak of different errors: the members' disagreement D grows with whatever makes the motion hard to
read (noise, wide spacing, rearrangement), the correction ε with whatever makes it impossible (a missing contact,
friction taken too low, a wrong track). T says "given these inputs": it is all but blind to friction taken too high.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.sequence.frame_forces import FrameStatus
from solver.sequence.judging.information import NO_INFORMATION, Information
from solver.statistics.agreement import pearson

# 1 − T = a D^p + b ε^q, a bound on 1 − r that one frame in fifteen passes: (a, p) and (b, q).
TRUST_DISAGREEMENT = (0.83, 2.65)
TRUST_CORRECTION = (0.42, 0.73)
INFERRED_DOUBT = 3.0  # share of T lost for each inferred grain per grain: one in seven is at the wrong place
HOLE_DOUBT = 6.0  # share of T lost for each hole per grain: neighbours of an unseen grain push into nothing
CHAIN_CORRECTION = (0.95, 0.8)  # the same for a single chain, which has no members to disagree
CHAIN_REACH = 4.45  # share of T lost per mean diameter of its gap threshold
NORMAL_DEVIATION = (0.003, 0.088, 0.985)  # of σ²/⟨f⟩² = a² + b² f/⟨f⟩ + (c s/⟨f⟩)², s the members' spread
TANGENT_DEVIATION = (0.001, 0.008, 1.206)
CHAIN_DEVIATION = (0.071, 0.239)  # a, b without members

SUSPECT_CORRECTION = 0.25  # ε beyond which the forces contradict the motion
MOSTLY = 0.6  # share of positions from which on what contradicts the motion does not contradict the field
MOST_UNSEEN = 0.2  # share of the grains; here and there a tracker loses one in a hundred, seldom one in ten
SUSPECT_PRESSURE_JUMP = 0.15  # |Δp| / p between frames
UNBALANCED = 0.05  # worst |ΣF| of a grain over the mean f_n; sound fields stay below .01, faulty ones reach .1 to 10
CHAIN_UNBALANCED = 0.15  # the same of a single chain, which leaves the motion some say: up to .07 in sound ones
# Mean stress over the stress of the loads: (1 + 1/K)/2 to (1 + K)/2 with K = 4, beyond what granular matter withstands.
LOAD_SHARES = (0.62, 2.5)
SETTLED_CORRECTION = 0.15  # ε below which a frame can count as settled
SETTLED_DIFFERENCE = 0.04  # H below which a frame can count as settled
SETTLING_FRAMES = 2  # after which the mean correlation is within .005 of that of later frames, at 0 to 40 µm of noise
REARRANGING_UNBALANCE = 0.037  # ū at a shear of 0.25° between photographs: a fifth of the force pattern is new
REFERENCE_SHEAR = math.radians(0.25)
# Share of the inferred forces that is new since the last photograph, from which on nothing is settled: members cling to
# former forces, so that it means a fifth of the true ones. It is .06 at .25° of shear, .2 at 1°.
NEW_FORCES = 0.12


@dataclass(frozen=True, slots=True)
class Evidence:
    """What a frame's status is decided by. NaN: not known."""

    reset: bool
    correction: float  # ε of the first chain
    disagreement: float  # D: rms spread of the members' f_n over the rms f_n; NaN for a single chain
    old_unbalance: float  # ū, NaN without former forces
    pressure_jump: float  # |Δp| / p of the reported field, NaN without a former pressure
    load_share: float  # mean stress of the reported field over the stress of the loads, NaN without loads
    unbalance: float  # worst |ΣF| of a grain over the mean f_n, of the reported field
    shear: float  # [rad] of the packing since the last frame
    frames_since_event: int  # since a reset, a suspect or a rearranging frame
    start_difference: float = math.nan  # H: of two chains started differently, over the rms; NaN: not computed
    start_forgotten: bool = False  # H was below its level for so long that it need not be known
    holes: int = 0  # places that a rod would fit into
    inferred: int = 0  # grains that no photograph shows
    grains: int = 0  # that take part
    reach: float = 0.0  # gap threshold of a single chain over the mean diameter: it lets false contacts in
    assessed: bool = True  # False: no motion leads to the frame, so that its forces are a guess
    mixed_trust: float = math.nan  # what motion and positions mixed are worth; NaN: positions were not asked
    positions_share: float = 0.0  # of them in the reported field
    unseen_share: float = 0.0  # of the grains that any photograph shows, those that this one does not
    hidden_share: float = 0.0  # 1 − correlation of the field with what is left when bridged grains are dropped
    information: Information = NO_INFORMATION
    force_change: float = math.nan  # 1 − correlation of f_n with that of the frame before, over the contacts of either


def trust(evidence: Evidence) -> float:
    """T in [0, 1], a conservative estimate of the correlation with the true normal forces; NaN: not assessed.

    Every deduction is made here: for doubt of the forces, for holes, for what bridged grains hide.
    """
    if not math.isnan(evidence.mixed_trust):
        return _with_deductions(evidence.mixed_trust, evidence)
    if math.isnan(evidence.correction) or not evidence.assessed:
        return math.nan
    correction, disagreement = max(evidence.correction, 0.0), evidence.disagreement
    if math.isnan(disagreement):
        doubt = CHAIN_CORRECTION[0] * correction ** CHAIN_CORRECTION[1] + CHAIN_REACH * evidence.reach
    else:
        doubt = (
            TRUST_DISAGREEMENT[0] * disagreement ** TRUST_DISAGREEMENT[1]
            + TRUST_CORRECTION[0] * correction ** TRUST_CORRECTION[1]
        )
    return _with_deductions(1.0 - doubt, evidence)


def _with_deductions(trust: float, evidence: Evidence) -> float:
    """T less what holes and inferred grains take off, and what is hidden."""
    if evidence.unseen_share > MOST_UNSEEN:
        trust *= 1.0 - evidence.unseen_share
    return float(np.clip(trust, 0.0, 1.0) * max(1.0 - unseen_doubt(evidence), 0.0)) * (1.0 - evidence.hidden_share)


def unseen_doubt(evidence: Evidence) -> float:
    """Share of the trust that rods take which no photograph shows: holes that would fit one, and inferred ones."""
    doubtful = HOLE_DOUBT * evidence.holes + INFERRED_DOUBT * evidence.inferred
    return doubtful / max(evidence.grains, 1)


def hidden_share(fn: Array, shown: NDArray[np.bool_]) -> float:
    """What is lost of forces (c,) [N] when only some contacts (c,) are shown: 1 − correlation with all.

    What is left out counts as zero for whoever compares the whole network.
    """
    return 1.0 - pearson(np.where(shown, fn, 0.0), fn)


def free_standard_deviation(fn: Array, spread: Array | None = None) -> Array:
    """σ of every normal force (c,) [N], from the forces fn and the members' spread (c,) [N]; None: a single chain."""
    if spread is None:
        return _deviation(fn, np.zeros_like(fn), (*CHAIN_DEVIATION, 0.0))
    return _deviation(fn, spread, NORMAL_DEVIATION)


def tangential_standard_deviation(fn: Array, friction: Array | float, spread: Array | None = None) -> Array:
    """σ of every tangential force (c,) [N], from fn (c,) [N], friction and the members' spread of f_t (c,) [N]."""
    if spread is None:
        return friction * free_standard_deviation(fn)
    return _deviation(fn, spread, TANGENT_DEVIATION)


def _deviation(fn: Array, spread: Array, constants: tuple[float, float, float]) -> Array:
    bearing = fn > 0
    if not bearing.any():
        return np.zeros_like(fn)
    mean, (a, b, c) = fn[bearing].mean(), constants
    return mean * np.sqrt(a**2 + b**2 * np.maximum(fn, 0.0) / mean + (c * spread / mean) ** 2)


def rearranging_level(shear: float) -> float:
    """ū beyond which a frame counts as rearranging; smaller where the photographs are closer.

    It ends at .015, above which events stood out at 0.1° and below: a smaller level takes noise for events.
    """
    return REARRANGING_UNBALANCE * float(np.clip((shear / REFERENCE_SHEAR) ** 1.5, 0.4, 4.0))


def is_suspect(evidence: Evidence) -> bool:
    return not evidence.reset and bool(find_faults(evidence))


class Standing(NamedTuple):
    """A frame's status, and why it has it."""

    status: FrameStatus
    reason: str  # a sentence for the user


def judge(evidence: Evidence) -> Standing:
    """Give a frame its status and say why in a sentence."""
    status, why = _judge(evidence)
    if not evidence.assessed and math.isnan(evidence.mixed_trust):
        return Standing(
            status, "no motion leads to the first frame: its forces are a guess, and their trust is not assessed"
        )
    if evidence.holes:
        places = "1 hole" if evidence.holes == 1 else f"{evidence.holes} holes"
        why += f"; {places} would fit a rod: grains may be unseen, and the trust is lowered for it"
    return Standing(status, why)


def _judge(evidence: Evidence) -> tuple[FrameStatus, str]:
    faults = find_faults(evidence)
    if evidence.reset:
        return FrameStatus.RESET, "; ".join(["there were no former forces to start from", *faults])
    if faults:
        return FrameStatus.SUSPECT, "; ".join(faults)
    level = rearranging_level(evidence.shear)
    if evidence.old_unbalance > level:
        return (
            FrameStatus.REARRANGING,
            f"the former forces leave ū = {evidence.old_unbalance:.3f} (> {level:.3f}) of unbalance on the new network",
        )
    if evidence.force_change > NEW_FORCES:
        return FrameStatus.SETTLING, _tell_change(evidence)
    if evidence.frames_since_event < SETTLING_FRAMES:
        return (
            FrameStatus.SETTLING,
            f"{evidence.frames_since_event} of {SETTLING_FRAMES} frames since the last event",
        )
    if math.isnan(evidence.correction):
        return FrameStatus.SETTLING, "nothing tells how much the forces must correct the measured motion"
    if evidence.correction > SETTLED_CORRECTION:
        return FrameStatus.SETTLING, f"the correction ε = {evidence.correction:.3f} is above {SETTLED_CORRECTION}"
    unknown = math.isnan(evidence.start_difference) and not evidence.start_forgotten
    if unknown and not math.isnan(evidence.disagreement):
        return FrameStatus.SETTLING, "nothing tells how much of the start is left in the forces"
    if evidence.start_difference > SETTLED_DIFFERENCE:
        return (
            FrameStatus.SETTLING,
            f"two different starts still differ by H = {evidence.start_difference:.3f} (> {SETTLED_DIFFERENCE})",
        )
    return FrameStatus.SETTLED, "history, motion and load agree"


def _tell_change(evidence: Evidence) -> str:
    """That too much is new since the last photograph, over how much shear, and how much less would do."""
    change, shear = evidence.force_change, math.degrees(evidence.shear)
    told = f"{100.0 * change:.0f} % of the force pattern is new since the last photograph, {shear:.2g}° of shear ago"
    if evidence.shear <= REFERENCE_SHEAR:
        return told
    return (
        f"{told}: photographs are too far apart; every {shear * 0.5 * NEW_FORCES / change:.1g}° would follow the forces"
    )


def find_faults(evidence: Evidence) -> list[str]:
    """What is wrong with the forces, one sentence each."""
    faults = []
    if evidence.unseen_share > MOST_UNSEEN:
        faults.append(
            f"{100 * evidence.unseen_share:.0f} % of the grains are not seen in it (> {100 * MOST_UNSEEN:.0f} %): a "
            "part of the photograph is not readable, and the forces there follow from those around"
        )
    unbalanced = CHAIN_UNBALANCED if math.isnan(evidence.disagreement) else UNBALANCED
    if not evidence.unbalance <= unbalanced:  # NaN is no balance
        faults.append(
            f"pathological: the worst grain is out of balance by {evidence.unbalance:.2g} mean forces "
            f"(> {unbalanced}): a contact is missing"
        )
    if not math.isnan(evidence.load_share) and not LOAD_SHARES[0] <= evidence.load_share <= LOAD_SHARES[1]:
        faults.append(
            f"pathological: the mean stress is {evidence.load_share:.2f} of the load, which allows "
            f"{LOAD_SHARES[0]} to {LOAD_SHARES[1]}: force chains are missing or jammed"
        )
    if evidence.correction > SUSPECT_CORRECTION and evidence.positions_share < MOSTLY:
        faults.append(
            f"the forces must correct the measured motion by ε = {evidence.correction:.2f} (> {SUSPECT_CORRECTION}): "
            "a strong contact is likely missing, friction too low or the motion wrong"
        )
    if evidence.pressure_jump > SUSPECT_PRESSURE_JUMP:
        faults.append(
            f"the mean stress jumped by {100 * evidence.pressure_jump:.0f} % (> {100 * SUSPECT_PRESSURE_JUMP:.0f} %)"
        )
    return faults
