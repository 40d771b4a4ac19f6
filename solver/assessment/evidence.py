"""Evidence of one solved frame: every measure that its status and its trust follow from."""

from __future__ import annotations

import math
from dataclasses import dataclass

from .motion_information import NO_INFORMATION, MotionInformation


@dataclass(frozen=True, slots=True)
class Evidence:
    """Measures of one solved frame, from which its status and trust follow. NaN: not known."""

    reset: bool
    correction: float  # ε: correction of the measured motion by the forces of the first chain
    disagreement: float  # D: rms standard deviation of f_n among the members over the rms f_n; NaN for a single chain
    old_unbalance: float  # ū: residual of the previous forces on this network; NaN without previous forces
    pressure_jump: float  # |Δp| / p of the reported field, NaN without a previous pressure
    load_fraction: float  # mean stress of the reported field over the stress of the loads, NaN without loads
    unbalance: float  # worst |ΣF| of a grain over the mean f_n, of the reported field
    shear: float  # [rad] of the packing since the last frame
    frames_since_event: int  # since a reset, a suspect or a rearranging frame
    start_difference: float = math.nan  # H: of two chains started differently, over the rms; NaN: not computed
    start_forgotten: bool = False  # H stayed below its level for enough frames
    holes: int = 0  # gaps inside the walls that a rod would fit into
    inferred: int = 0  # grains that no photograph shows
    grains: int = 0  # present in the frame
    interior: float = math.inf  # grains with neighbours all around: neither at a wall nor on the convex hull
    reach: float = 0.0  # gap threshold of a single chain over the mean diameter
    assessed: bool = True  # False: no motion leads to the frame
    mixed_trust: float = math.nan  # expected correlation of the mixed field; NaN: not mixed
    position_weight: float = 0.0  # weight of the position-only estimate in the reported field
    unseen_fraction: float = 0.0  # fraction of all tracked grains that this photograph does not show
    hidden_fraction: float = 0.0  # 1 − correlation of the field with itself without bridged grains
    information: MotionInformation = NO_INFORMATION
    agreement: float = math.nan  # correlation of the motion estimate with the position-only estimate
    position_agreement: float = math.nan  # of the position-only estimate with the motion-free balance of overlaps
    overlap_agreement: float = math.nan  # of the motion estimate with the motion-free balance of overlaps
    agreement_age: int = 0  # frames since these three were computed
    force_change: float = math.nan  # 1 − correlation of f_n with the previous frame, over the contacts of either
    power_gap: float = math.nan  # of the convex members: 0 if all friction acts at its limit against the sliding
    # Relative standard deviation of the sums of f_n among the members, where weight alone sets the scale; else NaN.
    scale_disagreement: float = math.nan
    inertial_number: float = math.nan  # of the step by the times of its photographs; NaN: no load is stated
    corrected_gap: float = 0.0  # [m] rms part of a gap that was corrected as errors of single grains
    centres_by_forces: bool = False  # errors of centres were found again by the forces of the sequence
    loaded: bool = True  # by a known load, or by weight alone: see `Packing.is_loaded`
    sought: bool = False  # rods that no photograph shows were sought: holes that are left need none
    # Σ |ΣF|² of the grains over 2 Σ f_n², of the reported field: at least so much of the squared forces is missing
    missing_force: float = 0.0
    # Overlap of the mean force over the noise of a position, by the position-only estimate
    shown_overlap: float = math.nan
    # Σ |ΣF| of the boundary rods inside the packing over Σ |F|: a load that nothing states
    boundary_reaction: float = 0.0
