"""Intervals that cover: factors that bring the formula's standard deviations to what truth shows, by kind of contact.

On simulated packings the ratio of error to stated deviation was collected for every group of contacts, and factors
were chosen so that one and two deviations cover 68 and 95 % in every group and world together, as nearly as errors with
heavy tails allow: on seeds 4 and 5 of thirteen worlds of 150 to 600 rods (`rodsight study intervals --grains 300
--fit 4 5` fits them anew and prints what they cover on worlds and seeds that they have not seen). What a group does not
say, terms of the frame do: where the methods disagree they err by more than their spread, in a larger packing, too; and
where positions and motion were mixed, by the more the more of the force pattern is new. To the first photograph no
motion leads: there errors grow with the friction that the field bears, for positions alone know little of tangential
forces.
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
    SOFT = 4  # overlaps of soft grains, with or without motion
    SOFT_FIRST = 5  # overlaps of soft grains, of a frame that no motion leads to


class Term(IntEnum):
    """What of a frame widens or narrows all its intervals, by a power of e for every unit."""

    DOUBT = 0  # 1 − T, save for what rods that no photograph shows take of it
    CHANGE = 1  # ln of the share of the force pattern that is new, over what is usual
    SIZE = 2  # ln of the number of contacts, over what is usual: the farther walls are, the less they tell
    FRICTION = 3  # ln of the friction that the field bears, over what is usual


WEAK, STRONG = 0.5, 1.5  # of the mean f_n
SLIDES = 0.5  # P(slides) from which on
DOUBTED = 0.9  # P(bears force) below which
BOTH = (0.02, 0.98)  # share of the positions between which both count
# σ/⟨f⟩ = factor of witness and group · exp(Σ slope · term) · TYPICAL (s / TYPICAL)^(1 + power), where s² adds up the
# squares of the formula's σ/⟨f⟩, of FLOOR, of what a contact that may bear nothing errs by, √(1 − P(bears)) f, and of
# the first frame of FIRST_SCALE f. Last axis: f_n, f_t.
FLOOR = np.array([0.02, 0.006])  # members that agree on nothing being there are wrong by this now and then
FIRST_SCALE = 0.15  # stresses that positions tell without any motion err by so much, all forces together
TYPICAL = np.array([0.2, 0.06])
FACTOR = np.array([
    [[0.59, 0.54], [0.57, 0.66], [0.52, 0.69], [0.58, 0.56], [0.55, 0.63], [0.45, 0.36]],
    [[0.46, 0.34], [0.44, 0.36], [0.48, 0.45], [0.46, 0.36], [0.46, 0.44], [0.47, 0.35]],
    [[0.76, 0.67]] * len(Group),  # of hard grains hardly ever: as of the first frame
    [[0.76, 0.67]] * len(Group),
    [[0.33, 0.32], [0.30, 0.25], [0.34, 0.27], [0.31, 0.31], [0.29, 0.30], [0.37, 0.65]],
    [[0.84, 0.69]] * len(Group),
])  # fmt: skip
# By witness and term; 0: not asked.
SLOPE = np.array([
    [[6.79, 5.82], [0.0, 0.0], [0.10, 0.07], [0.0, 0.0]],
    [[0.70, 1.20], [0.13, 0.07], [0.0, 0.0], [0.0, 0.0]],
    [[0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.81, 1.27]],
    [[0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.81, 1.27]],
    [[11.87, 6.36], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]],
    [[0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]],
])  # fmt: skip
# By witness.
POWER = np.array([[-0.11, -0.25], [0.07, -0.03], [-0.29, -0.65], [-0.29, -0.65], [-0.01, 0.19], [0.94, -0.59]])
MOST_DOUBT = 0.4  # 1 − T beyond which truths told nothing more
# The same for contact forces: what lowers the trust of a motion further is what it hides, not what it shows.
MOST_DOUBT_BY_WITNESS = (0.1, MOST_DOUBT, MOST_DOUBT, 0.0, 0.1, 0.0)
USUAL_CHANGE, CHANGES = 0.05, (0.005, 0.6)  # share of the force pattern that is new; what truths told something of
USUAL_SIZE = 500.0  # contacts that bear force
USUAL_FRICTION, NO_FRICTION = 0.04, 0.0125  # share of f_t in f_n, all contacts together; less is not told from nothing
# For every e-fold by which the friction was told wrong: error of f_n over f_n and over ⟨f⟩; of f_t over μ times these.
# Contacts that a wrong friction leaves without force are wrong most of all.
FRICTION_ERROR = ((0.5, 0.4), (0.6, 0.4))
TOLD_HIGH = 0.6  # of it where the friction was told too high: few contacts are held that should slide


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
    if frame.frame == 0:
        return Witness.SOFT_FIRST if frame.soft else Witness.FIRST
    return Witness.SOFT if frame.soft else witness_of(frame.positions_share)


def terms_of(frame: FrameForces) -> Array:
    """The frame's value of every Term (t,)."""
    hidden = min(frame.unseen_doubt, MOST_DOUBT)
    doubt = min(float(doubt_of(frame.trust / (1.0 - hidden))), MOST_DOUBT_BY_WITNESS[witness_behind(frame)])
    change = float(np.clip(np.nan_to_num(frame.force_change, nan=USUAL_CHANGE), *CHANGES))
    size = math.log(max(int((frame.fn > 0).sum()), 1) / USUAL_SIZE)
    return np.array([doubt, math.log(change / USUAL_CHANGE), size, math.log(friction_share(frame))])


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
    size = np.sqrt(formula**2 + FLOOR**2 + _errors_with_force(frame, mean) ** 2) / TYPICAL
    told = mean * TYPICAL * interval_factors(frame) * size ** (1.0 + POWER[witness_behind(frame)])
    told[formula == 0] = 0.0
    return replace(frame, fn_sd=told[:, 0], ft_sd=told[:, 1])


def _errors_with_force(frame: FrameForces, mean: float) -> Array:
    """What errs as the force does (c, 2): of contacts that may bear none, and of all contacts of the first frame."""
    nothing = np.zeros_like(frame.fn) if frame.bearing_probability is None else 1.0 - frame.bearing_probability
    scale = FIRST_SCALE if frame.frame == 0 else 0.0
    return np.sqrt(nothing + scale**2)[:, None] * np.abs(np.column_stack([frame.fn, frame.ft])) / mean


def formula_deviations(frame: FrameForces) -> Array:
    """What `calibrate_deviations` was given, over the mean f_n, with the floor and what errs as the force (c, 2)."""
    told = np.column_stack([frame.fn_sd, frame.ft_sd]) / (mean_normal_force(frame.fn) * TYPICAL)
    return TYPICAL * (told / interval_factors(frame)) ** (1.0 / (1.0 + POWER[witness_behind(frame)]))


def interval_factors(frame: FrameForces) -> Array:
    """What group, witness and the frame's terms make of the deviations of f_n and f_t (c, 2)."""
    witness = witness_behind(frame)
    return FACTOR[witness][groups_of(frame)] * np.exp(terms_of(frame) @ SLOPE[witness])


def widen_for_friction(frame: FrameForces, given: float, measured: float, share: float = 1.0) -> FrameForces:
    """The frame with the error of its friction in its deviations: a share of what lies between two frictions.

    Forces that positions alone told know nothing of sliding: theirs stay.
    """
    if not (given > 0 and measured > 0) or frame.positions_share > BOTH[1]:
        return frame
    excess = share * abs(math.log(measured / given)) * (TOLD_HIGH if measured < given else 1.0)
    mean = np.where(frame.fn_sd > 0, np.nan_to_num(mean_normal_force(frame.fn)), 0.0)  # what has no deviation gets none
    normal, tangent = (
        excess * np.hypot(of_force * np.maximum(frame.fn, 0.0), of_mean * mean) for of_force, of_mean in FRICTION_ERROR
    )
    return replace(frame, fn_sd=np.hypot(frame.fn_sd, normal), ft_sd=np.hypot(frame.ft_sd, measured * tangent))
