"""Exhaustive search for a patch over position and angle, on one level of the pyramid.

Every whole-pixel position of a window and every angle of a range is tried with the zero-normalised
cross-correlation. The best few positions that are not neighbours of one another are handed on: on a
coarse level the highest peak need not be the true one.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from app.tracking.correlation_kernels import interpolate


@njit(cache=True, nogil=True)
def angle_steps(reach, sweep):
    """Steps of the angle to either side: the rim, `reach` [px] from the centre, moves by 1.2 px at most in each."""
    return max(int(np.ceil(sweep * reach / 1.2)), 1)


@njit(cache=True, nogil=True, error_model="numpy")
def search_patch(
    reference, image, origin_x, origin_y, reach, x, y, angle, window, sweep, spacing, best, scratch, energy, steepest
):
    """Find the most similar places of `image` to the disc of `reference` about (origin_x, origin_y).

    reference: spline coefficients (h, w) of the level of the reference photograph; image (h, w): the same
    level of this one; x, y, angle: middle of what is searched; window [px] and sweep [rad]: half widths;
    spacing [px]: how far apart two places must be; best (k, 4): x, y, angle, ZNCC, best first, −1 where
    there are fewer. scratch, energy, steepest: (2 · window + 3)² buffers. All pixels are of this level.
    """
    height, width = image.shape
    side = int(reach)
    # The window is cut where the disc would leave the image.
    x_from, x_to = max(int(np.floor(x - window)), side), min(int(np.ceil(x + window)), width - 1 - side)
    y_from, y_to = max(int(np.floor(y - window)), side), min(int(np.ceil(y + window)), height - 1 - side)
    best[:, :] = 0.0
    best[:, 3] = -1.0
    nx, ny = x_to - x_from + 1, y_to - y_from + 1
    if nx < 1 or ny < 1:
        return
    limit = reach * reach
    count = 0
    for dy in range(-side, side + 1):
        for dx in range(-side, side + 1):
            if dx * dx + dy * dy <= limit:
                count += 1
    offset_x = np.empty(count, np.int32)
    offset_y = np.empty(count, np.int32)
    template = np.empty(count, np.float32)
    p = 0
    for dy in range(-side, side + 1):
        for dx in range(-side, side + 1):
            if dx * dx + dy * dy <= limit:
                offset_x[p], offset_y[p] = dx, dy
                p += 1

    _window_energy(image, offset_x, offset_y, x_from, y_from, nx, ny, scratch, energy)
    peak = scratch  # reused: the best ZNCC of every position over the angles
    peak[:ny, :nx] = -1.0
    steps = angle_steps(reach, sweep)
    full_turn = sweep >= np.pi - 1e-6
    trials = 2 * steps if full_turn else 2 * steps + 1
    rows = np.empty((ny, nx), np.float32)
    for trial in range(trials):
        turn = angle + sweep * (trial - steps) / steps
        if not _turn_template(reference, origin_x, origin_y, turn, offset_x, offset_y, template):
            continue
        rows[:, :] = 0.0
        for q in range(count):
            t = template[q]
            first = x_from + offset_x[q]
            for k in range(ny):
                # Slices of equal length, indexed from zero: the compiler then adds whole vectors.
                source = image[y_from + k + offset_y[q], first : first + nx]
                row = rows[k]
                for m in range(nx):
                    row[m] += t * source[m]
        for k in range(ny):
            for m in range(nx):
                value = rows[k, m] * energy[k, m]
                if value > peak[k, m]:
                    peak[k, m] = value
                    steepest[k, m] = turn
    _collect(peak, steepest, x_from, y_from, nx, ny, spacing, best)


@njit(cache=True, nogil=True, error_model="numpy")
def _window_energy(image, offset_x, offset_y, x_from, y_from, nx, ny, total, energy):
    """One over the norm of the image about its mean under the disc, at every position."""
    total[:ny, :nx] = 0.0
    energy[:ny, :nx] = 0.0
    level = image[y_from, x_from]
    for q in range(len(offset_x)):
        for k in range(ny):
            source = image[y_from + k + offset_y[q]]
            first = x_from + offset_x[q]
            for m in range(nx):
                g = source[first + m] - level
                total[k, m] += g
                energy[k, m] += g * g
    for k in range(ny):
        for m in range(nx):
            power = energy[k, m] - total[k, m] * total[k, m] / len(offset_x)
            # Below one grey level of contrast there is nothing to recognise.
            energy[k, m] = 1.0 / np.sqrt(power) if power > len(offset_x) else 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def _turn_template(reference, origin_x, origin_y, turn, offset_x, offset_y, template):
    """The reference turned by an angle, zero mean and unit norm."""
    height, width = reference.shape
    cos, sin = np.cos(turn), np.sin(turn)
    mean = 0.0
    for q in range(len(template)):
        x = origin_x + cos * offset_x[q] + sin * offset_y[q]
        y = origin_y - sin * offset_x[q] + cos * offset_y[q]
        x = min(max(x, 1.0), width - 2.001)
        y = min(max(y, 1.0), height - 2.001)
        ix, iy = int(x), int(y)
        template[q] = interpolate(reference, ix, iy, np.float32(x - ix), np.float32(y - iy))
        mean += template[q]
    mean /= len(template)
    power = 0.0
    for q in range(len(template)):
        template[q] -= np.float32(mean)
        power += template[q] * template[q]
    if power <= 0.0:
        return False
    scale = np.float32(1.0 / np.sqrt(power))
    for q in range(len(template)):
        template[q] *= scale
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def _collect(peak, steepest, x_from, y_from, nx, ny, spacing, best):
    """Take the highest peak, strike out its neighbourhood, and again."""
    for found in range(len(best)):
        value, at_k, at_m = np.float32(0.0), -1, -1
        for k in range(ny):
            for m in range(nx):
                if peak[k, m] > value:
                    value, at_k, at_m = peak[k, m], k, m
        if at_k < 0:
            return
        best[found, 0] = x_from + at_m
        best[found, 1] = y_from + at_k
        best[found, 2] = steepest[at_k, at_m]
        best[found, 3] = value
        near = int(np.ceil(spacing))
        for k in range(max(at_k - near, 0), min(at_k + near + 1, ny)):
            for m in range(max(at_m - near, 0), min(at_m + near + 1, nx)):
                if (k - at_k) ** 2 + (m - at_m) ** 2 < spacing * spacing:
                    peak[k, m] = -1.0
