"""Exhaustive search for a patch that is partly covered.

An object that covers a third of a patch, and is brighter or darker than the paint, dominates the correlation of the
whole. The opposite half of the patch still correlates. At every position and angle the four halves are therefore
correlated besides the whole.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .search import (
    BLOCK,
    angles_to_try,
    clip_window,
    collect_maxima,
    correlate,
    disc_offsets,
    gather_pixels,
    rotate_template,
)

# A half has half of the pixels, so its accidental correlations are greater by this factor.
HALF_ACCIDENT = np.sqrt(2.0)


@njit(cache=True, nogil=True, error_model="numpy")
def search_parts(reference, image, origin_x, origin_y, radius, x, y, angle, window, angle_window, spacing, best):
    """Search as `search_patch` does, with the greater of the whole's ZNCC and a half's ZNCC / √2."""
    x_from, y_from, nx, ny = clip_window(image, radius, x, y, window)
    best[:, :] = 0.0
    best[:, 3] = -1.0
    if nx < 1 or ny < 1:
        return
    offset_x, offset_y, start = disc_offsets(radius)
    count = len(offset_x)
    angles, sectors = angles_to_try(angle, radius, angle_window)
    trials = len(angles)
    template = np.empty((trials, count), np.float32)
    mean = np.empty((trials, 4), np.float32)
    scale = np.empty((trials, 4), np.float32)
    for trial in range(trials):
        rotate_template(reference, origin_x, origin_y, angles[trial], offset_x, offset_y, template[trial])
        _half_norms(template[trial], start, mean[trial], scale[trial])

    peak = np.full((sectors, ny, nx), np.float32(-1.0))
    best_trial = np.zeros((sectors, ny, nx), np.int16)
    rows_at_once = max(BLOCK // nx, 1)
    size = rows_at_once * nx
    pixels = np.empty((count, size), np.float32)
    total, inverse_norm = np.empty((2, size), np.float32)
    level, inverse_norms = np.empty((2, 4, size), np.float32)
    part = np.empty((4, size), np.float32)
    value = np.empty(size, np.float32)
    for first in range(0, ny, rows_at_once):
        row_count = min(rows_at_once, ny - first)
        length = row_count * nx
        gather_pixels(image, offset_x, offset_y, x_from, y_from + first, nx, row_count, pixels, total, inverse_norm)
        _half_inverse_norms(pixels, start, length, level, inverse_norms)
        for trial in range(trials):
            for k in range(4):
                correlate(template[trial, start[k] : start[k + 1]], pixels[start[k] : start[k + 1]], length, part[k])
            for p in range(length):
                value[p] = (part[0, p] + part[1, p] + part[2, p] + part[3, p]) * inverse_norm[p]
            for k in range(4):
                other = (k + 1) % 4
                for p in range(length):
                    half = part[k, p] + part[other, p] - mean[trial, k] * level[k, p]
                    value[p] = max(value[p], half * scale[trial, k] * inverse_norms[k, p])
            sector = trial * sectors // trials
            for k in range(row_count):
                for m in range(nx):
                    if value[k * nx + m] > peak[sector, first + k, m]:
                        peak[sector, first + k, m] = value[k * nx + m]
                        best_trial[sector, first + k, m] = trial
    collect_maxima(peak, best_trial, angles, x_from, y_from, spacing, best)


@njit(cache=True, nogil=True, error_model="numpy")
def _half_norms(template, start, mean, scale):
    """Write the mean of the template over every half, and its inverse norm about that mean, over √2."""
    for k in range(4):
        total, power, count = 0.0, 0.0, 0
        for quarter in (k, (k + 1) % 4):
            for q in range(start[quarter], start[quarter + 1]):
                total += template[q]
                power += template[q] * template[q]
                count += 1
        power -= total * total / count
        mean[k] = total / count
        scale[k] = 1.0 / (HALF_ACCIDENT * np.sqrt(power)) if power > 0.0 else 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def _half_inverse_norms(pixels, start, length, level, inverse_norms):
    """Write the sum of the pixels under every half (4, p), and their inverse norm about their mean (4, p)."""
    sums = np.zeros((2, 4, length), np.float32)
    for k in range(4):
        for q in range(start[k], start[k + 1]):
            row, total, square = pixels[q], sums[0, k], sums[1, k]
            for p in range(length):
                total[p] += row[p]
                square[p] += row[p] * row[p]
    for k in range(4):
        other = (k + 1) % 4
        count = start[k + 1] - start[k] + start[other + 1] - start[other]
        for p in range(length):
            level[k, p] = sums[0, k, p] + sums[0, other, p]
            power = sums[1, k, p] + sums[1, other, p] - level[k, p] ** 2 / count
            inverse_norms[k, p] = 1.0 / np.sqrt(power) if power > count else 0.0
