"""Forces of the second frame carried back to the first, where both are alike.

No motion leads to the first frame. Where a test is photographed from its middle on, its forces are nearly those of the
second, which motion tells well; after a packing is made they are others, and nothing is carried.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.bodies.grains import Array
from solver.contacts.pairs import align, recall
from solver.posterior.frame_posterior import FramePosterior
from solver.sequence.frame_forces import FrameForces
from solver.statistics.agreement import pearson

from .first_frame import UNSOUND

if TYPE_CHECKING:
    from ..inference import CorrectedSequence

# Correlation of both frames' f_n from which on something is carried, and from which on it counts in full. Sheared
# packings have .82 to .94, fresh ones .3 to .76 (300 rods, seeds 0 and 1, on which the constants were chosen).
ALIKE = (0.75, 0.85)
COUNTS = 0.4  # of the second frame's information: its errors are partly those of the first
DRIFT = 0.6  # share of the mean square difference of both frames that is change, not error
MOST_POSITIONS = 0.5  # in the second frame: what its positions say those of the first said already
UNNAMED = 0.2  # deviation of a force on a pair that a frame does not list, over the mean f_n
LEAST = 0.02  # the least of any deviation, over the mean f_n: a force that is said to be certain outweighs nothing
PLAIN = 0.7  # of a stated deviation: without what calibration makes of it, for it is calibrated once more


def carry_back(sequence: CorrectedSequence, first: FrameForces, second: FrameForces) -> FramePosterior | None:
    """What positions and the second frame say of the first one's forces; None where the second says nothing.

    Soft grains are told by overlap, which no later frame surpasses; without a loaded plate a frame's scale means
    nothing, or follows from weight.
    """
    if second.status in UNSOUND or second.positions_share > MOST_POSITIONS:
        return None
    if first.soft or not np.isfinite(sequence.packing.pressure).any():
        return None
    _, one, two = align(first.contacts.key, first.fn, second.contacts.key, second.fn)
    if not min(one.sum(), two.sum()) > 0.0:
        return None
    alike = float(np.clip((pearson(one, two) - ALIKE[0]) / (ALIKE[1] - ALIKE[0]), 0.0, 1.0))
    if not alike > 0.0:
        return None
    counts, scale = COUNTS * alike, float(one.sum() / two.sum())
    mean = float(first.fn.mean())
    own = np.column_stack([first.fn_sd, first.ft_sd])
    told = np.column_stack([second.fn, second.ft]), np.column_stack([second.fn_sd, second.ft_sd])
    force, deviation = (
        scale * recall(first.contacts.key, second.contacts.key, value, fill=fill)
        for value, fill in zip(told, (0.0, UNNAMED * mean / scale), strict=True)
    )
    drift = DRIFT * float(np.mean((one - scale * two) ** 2))
    blended, left = _blend(
        np.column_stack([first.fn, first.ft]), np.maximum(own, LEAST * mean) ** 2, force, counts, deviation**2 + drift
    )
    # Positions know the pattern better than the size of stresses along free walls, which sliding tells.
    size = (_risen(sequence) / scale) ** alike
    return _as_posterior(first, size * blended, PLAIN * size * np.sqrt(left), sequence.packing.grains.count)


def _risen(sequence: CorrectedSequence) -> float:
    """The first frame's loads over the second's."""
    first, second = (sequence.packing.mean_pressure(each) for each in sequence.snapshots[:2])
    return first / second if min(first, second) > 0.0 else 1.0


def _blend(one: Array, variance: Array, two: Array, counts: float, other: Array) -> tuple[Array, Array]:
    """The mean (c, 2) of two estimates weighted by their information, the second's by `counts`; and its variance.

    One weight for both components of a force, so that the mean of two forces inside the Coulomb cone is inside it.
    """
    weight = counts * variance[:, :1] / (counts * variance[:, :1] + other[:, :1])
    return (1.0 - weight) * one + weight * two, (1.0 - weight) * variance


def _as_posterior(first: FrameForces, force: Array, deviation: Array, grains: int) -> FramePosterior:
    """A field on the first frame's contacts, as positions tell theirs; its agreement with the motion sets the trust."""
    assert first.bearing_probability is not None
    return FramePosterior(
        contacts=first.contacts, fn=force[:, 0], ft=force[:, 1],
        fn_deviation=deviation[:, 0], ft_deviation=deviation[:, 1], bears=first.bearing_probability,
        centre_error=np.zeros((grains, 2)), radius_error=np.zeros(grains), overlap=first.overlap,
        overlap_deviation=0.0, offset=0.0, offset_deviation=0.0, trust=1.0, agreement=1.0,
    )  # fmt: skip
