"""How far a frame's forces may be trusted, and its status, from quantities that need no truth.

The constants were fitted on discrete-element truths with one Gauss-Seidel chain; T says "given these inputs": it is
blind to a friction coefficient that is too high, to scattered radii and to a kinematic number that is too large.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from solver.frame_forces import FrameStatus
from solver.grains import Array

SUSPECT_CORRECTION = 0.15  # ε beyond which the forces contradict the motion
SUSPECT_PRESSURE_JUMP = 0.15  # |Δp| / p between frames
SETTLED_CORRECTION = 0.08  # ε below which a frame can count as settled
SETTLING_FRAMES = 3
REARRANGING_UNBALANCE = 0.064  # ū at a shear of 0.25° between photographs
REFERENCE_SHEAR = math.radians(0.25)
NO_HISTORY_UNBALANCE = 0.55  # ū beyond which former forces are worth nothing


@dataclass(frozen=True, slots=True)
class Evidence:
    """What a frame's status is decided by."""

    reset: bool
    correction: float  # ε
    old_unbalance: float  # ū, NaN without former forces
    pressure_jump: float  # |Δp| / p, NaN without a former pressure
    shear: float  # [rad] of the packing since the last frame
    frames_since_event: int  # since a reset, a suspect or a rearranging frame


def trust(correction: float) -> float:
    """T = clip(1 − .97 ε^.81, 0, 1), a conservative estimate of the correlation with the true normal forces."""
    return float(np.clip(1.0 - 0.97 * max(correction, 0.0) ** 0.81, 0.0, 1.0))


def free_standard_deviation(fn: Array) -> Array:
    """σ of every normal force (c,) [N] without an ensemble: σ² = ⟨f⟩² (.071² + .239² f/⟨f⟩)."""
    bearing = fn > 0
    if not bearing.any():
        return np.zeros_like(fn)
    mean = fn[bearing].mean()
    return mean * np.sqrt(0.071**2 + 0.239**2 * np.maximum(fn, 0.0) / mean)


def rearranging_level(shear: float) -> float:
    """ū beyond which a frame counts as rearranging; smaller where the photographs are closer."""
    return REARRANGING_UNBALANCE * float(np.clip((shear / REFERENCE_SHEAR) ** 1.5, 0.25, 4.0))


def is_suspect(evidence: Evidence) -> bool:
    return not evidence.reset and (
        evidence.correction > SUSPECT_CORRECTION or evidence.pressure_jump > SUSPECT_PRESSURE_JUMP
    )


def judge(evidence: Evidence) -> tuple[FrameStatus, str]:
    """Give a frame its status and say why in a sentence."""
    if evidence.reset:
        return FrameStatus.RESET, "there were no former forces to start from"
    if evidence.correction > SUSPECT_CORRECTION:
        return (
            FrameStatus.SUSPECT,
            f"the forces must correct the measured motion by ε = {evidence.correction:.2f} (> {SUSPECT_CORRECTION}): "
            "a strong contact is likely missing or the motion is wrong",
        )
    if evidence.pressure_jump > SUSPECT_PRESSURE_JUMP:
        return (
            FrameStatus.SUSPECT,
            f"the mean stress jumped by {100 * evidence.pressure_jump:.0f} % (> {100 * SUSPECT_PRESSURE_JUMP:.0f} %)",
        )
    level = rearranging_level(evidence.shear)
    if evidence.old_unbalance > level:
        return (
            FrameStatus.REARRANGING,
            f"the former forces leave ū = {evidence.old_unbalance:.3f} (> {level:.3f}) of unbalance on the new network",
        )
    if evidence.frames_since_event < SETTLING_FRAMES:
        return (
            FrameStatus.SETTLING,
            f"{evidence.frames_since_event} of {SETTLING_FRAMES} frames since the last event",
        )
    if evidence.correction > SETTLED_CORRECTION:
        return FrameStatus.SETTLING, f"the correction ε = {evidence.correction:.3f} is above {SETTLED_CORRECTION}"
    return FrameStatus.SETTLED, "history, motion and load agree"
