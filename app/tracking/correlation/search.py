"""Exhaustive search for a patch over position and angle, on one level of the pyramid.

The zero-normalised cross-correlation is computed at every whole-pixel position of a window and every angle of a range.
The result is the best few maxima that are distinct in position or in angle: on a coarse level the highest peak need not
be the true one.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ..interpolation.spline_vectors import read_cubic

# Two maxima at one place are distinct when their angles differ by more than this [rad]. A maximum is as wide as a
# speckle, and a speckle at the rim of a distinguishable patch spans a much smaller angle.
DISTINCT_ANGLE = 0.5

# Greatest width [rad] of a sector of the angles. Each position keeps the best angle of every sector.
SECTOR = 0.5 * np.pi

# Number of positions that are correlated together: their pixels stay in a core's second cache.
BLOCK = 256


@njit(cache=True, nogil=True)
def angle_steps(radius, angle_window):
    """Number of angle steps to either side, each of which moves the rim at `radius` [px] by at most 1.2 px."""
    return max(int(np.ceil(angle_window * radius / 1.2)), 1)


@njit(cache=True, nogil=True, error_model="numpy")
def search_patch(reference, image, origin_x, origin_y, radius, x, y, angle, window, angle_window, spacing, best):
    """Find the places of an image that are most similar to a disc of the reference.

    All lengths are pixels of the level that is searched.

    Parameters
    ----------
    reference : (h, w) array
        Spline coefficients of the reference photograph.
    image : (h, w) array
        The photograph that is searched.
    origin_x, origin_y : float
        Centre of the disc in the reference [px].
    radius : float
        Radius of the disc [px].
    x, y, angle : float
        Middle of the search [px, px, rad].
    window, angle_window : float
        Half widths of the search [px, rad].
    spacing : float
        Least distance of two places at one angle [px].
    best : (k, 4) array
        Receives x, y, angle, ZNCC, best first; ZNCC −1 where fewer places exist.

    Notes
    -----
    With f the pixels of the rotated disc and g the pixels under it,

        ZNCC = Σ (f − f̄)(g − ḡ) / sqrt(Σ (f − f̄)² Σ (g − ḡ)²).
    """
    x_from, y_from, nx, ny = clip_window(image, radius, x, y, window)
    best[:, :] = 0.0
    best[:, 3] = -1.0
    if nx < 1 or ny < 1:
        return
    offset_x, offset_y, _ = disc_offsets(radius)
    count = len(offset_x)
    angles, sectors = angles_to_try(angle, radius, angle_window)
    trials = len(angles)
    template = np.empty((trials, count), np.float32)
    for trial in range(trials):
        rotate_template(reference, origin_x, origin_y, angles[trial], offset_x, offset_y, template[trial])

    peak = np.full((sectors, ny, nx), np.float32(-1.0))
    best_trial = np.zeros((sectors, ny, nx), np.int16)
    rows_at_once = max(BLOCK // nx, 1)
    pixels = np.empty((count, rows_at_once * nx), np.float32)
    inverse_norm = np.empty(rows_at_once * nx, np.float32)
    total = np.empty(rows_at_once * nx, np.float32)
    for first in range(0, ny, rows_at_once):
        row_count = min(rows_at_once, ny - first)
        gather_pixels(image, offset_x, offset_y, x_from, y_from + first, nx, row_count, pixels, total, inverse_norm)
        for trial in range(trials):
            correlate(template[trial], pixels, row_count * nx, total)
            sector = trial * sectors // trials
            for k in range(row_count):
                for m in range(nx):
                    value = total[k * nx + m] * inverse_norm[k * nx + m]
                    if value > peak[sector, first + k, m]:
                        peak[sector, first + k, m] = value
                        best_trial[sector, first + k, m] = trial
    collect_maxima(peak, best_trial, angles, x_from, y_from, spacing, best)


@njit(cache=True, nogil=True, error_model="numpy")
def clip_window(image, radius, x, y, window):
    """First column and row of the positions to try, and their numbers: the disc stays within the image."""
    height, width = image.shape
    side = int(radius)
    x_from, x_to = max(int(np.floor(x - window)), side), min(int(np.ceil(x + window)), width - 1 - side)
    y_from, y_to = max(int(np.floor(y - window)), side), min(int(np.ceil(y + window)), height - 1 - side)
    return x_from, y_from, x_to - x_from + 1, y_to - y_from + 1


@njit(cache=True, nogil=True, error_model="numpy")
def angles_to_try(angle, radius, angle_window):
    """Angles to try [rad], ascending, and the number of sectors of their range."""
    steps = angle_steps(radius, angle_window)
    trials = 2 * steps if angle_window >= np.pi - 1e-6 else 2 * steps + 1
    angles = np.empty(trials)
    for trial in range(trials):
        angles[trial] = angle + angle_window * (trial - steps) / steps
    return angles, max(int(np.ceil(2.0 * angle_window / SECTOR - 1e-6)), 1)


@njit(cache=True, nogil=True)
def disc_offsets(radius):
    """Offsets dx and dy (q,) of the pixels of a disc, quarter after quarter, and the start of each quarter (5,)."""
    side = int(radius)
    limit = radius * radius
    offset_x = np.empty((2 * side + 1) ** 2, np.int32)
    offset_y = np.empty((2 * side + 1) ** 2, np.int32)
    start = np.zeros(5, np.int64)
    q = 0
    for quarter in range(4):
        for dy in range(-side, side + 1):
            for dx in range(-side, side + 1):
                # The signs of (dx, dy) of the quarters: (+, +), (−, +), (−, −), (+, −).
                here = (0 if dx >= 0 else 1) if dy >= 0 else (2 if dx < 0 else 3)
                if here == quarter and dx * dx + dy * dy <= limit:
                    offset_x[q], offset_y[q] = dx, dy
                    q += 1
        start[quarter + 1] = q
    return offset_x[:q].copy(), offset_y[:q].copy(), start


@njit(cache=True, nogil=True, error_model="numpy")
def gather_pixels(image, offset_x, offset_y, x_from, y_from, nx, ny, pixels, total, inverse_norm):
    """Write the image under every pixel of the disc at every position, and the inverse norm about its mean."""
    length = nx * ny
    total[:length] = 0.0
    inverse_norm[:length] = 0.0
    level = image[y_from, x_from]
    for q in range(len(offset_x)):
        row = pixels[q]
        for k in range(ny):
            first = x_from + offset_x[q]
            source = image[y_from + k + offset_y[q], first : first + nx]
            part = row[k * nx : (k + 1) * nx]
            for m in range(nx):
                part[m] = source[m] - level
        for p in range(length):
            g = row[p]
            total[p] += g
            inverse_norm[p] += g * g
    count = len(offset_x)
    for p in range(length):
        power = inverse_norm[p] - total[p] * total[p] / count
        # A contrast below one grey level is no texture.
        inverse_norm[p] = 1.0 / np.sqrt(power) if power > count else 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def correlate(template, pixels, length, total):
    """Sum template · pixels (count, length) over the pixels, four of them at a time."""
    total[:length] = 0.0
    sums = total[:length]
    count = len(template)
    whole = count // 4 * 4
    for q in range(0, whole, 4):
        # Slices of equal length, indexed from zero: the compiler then adds whole vectors.
        t0, t1, t2, t3 = template[q], template[q + 1], template[q + 2], template[q + 3]
        u0, u1 = pixels[q, :length], pixels[q + 1, :length]
        u2, u3 = pixels[q + 2, :length], pixels[q + 3, :length]
        for p in range(length):
            sums[p] += (t0 * u0[p] + t1 * u1[p]) + (t2 * u2[p] + t3 * u3[p])
    for q in range(whole, count):
        t0, u0 = template[q], pixels[q, :length]
        for p in range(length):
            sums[p] += t0 * u0[p]


@njit(cache=True, nogil=True, error_model="numpy")
def rotate_template(reference, origin_x, origin_y, angle, offset_x, offset_y, template):
    """Write the reference rotated by an angle, with zero mean and unit norm; zero where it has no texture."""
    height, width = reference.shape
    cos, sin = np.cos(angle), np.sin(angle)
    mean = 0.0
    for q in range(len(template)):
        x = origin_x + cos * offset_x[q] + sin * offset_y[q]
        y = origin_y - sin * offset_x[q] + cos * offset_y[q]
        x = min(max(x, 1.0), width - 2.001)
        y = min(max(y, 1.0), height - 2.001)
        ix, iy = int(x), int(y)
        template[q] = read_cubic(reference, ix, iy, np.float32(x - ix), np.float32(y - iy))
        mean += template[q]
    mean /= len(template)
    power = 0.0
    for q in range(len(template)):
        template[q] -= np.float32(mean)
        power += template[q] * template[q]
    scale = np.float32(1.0 / np.sqrt(power)) if power > 0.0 else np.float32(0.0)
    for q in range(len(template)):
        template[q] *= scale


@njit(cache=True, nogil=True, error_model="numpy")
def collect_maxima(peak, best_trial, angles, x_from, y_from, spacing, best):
    """Collect the local maxima of all sectors and write the highest distinct ones to best (k, 4)."""
    sectors, ny, nx = peak.shape
    found = 0
    place = np.empty((sectors * ny * nx, 4), np.float32)
    for s in range(sectors):
        for k in range(ny):
            for m in range(nx):
                value = peak[s, k, m]
                if value > 0.0 and _is_highest(peak[s], k, m, value):
                    place[found, 0], place[found, 1] = m, k
                    place[found, 2], place[found, 3] = angles[best_trial[s, k, m]], value
                    found += 1
    for k_best in range(len(best)):
        at, value = -1, np.float32(0.0)
        for p in range(found):
            if place[p, 3] > value:
                at, value = p, place[p, 3]
        if at < 0:
            return
        x, y, angle = place[at, 0], place[at, 1], place[at, 2]
        best[k_best, 0], best[k_best, 1], best[k_best, 2], best[k_best, 3] = x_from + x, y_from + y, angle, value
        for p in range(found):
            near = (place[p, 0] - x) ** 2 + (place[p, 1] - y) ** 2 < spacing * spacing
            if near and is_same_angle(place[p, 2], angle):
                place[p, 3] = 0.0


@njit(cache=True, nogil=True, inline="always")
def is_same_angle(one, other):
    """Whether two angles belong to one maximum."""
    difference = abs(one - other) % (2.0 * np.pi)
    return min(difference, 2.0 * np.pi - difference) < DISTINCT_ANGLE


@njit(cache=True, nogil=True)
def _is_highest(peak, k, m, value):
    height, width = peak.shape
    for a in range(max(k - 1, 0), min(k + 2, height)):
        for b in range(max(m - 1, 0), min(m + 2, width)):
            if peak[a, b] > value:
                return False
    return True
