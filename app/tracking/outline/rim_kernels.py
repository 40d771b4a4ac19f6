"""Compiled loops of rim tracking: the search for rings of edges, and the circle through them.

A rim may be brighter or darker than its surroundings, both along the same rim: the light through a photoelastic disc
changes with its force. Only the size of the radial slope is used, not its sign. Edges that touching neighbours hide or
add are handled by Tukey's weights.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..detection.circles.edges import fit_points, weighted_median
from ..interpolation.spline_values import interpolate_cubic
from ..short_sort import ascending_order

# Samples along a ray [1/px]; a slope is read over half a pixel to each side.
DENSITY = 4
HALF = DENSITY // 2
# Greatest number of rays of a disc, one per pixel of its rim.
MAX_RAYS = 256
# Number of rays that vote in the search for a ring.
VOTING_RAYS = 64

# The weight of an edge is 1 above the first of these fractions of the rim's strong edges (the 90th percentile), and 0
# below the second.
FULL_EDGE, LEAST_EDGE = 0.6, 0.15
# Least slope of an edge, in standard deviations of the noise.
NOISE_SLOPE = 3.5
# Points this close to the circle [px] belong to its rim.
ON_CIRCLE = 0.7
MIN_POINTS = 8

# Columns of a measurement.
X, Y, RADIUS, SIGMA, QUALITY, VIEW = range(6)
COLUMNS = 6


@njit(cache=True, nogil=True, error_model="numpy")
def find_rings(slope_x, slope_y, x, y, radius, window, step, places):
    """Find the best places of rings.

    Parameters
    ----------
    slope_x, slope_y : (h, w) array
        Gradient of the photograph [grey/px].
    x, y, radius, window : (n,) array
        Circles and half widths of the search [px].
    step : float
        Distance of the places that are tried [px].
    places : (n, c, 3) array
        Receives x, y [px] and the mean root of the radial slope, best first; −1 where fewer places exist.
    """
    height, width = slope_x.shape
    cos, sin = np.empty(VOTING_RAYS), np.empty(VOTING_RAYS)
    for k in range(VOTING_RAYS):
        cos[k], sin[k] = np.cos(2.0 * np.pi * k / VOTING_RAYS), np.sin(2.0 * np.pi * k / VOTING_RAYS)
    for n in range(len(x)):
        places[n, :, :] = -1.0
        reach = int(window[n] / step)
        for a in range(-reach, reach + 1):
            for b in range(-reach, reach + 1):
                cx, cy = x[n] + step * b, y[n] + step * a
                total, seen = 0.0, 0
                for k in range(VOTING_RAYS):
                    px, py = int(cx + radius[n] * cos[k] + 0.5), int(cy + radius[n] * sin[k] + 0.5)
                    if px < 1 or py < 1 or px >= width - 1 or py >= height - 1:
                        continue
                    # With the root, many weak edges weigh more than few strong ones.
                    total += np.sqrt(abs(slope_x[py, px] * cos[k] + slope_y[py, px] * sin[k]))
                    seen += 1
                if seen > VOTING_RAYS // 2:
                    _insert_place(places[n], cx, cy, total / seen, 0.5 * radius[n])


@njit(cache=True, nogil=True)
def _insert_place(places, cx, cy, value, apart):
    """Insert a place into the best ones (c, 3) in descending order; of places closer than `apart` the best is kept."""
    count = len(places)
    for k in range(count):
        if places[k, 2] < 0.0:
            places[k, 0], places[k, 1], places[k, 2] = cx, cy, value
            _move_up(places, k)
            return
        if (places[k, 0] - cx) ** 2 + (places[k, 1] - cy) ** 2 < apart * apart:
            if value > places[k, 2]:
                places[k, 0], places[k, 1], places[k, 2] = cx, cy, value
                _move_up(places, k)
            return
    if value > places[count - 1, 2]:
        places[count - 1, 0], places[count - 1, 1], places[count - 1, 2] = cx, cy, value
        _move_up(places, count - 1)


@njit(cache=True, nogil=True)
def _move_up(places, k):
    while k > 0 and places[k, 2] > places[k - 1, 2]:
        for c in range(3):
            places[k, c], places[k - 1, c] = places[k - 1, c], places[k, c]
        k -= 1


@njit(cache=True, nogil=True, error_model="numpy")
def measure_rims(coefficients, x, y, radius, window, radius_sd, noise, found):
    """Measure the circles through the edges near given ones.

    Parameters
    ----------
    coefficients : (h, w) array
        Cubic spline coefficients of the photograph.
    x, y, radius, window : (n,) array
        Circles and half widths of the search for edges [px].
    radius_sd : float
        Standard deviation of the radius about the given one [px]; infinite: the radius is free.
    noise : float
        Standard deviation of a pixel's noise [grey].
    found : (n, 6) array
        Receives x, y, radius, standard deviation of a component of the centre [px] (NaN: no circle), fraction of the
        rim in view with an edge on the circle, fraction of the rim in view.
    """
    longest = int(np.ceil(2.0 * (window.max() + 1.0) * DENSITY)) + 1
    ray = np.empty(longest)
    angle, distance, strength = np.empty(MAX_RAYS), np.empty(MAX_RAYS), np.empty(MAX_RAYS)
    for n in range(len(x)):
        rays = min(max(int(2.0 * np.pi * radius[n]), 24), MAX_RAYS)
        count, view = 0, 0
        for p in range(rays):
            ray_angle = 2.0 * np.pi * p / rays
            edge, slope = _steepest(coefficients, x[n], y[n], ray_angle, radius[n], window[n], ray)
            if slope < 0.0:
                continue
            view += 1
            if slope > NOISE_SLOPE * noise:
                angle[count], distance[count], strength[count] = ray_angle, edge, slope
                count += 1
        found[n, X], found[n, Y], found[n, RADIUS] = x[n], y[n], radius[n]
        found[n, SIGMA], found[n, QUALITY], found[n, VIEW] = np.nan, 0.0, view / rays
        if count < max(MIN_POINTS, rays // 8):
            continue
        _fit_rim(angle[:count], distance[:count], strength[:count], view, radius_sd, found[n])


@njit(cache=True, nogil=True, error_model="numpy")
def _steepest(coefficients, cx, cy, ray_angle, radius, window, ray):
    """Distance of the greatest slope along a ray within the window [px], and its size; −1 outside the photograph."""
    height, width = coefficients.shape
    cos, sin = np.cos(ray_angle), np.sin(ray_angle)
    first = radius - window - 1.0
    count = int(np.ceil(2.0 * (window + 1.0) * DENSITY)) + 1
    for k in range(count):
        r = first + k / DENSITY
        px, py = cx + r * cos, cy + r * sin
        if not (px >= 1.0 and py >= 1.0 and px < width - 2 and py < height - 2):
            return 0.0, -1.0
        ix, iy = int(px), int(py)
        ray[k] = interpolate_cubic(coefficients, ix, iy, np.float32(px - ix), np.float32(py - iy))
    top, best = -1, 0.0
    for k in range(HALF + 1, count - HALF - 1):
        slope = abs(ray[k - HALF] - ray[k + HALF])
        if slope > best and abs(first + k / DENSITY - radius) <= window:
            top, best = k, slope
    if top < 0:
        return 0.0, 0.0
    before = abs(ray[top - 1 - HALF] - ray[top - 1 + HALF])
    after = abs(ray[top + 1 - HALF] - ray[top + 1 + HALF])
    if before > best or after > best:  # the window ends before the maximum
        return 0.0, 0.0
    bend = before - 2.0 * best + after
    shift = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    return first + (top + shift) / DENSITY, best


@njit(cache=True, nogil=True, error_model="numpy")
def _fit_rim(angle, distance, strength, view, radius_sd, found):
    """Fit a circle to edges with Tukey's weights and weights of each edge's slope relative to the rim's strong ones."""
    count = len(angle)
    strong = strength[ascending_order(strength)[int(0.9 * (count - 1))]]
    weight = np.empty(count)
    for p in range(count):
        fraction = (strength[p] / strong - LEAST_EDGE) / (FULL_EDGE - LEAST_EDGE)
        weight[p] = min(max(fraction, 0.0), 1.0) ** 2
    residual, w = np.empty(count), np.empty(count)
    radius = found[RADIUS]
    start = weighted_median(distance - radius, weight) if np.isinf(radius_sd) else 0.0
    shift, _, inverse, score = fit_points(angle, distance, weight, radius, start, radius_sd, 0.08, residual, w)
    on = 0
    for p in range(count):
        on += abs(residual[p]) < ON_CIRCLE and weight[p] > 0.0
    stretches = len(score)
    variance = 0.0
    for k in range(stretches):
        for i in range(2):
            step = inverse[i, 0] * score[k, 0] + inverse[i, 1] * score[k, 1] + inverse[i, 2] * score[k, 2]
            variance += 0.5 * step * step
    variance *= stretches / max(stretches - 3, 1)
    found[X] += shift[0]
    found[Y] += shift[1]
    found[RADIUS] += shift[2]
    found[QUALITY] = on / view
    if on >= MIN_POINTS and variance >= 0.0:
        # False edges lie on the circle as well, indistinguishable from true ones: the more of them there are, the
        # greater is the error.
        found[SIGMA] = np.sqrt(variance) / found[QUALITY] ** 2
