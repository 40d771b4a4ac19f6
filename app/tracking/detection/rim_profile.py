"""Where an outline is, when the rim before it grows darker.

Along a ray outwards the light is a level A that changes by C per pixel, cut off at the edge r₀, above the
dark B beyond it, and blurred by a Gaussian of width s. With t = (r₀ − r)/s,

    I(r) = B + A Φ(t) + C s (t Φ(t) + φ(t)).

The steepest point of such a profile lies inside r₀ by about −2 s² C/A. A rod that leans, or light from one
side, darkens one side of the rim more than the other: taking the steepest point for the edge then moves the
centre, by a tenth of a pixel with common lenses. Fitting C as well does not.

Paint makes C scatter from ray to ray. What shading makes of C/A varies slowly round the grain, as
b₀ + b₁ cos + b₂ sin, and is what the rays of one grain agree on; it is the prior of the next round.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from solver.bodies.grains import Array

from ...experiment.photographs import Image

# What is fitted of a ray, and where its dark is read [px from the edge], and the same in widths of the blur where that
# is more: a soft edge is still falling where a sharp one has ended, and a dark that is read there moves the edge.
INSIDE, INSIDE_WIDTHS = 1.0, 1.5
OUTSIDE, OUTSIDE_WIDTHS = 2.5, 3.75
DARK, DARK_WIDTHS = 2.0, 3.0
NEAREST_DARK = 1.0

# Scatter of C/A that paint makes [1/px], and misfit of the model [grey] against which it is weighed.
PAINT_SLOPE = 0.25
MISFIT = 3.0
FAR = 6.0  # widths of the blur beyond which an edge is over: 1e-9 of it is left


def locate_edges(
    rays: Image, first: float, step: float, start: Array, angle: Array, width: float, *, extent: float, rounds: int = 3
) -> tuple[Array, Array, Array, Array]:
    """Fit the profile to every ray.

    rays (p, s): grey values at first + step · k [px]; start (p,): rough edges [px], NaN where there is none; angle
    (p,) [rad]; width: of the blur [px]; extent: the width [px] for which the fitted part of a ray is chosen. Returns
    edge [px] (NaN where none fits), level A [grey], misfit [grey] and dark B [grey], all (p,).
    """
    count = len(start)
    dark, end = np.empty(count), np.empty(count)
    _find_darks(rays, first, step, start, max(DARK, DARK_WIDTHS * extent), dark, end)
    inside, outside = max(INSIDE, INSIDE_WIDTHS * extent), max(OUTSIDE, OUTSIDE_WIDTHS * extent)
    fitted = np.empty((count, 4))
    harmonics = np.stack([np.ones(count), np.cos(angle), np.sin(angle)], axis=1)
    expected = np.zeros(count)
    for k in range(rounds):
        # The first round knows nothing of the shading, only that paint scatters about some slope.
        scatter = 3.0 * PAINT_SLOPE if k == 0 else PAINT_SLOPE
        _fit_rays(rays, first, step, start, dark, end, width, inside, outside, expected, scatter, fitted)
        good = np.isfinite(fitted[:, 0])
        if k == rounds - 1 or good.sum() < 12:
            break
        slope = fitted[good, 2]
        expected = harmonics @ _robust_regression(harmonics[good], slope, fitted[good, 1])
    return fitted[:, 0], fitted[:, 1], fitted[:, 3], dark


@njit(cache=True, nogil=True)
def _find_darks(rays, first, step, start, beyond, dark, where):
    """Write the lowest grey level (p,) of every ray up to `beyond` [px] outside its edge, and where it is met [px].

    Farther out is the light of the next grain.
    """
    for p in range(len(start)):
        edge = start[p] if np.isfinite(start[p]) else 0.0
        dark[p], where[p] = np.inf, first
        for k in range(rays.shape[1]):
            outside = first + step * k - edge
            if outside >= NEAREST_DARK and outside <= beyond + 0.5 * step and rays[p, k] < dark[p]:
                dark[p], where[p] = rays[p, k], first + step * k


@njit(cache=True, nogil=True, error_model="numpy")
def _robust_regression(design, value, strength):
    """Coefficients (3,) of value (p,) over design (p, 3), by Tukey's weights."""
    count = len(value)
    weight, size, residual = np.empty(count), np.empty(count), np.empty(count)
    total = 0.0
    for p in range(count):
        weight[p] = max(strength[p], 0.0) ** 2
        total += weight[p]
    weight /= max(total / count, 1e-12)
    answer = np.zeros(3)
    answer[0] = np.median(value)
    for _ in range(8):
        for p in range(count):
            modelled = design[p, 0] * answer[0] + design[p, 1] * answer[1] + design[p, 2] * answer[2]
            residual[p] = value[p] - modelled
            size[p] = abs(residual[p])
        scale = max(1.4826 * np.median(size), 1e-3)
        # A prior as wide as any shading is likely to be keeps a half-seen outline from inventing one.
        prior = (scale / 0.3) ** 2
        n00, n01, n02, n11, n12, n22 = prior, 0.0, 0.0, prior, 0.0, prior
        v0, v1, v2 = 0.0, 0.0, 0.0
        for p in range(count):
            w = weight[p] * max(1.0 - (residual[p] / (4.685 * scale)) ** 2, 0.0) ** 2
            x, y, z = design[p, 0], design[p, 1], design[p, 2]
            n00, n01, n02 = n00 + w * x * x, n01 + w * x * y, n02 + w * x * z
            n11, n12, n22 = n11 + w * y * y, n12 + w * y * z, n22 + w * z * z
            v0, v1, v2 = v0 + w * x * value[p], v1 + w * y * value[p], v2 + w * z * value[p]
        # Cramer's rule for the symmetric three.
        c00, c01, c02 = n11 * n22 - n12 * n12, n02 * n12 - n01 * n22, n01 * n12 - n02 * n11
        c11, c12, c22 = n00 * n22 - n02 * n02, n01 * n02 - n00 * n12, n00 * n11 - n01 * n01
        determinant = n00 * c00 + n01 * c01 + n02 * c02
        answer[0] = (c00 * v0 + c01 * v1 + c02 * v2) / determinant
        answer[1] = (c01 * v0 + c11 * v1 + c12 * v2) / determinant
        answer[2] = (c02 * v0 + c12 * v1 + c22 * v2) / determinant
    return answer


@njit(cache=True, nogil=True, error_model="numpy")
def _fit_rays(rays, first, step, start, dark, end, width, inside, outside, expected, slope_scatter, fitted):
    """Gauss-Newton for edge, A, C of every ray; fitted (p, 4): edge, A, C/A, misfit."""
    samples = rays.shape[1]
    for p in range(len(start)):
        fitted[p, :] = np.nan
        if not (np.isfinite(start[p]) and np.isfinite(dark[p])):
            continue
        edge = start[p]
        low = max(int(np.ceil((edge - inside - first) / step)), 0)
        high = min(int(np.floor((min(edge + outside, end[p]) - first) / step)), samples - 1)
        if high - low < 8:
            continue
        level = 0.0
        for k in range(low, high + 1):
            level = max(level, rays[p, k] - dark[p])
        if not level > 2.0 * MISFIT:
            continue
        slope = expected[p] * level
        square = 0.0
        good = True
        for _ in range(8):
            n00, n01, n02, n11, n12, n22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            v0, v1, v2 = 0.0, 0.0, 0.0
            square = 0.0
            for k in range(low, high + 1):
                t = (edge - (first + step * k)) / width
                if t > FAR:
                    cumulative, density = 1.0, 0.0
                elif t < -FAR:
                    cumulative, density = 0.0, 0.0
                else:
                    cumulative = 0.5 * math.erfc(-t * math.sqrt(0.5))
                    density = math.exp(-0.5 * t * t) * 0.3989422804014327
                ramp = width * (t * cumulative + density)
                e = rays[p, k] - dark[p] - level * cumulative - slope * ramp
                j0 = level * density / width + slope * cumulative
                n00 += j0 * j0
                n01 += j0 * cumulative
                n02 += j0 * ramp
                n11 += cumulative * cumulative
                n12 += cumulative * ramp
                n22 += ramp * ramp
                v0 += j0 * e
                v1 += cumulative * e
                v2 += ramp * e
                square += e * e
            # C − b A = 0 within the scatter of the paint; b is what the whole grain says.
            pull = (MISFIT / (slope_scatter * max(level, 1.0))) ** 2 / step
            b = expected[p]
            e = -(slope - b * level)
            n11 += pull * b * b
            n12 -= pull * b
            n22 += pull
            v1 -= pull * b * e
            v2 += pull * e
            n00 *= 1.0 + 1e-6
            # Cramer's rule for the symmetric three.
            c00, c01, c02 = n11 * n22 - n12 * n12, n02 * n12 - n01 * n22, n01 * n12 - n02 * n11
            determinant = n00 * c00 + n01 * c01 + n02 * c02
            if not determinant > 0.0:
                good = False
                break
            c11, c12, c22 = n00 * n22 - n02 * n02, n01 * n02 - n00 * n12, n00 * n11 - n01 * n01
            d0 = (c00 * v0 + c01 * v1 + c02 * v2) / determinant
            d1 = (c01 * v0 + c11 * v1 + c12 * v2) / determinant
            d2 = (c02 * v0 + c12 * v1 + c22 * v2) / determinant
            d0 = min(max(d0, -0.4), 0.4)
            edge += d0
            level += d1
            slope += d2
            if abs(edge - start[p]) > 1.2 or not level > MISFIT:
                good = False
                break
            if abs(d0) < 1e-3:
                break
        if good:
            fitted[p, 0] = edge
            fitted[p, 1] = level
            fitted[p, 2] = slope / level
            fitted[p, 3] = np.sqrt(square / (high - low + 1))
