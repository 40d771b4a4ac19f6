"""Status of a frame: reset, suspect, rearranging, settling or settled, each with its reason in one sentence."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..frame_forces import FrameStatus
from ..part_settings import REFERENCE_STEP
from .evidence import Evidence
from .expected_correlation import fraction_seen
from .fitted import FITTED
from .trust import MAX_UNSEEN_FRACTION, motion_assessment

SUSPECT_CORRECTION = 0.25  # ε beyond which the forces contradict the motion
MOSTLY_POSITIONS = 0.6  # weight of the position-only estimate above which ε no longer makes a frame suspect
SUSPECT_PRESSURE_JUMP = 0.15  # |Δp| / p between frames
# T from which neither ε nor a jump makes a frame suspect whose forces are in balance: r is then below .82 in one frame
# of twenty at most, so that these two are sudden motion and sudden stress, and no contradiction.
RELIABLE = 0.85
IN_BALANCE = 0.01  # worst |ΣF| of a grain over the mean f_n: below it where friction and contacts can hold it
UNBALANCED = 0.05  # worst |ΣF| of a grain over the mean f_n: .1 to 10 in faulty fields
CHAIN_UNBALANCED = 0.15  # the same for a single chain, which gives the motion some weight: up to .07 in sound ones
# Mean stress over the stress of the loads: (1 + 1/K)/2 to (1 + K)/2 with K = 4, beyond what granular matter withstands.
LOAD_FRACTIONS = (0.62, 2.5)
SETTLED_CORRECTION = 0.15  # ε below which a frame can count as settled
SETTLED_DIFFERENCE = 0.04  # H below which a frame can count as settled
SETTLING_FRAMES = 2  # after which the mean correlation is within .005 of that of later frames, at 0 to 40 µm of noise
REARRANGING_UNBALANCE: float = FITTED["status"]["rearranging_residual"]  # ū at REFERENCE_STEP between photographs
# Fraction of the inferred force pattern that is new since the last photograph, above which no frame is settled. The
# members keep part of the previous forces, so it means a fifth of the true pattern. It is .06 at .25° of shear and .2
# at 1°.
NEW_FORCES = 0.12


def rearranging_level(shear: float) -> float:
    """ū above which a frame counts as rearranging, for a shear [rad] between photographs.

    The level does not fall below .015: at .1° and less a smaller one takes noise for events.
    """
    return REARRANGING_UNBALANCE * float(np.clip((shear / REFERENCE_STEP) ** 1.5, 0.4, 4.0))


def is_suspect(evidence: Evidence) -> bool:
    """Whether the forces contradict the motion or the load."""
    return not evidence.reset and bool(find_faults(evidence))


class StatusDecision(NamedTuple):
    """A frame's status with its reason."""

    status: FrameStatus
    reason: str  # a sentence for the user


def decide_status(evidence: Evidence) -> StatusDecision:
    """Decide the status of a frame from its evidence."""
    status, why = _decide(evidence)
    if not evidence.assessed and math.isnan(evidence.mixed_trust):
        return StatusDecision(
            status, "no motion leads to the first frame: its forces are a guess, and their trust is not assessed"
        )
    if evidence.holes and not evidence.sought:
        places = "1 hole" if evidence.holes == 1 else f"{evidence.holes} holes"
        why += f"; {places} would fit a rod: grains may be unseen"
    return StatusDecision(status, why)


def _decide(evidence: Evidence) -> tuple[FrameStatus, str]:
    faults = find_faults(evidence)
    if evidence.reset:
        return FrameStatus.RESET, "; ".join(["there were no previous forces to start from", *faults])
    if faults:
        return FrameStatus.SUSPECT, "; ".join(faults)
    level = rearranging_level(evidence.shear)
    if evidence.old_unbalance > level:
        return (
            FrameStatus.REARRANGING,
            f"the previous forces leave a residual of ū = {evidence.old_unbalance:.3f} (> {level:.3f}) on the new "
            "network",
        )
    if evidence.force_change > NEW_FORCES:
        return FrameStatus.SETTLING, _describe_change(evidence)
    if evidence.frames_since_event < SETTLING_FRAMES:
        count = evidence.frames_since_event
        return (
            FrameStatus.SETTLING,
            f"the last event was {count} {'frame' if count == 1 else 'frames'} ago: settling takes {SETTLING_FRAMES}",
        )
    if math.isnan(evidence.correction):
        return FrameStatus.SETTLING, "the correction of the measured motion is not known"
    if evidence.correction > SETTLED_CORRECTION:
        return FrameStatus.SETTLING, f"the correction ε = {evidence.correction:.3f} is above {SETTLED_CORRECTION}"
    unknown = math.isnan(evidence.start_difference) and not evidence.start_forgotten
    if unknown and not math.isnan(evidence.disagreement):
        return FrameStatus.SETTLING, "the influence of the initial forces is not known"
    if evidence.start_difference > SETTLED_DIFFERENCE:
        return (
            FrameStatus.SETTLING,
            f"two different starts still differ by H = {evidence.start_difference:.3f} (> {SETTLED_DIFFERENCE})",
        )
    return FrameStatus.SETTLED, "history, motion and load agree"


def _describe_change(evidence: Evidence) -> str:
    """State how much of the force pattern is new, over which shear, and which spacing would follow it."""
    change, shear = evidence.force_change, math.degrees(evidence.shear)
    change_words = (
        f"{100.0 * change:.0f} % of the force pattern is new since the last photograph, {shear:.2g}° of shear ago"
    )
    if evidence.shear <= REFERENCE_STEP:
        return change_words
    return f"{change_words}: photographs are too far apart; take one every {shear * 0.5 * NEW_FORCES / change:.1g}°"


def find_faults(evidence: Evidence) -> list[str]:
    """List what contradicts the forces, one sentence each."""
    faults = []
    if evidence.unseen_fraction > MAX_UNSEEN_FRACTION:
        faults.append(
            f"{100 * evidence.unseen_fraction:.0f} % of the grains are not found in it "
            f"(> {100 * MAX_UNSEEN_FRACTION:.0f} %): a part of the photograph is unreadable, and the forces there "
            "follow from those around"
        )
    unbalanced = CHAIN_UNBALANCED if math.isnan(evidence.disagreement) else UNBALANCED
    if not evidence.unbalance <= unbalanced:  # NaN is no balance
        faults.append(
            f"the worst grain is out of balance by {evidence.unbalance:.2g} mean forces "
            f"(> {unbalanced}): a contact of it may be missing, or it accelerates"
        )
    if not math.isnan(evidence.load_fraction) and not LOAD_FRACTIONS[0] <= evidence.load_fraction <= LOAD_FRACTIONS[1]:
        faults.append(
            f"the mean stress is {evidence.load_fraction:.2f} of the load, which allows "
            f"{LOAD_FRACTIONS[0]} to {LOAD_FRACTIONS[1]}: force chains are missing or jammed"
        )
    if motion_assessment(evidence).trust >= RELIABLE and evidence.unbalance < IN_BALANCE:
        return faults
    # Where nothing slides the motion is noise, which any forces must correct.
    seen_correction = evidence.correction * fraction_seen(evidence)
    if seen_correction > SUSPECT_CORRECTION and evidence.position_weight < MOSTLY_POSITIONS:
        faults.append(
            f"the forces must correct the measured motion by ε = {evidence.correction:.2f} (> {SUSPECT_CORRECTION}): "
            "a strong contact is probably missing, friction too low or the motion wrong"
        )
    if evidence.pressure_jump > SUSPECT_PRESSURE_JUMP:
        faults.append(
            f"the mean stress jumped by {100 * evidence.pressure_jump:.0f} % (> {100 * SUSPECT_PRESSURE_JUMP:.0f} %)"
        )
    return faults
