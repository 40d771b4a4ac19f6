"""Robust fit of the rigid motion that most of several points have in common."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...solver.bodies.grains import Array

# First steps, whose cutoff is at least three median residuals: with a poor start the majority would be outliers.
ADAPTIVE_STEPS = 10
STEPS = 30


def fit_common_motion(
    position: Array, moved: Array, covariance: Array, *, middle: Array, outlier: float, tolerance: float
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Fit the rigid motion that most points have in common.

    Parameters
    ----------
    position : (m, 2) array
        Points before the motion.
    moved : (m, 2) array
        Points after the motion.
    covariance : (m, 2, 2) array
        Covariances of the displacements.
    middle : (2,) array
        Centre of the rotation.
    outlier : float
        Standardised residual beyond which a point has no weight.
    tolerance : float
        Step, in the points' unit, below which the fit has converged.

    Returns
    -------
    motion : (3,) array
        dx, dy, angle [rad].
    covariance : (3, 3) array
        Covariance of the motion, increased where the points deviate more than their own covariances explain.
    agree : (m,) array
        Points with a weight.

    Notes
    -----
    Iteratively reweighted least squares: minimises Σ w rᵀ C⁻¹ r with the points' covariances C and Tukey's weights
    w = (1 − (d/c)²)², d² = rᵀ C⁻¹ r, zero beyond the cutoff c.
    """
    arm = position - middle
    inverse = np.linalg.inv(covariance)
    motion = _initial_motion(arm, moved - position)
    distance, weight, motion_covariance = np.zeros(len(position)), np.ones(len(position)), np.eye(3)
    for step in range(STEPS):
        rotated = rotate(motion[2], arm)
        residual = moved - middle - rotated - motion[:2]
        distance = np.sqrt(np.einsum("mi,mij,mj->m", residual, inverse, residual))
        cutoff = max(outlier, 3.0 * float(np.median(distance)) if step < ADAPTIVE_STEPS else 0.0)
        weight = np.clip(1.0 - (distance / cutoff) ** 2, 0.0, None) ** 2
        if np.count_nonzero(weight) < 2:
            return motion, motion_covariance, np.zeros(len(position), dtype=np.bool_)
        design = np.zeros((len(position), 2, 3))
        design[:, 0, 0] = design[:, 1, 1] = 1.0
        design[:, 0, 2], design[:, 1, 2] = -rotated[:, 1], rotated[:, 0]
        normal = np.einsum("m,mia,mij,mjb->ab", weight, design, inverse, design)
        right = np.einsum("m,mia,mij,mj->a", weight, design, inverse, residual)
        motion_covariance = np.linalg.inv(normal)
        change = motion_covariance @ right
        motion = motion + change
        if step >= ADAPTIVE_STEPS and np.abs(change[:2]).max() < tolerance:
            break
    # Increase the covariance where the residuals exceed the points' own covariances.
    excess = float((weight * distance**2).sum() / max(2.0 * weight.sum() - 3.0, 1.0))
    return motion, motion_covariance * max(excess, 1.0), weight > 0.0


def rotate(angle: float, arm: Array) -> Array:
    """Rotate vectors (m, 2) counter-clockwise by `angle` [rad]."""
    cos, sin = np.cos(angle), np.sin(angle)
    return np.stack([cos * arm[:, 0] - sin * arm[:, 1], sin * arm[:, 0] + cos * arm[:, 1]], axis=1)


def _initial_motion(arm: Array, displacement: Array) -> Array:
    """A rough rigid motion: the median displacement, and the median rotation of pairs of points."""
    motion = np.zeros(3)
    half = len(arm) // 2
    if half:
        order = np.argsort(arm[:, 0] if np.ptp(arm[:, 0]) > np.ptp(arm[:, 1]) else arm[:, 1], kind="stable")
        first, second = order[:half], order[-half:]
        before = arm[second] - arm[first]
        after = before + displacement[second] - displacement[first]
        cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
        motion[2] = float(np.median(np.arctan2(cross, np.einsum("mi,mi->m", before, after))))
    motion[:2] = np.median(displacement - (rotate(motion[2], arm) - arm), axis=0)
    return motion
