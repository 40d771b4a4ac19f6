"""Backward pass from the second frame to the first, where both are alike.

Where a test is photographed from its middle on, the forces of the first frame are nearly those of the second, which the
motion determines well. After a packing was prepared they differ, and the second frame gets no weight.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..solver.assessment.mixture_trust import fused_trust
from ..solver.bodies.grains import Array
from ..solver.contacts.pairs import align, match_values
from ..solver.frame_forces import FrameForces
from ..solver.posterior.frame_posterior import FramePosterior
from ..solver.statistics.agreement import pearson
from .corrected_sequence import CorrectedSequence

# Correlation of both estimates' f_n at which the second frame gets weight, and its full weight. Sheared packings have
# .93 to .95, fresh ones .57 to .76 (five scenarios of 300 rods, seeds 0 and 1; .88 and .78 of 100 rods).
ALIKE = (0.79, 0.87)
INDEPENDENT = 0.4  # fraction of the second frame's information that is new: its errors are partly those of the first
DRIFT = 0.6  # fraction of the mean square difference of both frames that is change, not error
MAX_POSITION_WEIGHT = 0.5  # in the second frame: above it, its forces add little to the positions of the first
UNLISTED_SD = 0.2  # standard deviation of a force on a pair that a frame does not list, over the mean f_n
MIN_SD = 0.02  # of any force, over the mean f_n


def fuse_second_frame(sequence: CorrectedSequence, first: FramePosterior, second: FrameForces) -> FramePosterior | None:
    """Fuse the posterior of the first frame with the forces of the second.

    Parameters
    ----------
    sequence : CorrectedSequence
    first : FramePosterior
        Position-only estimate of the first frame.
    second : FrameForces
        The second frame as solved.

    Returns
    -------
    FramePosterior or None
        None where the second frame adds nothing: soft grains (their overlaps determine the forces), no loaded wall
        (the scale of a frame is then arbitrary or set by weight), or unlike forces.

    Notes
    -----
    Per contact, f = (1 − w) f₁ + w s f₂ with w = a v₁ / (a v₁ + v₂), v the variances, v₂ including the drift between
    the frames, s the ratio of the sums of f_n and a the information that is independent. The fused trust is
    1 − (1 − w̄)² (1 − T₁) − w̄² (1 − T₂), with T₂ at most c / T₁, c being the correlation of both estimates.
    """
    if second.position_weight > MAX_POSITION_WEIGHT or sequence.settings.soft:
        return None
    if not np.isfinite(sequence.packing.pressure).any():
        return None
    _, one, two = align(first.contacts.key, first.fn, second.contacts.key, second.fn)
    if not min(one.sum(), two.sum()) > 0.0:
        return None
    agreement = pearson(one, two)
    alike = float(np.clip((agreement - ALIKE[0]) / (ALIKE[1] - ALIKE[0]), 0.0, 1.0))
    if not alike > 0.0:
        return None
    scale, mean = float(one.sum() / two.sum()), float(first.fn.mean())
    force, sd = (
        scale * match_values(first.contacts.key, second.contacts.key, values, fill=fill)
        for values, fill in (
            (np.column_stack([second.fn, second.ft]), 0.0),
            (np.column_stack([second.fn_sd, second.ft_sd]), UNLISTED_SD * mean / scale),
        )
    )
    drift = DRIFT * float(np.mean((one - scale * two) ** 2))
    own = np.maximum(np.column_stack([first.fn_sd, first.ft_sd]), MIN_SD * mean) ** 2
    weight = _second_weight(own, INDEPENDENT * alike, sd**2 + drift)
    fused = (1.0 - weight) * np.column_stack([first.fn, first.ft]) + weight * force
    # Positions determine the pattern better than the size of stresses along free walls, which sliding determines.
    size = (sequence.packing.load_ratio(*sequence.snapshots[:2]) / scale) ** alike
    fused_sd = size * np.sqrt((1.0 - weight) * own)
    return replace(
        first, fn=size * fused[:, 0], ft=size * fused[:, 1], fn_sd=fused_sd[:, 0], ft_sd=fused_sd[:, 1],
        trust=fused_trust(first.trust, second.expected_correlation, agreement, float(weight.mean())),
    )  # fmt: skip


def _second_weight(variance: Array, information: float, second: Array) -> Array:
    """Weight of the second estimate (c, 1), equal for both components: the mean stays in the Coulomb cone."""
    return information * variance[:, :1] / (information * variance[:, :1] + second[:, :1])
