"""Walls are rigid bars: the motion along a bar is that of its own points, not of the corners where bars meet.

A person marks where bars meet. As the packing dilates such a corner slides along the bar, so that the distance of the
two corners changes, which that of two points of a bar cannot. What share of the change belongs to either end is told by
the grains: one that rolls on the wall without sliding, as part of those that bear do at any time, moves with the bar.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.bodies.quantity import Quantity
from solver.bodies.wall_shapes import STRAIGHT, all_sides, outward_normals
from solver.calibration.gaps import MeasuredSequence

STRETCH = 4.0  # standard deviations of a length by which the ends of a rigid bar may come apart …
LEAST_STRETCH = 1e-4  # … and the share of the length
TOUCHING = 4.0  # standard deviations of a gap, and …
MISPLACED = 1e-2  # … mean radii by which its wall and its rim may be told wrong
SLIP_SIGMAS = 2.8  # noise of a grain's surface displacement, of a position: as between grains
SHARES = np.linspace(-0.5, 1.5, 201)  # of the change of length, that happens at end 0
NEARLY = 0.97  # of the best agreement: an end that is as good as held by the bar is


@dataclass(frozen=True, slots=True)
class Bars:
    """How the told ends of walls move along them."""

    slip: Annotated[
        Array,
        Quantity(
            "sliding of the told ends along the bar since the frame before, mean of both, towards end 1", "m",
            "frame wall", since=2, path="walls/slip",
        ),
    ]  # fmt: skip
    corner: Annotated[
        NDArray[np.bool_], Quantity("whether the told ends slide along the bar", dims="wall", since=2, absent=False)
    ]
    stretch: Annotated[Array, Quantity("greatest change of the told length, over the length", dims="wall", since=2)]
    share: Annotated[Array, Quantity("of the change of length that happens at end 0; NaN: none", dims="wall", since=2)]


def find_bars(sequence: MeasuredSequence, noise: float, told: NDArray[np.int8]) -> tuple[Bars, Array]:
    """Find which ends are corners and how they slide; and points (f, w, 2, 2) [m] of the bars, in place of such ends.

    noise [m]: standard deviation of an end along the wall; told (w,): 1 corner, 0 bar, −1 not told, which the
    stretching then judges.
    """
    ends = sequence.endpoints
    length = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
    stretch = np.abs(length - length[:1]).max(axis=0) / length.mean(axis=0)
    limit = np.maximum(STRETCH * np.sqrt(2.0) * noise, LEAST_STRETCH * length.mean(axis=0))
    stretches = stretch * length.mean(axis=0) > limit
    corner = np.where(told < 0, stretches, told == 1) & (all_sides(sequence.side, sequence.wall_count) == STRAIGHT)
    points, slip, share = ends.copy(), np.zeros(length.shape), np.full(sequence.wall_count, np.nan)
    for w in np.flatnonzero(corner).tolist():
        share[w] = _share_of_first_end(sequence, w, length[:, w])
        points[:, w], slip[:, w] = _points_of_bar(ends[:, w], length[:, w], share[w])
    return Bars(slip, corner, stretch, share), points


def _share_of_first_end(sequence: MeasuredSequence, w: int, length: Array) -> float:
    """The share of the change of length that lets most grains roll on the wall, rather than slide."""
    moved, stretched, noise = _surface_motion(sequence, w, length)
    if not len(moved):
        return 0.0
    left = moved[:, None] - SHARES * stretched[:, None]
    agreement = (1.0 / (1.0 + (left / noise[:, None]) ** 2)).mean(axis=0)
    best = float(agreement.max())
    for held in (0.0, 1.0):  # a hinge is what apparatuses have
        if agreement[np.argmin(np.abs(SHARES - held))] >= NEARLY * best:
            return held
    return float(SHARES[np.argmax(agreement)])


def _surface_motion(sequence: MeasuredSequence, w: int, length: Array) -> tuple[Array, Array, Array]:
    """Surface displacement of touching grains along the wall, from end 0 (m,) [m]; the stretch meanwhile; the noise."""
    ends = sequence.endpoints[:, w]
    normal = outward_normals(ends)
    along = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
    turn = np.unwrap(np.arctan2(along[:, 1], along[:, 0]))
    offset = sequence.position - ends[:, None, 0]
    place = np.einsum("fnk,fk->fn", offset, along)
    gap = -np.einsum("fnk,fk->fn", offset, normal) - sequence.radius
    sigma = np.where(sequence.present, sequence.sigma, 0.0)
    near = np.abs(gap) < TOUCHING * sigma + MISPLACED * float(sequence.radius.mean())
    beside = (place > 0.0) & (place < length[:, None])
    both = (near & beside & sequence.present)[1:] & (near & sequence.present)[:-1]
    rolled = sequence.radius * (np.diff(sequence.rotation, axis=0) - np.diff(turn)[:, None])
    motion = np.diff(place, axis=0) + rolled
    stretched = np.broadcast_to(np.diff(length)[:, None], motion.shape)
    noise = SLIP_SIGMAS * np.maximum(sigma[1:], LEAST_STRETCH * float(sequence.radius.mean()))
    known = both & np.isfinite(motion)
    return motion[known], stretched[known], noise[known]


def _points_of_bar(ends: Array, length: Array, share: float) -> tuple[Array, Array]:
    """Points (f, 2, 2) [m] of the bar on the line of its told ends (f, 2, 2), and the slip (f,) [m] of these.

    The bar begins where its ends are told in the first frame, and is made as long as covers them in all frames.
    """
    slid = share * (length - length[0])  # of the bar past end 0, towards end 1
    direction = (ends[:, 1] - ends[:, 0]) / length[:, None]
    first = min(0.0, float((-slid).min()))
    last = max(float(length[0]), float((length - slid).max()))
    points = ends[:, None, 0] + (slid[:, None] + np.array([first, last]))[:, :, None] * direction[:, None, :]
    # The bar moves by share of the stretch from end 0, and by share − 1 from end 1.
    slip = -(share - 0.5) * np.diff(length, prepend=length[0])
    return points, slip
