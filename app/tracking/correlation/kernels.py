"""The loops of correlation: interpolate a photograph under a patch, sum, solve three unknowns, repeat.

Inverse-compositional Gauss-Newton (Baker & Matthews 2004): the steepest descent images belong to the
fixed reference, so they and their Hessian are made once. Gain and offset of the light are projected
out of them, so that neither has to be known.

A patch is a run of rows of `data`, one per pixel: dx, dy (from the grain's centre), f (reference, zero
mean and unit norm over the patch), and the three steepest descent values jx, jy, jr, orthogonal to f
and to a constant.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .spline_vectors import add_projections, read_cubic, read_quintic

CONVERGED = 0
LEFT_IMAGE = 1
WANDERED = 2
UNFINISHED = 3

# Columns of a fit.
ZNCC, RESIDUAL, GAIN, OFFSET, KEPT, CODE = range(6)
FIT_COLUMNS = 6

# Tukey's biweight keeps 95 % of the efficiency on Gaussian noise with this width.
TUKEY_WIDTH = 4.685
# Steps for which the robust fit keeps the light it was given.
HELD_STEPS = 3
# A step [px] below which the patch is interpolated with all six taps; before that four of them show the way.
FINE_STEP = 0.1
# Pixels that show the way before that: more tell it no better than the last steps put right.
COARSE_PIXELS = 400
# Steps after which a fit must be promising. A step is a pixel and a half at most, and a fit's basin two or three.
PATIENCE = 5
# Steps after which most of a patch must fit robustly, and the share of its contrast by which it may then be off: a ZNCC
# of .8 is the least that is ever accepted, and corresponds to .6.
ROBUST_PATIENCE = 8
HOPELESS_MISFIT = 0.6
# The scale is read from the calmer pixels alone, so that half a patch may be something else: this share of them, and
# the quantile of that share of the absolute value of a standard normal variable.
CALM = 0.35
NORMAL_CALM = 0.4538


@njit(cache=True, nogil=True)
def inside(height, width, x, y, reach):
    """Whether a disc about (x, y) and the quintic spline's support lie within the image."""
    return x - reach >= 3.0 and y - reach >= 3.0 and x + reach <= width - 4.0 and y + reach <= height - 4.0


@njit(cache=True, nogil=True)
def count_pixels(cx, cy, reach):
    """Whole pixels within `reach` of the centre."""
    count = 0
    for iy in range(int(np.ceil(cy - reach)), int(np.floor(cy + reach)) + 1):
        half = np.sqrt(max(reach * reach - (iy - cy) ** 2, 0.0))
        count += int(np.floor(cx + half)) - int(np.ceil(cx - half)) + 1
    return count


@njit(cache=True, nogil=True)
def fill_patch(image, coefficients, cx, cy, reach, data, hessian_inverse, facts):
    """Write one patch: its rows of data, its inverse Hessian (3, 3) for a unit-norm f, and facts.

    facts: norm of the reference about its mean, mean, squared correlation length [px²]. Returns False
    where the patch has no texture.
    """
    p = 0
    mean = 0.0
    for iy in range(int(np.ceil(cy - reach)), int(np.floor(cy + reach)) + 1):
        half = np.sqrt(max(reach * reach - (iy - cy) ** 2, 0.0))
        for ix in range(int(np.ceil(cx - half)), int(np.floor(cx + half)) + 1):
            c = coefficients
            gx = (
                (c[iy - 1, ix + 1] - c[iy - 1, ix - 1])
                + 4.0 * (c[iy, ix + 1] - c[iy, ix - 1])
                + (c[iy + 1, ix + 1] - c[iy + 1, ix - 1])
            ) / 12.0
            gy = (
                (c[iy + 1, ix - 1] - c[iy - 1, ix - 1])
                + 4.0 * (c[iy + 1, ix] - c[iy - 1, ix])
                + (c[iy + 1, ix + 1] - c[iy - 1, ix + 1])
            ) / 12.0
            dx, dy = ix - cx, iy - cy
            data[p, 0] = dx
            data[p, 1] = dy
            data[p, 2] = image[iy, ix]
            data[p, 3] = gx
            data[p, 4] = gy
            data[p, 5] = gy * dx - gx * dy
            mean += image[iy, ix]
            p += 1
    count = p
    mean /= count
    power = 0.0
    slope = 0.0
    for p in range(count):
        power += (data[p, 2] - mean) ** 2
        slope += 0.5 * (data[p, 3] ** 2 + data[p, 4] ** 2)
    norm = np.sqrt(power)
    facts[0] = norm
    facts[1] = mean
    if norm < 0.5 * np.sqrt(count) or slope == 0.0:
        return False
    facts[2] = power / slope
    h = np.zeros((3, 3))
    along = np.zeros(3)
    level = np.zeros(3)
    for p in range(count):
        f = (data[p, 2] - mean) / norm
        data[p, 2] = f
        for k in range(3):
            data[p, 3 + k] /= norm
            along[k] += data[p, 3 + k] * f
            level[k] += data[p, 3 + k]
    for p in range(count):
        for k in range(3):
            data[p, 3 + k] -= along[k] * data[p, 2] + level[k] / count
    for p in range(count):
        for k in range(3):
            for m in range(3):
                h[k, m] += data[p, 3 + k] * np.float64(data[p, 3 + m])
    hessian_inverse[:, :] = np.linalg.inv(h)
    return True


@njit(cache=True, nogil=True)
def coarse_stride(count):
    """Of every so many pixels of a patch one leads a fit to where all of them end it."""
    return max(count // COARSE_PIXELS, 1)


@njit(cache=True, nogil=True)
def fill_coarse(data, coarse):
    """Write the inverse normal matrix (5, 5) of jx, jy, jr, f and 1 over the pixels that lead a fit."""
    normal = np.zeros((5, 5))
    row = np.ones(5)
    for p in range(0, len(data), coarse_stride(len(data))):
        row[0], row[1], row[2], row[3] = data[p, 3], data[p, 4], data[p, 5], data[p, 2]
        for k in range(5):
            for m in range(5):
                normal[k, m] += row[k] * row[m]
    coarse[:, :] = np.linalg.inv(normal)


@njit(cache=True, nogil=True, error_model="numpy")
def fit_rigid(coefficients, data, coarse, hessian_inverse, reach, leash, hopeless, tolerance, limit, pose, fit, sums):
    """Move `pose` (x, y, θ) until the patch fits; give up beyond `leash` [px] from where it began.

    A fit whose ZNCC is below `hopeless` after some steps is given up, too: at a wrong place it would run to the limit.
    coefficients: of the quintic spline. Read with the cubic one's four taps they show a crisper photograph at the same
    place, which is enough for every step but the last, and so is a part of the pixels; coarse: see `fill_coarse`.
    fit: ZNCC, residual variance per pixel [grey²], gain, offset [grey] (image = gain · f + offset, f of
    unit norm), share of the pixels kept, code. sums (4,): room to work in.
    """
    height, width = coefficients.shape
    count = len(data)
    stride = coarse_stride(count)
    x0, y0 = pose[0], pose[1]
    margin = int(reach) + 2
    fit[CODE] = UNFINISHED
    fit[KEPT] = 1.0
    fine = limit == 0
    for step in range(limit + 1):
        if not inside(height, width, pose[0], pose[1], reach):
            fit[CODE] = LEFT_IMAGE
            fit[ZNCC] = 0.0
            return
        bx, by = int(pose[0]) - margin, int(pose[1]) - margin
        ox, oy = np.float32(pose[0] - bx), np.float32(pose[1] - by)
        cos, sin = np.float32(np.cos(pose[2])), np.float32(np.sin(pose[2]))
        level = coefficients[int(pose[1]), int(pose[0])]
        s0, s1 = 0.0, 0.0
        sums[:] = 0.0
        for p in range(0, count, 1 if fine else stride):
            dx, dy = data[p, 0], data[p, 1]
            x = ox + cos * dx - sin * dy
            y = oy + sin * dx + cos * dy
            ix, iy = int(x), int(y)
            if fine:
                g = read_quintic(coefficients, bx + ix, by + iy, x - np.float32(ix), y - np.float32(iy)) - level
            else:
                g = read_cubic(coefficients, bx + ix, by + iy, x - np.float32(ix), y - np.float32(iy)) - level
            s0 += g
            s1 += np.float64(g) * g
            add_projections(sums, data, p, g)
        used = count if fine else (count + stride - 1) // stride
        power = s1 - s0 * s0 / used
        sf, sx, sy, sr = sums[0], sums[1], sums[2], sums[3]
        if fine:
            gain = sf
            h = hessian_inverse
            tx = (h[0, 0] * sx + h[0, 1] * sy + h[0, 2] * sr) / gain
            ty = (h[1, 0] * sx + h[1, 1] * sy + h[1, 2] * sr) / gain
            tr = (h[2, 0] * sx + h[2, 1] * sy + h[2, 2] * sr) / gain
        else:
            c = coarse
            gain = c[3, 0] * sx + c[3, 1] * sy + c[3, 2] * sr + c[3, 3] * sf + c[3, 4] * s0
            tx = (c[0, 0] * sx + c[0, 1] * sy + c[0, 2] * sr + c[0, 3] * sf + c[0, 4] * s0) / gain
            ty = (c[1, 0] * sx + c[1, 1] * sy + c[1, 2] * sr + c[1, 3] * sf + c[1, 4] * s0) / gain
            tr = (c[2, 0] * sx + c[2, 1] * sy + c[2, 2] * sr + c[2, 3] * sf + c[2, 4] * s0) / gain
        fit[ZNCC] = gain * np.sqrt(used / count / power) if power > 0.0 else 0.0
        fit[RESIDUAL] = max(power - gain * gain * used / count, 0.0) / max(used - 5, 1)
        fit[GAIN] = gain
        fit[OFFSET] = s0 / used + level
        if not gain > 0.0 or (step == PATIENCE and fit[ZNCC] < hopeless):
            fit[CODE] = WANDERED
            return
        if step == limit:
            return
        _compose(pose, tx, ty, tr, reach)
        if (pose[0] - x0) ** 2 + (pose[1] - y0) ** 2 > leash * leash:
            fit[CODE] = WANDERED
            return
        length = abs(tx) + abs(ty) + reach * abs(tr)
        if not fine:
            fine = length < FINE_STEP or step == limit - 1
        elif length < tolerance:
            # Gauss-Newton's error after this step is far below the step: what was summed before it stands,
            # its ZNCC differing by less than the square of the tolerance.
            fit[CODE] = CONVERGED
            return


@njit(cache=True, nogil=True, error_model="numpy")
def fit_all(
    coefficients, data, start, coarse, hessian_inverse, reach, rows, leash, hopeless, tolerance, limit, pose, fit
):
    """Fit the patches `rows` (m,), the pixels of patch k being data[start[k] : start[k + 1]]; see `fit_rigid`."""
    sums = np.empty(4)
    for m in range(len(rows)):
        k = rows[m]
        fit_rigid(
            coefficients, data[start[k] : start[k + 1]], coarse[k], hessian_inverse[k], reach[k],
            leash[m], hopeless[m], tolerance, limit, pose[m], fit[m], sums,
        )  # fmt: skip


@njit(cache=True, nogil=True, inline="always")
def _compose(pose, tx, ty, tr, reach):
    """W ← W ∘ W(t)⁻¹, a step no longer than a pixel and a half at the centre or at the rim."""
    longest = max(np.sqrt(tx * tx + ty * ty), reach * abs(tr))
    if longest > 1.5:
        tx *= 1.5 / longest
        ty *= 1.5 / longest
        tr *= 1.5 / longest
    angle = pose[2] - tr
    cos, sin = np.cos(angle), np.sin(angle)
    pose[0] -= cos * tx - sin * ty
    pose[1] -= sin * tx + cos * ty
    pose[2] = angle


@njit(cache=True, nogil=True, error_model="numpy")
def fit_robust(coefficients, data, reach, leash, noise, gain, offset, limit, pose, fit, covariance):
    """Refit with Tukey's weights, beginning with the light (gain, offset) that the neighbours have.

    noise [grey]: the standard deviation a clean residual has; the scale comes down to it, never below.
    covariance (3, 3): of the pose, from the weighted residual.
    """
    height, width = coefficients.shape
    count = len(data)
    x0, y0 = pose[0], pose[1]
    margin = int(reach) + 2
    g = np.empty(count)
    misfit = np.empty(count)
    inverse = np.zeros((5, 5))
    a, b = gain, offset
    # The given light is held for some steps: what covers the patch would drag a free one along, and then
    # hide among residuals that are large everywhere.
    held = HELD_STEPS
    second = False
    fit[CODE] = UNFINISHED
    for step in range(limit):
        if not inside(height, width, pose[0], pose[1], reach):
            fit[CODE] = LEFT_IMAGE
            fit[ZNCC] = 0.0
            return
        bx, by = int(pose[0]) - margin, int(pose[1]) - margin
        ox, oy = np.float32(pose[0] - bx), np.float32(pose[1] - by)
        cos, sin = np.float32(np.cos(pose[2])), np.float32(np.sin(pose[2]))
        for p in range(count):
            x = ox + cos * data[p, 0] - sin * data[p, 1]
            y = oy + sin * data[p, 0] + cos * data[p, 1]
            ix, iy = int(x), int(y)
            g[p] = read_quintic(coefficients, bx + ix, by + iy, x - np.float32(ix), y - np.float32(iy))
            misfit[p] = abs(g[p] - a * data[p, 2] - b)
        scale = max(np.quantile(misfit, CALM) / NORMAL_CALM, noise)
        if step == ROBUST_PATIENCE and scale > HOPELESS_MISFIT * a / np.sqrt(count):
            fit[CODE] = WANDERED
            fit[ZNCC] = 0.0
            return
        normal = np.zeros((5, 5))
        right = np.zeros(5)
        row = np.zeros(5)
        sw, sww = 0.0, 0.0
        sg, sgg, sf, sff, sfg = 0.0, 0.0, 0.0, 0.0, 0.0
        for p in range(count):
            u = misfit[p] / (TUKEY_WIDTH * scale)
            if u >= 1.0:
                continue
            w = (1.0 - u * u) ** 2
            row[0], row[1], row[2] = a * data[p, 3], a * data[p, 4], a * data[p, 5]
            row[3], row[4] = data[p, 2], 1.0
            for k in range(5):
                right[k] += w * row[k] * g[p]
                for m in range(k, 5):
                    normal[k, m] += w * row[k] * row[m]
            f = data[p, 2]
            sw += w
            sww += w * misfit[p] ** 2
            sg += w * g[p]
            sgg += w * g[p] * g[p]
            sf += w * f
            sff += w * f * f
            sfg += w * f * g[p]
        if sw < 0.15 * count:
            fit[CODE] = WANDERED
            fit[ZNCC] = 0.0
            return
        for k in range(5):
            normal[k, k] *= 1.0 + 1e-12
            for m in range(k):
                normal[k, m] = normal[m, k]
        inverse = np.linalg.inv(normal)
        tx, ty, tr, a_new, b_new = 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(5):
            tx += inverse[0, k] * right[k]
            ty += inverse[1, k] * right[k]
            tr += inverse[2, k] * right[k]
            a_new += inverse[3, k] * right[k]
            b_new += inverse[4, k] * right[k]
        spread = np.sqrt(max(sgg - sg * sg / sw, 1e-12) * max(sff - sf * sf / sw, 1e-12))
        fit[ZNCC] = (sfg - sf * sg / sw) / spread
        fit[RESIDUAL] = sww / max(sw - 5.0, 1.0)
        fit[KEPT] = sw / count
        if not a_new > 0.0:
            fit[CODE] = WANDERED
            return
        # Before the light and the scale have settled a large share of a step is an artefact.
        still = abs(a_new - a) < 0.01 * a and abs(tx) + abs(ty) + reach * abs(tr) < 0.005
        if held > 0:
            held -= 1
            still = False
        else:
            a, b = a_new, b_new
        fit[GAIN], fit[OFFSET] = a, b
        _compose(pose, tx, ty, tr, reach)
        if (pose[0] - x0) ** 2 + (pose[1] - y0) ** 2 > leash * leash:
            fit[CODE] = WANDERED
            return
        if still and not second and fit[ZNCC] < 0.95:
            # Often the place is right by now and only the light is not: once more from the given one.
            second = True
            held = HELD_STEPS
            a, b = gain, offset
        elif still:
            fit[CODE] = CONVERGED
            break
    for k in range(3):
        for m in range(3):
            covariance[k, m] = inverse[k, m] * fit[RESIDUAL]
