"""The homogeneous and the rigid motion that fit that of a packing's grains best; the time by which a rate is fast.

The motion that a packing makes as one rigid body, with its boundary, changes no force: a drum turns with its bed, a box
is tilted, a camera is turned between two photographs. What is read of the motion must not depend on that part, which
can be a thousand times as large as the rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from .grains import Array

MIN_GRAINS = 4  # fewer give no gradient
DOMINANT = 5.0  # rms of the rigid displacement over that of the rest, above which it is removed; in shear it is 3
FEWEST = 3  # grains


def displacement_gradient(
    position: Float[Array, "n 2"], displacement: Float[Array, "n 2"], present: NDArray[np.bool_]
) -> Float[Array, "2 2"]:
    """Fit the displacement gradient ∂u_a/∂x_b by least squares.

    Parameters
    ----------
    position : (n, 2)
        Positions [m] before or after the displacement; the gradient refers to these.
    displacement : (n, 2)
        Displacements [m].
    present : (n,) bool
        Grains that are used.

    Returns
    -------
    (2, 2)
        The gradient; NaN for fewer than MIN_GRAINS grains.
    """
    if present.sum() < MIN_GRAINS:
        return np.full((2, 2), np.nan)
    x = position[present]
    design = np.column_stack([x - x.mean(axis=0), np.ones(len(x))])
    return np.asarray(np.linalg.lstsq(design, displacement[present], rcond=None)[0][:2].T, dtype=np.float64)


def logarithmic_strain(gradient: Float[Array, "2 2"]) -> Float[Array, "2 2"]:
    """Return the logarithmic (Hencky) strain of a displacement gradient; extension is positive.

    Returns
    -------
    (2, 2)
        The strain; NaN where the gradient is not finite or det F ≤ 0.

    Notes
    -----
    ε = ½ ln(F Fᵀ) with F = 1 + ∂u/∂X, the gradient by positions before the motion. Rotations do not change it.
    """
    deformation = np.eye(2) + gradient
    if not np.isfinite(deformation).all() or not np.linalg.det(deformation) > 0.0:
        return np.full((2, 2), np.nan)
    stretch, axes = np.linalg.eigh(deformation @ deformation.T)
    return np.asarray((axes * (0.5 * np.log(stretch))) @ axes.T, dtype=np.float64)


def shear_strain(strain: Float[Array, "2 2"]) -> float:
    """Return the difference of the principal strains, the shear angle [rad] where it is small; NaN for NaN."""
    return float(np.hypot(strain[0, 0] - strain[1, 1], strain[0, 1] + strain[1, 0]))


def strain_magnitude(step: Float[Array, "2 2"]) -> float:
    """Return the shear strain or the greatest absolute principal strain, whichever is greater; NaN for NaN."""
    if not np.isfinite(step).all():
        return float("nan")
    return max(shear_strain(step), float(np.abs(np.linalg.eigvalsh(0.5 * (step + step.T))).max()))


def inertial_time(mass: float, pressure: float, length: float) -> float:
    """Return √(m̄/(p L)) [s], the inertial number over the rate of shear.

    Parameters
    ----------
    mass : float
        Mean mass of a grain m̄ [kg].
    pressure : float
        p [Pa].
    length : float
        Length of the rods L [m].
    """
    return float(np.sqrt(mass / (pressure * length)))


@dataclass(frozen=True, slots=True)
class RigidMotion:
    """A rotation about the origin, then a displacement."""

    angle: float  # [rad]
    displacement: Float[Array, " 2"]  # [m]

    def moved(self, point: Array) -> Array:
        """Points (…, 2) [m] after the motion."""
        cosine, sine = np.cos(self.angle), np.sin(self.angle)
        return point @ np.array([[cosine, sine], [-sine, cosine]]) + self.displacement


def find_dominant_rigid_motion(before: Array, after: Array, present: NDArray[np.bool_]) -> RigidMotion | None:
    """Find the rigid motion that fits the grains best (least squares), where it exceeds the rest by far.

    Parameters
    ----------
    before, after : (n, 2)
        Positions [m].
    present : (n,) bool
        Grains whose positions are known in both.

    Returns
    -------
    RigidMotion, or None
        None where the grains' own motion is a fifth of it or more.

    Notes
    -----
    With centred positions x and y the angle is atan2(Σ x × y, Σ x · y) (Kabsch, Acta Cryst. A32, 922, 1976).
    """
    if present.sum() < FEWEST:
        return None
    x, y = before[present], after[present]
    x0, y0 = x.mean(axis=0), y.mean(axis=0)
    u, v = x - x0, y - y0
    angle = float(np.arctan2(np.sum(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]), np.sum(u * v)))
    turned = RigidMotion(angle, np.zeros(2))
    found = RigidMotion(angle, y0 - turned.moved(x0))
    rest, rigid = y - found.moved(x), found.moved(x) - x
    return found if np.sum(rigid**2) > DOMINANT**2 * np.sum(rest**2) else None
