"""Exhaustive search for a patch over position and angle, on one level of the pyramid.

Every whole-pixel position of a window and every angle of a range is tried with the zero-normalised
cross-correlation. The best few maxima that are distinct from one another, in position or in angle, are
handed on: on a coarse level the highest peak need not be the true one.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .spline_vectors import read_cubic

# Two maxima at one place are distinct when their angles differ by more than this [rad]. A maximum is a speckle's size
# wide, which is much less at the rim of any patch that can be told from another.
DISTINCT_TURN = 0.5

# For each position the best angle is kept of every part of the range that is no wider than this [rad].
SECTOR = 0.5 * np.pi

# Positions that are correlated together: the pixels under all of them stay in a core's second cache.
BLOCK = 256


@njit(cache=True, nogil=True)
def angle_steps(reach, sweep):
    """Steps of the angle to either side: the rim, `reach` [px] from the centre, moves by 1.2 px at most in each."""
    return max(int(np.ceil(sweep * reach / 1.2)), 1)


@njit(cache=True, nogil=True, error_model="numpy")
def search_patch(reference, image, origin_x, origin_y, reach, x, y, angle, window, sweep, spacing, best):
    """Find the most similar places of `image` to the disc of `reference` about (origin_x, origin_y).

    reference: spline coefficients (h, w) of the level of the reference photograph; image (h, w): the same
    level of this one; x, y, angle: middle of what is searched; window [px] and sweep [rad]: half widths;
    spacing [px]: how far apart two places of one angle must be; best (k, 4): x, y, angle, ZNCC, best first,
    −1 where there are fewer. All pixels are of this level.
    """
    x_from, y_from, nx, ny = cut_window(image, reach, x, y, window)
    best[:, :] = 0.0
    best[:, 3] = -1.0
    if nx < 1 or ny < 1:
        return
    offset_x, offset_y, _ = disc(reach)
    count = len(offset_x)
    turn, sectors = turns_to_try(angle, reach, sweep)
    trials = len(turn)
    template = np.empty((trials, count), np.float32)
    for trial in range(trials):
        turn_template(reference, origin_x, origin_y, turn[trial], offset_x, offset_y, template[trial])

    peak = np.full((sectors, ny, nx), np.float32(-1.0))
    steepest = np.zeros((sectors, ny, nx), np.int16)
    rows_at_once = max(BLOCK // nx, 1)
    under = np.empty((count, rows_at_once * nx), np.float32)
    energy = np.empty(rows_at_once * nx, np.float32)
    total = np.empty(rows_at_once * nx, np.float32)
    for first in range(0, ny, rows_at_once):
        ahead = min(rows_at_once, ny - first)
        lay_out(image, offset_x, offset_y, x_from, y_from + first, nx, ahead, under, total, energy)
        for trial in range(trials):
            correlate(template[trial], under, ahead * nx, total)
            sector = trial * sectors // trials
            for k in range(ahead):
                for m in range(nx):
                    value = total[k * nx + m] * energy[k * nx + m]
                    if value > peak[sector, first + k, m]:
                        peak[sector, first + k, m] = value
                        steepest[sector, first + k, m] = trial
    collect(peak, steepest, turn, x_from, y_from, spacing, best)


@njit(cache=True, nogil=True, error_model="numpy")
def cut_window(image, reach, x, y, window):
    """First column and row of the positions to try, and how many of either; none where the disc leaves the image."""
    height, width = image.shape
    side = int(reach)
    x_from, x_to = max(int(np.floor(x - window)), side), min(int(np.ceil(x + window)), width - 1 - side)
    y_from, y_to = max(int(np.floor(y - window)), side), min(int(np.ceil(y + window)), height - 1 - side)
    return x_from, y_from, x_to - x_from + 1, y_to - y_from + 1


@njit(cache=True, nogil=True, error_model="numpy")
def turns_to_try(angle, reach, sweep):
    """Angles to try [rad], ascending, and the number of parts of the range of which each keeps its best."""
    steps = angle_steps(reach, sweep)
    trials = 2 * steps if sweep >= np.pi - 1e-6 else 2 * steps + 1
    turn = np.empty(trials)
    for trial in range(trials):
        turn[trial] = angle + sweep * (trial - steps) / steps
    return turn, max(int(np.ceil(2.0 * sweep / SECTOR - 1e-6)), 1)


@njit(cache=True, nogil=True)
def disc(reach):
    """Whole pixels (q,) of a disc, dx and dy, quarter after quarter, and where each quarter begins (5,)."""
    side = int(reach)
    limit = reach * reach
    offset_x = np.empty((2 * side + 1) ** 2, np.int32)
    offset_y = np.empty((2 * side + 1) ** 2, np.int32)
    start = np.zeros(5, np.int64)
    q = 0
    for quarter in range(4):
        for dy in range(-side, side + 1):
            for dx in range(-side, side + 1):
                # Turned a quarter further each time: (+, +), (−, +), (−, −), (+, −).
                here = (0 if dx >= 0 else 1) if dy >= 0 else (2 if dx < 0 else 3)
                if here == quarter and dx * dx + dy * dy <= limit:
                    offset_x[q], offset_y[q] = dx, dy
                    q += 1
        start[quarter + 1] = q
    return offset_x[:q].copy(), offset_y[:q].copy(), start


@njit(cache=True, nogil=True, error_model="numpy")
def lay_out(image, offset_x, offset_y, x_from, y_from, nx, ny, under, total, energy):
    """Write what lies under every pixel of the disc at every position, and one over its norm about its mean."""
    length = nx * ny
    total[:length] = 0.0
    energy[:length] = 0.0
    level = image[y_from, x_from]
    for q in range(len(offset_x)):
        row = under[q]
        for k in range(ny):
            first = x_from + offset_x[q]
            source = image[y_from + k + offset_y[q], first : first + nx]
            part = row[k * nx : (k + 1) * nx]
            for m in range(nx):
                part[m] = source[m] - level
        for p in range(length):
            g = row[p]
            total[p] += g
            energy[p] += g * g
    count = len(offset_x)
    for p in range(length):
        power = energy[p] - total[p] * total[p] / count
        # Below one grey level of contrast there is nothing to recognise.
        energy[p] = 1.0 / np.sqrt(power) if power > count else 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def correlate(template, under, length, total):
    """Sum template · what lies under it (count, length) over the pixels, four of them at a time."""
    total[:length] = 0.0
    sums = total[:length]
    count = len(template)
    whole = count // 4 * 4
    for q in range(0, whole, 4):
        # Slices of equal length, indexed from zero: the compiler then adds whole vectors.
        t0, t1, t2, t3 = template[q], template[q + 1], template[q + 2], template[q + 3]
        u0, u1 = under[q, :length], under[q + 1, :length]
        u2, u3 = under[q + 2, :length], under[q + 3, :length]
        for p in range(length):
            sums[p] += (t0 * u0[p] + t1 * u1[p]) + (t2 * u2[p] + t3 * u3[p])
    for q in range(whole, count):
        t0, u0 = template[q], under[q, :length]
        for p in range(length):
            sums[p] += t0 * u0[p]


@njit(cache=True, nogil=True, error_model="numpy")
def turn_template(reference, origin_x, origin_y, turn, offset_x, offset_y, template):
    """The reference turned by an angle, zero mean and unit norm; zero where it has no texture."""
    height, width = reference.shape
    cos, sin = np.cos(turn), np.sin(turn)
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
def collect(peak, steepest, turn, x_from, y_from, spacing, best):
    """Gather the local maxima of every sector and take the highest that are distinct from those taken before."""
    sectors, ny, nx = peak.shape
    found = 0
    place = np.empty((sectors * ny * nx, 4), np.float32)
    for s in range(sectors):
        for k in range(ny):
            for m in range(nx):
                value = peak[s, k, m]
                if value > 0.0 and _is_highest(peak[s], k, m, value):
                    place[found, 0], place[found, 1] = m, k
                    place[found, 2], place[found, 3] = turn[steepest[s, k, m]], value
                    found += 1
    for taken in range(len(best)):
        at, value = -1, np.float32(0.0)
        for p in range(found):
            if place[p, 3] > value:
                at, value = p, place[p, 3]
        if at < 0:
            return
        x, y, angle = place[at, 0], place[at, 1], place[at, 2]
        best[taken, 0], best[taken, 1], best[taken, 2], best[taken, 3] = x_from + x, y_from + y, angle, value
        for p in range(found):
            near = (place[p, 0] - x) ** 2 + (place[p, 1] - y) ** 2 < spacing * spacing
            if near and is_same_turn(place[p, 2], angle):
                place[p, 3] = 0.0


@njit(cache=True, nogil=True, inline="always")
def is_same_turn(one, other):
    """Whether two angles are of one maximum."""
    apart = abs(one - other) % (2.0 * np.pi)
    return min(apart, 2.0 * np.pi - apart) < DISTINCT_TURN


@njit(cache=True, nogil=True)
def _is_highest(peak, k, m, value):
    height, width = peak.shape
    for a in range(max(k - 1, 0), min(k + 2, height)):
        for b in range(max(m - 1, 0), min(m + 2, width)):
            if peak[a, b] > value:
                return False
    return True
