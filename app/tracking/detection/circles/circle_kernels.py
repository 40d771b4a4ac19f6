"""Compiled measurement of circles: their edges, and the circle fitted through them."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from ...short_sort import select
from .edges import DENSITY, MARGIN, fit_circle, trace
from .rim_profile import fit_rim

# Least slope of an edge per pixel, as a fraction of the local contrast, and the slope from which its weight is full.
EDGE_SLOPE, SURE_SLOPE = 0.08, 0.3
# The level beyond an edge is at most this fraction of the local contrast above the local dark, else it is paint.
DARK_HALF = 0.5
# Greatest displacement of a fitted circle, in widths of the window in which its points were searched for.
MAX_SHIFT_RATIO = 2.5
# Points this close to the circle [px] belong to its outline.
ON_CIRCLE = 0.7
# Greatest radius [px] of a small circle. A small circle is rejected if its points lie on one side, as those of a
# chipped rim do. The points of half a circle have a one-sidedness of 0.64.
SMALL = 12.0
ONE_SIDED = 0.55
MIN_SCALE = 0.1  # [px] residuals of steepest points below it are never outliers
MIN_SCALE_CLOSE = 0.05  # [px] the same of the edges of a fitted profile
CLOSE_WINDOW = 2.0  # [px] half width of the search for the steepest points from which profiles are fitted
ROUNDS = 3  # of the fit of the profiles
# Level of a profile, as a fraction of the local contrast, from which its weight is full, and its least weight.
SURE_LEVEL, LEAST_WEIGHT = 0.6, 0.05
# Remaining effect of the rim's shading on the centre, over the effect that the model of the rim removes.
SHADING_LEFT = 1.2


@njit(cache=True, nogil=True)
def measure_circles(coefficients, dark, contrast, rough, rules, out):
    """Fit circles through the steepest points near rough ones.

    Parameters
    ----------
    coefficients : (H, W) array
        Cubic spline coefficients of the photograph.
    dark, contrast : (H, W) array
        Local dark level and contrast [grey].
    rough : (c, 6) array
        x, y, radius [px]; half width of the window about radius + shift [px]; that shift [px]; standard deviation of
        the radius [px], infinite: it is free.
    rules : (c, 6) array
        Excess of the dark, as a fraction of the contrast; narrow gaps, 0 or 1; fraction and least number of rays that
        must meet an edge, and the number that always suffices; fraction of the rays that must be in view.
    out : (c, 5) array
        Receives x, y, radius, standard deviation of the centre's components [px], and the fraction of the outline in
        view that is detected; NaN and 0 where there is no circle.
    """
    for c in range(len(rough)):
        x, y, radius, window, shift, radius_sd = rough[c]
        out[c, 0], out[c, 1], out[c, 2], out[c, 3], out[c, 4] = x, y, radius, np.nan, 0.0
        wanted = radius + shift
        least, viewed, angle, _, edges, seen, local = rim_edges(
            coefficients, dark, contrast, (x, y, wanted), window, rules[c]
        )
        if seen.sum() < least:
            continue
        at, distance, weight = steepest_points(angle, edges, seen, local)
        moved, sigma, residual = fit_circle(at, distance, weight, wanted, radius_sd, MIN_SCALE)
        there = x + moved[0], y + moved[1], wanted + moved[2]
        if not np.hypot(there[0] - x, there[1] - y) + abs(there[2] - radius - shift) < MAX_SHIFT_RATIO * window:
            continue
        on = np.abs(residual) < ON_CIRCLE
        if radius <= SMALL and _one_sidedness(at[on]) > ONE_SIDED:
            continue
        out[c, 0], out[c, 1], out[c, 2] = there[0], there[1], there[2] - shift
        out[c, 3] = sigma
        out[c, 4] = on.sum() / viewed


@njit(cache=True, nogil=True)
def measure_closely(coefficients, dark, contrast, rough, rules, width, out):
    """Fit circles through the edges that the fitted profiles of the rims give.

    Parameters
    ----------
    coefficients, dark, contrast, out : array
        As in `measure_circles`.
    rough : (c, 5) array
        x, y, radius [px]; excess of the edges' radius over the grain's [px]; standard deviation of the radius [px],
        infinite: it is free.
    rules : (c, 6) array
        As in `measure_circles`.
    width : float
        Width of the blur [px].
    """
    for c in range(len(rough)):
        x, y, radius, shift, radius_sd = rough[c]
        out[c, 0], out[c, 1], out[c, 2], out[c, 3], out[c, 4] = x, y, radius, np.nan, 0.0
        wanted = radius + shift
        least, viewed, angle, rays, edges, seen, local = rim_edges(
            coefficients, dark, contrast, (x, y, wanted), CLOSE_WINDOW, rules[c]
        )
        if seen.sum() < least:
            continue
        at, distance, weight = steepest_points(angle, edges, seen, local)
        steepest, _, _ = fit_circle(at, distance, weight, wanted, np.inf, MIN_SCALE)
        for p in range(len(angle)):
            if not seen[p]:
                edges[p, 0] = np.nan
        first = wanted - CLOSE_WINDOW - MARGIN
        fitted, darks = fit_rim(rays, first, 1.0 / DENSITY, edges[:, 0].copy(), angle, width, width, ROUNDS)
        good = np.isfinite(fitted[:, 0])
        if good.sum() < least:
            continue
        at, distance, level, darks = angle[good], fitted[:, 0][good], fitted[:, 1][good], darks[good]
        above, strength = lowest_tenth(darks), np.empty_like(distance)
        for p in range(len(at)):
            clear = 1.0 - (darks[p] - above) / (rules[c, 0] * local)
            clear = min(max(clear, LEAST_WEIGHT), 1.0)
            strength[p] = (min(level[p] / (SURE_LEVEL * local), 1.0) * clear) ** 2
        moved, sigma, residual = fit_circle(at, distance, strength, wanted, radius_sd, MIN_SCALE_CLOSE)
        shaded = np.hypot(x + moved[0] - (x + steepest[0]), y + moved[1] - (y + steepest[1])) / np.sqrt(2.0)
        out[c, 0], out[c, 1], out[c, 2] = x + moved[0], y + moved[1], wanted + moved[2] - shift
        out[c, 3] = np.hypot(sigma, SHADING_LEFT * shaded)
        out[c, 4] = (np.abs(residual) < ON_CIRCLE).sum() / viewed


@njit(cache=True, nogil=True)
def rim_edges(coefficients, dark, contrast, circle, window, rule):
    """Trace the edges about a circle.

    Parameters
    ----------
    coefficients, dark, contrast : array
        As in `measure_circles`.
    circle : tuple of float
        x, y, radius of the edges [px].
    window : float
        Half width of the search [px].
    rule : (6,) array
        A row of the rules of `measure_circles`.

    Returns
    -------
    tuple
        Number of rays that must meet an edge, infinite where too few are in view; number of rays in view; angle (p,),
        rays (p, s) and edges (p, 3) as from `trace`; which rays meet an edge (p,); local contrast [grey].
    """
    x, y, radius = circle
    excess, narrow, fraction, fewest, enough, min_view = rule
    angle, rays, edges, in_view = trace(coefficients, x, y, radius, window, narrow != 0.0)
    seen = np.zeros(len(angle), np.bool_)
    local = see_edges(edges, dark, contrast, x, y, excess, seen)
    viewed = in_view.sum()
    least = max(min(enough, np.rint(fraction * len(angle))), fewest)
    return least if viewed / len(angle) >= min_view else np.inf, viewed, angle, rays, edges, seen, local


@njit(cache=True, nogil=True)
def steepest_points(angle, edges, seen, local):
    """Return angle, distance and weight (q,) of the steepest points that are seen."""
    weight = edges[:, 1][seen].astype(np.float32) / np.float32(SURE_SLOPE * local)
    return angle[seen], edges[:, 0][seen], np.minimum(weight, np.float32(1.0)) ** 2


@njit(cache=True, nogil=True)
def see_edges(edges, dark, contrast, x, y, excess, seen):
    """Mark the rays (p,) that meet an edge, and return the local contrast [grey].

    excess: greatest difference between the level beyond an edge and the darkest level, as a fraction of the contrast.
    """
    height, width = contrast.shape
    row, column = min(max(int(y), 0), height - 1), min(max(int(x), 0), width - 1)
    local, about = float(contrast[row, column]), float(dark[row, column])
    steep, bright = np.float32(EDGE_SLOPE * local), np.float32(about + DARK_HALF * local)
    count = 0
    for p in range(len(seen)):
        strength, beyond = np.float32(edges[p, 1]), np.float32(edges[p, 2])
        seen[p] = np.isfinite(edges[p, 0]) and strength > steep and beyond < bright
        count += seen[p]
    if count:
        # The tenth percentile, because noise determines the single darkest ray.
        limit = np.float32(float(lowest_tenth(edges[:, 2][seen].astype(np.float32))) + excess * local)
        for p in range(len(seen)):
            seen[p] = seen[p] and np.float32(edges[p, 2]) < limit
    return local


@njit(cache=True, nogil=True)
def lowest_tenth(values):
    """Return the tenth percentile of values (p,) without NaN, as numpy interpolates it."""
    place = (len(values) - 1) * 0.1
    low = int(place)
    part = place - low
    work = values.copy()
    below = select(work, low)
    above = select(work[low:], min(1, len(values) - 1 - low))
    rise = above - below
    if part >= 0.5:
        return above - rise * values.dtype.type(1.0 - part)
    return below + rise * values.dtype.type(part)


@njit(cache=True, nogil=True)
def _one_sidedness(angle):
    """Length of the mean unit vector at angles (p,) [rad]: 0 all around, 1 in one place."""
    if len(angle) == 0:
        return 1.0
    x = y = 0.0
    for each in angle:
        x += math.cos(each)
        y += math.sin(each)
    return np.hypot(x / len(angle), y / len(angle))
