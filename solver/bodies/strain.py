"""How a packing as a whole deforms: the homogeneous motion that fits those of its grains best."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy.typing import NDArray

from solver.bodies.grains import Array

FEWEST = 4  # grains below which nothing is said


def displacement_gradient(
    position: Float[Array, "n 2"], displacement: Float[Array, "n 2"], here: NDArray[np.bool_]
) -> Float[Array, "2 2"]:
    """Give ∂u_a/∂x_b of the grains (n,) that are here, by least squares; NaN where they are too few.

    position: before the displacement [m], or after it, which the gradient then refers to.
    """
    if here.sum() < FEWEST:
        return np.full((2, 2), np.nan)
    x = position[here]
    design = np.column_stack([x - x.mean(axis=0), np.ones(len(x))])
    return np.asarray(np.linalg.lstsq(design, displacement[here], rcond=None)[0][:2].T, dtype=np.float64)


def logarithmic_strain(gradient: Float[Array, "2 2"]) -> Float[Array, "2 2"]:
    """Strain ½ ln(F Fᵀ) of a displacement gradient before the motion, F = 1 + gradient; extension is positive.

    It is that of the whole way, however far: rotations leave it as it is. NaN where the gradient is none.
    """
    deformation = np.eye(2) + gradient
    if not np.isfinite(deformation).all() or not np.linalg.det(deformation) > 0.0:
        return np.full((2, 2), np.nan)
    stretch, axes = np.linalg.eigh(deformation @ deformation.T)
    return np.asarray((axes * (0.5 * np.log(stretch))) @ axes.T, dtype=np.float64)


def shear_of(strain: Float[Array, "2 2"]) -> float:
    """Difference of the principal strains [rad], the amount of shear where it is small; NaN of NaN."""
    return float(np.hypot(strain[0, 0] - strain[1, 1], strain[0, 1] + strain[1, 0]))


def way_of(step: Float[Array, "2 2"]) -> float:
    """How far a strain goes: its shear, or its greatest principal strain where that is greater; NaN of NaN."""
    if not np.isfinite(step).all():
        return float("nan")
    return max(shear_of(step), float(np.abs(np.linalg.eigvalsh(0.5 * (step + step.T))).max()))
