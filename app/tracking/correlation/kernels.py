"""Compiled loops of correlation: plain and robust Gauss-Newton fits of a patch's position and rotation.

Inverse-compositional Gauss-Newton (Baker & Matthews 2004): the steepest descent images belong to the fixed reference,
so they and their Hessian are computed once. Gain and offset of the light are projected out of them, so that neither has
to be known.

A patch is a block of rows of `data`, one per pixel: dx, dy (from the grain's centre), f (reference, zero mean and unit
norm over the patch), and the three steepest descent values jx, jy, jr, orthogonal to f and to a constant.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ...solver.array_copies import copy_matrix
from ..interpolation.projections import COLUMNS, LANES, SUMS, project_cubic, project_quintic
from ..interpolation.spline_vectors import read_quintic

CONVERGED = 0
LEFT_IMAGE = 1
DIVERGED = 2
UNFINISHED = 3

# Columns of a fit.
ZNCC, RESIDUAL, GAIN, OFFSET, KEPT, CODE = range(6)
FIT_COLUMNS = 6

# Tukey's biweight has 95 % efficiency on Gaussian noise with this cutoff, in standard deviations.
TUKEY_WIDTH = 4.685
# Steps for which the robust fit keeps the given gain and offset.
FIXED_LIGHT_STEPS = 3
# Step [px] below which the patch is interpolated with the quintic spline's six taps; the steps before use the cubic's
# four.
FINE_STEP = 0.1
# Number of pixels that the steps before use: the fine steps correct the small loss of accuracy.
COARSE_PIXELS = 400
# Step at which a fit of low ZNCC is stopped. A step is at most 1.5 px long, and the basin of convergence two or three.
CHECK_STEP = 5
# Step at which most of a patch must fit robustly, and the greatest residual then, as a fraction of the patch's
# contrast: .6 corresponds to a ZNCC of .8, the least that is ever accepted.
ROBUST_CHECK_STEP = 8
MAX_MISFIT = 0.6
# The scale of the residuals is this quantile of them, so that half of a patch may be covered, over the same quantile of
# the absolute value of a standard normal variable.
SCALE_QUANTILE = 0.35
NORMAL_QUANTILE = 0.4538
# Pivot of a normal matrix, as a fraction of its diagonal, below which the pixels do not determine the solution.
SINGULAR = 1e-12


@njit(cache=True, nogil=True)
def inside(height, width, x, y, radius):
    """Whether a disc about (x, y) and the quintic spline's support lie within the image."""
    return x - radius >= 3.0 and y - radius >= 3.0 and x + radius <= width - 4.0 and y + radius <= height - 4.0


@njit(cache=True, nogil=True)
def is_positive_definite(matrix):
    """Whether a symmetric matrix (n, n) has an inverse, by Cholesky's pivots; false where it holds a NaN."""
    n = len(matrix)
    factor = np.zeros((n, n))
    for i in range(n):
        for j in range(i + 1):
            left = matrix[i, j]
            for k in range(j):
                left -= factor[i, k] * factor[j, k]
            if i == j:
                if not (left > SINGULAR * matrix[i, i] and left < np.inf):
                    return False
                factor[i, i] = np.sqrt(left)
            else:
                factor[i, j] = left / factor[j, j]
    return True


@njit(cache=True, nogil=True)
def count_pixels(cx, cy, radius):
    """Number of pixels within `radius` of the centre."""
    count = 0
    for iy in range(int(np.ceil(cy - radius)), int(np.floor(cy + radius)) + 1):
        half = np.sqrt(max(radius * radius - (iy - cy) ** 2, 0.0))
        count += int(np.floor(cx + half)) - int(np.ceil(cx - half)) + 1
    return count


@njit(cache=True, nogil=True)
def fill_patch(image, coefficients, cx, cy, radius, data, hessian_inverse, statistics):
    """Write the data of one patch and its inverse Hessian.

    Parameters
    ----------
    image, coefficients : (h, w) array
        The reference photograph [grey] and its cubic spline coefficients.
    cx, cy, radius : float
        The disc [px].
    data : (p, 6) array
        Receives dx, dy, f, jx, jy, jr of every pixel.
    hessian_inverse : (3, 3) array
        Receives the inverse Hessian for an f of unit norm.
    statistics : (3,) array
        Receives the norm of the reference about its mean [grey], its mean [grey], and the squared correlation length
        [px²].

    Returns
    -------
    bool
        Whether the patch has a texture, in both directions.
    """
    p = 0
    mean = 0.0
    for iy in range(int(np.ceil(cy - radius)), int(np.floor(cy + radius)) + 1):
        half = np.sqrt(max(radius * radius - (iy - cy) ** 2, 0.0))
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
    statistics[0] = norm
    statistics[1] = mean
    if norm < 0.5 * np.sqrt(count) or slope == 0.0:
        return False
    statistics[2] = power / slope
    h = np.zeros((3, 3))
    projection = np.zeros(3)
    level = np.zeros(3)
    for p in range(count):
        f = (data[p, 2] - mean) / norm
        data[p, 2] = f
        for k in range(3):
            data[p, 3 + k] /= norm
            projection[k] += data[p, 3 + k] * f
            level[k] += data[p, 3 + k]
    for p in range(count):
        for k in range(3):
            data[p, 3 + k] -= projection[k] * data[p, 2] + level[k] / count
    for p in range(count):
        for k in range(3):
            for m in range(3):
                h[k, m] += data[p, 3 + k] * np.float64(data[p, 3 + m])
    if not is_positive_definite(h):
        return False
    copy_matrix(np.linalg.inv(h), hessian_inverse)
    return True


@njit(cache=True, nogil=True)
def coarse_stride(count):
    """Stride of the pixels of a patch that the coarse steps use."""
    return max(count // COARSE_PIXELS, 1)


@njit(cache=True, nogil=True)
def count_coarse(count):
    """Number of pixels of a patch that the coarse steps use."""
    stride = coarse_stride(count)
    return (count + stride - 1) // stride


@njit(cache=True, nogil=True)
def pack_blocks(data, blocks):
    """Write the pixels (p, 6) in blocks (b, 6, 8), those of the coarse steps first; zeros follow the last."""
    count = len(data)
    stride = coarse_stride(count)
    for b in range(len(blocks)):
        for k in range(COLUMNS):
            for lane in range(LANES):
                blocks[b, k, lane] = 0.0
    place = 0
    for first in range(stride):
        for p in range(first, count, stride):
            for k in range(COLUMNS):
                blocks[place // LANES, k, place % LANES] = data[p, k]
            place += 1


@njit(cache=True, nogil=True)
def fill_coarse(data, coarse):
    """Write the inverse normal matrix (5, 5) of jx, jy, jr, f and 1 over the pixels of the coarse steps."""
    normal = np.zeros((5, 5))
    row = np.ones(5)
    for p in range(0, len(data), coarse_stride(len(data))):
        row[0], row[1], row[2], row[3] = data[p, 3], data[p, 4], data[p, 5], data[p, 2]
        for k in range(5):
            for m in range(5):
                normal[k, m] += row[k] * row[m]
    copy_matrix(np.linalg.inv(normal), coarse)


@njit(cache=True, nogil=True, error_model="numpy")
def fit_rigid(
    coefficients, blocks, count, coarse, hessian_inverse, radius, max_shift, min_zncc, tolerance, limit, pose, fit, sums
):
    """Fit one patch by inverse-compositional Gauss-Newton.

    Parameters
    ----------
    coefficients : (h, w) array
        Quintic spline coefficients of the photograph.
    blocks : (b, 6, 8) array
        The pixels of the patch, see `pack_blocks`.
    count : int
        Their number.
    coarse, hessian_inverse, radius
        The patch, see `fill_patch` and `fill_coarse`.
    max_shift : float
        Distance from the start [px] beyond which the fit is stopped.
    min_zncc : float
        ZNCC below which the fit is stopped at step `CHECK_STEP`: at a wrong place it would run to the limit.
    tolerance : float
        Step [px] below which the fit has converged.
    limit : int
        Greatest number of steps; 0: only the quality at the given pose is computed.
    pose : (3,) array
        Start and result: x, y [px], θ [rad].
    fit : (FIT_COLUMNS,) array
        Receives ZNCC, residual variance of a pixel [grey²], gain, offset [grey] (image = gain · f + offset, f of unit
        norm), fraction of the pixels used, code.
    sums : (6,) array
        Workspace.

    Notes
    -----
    With H = Σ jᵀj and g the interpolated photograph, a step is t = H⁻¹ Σ jᵀ g / gain, gain = Σ f g, and the warp is
    W ← W ∘ W(t)⁻¹ (Baker & Matthews 2004). The quintic coefficients read with the cubic spline's four taps give a
    sharper photograph without displacement. That, and a part of the pixels, is accurate enough for all steps but the
    last ones.
    """
    height, width = coefficients.shape
    coarse_count = count_coarse(count)
    x0, y0 = pose[0], pose[1]
    margin = int(radius) + 2
    fit[CODE] = UNFINISHED
    fit[KEPT] = 1.0
    fine = limit == 0
    for step in range(limit + 1):
        if not inside(height, width, pose[0], pose[1], radius):
            fit[CODE] = LEFT_IMAGE
            fit[ZNCC] = 0.0
            return
        bx, by = int(pose[0]) - margin, int(pose[1]) - margin
        ox, oy = np.float32(pose[0] - bx), np.float32(pose[1] - by)
        cos, sin = np.float32(np.cos(pose[2])), np.float32(np.sin(pose[2]))
        level = coefficients[int(pose[1]), int(pose[0])]
        if fine:
            used = count
            project_quintic(coefficients, blocks, used, bx, by, ox, oy, cos, sin, level, sums)
        else:
            used = coarse_count
            project_cubic(coefficients, blocks, used, bx, by, ox, oy, cos, sin, level, sums)
        sf, sx, sy, sr, s0, s1 = sums[0], sums[1], sums[2], sums[3], sums[4], sums[5]
        power = s1 - s0 * s0 / used
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
        if not gain > 0.0 or (step == CHECK_STEP and fit[ZNCC] < min_zncc):
            fit[CODE] = DIVERGED
            return
        if step == limit:
            return
        _compose(pose, tx, ty, tr, radius)
        if (pose[0] - x0) ** 2 + (pose[1] - y0) ** 2 > max_shift * max_shift:
            fit[CODE] = DIVERGED
            return
        length = abs(tx) + abs(ty) + radius * abs(tr)
        if not fine:
            fine = length < FINE_STEP or step == limit - 1
        elif length < tolerance:
            # The error after this step is far below the step. The sums before it are kept: their ZNCC differs by less
            # than the square of the tolerance.
            fit[CODE] = CONVERGED
            return


@njit(cache=True, nogil=True, error_model="numpy")
def fit_all(
    coefficients, blocks, start, count, coarse, hessian_inverse, radius, rows, max_shift, min_zncc, tolerance, limit,
    pose, fit,
):  # fmt: skip
    """Fit the patches `rows` (m,), of count[k] pixels in blocks[start[k] : start[k + 1]]; see `fit_rigid`."""
    sums = np.empty(SUMS)
    for m in range(len(rows)):
        k = rows[m]
        fit_rigid(
            coefficients, blocks[start[k] : start[k + 1]], count[k], coarse[k], hessian_inverse[k], radius[k],
            max_shift[m], min_zncc[m], tolerance, limit, pose[m], fit[m], sums,
        )  # fmt: skip


@njit(cache=True, nogil=True, inline="always")
def _compose(pose, tx, ty, tr, radius):
    """Set W ← W ∘ W(t)⁻¹ with a step of at most 1.5 px at the centre and at the rim."""
    longest = max(np.sqrt(tx * tx + ty * ty), radius * abs(tr))
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
def _scale_quantile(values):
    """Quantile SCALE_QUANTILE of values (n,), between the nearest two; NumPy's own takes 10 s more to compile."""
    ordered = np.sort(values)
    at = SCALE_QUANTILE * (len(values) - 1)
    k = int(at)
    return ordered[k] + (at - k) * (ordered[min(k + 1, len(values) - 1)] - ordered[k])


@njit(cache=True, nogil=True, error_model="numpy")
def fit_robust(coefficients, data, radius, max_shift, noise, gain, offset, limit, pose, fit, covariance):
    """Refit one patch with Tukey's weights.

    Parameters
    ----------
    coefficients, data, radius, max_shift, limit, pose, fit
        As of `fit_rigid`.
    noise : float
        Least scale of the residuals [grey]: the standard deviation of a clean one.
    gain, offset : float
        Initial gain and offset of the light [grey], as the neighbours have them.
    covariance : (3, 3) array
        Receives the covariance of the pose, from the weighted residual.

    Notes
    -----
    Iteratively reweighted least squares of g = gain · f(W(t)) + offset in t, gain and offset, with weights
    w = (1 − (r / (4.685 s))²)² for |r| < 4.685 s, else 0; r: residual, s: its scale.
    """
    height, width = coefficients.shape
    count = len(data)
    x0, y0 = pose[0], pose[1]
    margin = int(radius) + 2
    g = np.empty(count)
    misfit = np.empty(count)
    inverse = np.zeros((5, 5))
    a, b = gain, offset
    # The given light is fixed for some steps: a covering object would bias a free one, and all residuals would then be
    # large.
    fixed_steps = FIXED_LIGHT_STEPS
    restarted = False
    fit[CODE] = UNFINISHED
    for step in range(limit):
        if not inside(height, width, pose[0], pose[1], radius):
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
        scale = max(_scale_quantile(misfit) / NORMAL_QUANTILE, noise)
        if step == ROBUST_CHECK_STEP and scale > MAX_MISFIT * a / np.sqrt(count):
            fit[CODE] = DIVERGED
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
            fit[CODE] = DIVERGED
            fit[ZNCC] = 0.0
            return
        for k in range(5):
            normal[k, k] *= 1.0 + 1e-12
            for m in range(k):
                normal[k, m] = normal[m, k]
        if not is_positive_definite(normal):
            fit[CODE] = DIVERGED
            fit[ZNCC] = 0.0
            return
        inverse = np.linalg.inv(normal)
        tx, ty, tr, a_new, b_new = 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(5):
            tx += inverse[0, k] * right[k]
            ty += inverse[1, k] * right[k]
            tr += inverse[2, k] * right[k]
            a_new += inverse[3, k] * right[k]
            b_new += inverse[4, k] * right[k]
        norms = np.sqrt(max(sgg - sg * sg / sw, 1e-12) * max(sff - sf * sf / sw, 1e-12))
        fit[ZNCC] = (sfg - sf * sg / sw) / norms
        fit[RESIDUAL] = sww / max(sw - 5.0, 1.0)
        fit[KEPT] = sw / count
        if not a_new > 0.0:
            fit[CODE] = DIVERGED
            return
        # Before the light and the scale have converged, a large part of a step is an artefact.
        converged = abs(a_new - a) < 0.01 * a and abs(tx) + abs(ty) + radius * abs(tr) < 0.005
        if fixed_steps > 0:
            fixed_steps -= 1
            converged = False
        else:
            a, b = a_new, b_new
        fit[GAIN], fit[OFFSET] = a, b
        _compose(pose, tx, ty, tr, radius)
        if (pose[0] - x0) ** 2 + (pose[1] - y0) ** 2 > max_shift * max_shift:
            fit[CODE] = DIVERGED
            return
        if converged and not restarted and fit[ZNCC] < 0.95:
            # Often the place is right and only the light is wrong: restart with the given light.
            restarted = True
            fixed_steps = FIXED_LIGHT_STEPS
            a, b = gain, offset
        elif converged:
            fit[CODE] = CONVERGED
            break
    for k in range(3):
        for m in range(3):
            covariance[k, m] = inverse[k, m] * fit[RESIDUAL]
