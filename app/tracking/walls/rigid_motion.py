"""The rigid motion of the plane that most of several points share."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.bodies.grains import Array

# Steps during which outliers are judged against the others' scatter, lest a start that is off throw out the majority.
WIDE_STEPS = 10
STEPS = 30


def share_motion(
    place: Array, moved: Array, covariance: Array, *, middle: Array, outlier: float, tolerance: float
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """The rigid motion (dx, dy, angle about `middle`) that takes most of `place` (m, 2) to `moved` (m, 2).

    Least squares with the points' own covariances (m, 2, 2), so that a point that is known only across one direction
    holds the motion only there; reweighted with Tukey's weights on the standardised residual, zero beyond `outlier`
    standard deviations. tolerance: the step, in the points' unit, below which it has converged. Returns the motion
    (3,), its covariance (3, 3), and which points agree (m,).
    """
    arm = place - middle
    inverse = np.linalg.inv(covariance)
    motion = _begin(arm, moved - place)
    distance, weight, spread = np.zeros(len(place)), np.ones(len(place)), np.eye(3)
    for step in range(STEPS):
        turned = turn(motion[2], arm)
        residual = moved - middle - turned - motion[:2]
        distance = np.sqrt(np.einsum("mi,mij,mj->m", residual, inverse, residual))
        width = max(outlier, 3.0 * float(np.median(distance)) if step < WIDE_STEPS else 0.0)
        weight = np.clip(1.0 - (distance / width) ** 2, 0.0, None) ** 2
        if np.count_nonzero(weight) < 2:
            return motion, spread, np.zeros(len(place), dtype=np.bool_)
        design = np.zeros((len(place), 2, 3))
        design[:, 0, 0] = design[:, 1, 1] = 1.0
        design[:, 0, 2], design[:, 1, 2] = -turned[:, 1], turned[:, 0]
        normal = np.einsum("m,mia,mij,mjb->ab", weight, design, inverse, design)
        right = np.einsum("m,mia,mij,mj->a", weight, design, inverse, residual)
        spread = np.linalg.inv(normal)
        change = spread @ right
        motion = motion + change
        if step >= WIDE_STEPS and np.abs(change[:2]).max() < tolerance:
            break
    # What the points' scatter shows beyond their own estimates counts too.
    excess = float((weight * distance**2).sum() / max(2.0 * weight.sum() - 3.0, 1.0))
    return motion, spread * max(excess, 1.0), weight > 0.0


def turn(angle: float, arm: Array) -> Array:
    """Vectors (m, 2) turned counter-clockwise by `angle` [rad]."""
    cos, sin = np.cos(angle), np.sin(angle)
    return np.stack([cos * arm[:, 0] - sin * arm[:, 1], sin * arm[:, 0] + cos * arm[:, 1]], axis=1)


def _begin(arm: Array, displacement: Array) -> Array:
    """A rough rigid motion: the median displacement, and the median of the turns that pairs of points show."""
    motion = np.zeros(3)
    half = len(arm) // 2
    if half:
        order = np.argsort(arm[:, 0] if np.ptp(arm[:, 0]) > np.ptp(arm[:, 1]) else arm[:, 1], kind="stable")
        first, second = order[:half], order[-half:]
        before = arm[second] - arm[first]
        after = before + displacement[second] - displacement[first]
        cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
        motion[2] = float(np.median(np.arctan2(cross, np.einsum("mi,mi->m", before, after))))
    motion[:2] = np.median(displacement - (turn(motion[2], arm) - arm), axis=0)
    return motion
