"""Standard deviations of a frame's statistics: what truths showed them to err by, scaled by the frame's trust.

σ = c √(1 − T), of positive quantities times their value, with a constant for every statistic and for what the forces
were read from; `rodsight study numbers --fit` fits the constants anew and prints what one and two deviations cover.
Of two fits, on other packings each, the wider constant stands.
Positions alone know little of what slides, so that stresses read from them err by degrees though the forces correlate.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from solver.sequence.frame_forces import FrameForces
from solver.sequence.judging.intervals import Witness, doubt_of, witness_of
from solver.statistics.frame_statistics import FrameStatistics

# Constants where motion spoke, where motion and positions were mixed, and where positions spoke; rad of angles.
DEVIATION: dict[str, tuple[float, float, float]] = {
    "friction_angle": (0.032, 0.17, 0.28),
    "wall_ratio_angle": (0.093, 0.21, 0.39),
    "principal_direction": (0.097, 0.56, 0.18),
    "pressure": (0.097, 0.15, 0.51),
    "sigma_1": (0.097, 0.22, 0.7),
    "sigma_2": (0.1, 0.13, 0.5),
    "coordination_number": (0.073, 0.11, 0.066),
    "coordination_number_without_rattlers": (0.087, 0.058, 0.055),
    "rattler_count": (0.41, 1.3, 1),
    "contact_count": (0.074, 0.11, 0.066),
    "sliding_fraction": (0.16, 0.26, 0.46),  # of rods 1:5 in size a whole packing is off by what others are in a frame
    "mobilisation": (0.065, 0.29, 0.64),
    "mean_fn": (0.17, 0.24, 0.58),
    "max_fn": (0.28, 0.47, 0.58),
    "fabric_anisotropy": (0.068, 0.073, 0.066),
    "contact_anisotropy": (0.068, 0.073, 0.066),
    "branch_anisotropy": (0.0084, 0.0046, 0.0076),
    "normal_force_anisotropy": (0.095, 0.12, 0.29),
    "tangential_force_anisotropy": (0.02, 0.13, 0.23),
    "friction_angle_of_anisotropies": (0.046, 0.11, 0.26),
    "strong_share": (0.058, 0.054, 0.035),
    "strong_pressure_share": (0.063, 0.093, 0.085),
    "strong_deviator_share": (0.15, 0.57, 0.6),
    "chain_count": (0.79, 0.64, 0.56),
    "chain_grain_share": (0.089, 0.07, 0.073),
}
# Quantities whose error grows with their value.
RELATIVE = frozenset({
    "pressure", "sigma_1", "sigma_2", "coordination_number", "coordination_number_without_rattlers", "rattler_count",
    "contact_count", "mean_fn", "max_fn", "chain_count",
})  # fmt: skip
SIZED = frozenset({"pressure", "sigma_1", "sigma_2", "mean_fn", "max_fn"})  # nothing, where no size of forces is known
# Error for every e-fold by which the friction was told wrong, with what a constant above is multiplied by.
FRICTION_ERROR: dict[str, float] = {
    "friction_angle": 0.14,
    "wall_ratio_angle": 0.16,
    "principal_direction": 0.18,
    "pressure": 0.19,
    "sigma_1": 0.28,
    "mean_fn": 0.23,
    "max_fn": 0.5,
    "normal_force_anisotropy": 0.23,
    "tangential_force_anisotropy": 0.075,
    "friction_angle_of_anisotropies": 0.15,
    "mobilisation": 0.18,
}
LEAST_DOUBT = 0.03  # 1 − T below which truths told nothing more


def with_deviations(
    statistics: FrameStatistics, frame: FrameForces, *, scale_is_known: bool, moved: bool
) -> FrameStatistics:
    """Statistics with their standard deviations.

    scale_is_known: loads or weight tell the size of the forces; moved: a motion leads to the frame, as it did to those
    that the constants were fitted on.
    """
    if not (moved and np.isfinite(frame.trust)):
        return statistics
    witness = witness_of(frame.positions_share)
    told: dict[str, Any] = {
        f"{name}_sd": deviation_of(name, float(getattr(statistics, name)), witness, frame.trust)
        for name in DEVIATION
        if scale_is_known or name not in SIZED
    }
    return replace(statistics, **told)


def widen_for_friction(statistics: FrameStatistics, given: float, measured: float) -> FrameStatistics:
    """Statistics with the error of a friction that the motion contradicts in their deviations."""
    excess = abs(math.log(measured / given)) if given > 0 and measured > 0 else 0.0
    return replace(statistics, **{
        f"{name}_sd": math.hypot(
            getattr(statistics, f"{name}_sd"), excess * error * size_of(name, float(getattr(statistics, name)))
        )
        for name, error in FRICTION_ERROR.items()
    })  # fmt: skip


def deviation_of(name: str, value: float, witness: Witness, trust: float) -> float:
    """The standard deviation of one statistic, in its unit."""
    return DEVIATION[name][witness] * size_of(name, value) * float(np.sqrt(max(float(doubt_of(trust)), LEAST_DOUBT)))


def size_of(name: str, value: float) -> float:
    """What a constant is multiplied by: the value, or one."""
    return abs(value) if name in RELATIVE else 1.0
