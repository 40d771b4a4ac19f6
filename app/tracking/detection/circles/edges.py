"""Edges along a grain's outline with subpixel accuracy, and the circle fitted through them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ....experiment.pictures.image import Image
from ....solver.bodies.grains import Array
from ...interpolation.spline_values import interpolate_cubic
from ...short_sort import ascending_order

# Samples along a radius [1/px].
DENSITY = 4
MARGIN = 3.0  # [px] length of the rays beyond the window in which edges are searched for
HALF, TWICE, NOWHERE = np.float32(0.5), np.float32(2.0), np.float32(np.inf)

# Number of points of the outline, one per pixel, in an arc that one dot of paint may affect.
POINTS_PER_ARC = 8.0


@dataclass(frozen=True, slots=True)
class Outline:
    """Edge points of one grain."""

    angle: Array  # (p,) [rad] from the rough centre
    edges: Array  # (p, 3) distance [px], slope [grey/px], grey level two pixels outside, or the darkest up to there
    in_view: NDArray[np.bool_]  # (p,) whether the ray lies within the photograph
    rays: Image  # (p, s) [grey] values at distances first + k / DENSITY
    first: float  # [px]

    @property
    def distance(self) -> Array:
        """Distance of the edge from the rough centre (p,) [px], NaN without an edge."""
        return self.edges[:, 0]

    @property
    def strength(self) -> Image:
        """Slope of the edge (p,) [grey/px]."""
        return self.edges[:, 1].astype(np.float32)


@njit(cache=True, nogil=True)
def sample_rays(coefficients, cx, cy, angles, first, step, out):
    """Write the grey values (p, s) along rays at distances first + step · k; NaN outside the photograph."""
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
            out[p, k] = interpolate_cubic(coefficients, ix, iy, np.float32(x - ix), np.float32(y - iy))


def trace_outline(
    coefficients: Image, x: float, y: float, radius: float, window: float, *, narrow: bool = False
) -> Outline:
    """Find the steepest outward descent along every ray, within `window` [px] of the radius [px].

    narrow: gaps may be narrower than the two pixels outside the edge where their dark is read.
    """
    angle, rays, edges, in_view = trace(coefficients, x, y, radius, window, narrow)
    return Outline(angle, edges, in_view, rays, radius - window - MARGIN)


@njit(cache=True, nogil=True)
def trace(coefficients, x, y, radius, window, narrow):
    """Return angles (p,), rays (p, s), edges (p, 3) and visibility (p,) around a place, see `find_steepest`."""
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
    """Find the edge of every ray with subpixel accuracy.

    Parameters
    ----------
    ray : (p, s) array
        Grey values of the rays.
    first : float
        Distance of the rays' first sample [px].
    radius, window : float
        Middle and half width of the search [px].
    narrow : bool
        The level beyond an edge is the darkest up to two pixels outside, not the one at two pixels.
    edges : (p, 3) array
        Receives the distance of the edge [px] (NaN: none), its slope [grey/px] and the level beyond it [grey].
    in_view : (p,) array
        Receives whether the whole ray lies within the photograph.
    """
    samples = ray.shape[1]
    half = DENSITY // 2
    # Central difference over half a pixel to each side: smoothed by less than the lens's blur.
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
        # The greatest slope at the window's end is no maximum.
        peaked = in_view[p] and at >= before and at >= after and abs(shift) <= 1.0 and at > 0.0
        edges[p, 0] = first + (top + half) / DENSITY + shift / DENSITY if peaked else np.nan
        edges[p, 1] = at if peaked else 0.0
        outside = min(max(top + half + 2 * DENSITY, 0), samples - 1)
        edges[p, 2] = ray[p, outside]
        if narrow:
            for k in range(top + half, outside):
                edges[p, 2] = min(edges[p, 2], ray[p, k])


@njit(cache=True, nogil=True)
def fit_circle(angle, distance, weight, radius, radius_sd, min_scale):
    """Fit a circle through points with Tukey's weights.

    Parameters
    ----------
    angle, distance : (p,) array
        Points about the rough centre [rad, px].
    weight : (p,) array
        Weights of the points.
    radius : float
        Rough radius [px].
    radius_sd : float
        Standard deviation of the true radius about the given one [px]; infinite where it is unknown.
    min_scale : float
        Residuals below it are never outliers [px].

    Returns
    -------
    tuple
        Change of centre and radius (3,) [px]; standard deviation of a component of the centre [px]; residual (p,) of
        every point [px], positive outside the circle.

    Notes
    -----
    Minimises Σ w r² + prior · Δradius² by Gauss-Newton, r: distance from the circle, w: the given weights times Tukey's
    (1 − (r / (4.685 s))²)², s: 1.4826 times the median of |r|. The centre's variance is the sandwich estimate
    H⁻¹ (Σ g gᵀ) H⁻¹ with the scores g summed over arcs of the outline, because one dot of paint affects several points.
    """
    # Start from the points' own radius: with a common shift they would all be outliers.
    start = weighted_median(distance - radius, weight) if np.isinf(radius_sd) else 0.0
    residual, w = np.empty_like(distance), np.empty_like(distance)
    shift, scale, inverse, score = fit_points(
        angle, distance, weight.astype(np.float64), radius, start, radius_sd, min_scale, residual, w
    )
    variance = centre_variance(angle, radius, w, score, inverse, scale, radius_sd)
    # With too few points for a circle the variance consists of rounding errors.
    return shift, np.sqrt(variance) if variance >= 0.0 else np.inf, residual


@njit(cache=True, nogil=True)
def fit_points(angle, distance, weight, radius, start, radius_sd, min_scale, residual, w):
    """Fit a circle, see `fit_circle`; writes the last residuals and weights w (p,).

    Returns
    -------
    shift : (3,) array
        Change of centre and radius [px].
    scale : float
        Scale of the residuals [px].
    inverse : (3, 3) array
        Inverse normal matrix.
    score : (s, 3) array
        Scores of the arcs.
    """
    count = len(angle)
    px, py = distance * np.cos(angle), distance * np.sin(angle)
    design = np.ones((count, 3))
    shift, step = np.zeros(3), np.zeros(3)
    shift[2] = start
    scale, inverse = min_scale, np.eye(3)
    for _ in range(30):
        for p in range(count):
            ex, ey = px[p] - shift[0], py[p] - shift[1]
            length = np.hypot(ex, ey)
            residual[p] = length - radius - shift[2]
            design[p, 0], design[p, 1] = ex / length, ey / length
        scale = max(weighted_median(np.abs(residual), weight) / 0.6745, min_scale)
        prior = (scale / radius_sd) ** 2 * POINTS_PER_ARC
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
        if max(abs(step[0]), abs(step[1]), abs(step[2])) < 1e-4:
            break
    greatest = angle[0]
    for p in range(1, count):
        greatest = max(greatest, angle[p])
    score = np.zeros((int(greatest * radius / POINTS_PER_ARC) + 1, 3))
    for p in range(count):
        row = int(angle[p] * radius / POINTS_PER_ARC)
        for i in range(3):
            score[row, i] += design[p, i] * w[p] * residual[p]
    return shift, scale, inverse, score


@njit(cache=True, nogil=True)
def centre_variance(angle, radius, w, score, inverse, scale, radius_sd):
    """Return the variance of a component of the centre [px²], from the scores (s, 3) of the arcs with a weight."""
    weight = np.zeros(len(score))
    for p in range(len(angle)):
        weight[int(angle[p] * radius / POINTS_PER_ARC)] += w[p]
    arcs, variance, squares = 0, 0.0, 0.0
    for k in range(len(score)):
        if weight[k] > 0.0:
            arcs += 1
            for i in range(2):
                step = inverse[i, 0] * score[k, 0] + inverse[i, 1] * score[k, 1] + inverse[i, 2] * score[k, 2]
                squares += step * step
    variance = squares * arcs / max(arcs - 3, 1)
    # The variance of the radius's prior is added.
    prior = (scale / radius_sd) ** 2 * POINTS_PER_ARC
    for i in range(2):
        variance += inverse[i, 2] * prior * inverse[2, i] * scale**2 * POINTS_PER_ARC
    return 0.5 * variance


@njit(cache=True, nogil=True)
def weighted_median(value, weight):
    """Return the value (p,) with half of the weight (p,) on either side."""
    order = ascending_order(value)
    total = weight[order[0]]
    for k in range(1, len(order)):
        total += weight[order[k]]
    below, k = weight[order[0]], 0
    while below < 0.5 * total and k < len(order) - 1:
        k += 1
        below += weight[order[k]]
    return value[order[k]]
