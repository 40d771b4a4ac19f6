"""Position of an outline whose rim is shaded.

Along a ray outwards the light is a level A that changes by C per pixel, cut off at the edge r₀, above the
dark B beyond it, and blurred by a Gaussian of width s. With t = (r₀ − r)/s,

    I(r) = B + A Φ(t) + C s (t Φ(t) + φ(t)).

The steepest point of such a profile lies inside r₀ by about −2 s² C/A. A rod that leans, or light from one side,
darkens one side of the rim more than the other. The steepest points then displace the centre, by a tenth of a pixel
with common lenses. Fitting C as well avoids this.

Paint makes C vary randomly from ray to ray. Shading makes C/A vary slowly around the grain, as b₀ + b₁ cos + b₂ sin.
This common part is fitted to the rays of a grain and is the prior of the next round.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from ....experiment.pictures.image import Image
from ....solver.bodies.grains import Array
from ....solver.robust_scale import SD_OVER_MAD
from ...short_sort import median

# Fitted part of a ray and range of its dark [px from the edge], and the same in widths of the blur where that is more:
# a soft edge still falls where a sharp one has ended, and a dark that is read there displaces the edge.
INSIDE, INSIDE_WIDTHS = 1.0, 1.5
OUTSIDE, OUTSIDE_WIDTHS = 2.5, 3.75
DARK, DARK_WIDTHS = 2.0, 3.0
NEAREST_DARK = 1.0

# Standard deviation of C/A due to paint [1/px], and of the model's error [grey], which set the prior's weight.
PAINT_SLOPE = 0.25
MISFIT = 3.0
FAR = 6.0  # widths of the blur beyond which an edge is neglected: 1e-9 of it remains

# Nodes of the table of the normal distribution per unit of t: series of five terms about the nearest one have errors
# below 1e-11, and take a fifth of the time of the error function.
NODES = 64
TABLE_END = FAR + 1.0 / NODES
LANES = 8  # numbers of a vector instruction, of which whole ones are computed


def _tabulate_normal() -> tuple[Array, Array]:
    """Distribution Φ and density φ at t = −TABLE_END + k / NODES, which end at FAR."""
    t = np.arange(2 * round(TABLE_END * NODES) + 1) / NODES - TABLE_END
    cumulative = np.array([0.5 * math.erfc(-each * math.sqrt(0.5)) for each in t])
    density = np.exp(-0.5 * t * t) / math.sqrt(2.0 * math.pi)
    cumulative[[0, -1]], density[[0, -1]] = (0.0, 1.0), 0.0
    return cumulative, density


CUMULATIVE, DENSITIES = _tabulate_normal()


def locate_edges(
    rays: Image,
    distances: tuple[float, float],
    start: Array,
    angle: Array,
    width: float,
    *,
    extent: float,
    rounds: int = 3,
) -> tuple[Array, Array, Array, Array]:
    """Fit the profile to every ray.

    Parameters
    ----------
    rays : (p, s) array
        Grey values on the rays.
    distances : tuple of float
        First distance of a ray from the centre, and the step from one to the next [px].
    start : (p,) array
        Rough edges [px]; NaN without an edge.
    angle : (p,) array
        Angles of the rays [rad].
    width : float
        Width of the blur [px].
    extent : float
        Width of the blur for which the fitted part of a ray is chosen [px].
    rounds : int
        Rounds of the fit, each but the first with the prior of the round before.

    Returns
    -------
    edge, level, misfit, dark : (p,) array
        Edge [px] (NaN without a fit), level A, misfit and dark B [grey].

    Notes
    -----
    I(r) = B + A Φ(t) + C s (t Φ(t) + φ(t)), t = (r₀ − r)/s; fitted are r₀, A and C.
    """
    fitted, dark = fit_rim(rays, *distances, start, angle, width, extent, rounds)
    return fitted[:, 0], fitted[:, 1], fitted[:, 3], dark


@njit(cache=True, nogil=True)
def fit_rim(rays, first, step, start, angle, width, extent, rounds):
    """Return edge, level, slope over level, misfit (p, 4) and dark (p,), see `locate_edges`."""
    count = len(start)
    dark, end = np.empty(count), np.empty(count)
    _find_darks(rays, first, step, start, max(DARK, DARK_WIDTHS * extent), dark, end)
    inside, outside = max(INSIDE, INSIDE_WIDTHS * extent), max(OUTSIDE, OUTSIDE_WIDTHS * extent)
    fitted, expected = np.empty((count, 4)), np.zeros(count)
    harmonics = np.ones((count, 3))
    for p in range(count):
        harmonics[p, 1], harmonics[p, 2] = np.cos(angle[p]), np.sin(angle[p])
    for k in range(rounds):
        # The first round has no estimate of the shading, so its prior is wider.
        scatter = 3.0 * PAINT_SLOPE if k == 0 else PAINT_SLOPE
        _fit_rays(rays, first, step, start, dark, end, width, inside, outside, expected, scatter, fitted)
        good = np.isfinite(fitted[:, 0])
        if k == rounds - 1 or good.sum() < 12:
            break
        shading = _robust_regression(harmonics[good], fitted[:, 2][good], fitted[:, 1][good])
        for p in range(count):
            expected[p] = harmonics[p, 0] * shading[0] + harmonics[p, 1] * shading[1] + harmonics[p, 2] * shading[2]
    return fitted, dark


@njit(cache=True, nogil=True)
def _find_darks(rays, first, step, start, beyond, dark, where):
    """Write the lowest grey level (p,) of every ray up to `beyond` [px] outside its edge, and its distance [px].

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
    """Coefficients (3,) of value (p,) over design (p, 3), with Tukey's weights."""
    count = len(value)
    weight, size, residual = np.empty(count), np.empty(count), np.empty(count)
    total = 0.0
    for p in range(count):
        weight[p] = max(strength[p], 0.0) ** 2
        total += weight[p]
    weight /= max(total / count, 1e-12)
    answer = np.zeros(3)
    answer[0] = median(value)
    for _ in range(8):
        for p in range(count):
            modelled = design[p, 0] * answer[0] + design[p, 1] * answer[1] + design[p, 2] * answer[2]
            residual[p] = value[p] - modelled
            size[p] = abs(residual[p])
        scale = max(SD_OVER_MAD * median(size), 1e-3)
        # A prior as wide as usual shading prevents a false one from half an outline.
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


@njit(cache=True, nogil=True)
def write_normal(t, cumulative, density):
    """Write the standard normal distribution Φ and its density φ at t (n,), beyond FAR their limits.

    Notes
    -----
    Taylor's series about the nearest node t₀ of the table, with φ′ = −t φ.
    """
    for k in range(len(t)):
        clipped = min(max(t[k], -TABLE_END), TABLE_END)
        node = int((clipped + TABLE_END) * NODES + 0.5)
        a = node / NODES - TABLE_END
        d, phi = clipped - a, DENSITIES[node]
        second, third = a * a - 1.0, a * (3.0 - a * a)
        fourth = a * a * (a * a - 6.0) + 3.0
        cumulative[k] = CUMULATIVE[node] + phi * d * (
            1.0 + d * (-a / 2.0 + d * (second / 6.0 + d * (third / 24.0 + d * fourth / 120.0)))
        )
        density[k] = phi * (1.0 + d * (-a + d * (second / 2.0 + d * (third / 6.0 + d * fourth / 24.0))))


@njit(cache=True, nogil=True, error_model="numpy")
def _fit_rays(rays, first, step, start, dark, end, width, inside, outside, expected, slope_scatter, fitted):
    """Gauss-Newton for edge, A, C of every ray; fitted (p, 4): edge, A, C/A, misfit."""
    samples = rays.shape[1]
    t, cumulatives, densities = np.empty(samples + LANES), np.empty(samples + LANES), np.empty(samples + LANES)
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
            # Whole vectors: those beyond the last sample are not used.
            padded = (high - low + LANES) // LANES * LANES
            for k in range(padded):
                t[k] = (edge - (first + step * (low + k))) / width
            write_normal(t[:padded], cumulatives, densities)
            for k in range(low, high + 1):
                cumulative, density = cumulatives[k - low], densities[k - low]
                ramp = width * (t[k - low] * cumulative + density)
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
            # Prior: C − b A = 0 within the paint's standard deviation, b: fitted to the whole grain.
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
