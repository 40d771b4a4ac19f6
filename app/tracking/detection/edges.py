"""A grain's outline to a part of a pixel, and the circle through it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from solver.bodies.grains import Array

from ...experiment.photographs import Image
from ..correlation.interpolation import interpolate

# Samples along a radius [1/px].
DENSITY = 4
MARGIN = 3.0  # [px] that they reach beyond the window in which edges are looked for
HALF, TWICE, NOWHERE = np.float32(0.5), np.float32(2.0), np.float32(np.inf)

# Points of the outline, one per pixel, that one dot of paint may spoil together.
POINTS_OF_A_STRETCH = 8.0


@dataclass(frozen=True, slots=True)
class Outline:
    """Edge points of one grain."""

    angle: Array  # (p,) [rad] from the rough centre
    edges: Array  # (p, 3) distance [px], slope [grey/px], grey level two pixels outside, or the darkest up to there
    in_view: NDArray[np.bool_]  # (p,) whether the photograph reaches there
    rays: Image  # (p, s) [grey] the rays themselves, at distances first + k / DENSITY
    first: float  # [px]

    @property
    def distance(self) -> Array:
        """Of the edge from the rough centre (p,) [px], NaN where there is none."""
        return self.edges[:, 0]

    @property
    def strength(self) -> Image:
        """Slope of the edge (p,) [grey/px]."""
        return self.edges[:, 1].astype(np.float32)


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
    angle, rays, edges, in_view = trace(coefficients, x, y, radius, window, narrow)
    return Outline(angle, edges, in_view, rays, radius - window - MARGIN)


@njit(cache=True, nogil=True)
def trace(coefficients, x, y, radius, window, narrow):
    """Rays (p, s) about a place, their angles (p,), the steepest descent of each (p, 3) and which lie in view (p,)."""
    step = 1.0 / radius
    angle = np.empty(int(np.ceil(2.0 * np.pi / step)))
    for p in range(len(angle)):
        angle[p] = p * step
    ray = np.empty((len(angle), int(np.ceil(2.0 * (window + MARGIN) * DENSITY)) + 1), np.float32)
    first = radius - window - MARGIN
    sample_rays(coefficients, x, y, angle, first, 1.0 / DENSITY, ray)
    edges, in_view = np.empty((len(angle), 3)), np.empty(len(angle), np.bool_)
    find_steepest(ray, first, radius, window, narrow, edges, in_view)
    return angle, ray, edges, in_view


@njit(cache=True, nogil=True, error_model="numpy")
def find_steepest(ray, first, radius, window, narrow, edges, in_view):
    """Write of every ray (p, s) the edge [px], NaN where there is none, its slope, and the grey level beyond it (p, 3).

    first [px]: where the rays begin; in_view (p,): whether the whole ray lies in the photograph; narrow: the darkest
    level up to two pixels outside counts, not the one there.
    """
    samples = ray.shape[1]
    half = DENSITY // 2
    # A second difference over half a pixel to each side: the slope, smoothed by less than the lens's blur.
    scale = np.float32(DENSITY / (2.0 * half))
    slopes = samples - 2 * half
    slope = np.empty(slopes, np.float32)
    for p in range(len(ray)):
        in_view[p] = True
        for k in range(samples):
            in_view[p] = in_view[p] and np.isfinite(ray[p, k])
        top, best = 0, -np.inf
        for k in range(slopes):
            slope[k] = (ray[p, k] - ray[p, k + 2 * half]) * scale
            here = first + (k + half) / DENSITY
            if abs(here - radius) <= window and slope[k] > best:
                top, best = k, slope[k]
        top = min(max(top, 1), slopes - 2)
        before, at, after = slope[top - 1], slope[top], slope[top + 1]
        bend = before - TWICE * at + after
        shift = HALF * (before - after) / bend if bend != 0.0 else NOWHERE
        # A maximum at the window's end is not one.
        peaked = in_view[p] and at >= before and at >= after and abs(shift) <= 1.0 and at > 0.0
        edges[p, 0] = first + (top + half) / DENSITY + shift / DENSITY if peaked else np.nan
        edges[p, 1] = at if peaked else 0.0
        outside = min(max(top + half + 2 * DENSITY, 0), samples - 1)
        edges[p, 2] = ray[p, outside]
        if narrow:
            for k in range(top + half, outside):
                edges[p, 2] = min(edges[p, 2], ray[p, k])


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
    start = weighted_median(distance - radius, weight) if np.isinf(radius_scatter) else 0.0
    residual, w = np.empty_like(distance), np.empty_like(distance)
    shift, scale, inverse, score = fit_points(
        angle, distance, np.asarray(weight, dtype=np.float64), radius, start, radius_scatter, scale_least, residual, w
    )
    variance = centre_variance(angle, radius, w, score, inverse, scale, radius_scatter)
    # Where too few points are left to fix a circle, nothing but rounding errors is.
    sigma = float(np.sqrt(variance)) if variance >= 0.0 else np.inf
    return Circle(x + shift[0], y + shift[1], radius + shift[2], sigma, residual)


@njit(cache=True, nogil=True)
def fit_points(angle, distance, weight, radius, start, radius_scatter, scale_least, residual, w):
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
        scale = max(weighted_median(np.abs(residual), weight) / 0.6745, scale_least)
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
def centre_variance(angle, radius, w, score, inverse, scale, radius_scatter):
    """Variance of a component of the centre [px²], from the scores (s, 3) of those stretches that weigh anything."""
    weight = np.zeros(len(score))
    for p in range(len(angle)):
        weight[int(angle[p] * radius / POINTS_OF_A_STRETCH)] += w[p]
    stretches, variance, squares = 0, 0.0, 0.0
    for k in range(len(score)):
        if weight[k] > 0.0:
            stretches += 1
            for i in range(2):
                step = inverse[i, 0] * score[k, 0] + inverse[i, 1] * score[k, 1] + inverse[i, 2] * score[k, 2]
                squares += step * step
    variance = squares * stretches / max(stretches - 3, 1)
    # What the radius' prior leaves open counts too.
    prior = (scale / radius_scatter) ** 2 * POINTS_OF_A_STRETCH
    for i in range(2):
        variance += inverse[i, 2] * prior * inverse[2, i] * scale**2 * POINTS_OF_A_STRETCH
    return 0.5 * variance


@njit(cache=True, nogil=True)
def weighted_median(value, weight):
    """The value (p,) with half of the weight (p,) on either side."""
    order = np.argsort(value)
    total = np.cumsum(weight[order])
    return value[order[min(np.searchsorted(total, 0.5 * total[-1]), len(value) - 1)]]
