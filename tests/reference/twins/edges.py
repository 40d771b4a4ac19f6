"""A circle through edge points and the profile of a rim, fitted with whole matrices."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from solver.bodies.grains import Array


def weighted_median(value: Array, weight: Array) -> float:
    """The least value with half the weight at or below it."""
    for each in sorted(set(value.tolist())):
        if weight[value <= each].sum() >= 0.5 * weight.sum():
            return each
    raise AssertionError


def circle_step(
    angle: Array, distance: Array, weight: Array, radius: float, shift: Array, scatter: float, scale_least: float
) -> tuple[Array, Array, Array]:
    """One Tukey-weighted step of centre and radius (3,) from a shift of them, residuals and weights (p,)."""
    point = distance[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1) - shift[:2]
    length = np.linalg.norm(point, axis=1)
    residual = length - radius - shift[2]
    scale = max(weighted_median(np.abs(residual), weight) / 0.6745, scale_least)
    w = weight * np.clip(1.0 - (residual / (4.685 * scale)) ** 2, 0.0, None) ** 2
    design = np.column_stack([point / length[:, None], np.ones(len(angle))])
    prior = (scale / scatter) ** 2 * 8.0
    normal = design.T @ (w[:, None] * design) + np.diag([0.0, 0.0, prior])
    return np.linalg.solve(normal, design.T @ (w * residual) - [0.0, 0.0, prior * shift[2]]), residual, w


def rim(r: Array, edge: float, level: float, slope: float, width: float) -> Array:
    """A Φ(t) + C s (t Φ(t) + φ(t)) with t = (r₀ − r)/s: the light above the dark."""
    t = (edge - r) / width
    density = np.exp(-0.5 * t**2) / np.sqrt(2.0 * np.pi)
    return level * ndtr(t) + slope * width * (t * ndtr(t) + density)


def rim_misfit(
    ray: Array,
    r: Array,
    values: Array,
    dark: float,
    width: float,
    expected: float,
    scatter: float,
    step: float,
    level: float,
) -> Array:
    """Residuals of edge, level and slope, and of what paint lets the slope be; `level` is that of the last round."""
    edge, a, c = values
    pull = 3.0 / (scatter * max(level, 1.0)) / np.sqrt(step)
    return np.append(ray - dark - rim(r, edge, a, c, width), -pull * (c - expected * a))
