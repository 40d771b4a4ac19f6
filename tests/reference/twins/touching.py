"""Densities of touching and of open gaps by whole arrays; `solver.posterior.touching_kernels` has them one by one."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from solver.bodies.grains import Array


def densities(gap: Array, mean: Array, room: Array, s: float, share: Array) -> tuple[Array, Array]:
    """Of touching and of open gaps (f, c) [m] about means (c,) [m] with rooms (c,) [m] above; share (f,)."""
    rest = gap - mean
    touching = share[:, None] * np.exp(-0.5 * (rest / s) ** 2) / (s * np.sqrt(2.0 * np.pi))
    opened = (1.0 - share[:, None]) * (ndtr(rest / s) - ndtr((rest - room) / s)) / np.maximum(room, s)
    return touching, opened
