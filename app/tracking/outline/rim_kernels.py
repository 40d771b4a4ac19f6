"""The loops of following rims: where a ring of edges lies, and the circle through them.

A rim may be brighter or darker than what is beside it, and that by turns along one and the same rim: the light through
a photoelastic disc changes with its force. So only the size of the radial slope counts, not its sign. What neighbours
that touch hide or add is left to Tukey's weights.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..correlation.interpolation import interpolate
from ..detection.edges import fit_points, weighted_median

# Samples along a ray [1/px]; a slope is read over half a pixel to each side.
DENSITY = 4
HALF = DENSITY // 2
# Rays of a disc: one a pixel of its rim, but no more than so many.
MOST_RAYS = 256
# Rays that vote when a ring is looked for.
VOTES = 64

# An edge counts in full from this share of the rim's own strong edges, the upper tenth, and not at all below the other.
FULL_EDGE, LEAST_EDGE = 0.6, 0.15
# and it stands out from the noise by this many deviations of the greatest slope that noise shows within a window
NOISE_SLOPE = 3.5
# Points this close to the circle [px] count as its rim.
ON_CIRCLE = 0.7
FEWEST_POINTS = 8

# Columns of a measurement.
X, Y, RADIUS, SIGMA, QUALITY, VIEW = range(6)
COLUMNS = 6


@njit(cache=True, nogil=True, error_model="numpy")
def find_rings(slope_x, slope_y, x, y, radius, window, step, places):
    """Write the best places (n, c, 3) of rings: x, y [px], mean radial slope; −1 where there are fewer.

    slope_x, slope_y (h, w) [grey/px]; x, y, radius, window (n,) [px]: circles and half widths; step [px]: of the places
    that are tried. A slope counts up to the mean of the strong ones on the ring at its own place.
    """
    height, width = slope_x.shape
    cos, sin = np.empty(VOTES), np.empty(VOTES)
    for k in range(VOTES):
        cos[k], sin[k] = np.cos(2.0 * np.pi * k / VOTES), np.sin(2.0 * np.pi * k / VOTES)
    for n in range(len(x)):
        places[n, :, :] = -1.0
        reach = int(window[n] / step)
        for a in range(-reach, reach + 1):
            for b in range(-reach, reach + 1):
                cx, cy = x[n] + step * b, y[n] + step * a
                total, seen = 0.0, 0
                for k in range(VOTES):
                    px, py = int(cx + radius[n] * cos[k] + 0.5), int(cy + radius[n] * sin[k] + 0.5)
                    if px < 1 or py < 1 or px >= width - 1 or py >= height - 1:
                        continue
                    # A root lets many slight edges count for more than few strong ones.
                    total += np.sqrt(abs(slope_x[py, px] * cos[k] + slope_y[py, px] * sin[k]))
                    seen += 1
                if seen > VOTES // 2:
                    _keep(places[n], cx, cy, total / seen, 0.5 * radius[n])


@njit(cache=True, nogil=True)
def _keep(places, cx, cy, value, apart):
    """Insert a place into the best ones (c, 3) in descending order; of places closer than `apart` the best stays."""
    count = len(places)
    for k in range(count):
        if places[k, 2] < 0.0:
            places[k, 0], places[k, 1], places[k, 2] = cx, cy, value
            _rise(places, k)
            return
        if (places[k, 0] - cx) ** 2 + (places[k, 1] - cy) ** 2 < apart * apart:
            if value > places[k, 2]:
                places[k, 0], places[k, 1], places[k, 2] = cx, cy, value
                _rise(places, k)
            return
    if value > places[count - 1, 2]:
        places[count - 1, 0], places[count - 1, 1], places[count - 1, 2] = cx, cy, value
        _rise(places, count - 1)


@njit(cache=True, nogil=True)
def _rise(places, k):
    while k > 0 and places[k, 2] > places[k - 1, 2]:
        for c in range(3):
            places[k, c], places[k - 1, c] = places[k - 1, c], places[k, c]
        k -= 1


@njit(cache=True, nogil=True, error_model="numpy")
def measure_rims(coefficients, x, y, radius, window, radius_scatter, noise, found):
    """Write the circle (n, 6) through the edges within window (n,) [px] of every circle x, y, radius (n,) [px].

    found: x, y, radius, σ of a component of the centre [px], share of the rim in view that is seen as an edge on the
    circle, share of the rim that is in view. σ is NaN where there is no circle. noise [grey]: of a pixel.
    """
    longest = int(np.ceil(2.0 * (window.max() + 1.0) * DENSITY)) + 1
    ray = np.empty(longest)
    angle, distance, strength = np.empty(MOST_RAYS), np.empty(MOST_RAYS), np.empty(MOST_RAYS)
    for n in range(len(x)):
        rays = min(max(int(2.0 * np.pi * radius[n]), 24), MOST_RAYS)
        count, view = 0, 0
        for p in range(rays):
            turn = 2.0 * np.pi * p / rays
            edge, slope = _steepest(coefficients, x[n], y[n], turn, radius[n], window[n], ray)
            if slope < 0.0:
                continue
            view += 1
            if slope > NOISE_SLOPE * noise:
                angle[count], distance[count], strength[count] = turn, edge, slope
                count += 1
        found[n, X], found[n, Y], found[n, RADIUS] = x[n], y[n], radius[n]
        found[n, SIGMA], found[n, QUALITY], found[n, VIEW] = np.nan, 0.0, view / rays
        if count < max(FEWEST_POINTS, rays // 8):
            continue
        _fit_rim(angle[:count], distance[:count], strength[:count], view, radius_scatter, found[n])


@njit(cache=True, nogil=True, error_model="numpy")
def _steepest(coefficients, cx, cy, turn, radius, window, ray):
    """Distance of the greatest slope along a ray within the window [px], and its size; −1 where not in view."""
    height, width = coefficients.shape
    cos, sin = np.cos(turn), np.sin(turn)
    first = radius - window - 1.0
    count = int(np.ceil(2.0 * (window + 1.0) * DENSITY)) + 1
    for k in range(count):
        r = first + k / DENSITY
        px, py = cx + r * cos, cy + r * sin
        if not (px >= 1.0 and py >= 1.0 and px < width - 2 and py < height - 2):
            return 0.0, -1.0
        ix, iy = int(px), int(py)
        ray[k] = interpolate(coefficients, ix, iy, np.float32(px - ix), np.float32(py - iy))
    top, best = -1, 0.0
    for k in range(HALF + 1, count - HALF - 1):
        slope = abs(ray[k - HALF] - ray[k + HALF])
        if slope > best and abs(first + k / DENSITY - radius) <= window:
            top, best = k, slope
    if top < 0:
        return 0.0, 0.0
    before = abs(ray[top - 1 - HALF] - ray[top - 1 + HALF])
    after = abs(ray[top + 1 - HALF] - ray[top + 1 + HALF])
    if before > best or after > best:  # it is still rising where the window ends
        return 0.0, 0.0
    bend = before - 2.0 * best + after
    shift = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    return first + (top + shift) / DENSITY, best


@njit(cache=True, nogil=True, error_model="numpy")
def _fit_rim(angle, distance, strength, view, radius_scatter, found):
    """Tukey's circle through edges, each as heavy as it is strong beside the strong ones of its own rim."""
    count = len(angle)
    strong = np.sort(strength)[int(0.9 * (count - 1))]
    weight = np.empty(count)
    for p in range(count):
        share = (strength[p] / strong - LEAST_EDGE) / (FULL_EDGE - LEAST_EDGE)
        weight[p] = min(max(share, 0.0), 1.0) ** 2
    residual, w = np.empty(count), np.empty(count)
    radius = found[RADIUS]
    start = weighted_median(distance - radius, weight) if np.isinf(radius_scatter) else 0.0
    shift, _, inverse, score = fit_points(angle, distance, weight, radius, start, radius_scatter, 0.08, residual, w)
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
    if on >= FEWEST_POINTS and variance >= 0.0:
        # Edges that lie elsewhere are there on the circle, too, and are not told from it: the more, the less is known.
        found[SIGMA] = np.sqrt(variance) / found[QUALITY] ** 2
