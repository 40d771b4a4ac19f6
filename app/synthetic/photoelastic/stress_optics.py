"""Fringes of a photoelastic disc under contact forces, by the stress-optic law.

Every contact force stresses the disc as it would a half plane (Flamant): radially from the contact point, by
−2 F cos θ/(π r) per length. Their sum and a uniform pressure, which shows no fringes, are Michell's solution for a disc
in equilibrium. Between crossed circular polarisers the light is I = I₀ sin²(π N), N = C |σ₁ − σ₂|.
"""

from __future__ import annotations

import numpy as np

from ...solver.bodies.grains import Array

NEAREST = 0.04  # radii: distance from a contact point within which the stress is that at this distance


def stress_difference(x: Array, y: Array, radius: float, direction: Array, force: Array) -> Array:
    """Compute the difference of the principal stresses of a disc, times its thickness.

    Parameters
    ----------
    x, y : (p,)
        Places [m] from the disc's centre.
    radius : float
        [m]
    direction : (k, 2)
        Unit vectors from the centre to the contact points.
    force : (k, 2)
        Forces on the disc [N].

    Returns
    -------
    ndarray, shape (p,)
        |σ₁ − σ₂| times the thickness [N/m].

    Notes
    -----
    With r the vector from contact point k to the place, σ = −Σ_k 2 (F_k·r)/(π |r|²) r̂ ⊗ r̂ + a uniform pressure, and
    σ₁ − σ₂ = √((σ_xx − σ_yy)² + 4 σ_xy²).
    """
    deviator, shear = np.zeros(len(x)), np.zeros(len(x))
    for (nx, ny), (fx, fy) in zip(radius * direction, force, strict=True):
        dx, dy = x - nx, y - ny
        square = np.maximum(dx * dx + dy * dy, (NEAREST * radius) ** 2)
        radial = -2.0 / np.pi * (fx * dx + fy * dy) / square
        deviator += radial * (dx * dx - dy * dy) / square
        shear += radial * dx * dy / square
    return np.sqrt(deviator**2 + 4.0 * shear**2)


def fringe_light(stress: Array, per_order: float) -> Array:
    """Fraction of the light that crossed circular polarisers pass; per_order: stress [N/m] of a fringe order."""
    return np.sin(np.pi * stress / per_order) ** 2
