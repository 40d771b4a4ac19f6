"""Densities of touching and of open gaps by arrays; `solver.posterior.touching_kernels` computes them one by one."""

from __future__ import annotations

import numpy as np
from rodsight.solver.bodies.grains import Array
from scipy.special import ndtr


def densities(gap: Array, mean: Array, open_range: Array, s: float, fraction: Array) -> tuple[Array, Array]:
    """Densities of touching and open gaps (f, c) [m]; mean, open_range (c,) [m] above it; fraction (f,)."""
    rest = gap - mean
    touching = fraction[:, None] * np.exp(-0.5 * (rest / s) ** 2) / (s * np.sqrt(2.0 * np.pi))
    opened = (1.0 - fraction[:, None]) * (ndtr(rest / s) - ndtr((rest - open_range) / s)) / np.maximum(open_range, s)
    return touching, opened
