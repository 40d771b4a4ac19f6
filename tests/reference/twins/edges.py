"""A circle through edge points and the profile of a rim, fitted with whole matrices."""

from __future__ import annotations

import numpy as np
from rodsight.solver.bodies.grains import Array
from scipy.special import ndtr


def weighted_median(value: Array, weight: Array) -> float:
    """The smallest value with half the weight at or below it."""
    for each in sorted(set(value.tolist())):
        if weight[value <= each].sum() >= 0.5 * weight.sum():
            return each
    raise AssertionError


def circle_step(
    angle: Array, distance: Array, weight: Array, radius: float, shift: Array, scatter: float, min_scale: float
) -> tuple[Array, Array, Array]:
    """One Tukey-weighted step of centre and radius (3,) from a shift of them, residuals and weights (p,)."""
    point = distance[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1) - shift[:2]
    length = np.linalg.norm(point, axis=1)
    residual = length - radius - shift[2]
    scale = max(weighted_median(np.abs(residual), weight) / 0.6745, min_scale)
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
    """Residuals of edge, level and slope, and of the slope bound of the paint; `level`: of the previous iteration."""
    edge, a, c = values
    pull = 3.0 / (scatter * max(level, 1.0)) / np.sqrt(step)
    return np.append(ray - dark - rim(r, edge, a, c, width), -pull * (c - expected * a))


def steepest(ray: Array, first: float, radius: float, window: float, narrow: bool) -> tuple[float, float, float]:
    """Edge, slope and level beyond it of one ray sampled in quarters of a pixel; NaN and 0 without an edge."""
    r = first + 0.25 * np.arange(len(ray))
    slope = (ray[:-4] - ray[4:]) * 1.0  # per pixel
    where = r[2:-2]
    top = int(np.argmax(np.where(np.abs(where - radius) <= window, slope, -np.inf)))
    top = min(max(top, 1), len(slope) - 2)
    end = min(top + 2 + 8, len(ray) - 1)
    beyond = float(ray[top + 2 : end + 1].min() if narrow else ray[end])
    parabola = np.polyfit([-1.0, 0.0, 1.0], slope[top - 1 : top + 2], 2)
    if not (slope[top] > 0.0 and slope[top] >= slope[top - 1] and slope[top] >= slope[top + 1]):
        return np.nan, 0.0, beyond
    return float(where[top] - 0.25 * parabola[1] / (2.0 * parabola[0])), float(slope[top]), beyond


def apart(x: Array, y: Array, radius: Array, allowed: float) -> list[int]:
    """Keep the circles that overlap no kept circle before them."""
    kept: list[int] = []
    for k in range(len(x)):
        away = [np.hypot(x[k] - x[m], y[k] - y[m]) for m in kept]
        least = [radius[k] + radius[m] - allowed * min(radius[k], radius[m]) for m in kept]
        if all(a >= b for a, b in zip(away, least, strict=True)):
            kept.append(k)
    return kept


def sandwich_variance(score: Array, weight: Array, inverse: Array, scale: float, scatter: float) -> float:
    """Variance of a component of the centre: H⁻¹ SᵀS H⁻¹ over the stretches with weight, plus that of the prior."""
    used = score[weight > 0.0]
    spread = inverse @ (used.T @ used) @ inverse * len(used) / max(len(used) - 3, 1)
    prior = np.diag([0.0, 0.0, (scale / scatter) ** 2 * 8.0])
    spread = spread + inverse @ prior @ inverse * scale**2 * 8.0
    return 0.5 * float(spread[0, 0] + spread[1, 1])
