"""Calibrated standard deviations of forces, by kind of contact.

On simulated packings the ratio of error to the formula's standard deviation was collected for every group of contacts.
Factors were fitted so that one and two standard deviations cover 68 and 95 % in every group and scenario together, as
nearly as errors with heavy tails allow (fitted.toml names command, data and date). Terms of the frame add what a group
does not show: where the members disagree the errors exceed their standard deviation, in a larger packing more so; where
positions and motion are mixed they grow with the new part of the force pattern. No motion leads to the first frame:
there errors grow with the friction that the field carries, because positions alone know little of tangential forces.
"""

from __future__ import annotations

import math
from dataclasses import replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from ...bodies.grains import Array
from ...frame_forces import FrameForces
from ...statistics.force_statistics import mean_normal_force
from ..fitted import FITTED


class Group(IntEnum):
    """Kinds of contacts with intervals of their own; where several apply, the last one counts."""

    WEAK = 0  # f_n below half the mean
    MEAN = 1
    STRONG = 2  # above one and a half
    SLIDING = 3  # more likely than not
    WALL = 4
    UNCERTAIN = 5  # may carry no force at all


class EvidenceSource(IntEnum):
    """Data that a field was estimated from."""

    MOTION = 0
    BOTH = 1  # motion and positions, mixed
    POSITIONS = 2
    FIRST = 3  # positions of a frame to which no motion leads
    SOFT = 4  # overlaps of soft grains, with or without motion
    SOFT_FIRST = 5  # overlaps of soft grains, of a frame to which no motion leads


class Term(IntEnum):
    """Properties of a frame that widen or narrow all its intervals, by a power of e for every unit."""

    PENALTY = 0  # 1 − T by the usual margin, the part for unseen rods excluded
    CHANGE = 1  # ln of the fraction of the force pattern that is new, over its usual value
    SIZE = 2  # ln of the number of contacts, over its usual value
    FRICTION = 3  # ln of the friction that the field carries, over its usual value


WEAK, STRONG = 0.5, 1.5  # of the mean f_n
SLIDES = 0.5  # P(slides) from which on
UNCERTAIN = 0.9  # P(bears force) below which
BOTH = (0.02, 0.98)  # weights of the position-only estimate between which both count
_FITTED = FITTED["force_intervals"]
# σ/⟨f⟩ = factor of source and group · exp(Σ slope · term) · TYPICAL (s / TYPICAL)^(1 + power), where s² adds the
# squares of the formula's σ/⟨f⟩, of FLOOR, of √(1 − P(bears)) f, and for the first frame of FIRST_SCALE f. Last axis:
# f_n, f_t.
FLOOR = np.array(_FITTED["floor"])
# Of f_n and f_t of hard grains at f_n = ⟨f_n⟩, over it, whatever the noise; in proportion to f_n between MODEL_FORCES.
MODEL_ERROR = np.array(_FITTED["model_error"])
MODEL_FORCES = (0.1, 1.2)  # over ⟨f_n⟩
FIRST_SCALE: float = _FITTED["first_scale"]
TYPICAL = np.array(_FITTED["typical"])
MARGIN: float = _FITTED["margin"]
SOFT_MARGIN: float = _FITTED["soft_margin"]
MAX_EXPECTED = 1.0 - 1e-9  # whose arctanh is finite
FACTOR = np.array(_FITTED["factor"])
SLOPE = np.array(_FITTED["slope"])
POWER = np.array(_FITTED["power"])
MAX_PENALTY = 0.4  # 1 − T beyond which the simulated packings give no information
# The same for contact forces, by source: further losses of a motion's trust are not errors of its forces.
MAX_PENALTY_BY_SOURCE = (0.1, MAX_PENALTY, MAX_PENALTY, 0.0, 0.1, 0.0)
USUAL_CHANGE, CHANGES = 0.05, (0.005, 0.6)  # new fraction of the force pattern: usual value, range of the fit
USUAL_SIZE = 500.0  # contacts that bear force
USUAL_FRICTION, MIN_FRICTION = 0.04, 0.0125  # Σ|f_t| / Σ f_n: usual value, detection limit
# For every e-fold by which the friction differs: error of f_n over f_n and over ⟨f⟩; of f_t over μ times these.
FRICTION_ERROR = ((0.5, 0.4), (0.6, 0.4))
HIGH_FRICTION = 0.6  # of that error where the given friction is too high: few contacts stick that should slide


def groups_of(frame: FrameForces) -> NDArray[np.uint8]:
    """Group of every contact (c,)."""
    mean = mean_normal_force(frame.fn)
    strength = np.nan_to_num(frame.fn / mean) if mean > 0 else np.zeros_like(frame.fn)
    group = np.full(len(frame.fn), Group.MEAN, np.uint8)
    group[strength < WEAK] = Group.WEAK
    group[strength > STRONG] = Group.STRONG
    if frame.sliding_probability is not None:
        group[frame.sliding_probability > SLIDES] = Group.SLIDING
    group[frame.contacts.with_wall] = Group.WALL
    if frame.bearing_probability is not None:
        group[frame.bearing_probability < UNCERTAIN] = Group.UNCERTAIN
    return group


def evidence_source_of(position_weight: float) -> EvidenceSource:
    """Source of a field in which the position-only estimate has this weight."""
    low, high = BOTH
    return (
        EvidenceSource.MOTION
        if position_weight < low
        else EvidenceSource.POSITIONS
        if position_weight > high
        else EvidenceSource.BOTH
    )


def penalty_of(trust: float | Array) -> Array:
    """1 − T, at most MAX_PENALTY, which also stands for a trust that is not assessed."""
    return np.clip(np.nan_to_num(1.0 - np.asarray(trust, np.float64), nan=MAX_PENALTY), 0.0, MAX_PENALTY)


def usual_trust(frame: FrameForces) -> float:
    """Bound of the expected correlation by the usual margin, with which the intervals were fitted.

    The trust itself depends on the evidence also by its margin, which is no error of the forces; it stands for this
    bound where there is no separate expectation.

    Notes
    -----
    tanh(arctanh r − margin), r the expected correlation, at least 0.
    """
    expected = frame.expected_correlation
    if not expected > frame.trust:
        return frame.trust
    margin = SOFT_MARGIN if frame.soft else MARGIN
    return max(math.tanh(math.atanh(min(expected, MAX_EXPECTED)) - margin), 0.0)


def source_of_frame(frame: FrameForces) -> EvidenceSource:
    """Source of the frame's field; no motion leads to the first frame."""
    if frame.frame == 0:
        return EvidenceSource.SOFT_FIRST if frame.soft else EvidenceSource.FIRST
    return EvidenceSource.SOFT if frame.soft else evidence_source_of(frame.position_weight)


def terms_of(frame: FrameForces) -> Array:
    """Value of every Term of the frame (t,)."""
    hidden = min(frame.unseen_penalty, MAX_PENALTY)
    penalty = min(float(penalty_of(usual_trust(frame) / (1.0 - hidden))), MAX_PENALTY_BY_SOURCE[source_of_frame(frame)])
    change = float(np.clip(np.nan_to_num(frame.force_change, nan=USUAL_CHANGE), *CHANGES))
    size = math.log(max(int((frame.fn > 0).sum()), 1) / USUAL_SIZE)
    return np.array([penalty, math.log(change / USUAL_CHANGE), size, math.log(relative_friction(frame))])


def relative_friction(frame: FrameForces) -> float:
    """Friction that the field of the first frame carries, over its usual value; 1 for all other frames."""
    if frame.frame > 0:
        return 1.0
    carried = float(np.maximum(frame.fn, 0.0).sum())
    ratio = float(np.abs(frame.ft).sum()) / carried if carried > 0 else 0.0
    return (ratio + MIN_FRICTION) / (USUAL_FRICTION + MIN_FRICTION)


def calibrate_sd(frame: FrameForces) -> FrameForces:
    """Replace the formula's standard deviations by calibrated ones; those that are zero stay zero."""
    mean = mean_normal_force(frame.fn)
    if not mean > 0:
        return frame
    formula = np.column_stack([frame.fn_sd, frame.ft_sd]) / mean
    size = np.sqrt(formula**2 + FLOOR**2 + _errors_with_force(frame, mean) ** 2) / TYPICAL
    sd = mean * TYPICAL * interval_factors(frame) * size ** (1.0 + POWER[source_of_frame(frame)])
    sd = np.sqrt(sd**2 + _added_variance(frame, mean))
    sd[formula == 0] = 0.0
    return replace(frame, fn_sd=sd[:, 0], ft_sd=sd[:, 1])


def _added_variance(frame: FrameForces, mean: float) -> Array:
    """Variances (c, 2) [N²] that no disagreement of the members shows: of the scale and of the model."""
    if frame.soft:
        return _scale_errors(frame) ** 2
    size = np.clip(np.nan_to_num(frame.fn / mean), *MODEL_FORCES)[:, None]
    return _scale_errors(frame) ** 2 + (size * MODEL_ERROR * mean) ** 2


def _errors_with_force(frame: FrameForces, mean: float) -> Array:
    """Relative errors proportional to the force (c, 2): of contacts that may bear none, and of the first frame."""
    unloaded = np.zeros_like(frame.fn) if frame.bearing_probability is None else 1.0 - frame.bearing_probability
    scale = FIRST_SCALE if frame.frame == 0 else 0.0
    return np.sqrt(unloaded + scale**2)[:, None] * np.abs(np.column_stack([frame.fn, frame.ft])) / mean


def _scale_errors(frame: FrameForces) -> Array:
    """Standard deviations (c, 2) [N] by the scale that all forces share.

    Those of soft grains were fitted with it, and those of the first frame contain FIRST_SCALE.
    """
    relative = 0.0 if frame.soft or math.isnan(frame.scale_sd) else frame.scale_sd
    if frame.frame == 0:
        relative = math.sqrt(max(relative**2 - FIRST_SCALE**2, 0.0))
    return relative * np.abs(np.column_stack([frame.fn, frame.ft]))


def widen_scale(frame: FrameForces, sd: float) -> FrameForces:
    """Add a relative error of all forces to the standard deviation of the scale, and to those of the forces."""
    wider = replace(frame, scale_sd=math.hypot(frame.scale_sd, sd))
    variance = _scale_errors(wider) ** 2 - _scale_errors(frame) ** 2
    stated = np.column_stack([frame.fn_sd, frame.ft_sd])
    both = np.where(stated > 0.0, np.sqrt(stated**2 + variance), stated)  # zero stays zero
    return replace(wider, fn_sd=both[:, 0], ft_sd=both[:, 1])


def formula_sd_of(frame: FrameForces) -> Array:
    """Invert `calibrate_sd`: its argument over the mean f_n, floor and proportional errors included (c, 2)."""
    stated = np.column_stack([frame.fn_sd, frame.ft_sd])
    mean = mean_normal_force(frame.fn)
    sd = np.sqrt(np.maximum(stated**2 - _added_variance(frame, mean), 0.0)) / (mean * TYPICAL)
    return TYPICAL * (sd / interval_factors(frame)) ** (1.0 / (1.0 + POWER[source_of_frame(frame)]))


def correlation_by_intervals(frame: FrameForces) -> float:
    """Compute the correlation of f_n with the true forces that the standard deviations of f_n lead to expect.

    Notes
    -----
    1/√(1 + Σ s²/Σ (f_n − ⟨f_n⟩)²) for estimates that are the mean of a posterior with standard deviations s, without
    their part by the scale, which changes no correlation. NaN where all forces are alike, or without any.
    """
    variance = float(np.sum((frame.fn - frame.fn.mean()) ** 2)) if len(frame.fn) else 0.0
    left = np.maximum(frame.fn_sd**2 - _scale_errors(frame)[:, 0] ** 2, 0.0)
    return 1.0 / math.sqrt(1.0 + float(left.sum()) / variance) if variance > 0.0 else math.nan


def interval_factors(frame: FrameForces) -> Array:
    """Factors on the standard deviations of f_n and f_t (c, 2) by group, source and terms of the frame."""
    source = source_of_frame(frame)
    return FACTOR[source][groups_of(frame)] * np.exp(terms_of(frame) @ SLOPE[source])


def widen_for_friction(frame: FrameForces, given: float, measured: float, fraction: float = 1.0) -> FrameForces:
    """Add the error of the friction coefficient to the standard deviations: a fraction of the step between two values.

    Forces from positions alone do not depend on sliding: theirs stay.
    """
    if not (given > 0 and measured > 0) or frame.position_weight > BOTH[1]:
        return frame
    excess = fraction * abs(math.log(measured / given)) * (HIGH_FRICTION if measured < given else 1.0)
    mean = np.where(frame.fn_sd > 0, np.nan_to_num(mean_normal_force(frame.fn)), 0.0)  # zero stays zero
    normal, tangent = (
        excess * np.hypot(of_force * np.maximum(frame.fn, 0.0), of_mean * mean) for of_force, of_mean in FRICTION_ERROR
    )
    return replace(frame, fn_sd=np.hypot(frame.fn_sd, normal), ft_sd=np.hypot(frame.ft_sd, measured * tangent))
