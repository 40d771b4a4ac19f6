"""Intervals that cover: factors that bring the formula's standard deviations to what truth shows, by kind of contact.

Split conformal prediction by groups: on simulated packings the ratio of error to stated deviation was collected for
every group of contacts, and factors were chosen so that one and two deviations cover 68 and 95 % there;
`rodsight study intervals` fits them anew and prints what they cover on worlds and seeds that they have not seen. What a
group does not say, trust does: where the methods disagree they err by more than their spread, and where positions and
motion were mixed their difference overstates the error of the mean. To the first photograph no motion leads: there
errors grow with the friction that the field bears, for positions alone know little of tangential forces.
"""

from __future__ import annotations

import math
from dataclasses import replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array
from solver.sequence.frame_forces import FrameForces
from solver.statistics.force_statistics import mean_normal_force


class Group(IntEnum):
    """What an interval's width hangs on; of several the first from the end."""

    WEAK = 0  # f_n below half the mean
    MEAN = 1
    STRONG = 2  # above one and a half
    SLIDING = 3  # more likely than not
    WALL = 4
    DOUBTFUL = 5  # likely enough to bear no force at all


class Witness(IntEnum):
    """What a field was read from."""

    MOTION = 0
    BOTH = 1  # motion and positions, mixed
    POSITIONS = 2
    FIRST = 3  # positions, of a frame that no motion leads to


WEAK, STRONG = 0.5, 1.5  # of the mean f_n
SLIDES = 0.5  # P(slides) from which on
DOUBTED = 0.9  # P(bears force) below which
BOTH = (0.02, 0.98)  # share of the positions between which both count
# σ/⟨f⟩ = factor of witness and group · exp(slope (1 − T)) · TYPICAL (s / TYPICAL)^(1 + power), where s² adds up the
# squares of the formula's σ/⟨f⟩ and of FLOOR; of the first frame times a power of its friction. Last axis: f_n, f_t.
FLOOR = np.array([0.02, 0.006])  # members that agree on nothing being there are wrong by this now and then
TYPICAL = np.array([0.2, 0.06])
FACTOR = np.array([
    [[0.61, 0.55], [0.63, 0.66], [0.58, 0.68], [0.62, 0.60], [0.62, 0.66], [0.53, 0.40]],
    [[0.61, 0.50], [0.67, 0.56], [0.87, 0.70], [0.71, 0.53], [0.79, 0.71], [0.56, 0.53]],
    [[0.33, 0.61], [0.33, 0.57], [0.44, 0.56], [0.31, 0.50], [0.38, 0.72], [0.28, 0.58]],
    [[0.72, 0.49]] * len(Group),
])  # fmt: skip
TRUST_SLOPE = np.array([[6.48, 5.83], [-0.05, 0.12], [-0.24, -0.12], [0.0, 0.0]])  # by witness
POWER = np.array([[-0.17, -0.31], [-0.30, -0.21], [-0.86, -0.45], [-0.29, -0.33]])  # by witness
FRICTION_POWER = np.array([1.05, 1.29])  # of the first frame
MOST_DOUBT = 0.4  # 1 − T beyond which truths told nothing more
# The same for contact forces: what lowers the trust of a motion further is what it hides, not what it shows.
MOST_DOUBT_BY_WITNESS = (0.1, MOST_DOUBT, MOST_DOUBT, 0.0)
USUAL_FRICTION, NO_FRICTION = 0.04, 0.0125  # share of f_t in f_n, all contacts together; less is not told from nothing
# Error of f_n over f_n, and of f_t over μ f_n, for every e-fold by which the friction was told wrong.
FRICTION_ERROR = (0.9, 1.05)


def groups_of(frame: FrameForces) -> NDArray[np.uint8]:
    """The Group of every contact (c,)."""
    mean = mean_normal_force(frame.fn)
    strength = np.nan_to_num(frame.fn / mean) if mean > 0 else np.zeros_like(frame.fn)
    group = np.full(len(frame.fn), Group.MEAN, np.uint8)
    group[strength < WEAK] = Group.WEAK
    group[strength > STRONG] = Group.STRONG
    if frame.sliding_probability is not None:
        group[frame.sliding_probability > SLIDES] = Group.SLIDING
    group[frame.contacts.with_wall] = Group.WALL
    if frame.bearing_probability is not None:
        group[frame.bearing_probability < DOUBTED] = Group.DOUBTFUL
    return group


def witness_of(positions_share: float) -> Witness:
    """What a field was read from in which positions count so much."""
    low, high = BOTH
    return Witness.MOTION if positions_share < low else Witness.POSITIONS if positions_share > high else Witness.BOTH


def doubt_of(trust: float | Array) -> Array:
    """1 − T as far as it is counted; what is not assessed counts as most."""
    return np.clip(np.nan_to_num(1.0 - np.asarray(trust, np.float64), nan=MOST_DOUBT), 0.0, MOST_DOUBT)


def witness_behind(frame: FrameForces) -> Witness:
    """What the frame's field was read from; the first frame of all has no motion that leads to it."""
    return Witness.FIRST if frame.frame == 0 else witness_of(frame.positions_share)


def counted_doubt(frame: FrameForces) -> float:
    """1 − T as far as it widens the intervals of the frame's contacts."""
    return min(float(doubt_of(frame.trust)), MOST_DOUBT_BY_WITNESS[witness_behind(frame)])


def friction_share(frame: FrameForces) -> float:
    """How much friction the first frame's field bears, over what is usual; 1 of all others."""
    if frame.frame > 0:
        return 1.0
    borne = float(np.maximum(frame.fn, 0.0).sum())
    share = float(np.abs(frame.ft).sum()) / borne if borne > 0 else 0.0
    return (share + NO_FRICTION) / (USUAL_FRICTION + NO_FRICTION)


def calibrate_deviations(frame: FrameForces) -> FrameForces:
    """The frame with deviations that cover, in place of the formula's; contacts without a deviation keep none."""
    mean = mean_normal_force(frame.fn)
    if not mean > 0:
        return frame
    formula = np.column_stack([frame.fn_sd, frame.ft_sd]) / mean
    size = np.hypot(formula, FLOOR) / TYPICAL
    told = mean * TYPICAL * interval_factors(frame) * size ** (1.0 + POWER[witness_behind(frame)])
    told[formula == 0] = 0.0
    return replace(frame, fn_sd=told[:, 0], ft_sd=told[:, 1])


def formula_deviations(frame: FrameForces) -> Array:
    """What `calibrate_deviations` was given, over the mean f_n and with the floor (c, 2)."""
    told = np.column_stack([frame.fn_sd, frame.ft_sd]) / (mean_normal_force(frame.fn) * TYPICAL)
    return TYPICAL * (told / interval_factors(frame)) ** (1.0 / (1.0 + POWER[witness_behind(frame)]))


def interval_factors(frame: FrameForces) -> Array:
    """What group, witness and trust make of the deviations of f_n and f_t (c, 2), of the first frame its friction."""
    witness = witness_behind(frame)
    of_frame = np.exp(TRUST_SLOPE[witness] * counted_doubt(frame)) * friction_share(frame) ** FRICTION_POWER
    return FACTOR[witness][groups_of(frame)] * of_frame


def widen_for_friction(frame: FrameForces, given: float, measured: float, share: float = 1.0) -> FrameForces:
    """The frame with the error of its friction in its deviations: a share of what lies between two frictions."""
    if not (given > 0 and measured > 0):
        return frame
    excess = share * abs(math.log(measured / given)) * np.maximum(frame.fn, 0.0)
    normal, tangent = FRICTION_ERROR
    return replace(
        frame, fn_sd=np.hypot(frame.fn_sd, normal * excess), ft_sd=np.hypot(frame.ft_sd, tangent * measured * excess)
    )
