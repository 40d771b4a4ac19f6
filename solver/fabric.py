"""Fabric: how contact directions are distributed."""

from __future__ import annotations

import numpy as np

from solver.grains import Array


def contact_fabric(normal: Array) -> Array:
    """Second-order fabric tensor, the mean of n ⊗ n over contacts (c, 2); isotropic without contacts (2, 2)."""
    if len(normal) == 0:
        return 0.5 * np.eye(2)
    return normal.T @ normal / len(normal)


def fabric_anisotropy(fabric: Array) -> float:
    """a = 2 (F₁ − F₂), the amplitude of the distribution E(θ) = (1 + a cos 2(θ − θ_F)) / 2π."""
    minor, major = np.linalg.eigvalsh(0.5 * (fabric + fabric.T))
    return float(2.0 * (major - minor))
