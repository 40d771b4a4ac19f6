"""Circles measured one after the other in compiled code: their edges, and the circle through them."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .edges import centre_variance, fit_points, trace, weighted_median

# An edge is one where the light falls by this share of the local contrast per pixel, as surely as by the other;
EDGE_SLOPE, SURE_SLOPE = 0.08, 0.3
# what is brighter than this share of the way from the dark about a grain to its light is paint, not a gap.
DARK_HALF = 0.5
# A circle that has left the window in which its points were looked for, by this many times, is none of theirs.
ASTRAY = 2.5
# Points this close to the circle [px] count as its outline.
ON_CIRCLE = 0.7
# The radius [px] of a small circle. It is none if its points lie on one side: a chipped rim has as many. Half a
# circle's have 0.64.
SMALL = 12.0
ONE_SIDED = 0.55
SCALE_LEAST = 0.1  # [px] residuals of steepest points below it are never outliers


@njit(cache=True, nogil=True)
def measure_circles(coefficients, dark, contrast, rough, rules, out):
    """The circle through the steepest points near each of the rough ones (c, 6).

    rough: x, y, radius [px]; the window [px] about radius + shift; that shift [px]; standard deviation of the radius
    [px], infinite: it is free. rules (c, 6): excess of the dark; narrow gaps, 0 or 1; share and least number of rays
    that must see an edge, and the number that always suffices; share of them that must be in view. out (c, 5): x, y,
    radius, standard deviation of the centre's components [px], share of the outline in view that is seen; NaN and 0
    where there is no circle.
    """
    for c in range(len(rough)):
        x, y, radius, window, shift, scatter = rough[c]
        excess, narrow, share, fewest, enough, least_view = rules[c]
        out[c, 0], out[c, 1], out[c, 2], out[c, 3], out[c, 4] = x, y, radius, np.nan, 0.0
        wanted = radius + shift
        angle, _, edges, in_view = trace(coefficients, x, y, wanted, window, narrow != 0.0)
        seen = np.zeros(len(angle), np.bool_)
        local = see_edges(edges, dark, contrast, x, y, excess, seen)
        count, viewed = seen.sum(), in_view.sum()
        least = max(min(enough, np.rint(share * len(angle))), fewest)
        if count < least or viewed / len(angle) < least_view:
            continue
        at, distance = angle[seen], edges[:, 0][seen]
        weight = edges[:, 1][seen].astype(np.float32) / np.float32(SURE_SLOPE * local)
        weight = np.minimum(weight, np.float32(1.0)) ** 2
        start = weighted_median(distance - wanted, weight) if np.isinf(scatter) else 0.0
        residual, w = np.empty_like(distance), np.empty_like(distance)
        moved, scale, inverse, score = fit_points(
            at, distance, weight.astype(np.float64), wanted, start, scatter, SCALE_LEAST, residual, w
        )
        there = x + moved[0], y + moved[1], wanted + moved[2]
        if not np.hypot(there[0] - x, there[1] - y) + abs(there[2] - radius - shift) < ASTRAY * window:
            continue
        on = np.abs(residual) < ON_CIRCLE
        if radius <= SMALL and _one_sidedness(at[on]) > ONE_SIDED:
            continue
        variance = centre_variance(at, wanted, w, score, inverse, scale, scatter)
        out[c, 0], out[c, 1], out[c, 2] = there[0], there[1], there[2] - shift
        out[c, 3] = np.sqrt(variance) if variance >= 0.0 else np.inf
        out[c, 4] = on.sum() / viewed


@njit(cache=True, nogil=True)
def see_edges(edges, dark, contrast, x, y, excess, seen):
    """Mark which rays (p,) meet an edge; gives the local contrast [grey].

    excess: of the contrast, by which what lies beyond an edge may exceed the darkest that is met.
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
        # The tenth-darkest part, not the single darkest ray: noise makes that one.
        limit = np.float32(float(lowest_tenth(edges[:, 2][seen].astype(np.float32))) + excess * local)
        for p in range(len(seen)):
            seen[p] = seen[p] and np.float32(edges[p, 2]) < limit
    return local


@njit(cache=True, nogil=True)
def lowest_tenth(values):
    """The tenth percentile of values (p,), as numpy interpolates it; none of them is NaN."""
    ordered = np.sort(values)
    place = (len(values) - 1) * 0.1
    low = int(place)
    part = place - low
    below, above = ordered[low], ordered[min(low + 1, len(values) - 1)]
    rise = above - below
    if part >= 0.5:
        return above - rise * values.dtype.type(1.0 - part)
    return below + rise * values.dtype.type(part)


@njit(cache=True, nogil=True)
def _one_sidedness(angle):
    """How much points at these angles (p,) [rad] lie on one side: 0 all about, 1 in one place."""
    if len(angle) == 0:
        return 1.0
    x = y = 0.0
    for each in angle:
        x += math.cos(each)
        y += math.sin(each)
    return np.hypot(x / len(angle), y / len(angle))
