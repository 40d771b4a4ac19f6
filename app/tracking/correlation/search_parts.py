"""Exhaustive search for a patch that is partly covered.

What covers a third of a patch, and is brighter or darker than the paint, governs the correlation of the whole. The half
of it that is turned away still correlates: at every position and angle the four halves are tried beside the whole.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .search import (
    BLOCK,
    collect,
    correlate,
    cut_window,
    disc,
    lay_out,
    turn_template,
    turns_to_try,
)

# A half has half the pixels, so accidental correlations are greater by this factor.
HALF_ACCIDENT = np.sqrt(2.0)


@njit(cache=True, nogil=True, error_model="numpy")
def search_parts(reference, image, origin_x, origin_y, reach, x, y, angle, window, sweep, spacing, best):
    """As `search_patch`; the ZNCC of a place is that of the whole, or that of a half over √2 where this is more."""
    x_from, y_from, nx, ny = cut_window(image, reach, x, y, window)
    best[:, :] = 0.0
    best[:, 3] = -1.0
    if nx < 1 or ny < 1:
        return
    offset_x, offset_y, start = disc(reach)
    count = len(offset_x)
    turn, sectors = turns_to_try(angle, reach, sweep)
    trials = len(turn)
    template = np.empty((trials, count), np.float32)
    mean = np.empty((trials, 4), np.float32)
    scale = np.empty((trials, 4), np.float32)
    for trial in range(trials):
        turn_template(reference, origin_x, origin_y, turn[trial], offset_x, offset_y, template[trial])
        _weigh_halves(template[trial], start, mean[trial], scale[trial])

    peak = np.full((sectors, ny, nx), np.float32(-1.0))
    steepest = np.zeros((sectors, ny, nx), np.int16)
    rows_at_once = max(BLOCK // nx, 1)
    size = rows_at_once * nx
    under = np.empty((count, size), np.float32)
    total, energy = np.empty((2, size), np.float32)
    level, power = np.empty((2, 4, size), np.float32)
    part = np.empty((4, size), np.float32)
    value = np.empty(size, np.float32)
    for first in range(0, ny, rows_at_once):
        ahead = min(rows_at_once, ny - first)
        length = ahead * nx
        lay_out(image, offset_x, offset_y, x_from, y_from + first, nx, ahead, under, total, energy)
        _halves_energy(under, start, length, level, power)
        for trial in range(trials):
            for k in range(4):
                correlate(template[trial, start[k] : start[k + 1]], under[start[k] : start[k + 1]], length, part[k])
            for p in range(length):
                value[p] = (part[0, p] + part[1, p] + part[2, p] + part[3, p]) * energy[p]
            for k in range(4):
                other = (k + 1) % 4
                for p in range(length):
                    half = part[k, p] + part[other, p] - mean[trial, k] * level[k, p]
                    value[p] = max(value[p], half * scale[trial, k] * power[k, p])
            sector = trial * sectors // trials
            for k in range(ahead):
                for m in range(nx):
                    if value[k * nx + m] > peak[sector, first + k, m]:
                        peak[sector, first + k, m] = value[k * nx + m]
                        steepest[sector, first + k, m] = trial
    collect(peak, steepest, turn, x_from, y_from, spacing, best)


@njit(cache=True, nogil=True, error_model="numpy")
def _weigh_halves(template, start, mean, scale):
    """Mean of the template over every half, and one over its norm about it, over √2."""
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
def _halves_energy(under, start, length, level, power):
    """Sum of what lies under every half (4, p), and one over its norm about its mean (4, p)."""
    sums = np.zeros((2, 4, length), np.float32)
    for k in range(4):
        for q in range(start[k], start[k + 1]):
            row, total, square = under[q], sums[0, k], sums[1, k]
            for p in range(length):
                total[p] += row[p]
                square[p] += row[p] * row[p]
    for k in range(4):
        other = (k + 1) % 4
        count = start[k + 1] - start[k] + start[other + 1] - start[other]
        for p in range(length):
            level[k, p] = sums[0, k, p] + sums[0, other, p]
            left = sums[1, k, p] + sums[1, other, p] - level[k, p] ** 2 / count
            power[k, p] = 1.0 / np.sqrt(left) if left > count else 0.0
