"""A grain's outline to a part of a pixel, and the circle through it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from solver.bodies.grains import Array

from ...experiment.photographs import Image
from ..correlation.kernels import interpolate

# Samples along a radius [1/px].
DENSITY = 4

# Points of the outline, one per pixel, that one dot of paint may spoil together.
POINTS_OF_A_STRETCH = 8.0


@dataclass(frozen=True, slots=True)
class Outline:
    """Edge points of one grain."""

    angle: Array  # (p,) [rad] from the rough centre
    distance: Array  # (p,) [px] of the edge from the rough centre, NaN where there is none
    strength: Image  # (p,) [grey/px] slope of the edge
    beyond: Image  # (p,) [grey] two pixels outside the edge, or the darkest up to there
    in_view: NDArray[np.bool_]  # (p,) whether the photograph reaches there
    rays: Image  # (p, s) [grey] the rays themselves, at distances first + k / DENSITY
    first: float  # [px]


@njit(cache=True, nogil=True)
def sample_rays(coefficients, cx, cy, angles, first, step, out):
    """Grey values along rays: out (p, s) at distances first + step · k; NaN outside the photograph."""
    height, width = coefficients.shape
    for p in range(len(angles)):
        cos, sin = np.cos(angles[p]), np.sin(angles[p])
        for k in range(out.shape[1]):
            r = first + step * k
            x, y = cx + r * cos, cy + r * sin
            if not (x >= 1.0 and y >= 1.0 and x < width - 2 and y < height - 2):
                out[p, k] = np.nan
                continue
            ix, iy = int(x), int(y)
            out[p, k] = interpolate(coefficients, ix, iy, np.float32(x - ix), np.float32(y - iy))


def trace_outline(
    coefficients: Image, x: float, y: float, radius: float, window: float, *, narrow: bool = False
) -> Outline:
    """Look along every ray for the steepest descent outwards within `window` [px] of the radius [px].

    narrow: gaps may end before the two pixels outside the edge where their dark is read.
    """
    angle = np.arange(0.0, 2.0 * np.pi, 1.0 / radius)
    margin = 3.0
    first = radius - window - margin
    count = int(np.ceil(2.0 * (window + margin) * DENSITY)) + 1
    ray = np.empty((len(angle), count), np.float32)
    sample_rays(coefficients, x, y, angle, first, 1.0 / DENSITY, ray)
    # A second difference over half a pixel to each side: the slope, smoothed by less than the lens's blur.
    half = DENSITY // 2
    slope = (ray[:, : -2 * half] - ray[:, 2 * half :]) * (DENSITY / (2.0 * half))
    where = first + (np.arange(slope.shape[1]) + half) / DENSITY
    allowed = np.abs(where - radius) <= window
    in_view: NDArray[np.bool_] = np.asarray(np.isfinite(ray).all(axis=1), dtype=np.bool_)
    masked = np.where(allowed[None, :] & np.isfinite(slope), slope, -np.inf)
    top = np.argmax(masked, axis=1)
    rows = np.arange(len(angle))
    top = np.clip(top, 1, slope.shape[1] - 2)
    before, at, after = slope[rows, top - 1], slope[rows, top], slope[rows, top + 1]
    with np.errstate(invalid="ignore", divide="ignore"):
        shift = 0.5 * (before - after) / (before - 2.0 * at + after)
    # A maximum at the window's end is not one.
    peaked = in_view & (at >= before) & (at >= after) & (np.abs(shift) <= 1.0) & (at > 0.0)
    distance = np.where(peaked, where[top] + shift / DENSITY, np.nan)
    outside = np.clip(top + half + int(2.0 * DENSITY), 0, count - 1)
    beyond = ray[rows, outside]
    if narrow:
        _take_darkest(ray, top + half, outside, beyond)
    return Outline(angle, distance, np.where(peaked, at, 0.0), beyond, in_view, ray, first)


@njit(cache=True, nogil=True)
def _take_darkest(ray, start, end, beyond):
    for p in range(len(beyond)):
        for k in range(start[p], end[p]):
            beyond[p] = min(beyond[p], ray[p, k])


@dataclass(frozen=True, slots=True)
class Circle:
    """A circle through edge points."""

    x: float  # [px]
    y: float  # [px]
    radius: float  # [px]
    sigma: float  # [px] standard deviation of a component of the centre
    residual: Array  # (p,) [px] of every point, positive outside the circle


def fit_circle(
    x: float,
    y: float,
    radius: float,
    angle: Array,
    distance: Array,
    weight: Array,
    *,
    radius_scatter: float,
    scale_least: float,
) -> Circle:
    """Tukey-weighted circle through points at angle (p,) [rad], distance (p,) [px] from (x, y).

    radius_scatter [px]: standard deviation of the true radius about the given one, infinite where it is
    unknown. scale_least [px]: residuals below it are never outliers. The centre's standard deviation
    comes from the scores summed over stretches of the outline, because one dot of paint spoils several
    points at once.
    """
    # Start from the radius that the points themselves have, lest a common shift make outliers of them.
    start = _weighted_median(distance - radius, weight) if np.isinf(radius_scatter) else 0.0
    residual, w = np.empty_like(distance), np.empty_like(distance)
    shift, scale, inverse, score = _fit(
        angle, distance, np.asarray(weight, dtype=np.float64), radius, start, radius_scatter, scale_least, residual, w
    )
    score = score[np.bincount((angle * radius / POINTS_OF_A_STRETCH).astype(np.intp), w, len(score)) > 0.0]
    spread = inverse @ (score.T @ score) @ inverse * len(score) / max(len(score) - 3, 1)
    # What the radius' prior leaves open counts too.
    prior = np.diag([0.0, 0.0, (scale / radius_scatter) ** 2 * POINTS_OF_A_STRETCH])
    spread += inverse @ prior @ inverse * scale**2 * POINTS_OF_A_STRETCH
    variance = 0.5 * (spread[0, 0] + spread[1, 1])
    # Where too few points are left to fix a circle, nothing but rounding errors is.
    sigma = float(np.sqrt(variance)) if variance >= 0.0 else np.inf
    return Circle(x + shift[0], y + shift[1], radius + shift[2], sigma, residual)


@njit(cache=True, nogil=True)
def _fit(angle, distance, weight, radius, start, radius_scatter, scale_least, residual, w):
    """Shift (3,) of centre and radius, scale, inverse normal matrix (3, 3) and the scores (s, 3) of the stretches.

    residual, w (p,): filled with the last residuals and weights.
    """
    count = len(angle)
    px, py = distance * np.cos(angle), distance * np.sin(angle)
    design = np.ones((count, 3))
    shift, step = np.zeros(3), np.zeros(3)
    shift[2] = start
    scale, inverse = scale_least, np.eye(3)
    for _ in range(30):
        for p in range(count):
            ex, ey = px[p] - shift[0], py[p] - shift[1]
            length = np.hypot(ex, ey)
            residual[p] = length - radius - shift[2]
            design[p, 0], design[p, 1] = ex / length, ey / length
        scale = max(_weighted_median(np.abs(residual), weight) / 0.6745, scale_least)
        prior = (scale / radius_scatter) ** 2 * POINTS_OF_A_STRETCH
        normal, right = np.zeros((3, 3)), np.zeros(3)
        for p in range(count):
            w[p] = weight[p] * max(1.0 - (residual[p] / (4.685 * scale)) ** 2, 0.0) ** 2
            for i in range(3):
                right[i] += w[p] * residual[p] * design[p, i]
                for j in range(3):
                    normal[i, j] += w[p] * design[p, i] * design[p, j]
        normal[2, 2] += prior
        right[2] -= prior * shift[2]
        inverse = np.linalg.inv(normal + 1e-9 * np.eye(3))
        step = inverse @ right
        shift += step
        if np.abs(step).max() < 1e-4:
            break
    score = np.zeros((int(angle.max() * radius / POINTS_OF_A_STRETCH) + 1, 3))
    for p in range(count):
        row = int(angle[p] * radius / POINTS_OF_A_STRETCH)
        for i in range(3):
            score[row, i] += design[p, i] * w[p] * residual[p]
    return shift, scale, inverse, score


@njit(cache=True, nogil=True)
def _weighted_median(value, weight):
    order = np.argsort(value)
    total = np.cumsum(weight[order])
    return value[order[min(np.searchsorted(total, 0.5 * total[-1]), len(value) - 1)]]
