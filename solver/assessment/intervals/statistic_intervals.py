"""Standard deviations of a frame's statistics, from the errors on simulated packings and the frame's trust.

σ = c √(1 − T), for positive quantities times their value, with a constant for every statistic and evidence source
(fitted.toml names command, data and date). Positions alone know little of sliding, so stresses read from them err by
degrees although the forces correlate. Of the principal direction it is the error of the stress deviator, from which
`direction_sd` follows: the less the stresses differ, the less their direction is known.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from ...frame_forces import FrameForces
from ...statistics.frame_statistics import FrameStatistics
from ..fitted import FITTED
from .force_intervals import EvidenceSource, evidence_source_of, penalty_of, usual_trust

# By statistic: where motion, motion and positions, positions were used; rad of angles, of the principal direction a
# component of the deviator over the mean stress.
CONSTANT: dict[str, tuple[float, float, float]] = {
    name: tuple(values) for name, values in FITTED["statistic_intervals"]["constant"].items()
}
# Quantities whose error grows with their value.
RELATIVE = frozenset({
    "pressure", "sigma_1", "sigma_2", "coordination_number", "coordination_number_without_rattlers", "rattler_count",
    "contact_count", "mean_fn", "max_fn", "chain_count",
})  # fmt: skip
SIZED = frozenset({"pressure", "sigma_1", "sigma_2", "mean_fn", "max_fn"})  # undefined without a scale of forces
# Error for every e-fold by which the friction differs, in the unit of the constant.
FRICTION_ERROR: dict[str, float] = FITTED["statistic_intervals"]["friction_error"]
MIN_PENALTY = 0.03  # 1 − T below which the simulated packings give no information
UNKNOWN_DIRECTION = math.pi / math.sqrt(12.0)  # [rad] standard deviation of an axis of which nothing is known


def with_sd(statistics: FrameStatistics, frame: FrameForces, *, scale_is_known: bool, moved: bool) -> FrameStatistics:
    """Add standard deviations to the statistics of a frame.

    Parameters
    ----------
    statistics : FrameStatistics
    frame : FrameForces
        The forces that they follow from.
    scale_is_known : bool
        Whether loads or weight set the scale of the forces.
    moved : bool
        Whether a motion leads to the frame, as to all frames of the fit; without it nothing is added.
    """
    if not (moved and np.isfinite(frame.trust)):
        return statistics
    source = evidence_source_of(frame.position_weight)
    added: dict[str, Any] = {
        f"{name}_sd": sd_of(name, float(getattr(statistics, name)), source, usual_trust(frame))
        for name in CONSTANT
        if scale_is_known or name not in SIZED
    }
    added["principal_direction_sd"] = direction_sd(
        statistics.sigma_1, statistics.sigma_2, added["principal_direction_sd"]
    )
    return replace(statistics, **added)


def widen_for_friction(statistics: FrameStatistics, given: float, measured: float) -> FrameStatistics:
    """Add the error of a friction coefficient that the motion contradicts to the standard deviations."""
    excess = abs(math.log(measured / given)) if given > 0 and measured > 0 else 0.0
    return replace(statistics, **{
        f"{name}_sd": math.hypot(
            getattr(statistics, f"{name}_sd"), excess * error * size_of(name, float(getattr(statistics, name)))
        )
        for name, error in FRICTION_ERROR.items()
    })  # fmt: skip


def sd_of(name: str, value: float, source: EvidenceSource, trust: float) -> float:
    """Standard deviation of one statistic, in its unit."""
    return CONSTANT[name][source] * size_of(name, value) * float(np.sqrt(max(float(penalty_of(trust)), MIN_PENALTY)))


def direction_sd(sigma_1: float, sigma_2: float, deviator_sd: float) -> float:
    """Compute the standard deviation of the principal direction [rad] from that of the deviator.

    Parameters
    ----------
    sigma_1, sigma_2 : float
        Principal stresses [Pa], compression positive.
    deviator_sd : float
        Standard deviation s of a component of the deviator, (σ_xx − σ_yy, 2 σ_xy) over σ_1 + σ_2.

    Notes
    -----
    ½ s / √(d² + 3 s²/π²) with d = (σ_1 − σ_2) / (σ_1 + σ_2): ½ s/d of a large deviator, and of none π/√12, the standard
    deviation of an axis that may have any direction.
    """
    total = sigma_1 + sigma_2
    deviator = (sigma_1 - sigma_2) / total if total > 0.0 else 0.0
    return 0.5 * deviator_sd / math.hypot(deviator, 0.5 * deviator_sd / UNKNOWN_DIRECTION)


def size_of(name: str, value: float) -> float:
    """Factor on the constant: the value for relative errors, else one."""
    return abs(value) if name in RELATIVE else 1.0
