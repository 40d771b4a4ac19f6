"""Kernels that draw rods and bars on sub-pixels, sum them over pixels and add the backing.

Each body adds its covered fraction of a pixel times its grey level, which is exact for blurred bodies that touch but do
not overlap. Rows and columns count sub-pixels of a tile while drawing, x to the right and y down.
"""

from __future__ import annotations

import math

from numba import njit

from .paint import BACKING_PITCH

FINE = 3  # sub-pixels per pixel, along a side
SMOOTHING = 0.6  # [sub-pixel], standard deviation of a sub-pixel's own soft edge
EDGE = 3.0 * SMOOTHING  # [sub-pixel], half the support of (1 − t²)³ is three of its standard deviations


@njit(cache=True)
def blurred_step(t):
    """Integrate the kernel (1 − t²)³, normalised to 0 at t ≤ −1 and 1 at t ≥ 1."""
    if t <= -1.0:
        return 0.0
    if t >= 1.0:
        return 1.0
    s = t * t
    return 0.5 + t * (1.0 - s * (1.0 - s * (0.6 - s / 7.0))) * (35.0 / 32.0)


@njit(cache=True)
def draw_rod(glow, fraction, x, y, radius, cosine, sine, dots, white, black, rim_shading, tilt, rim_width):
    """Draw a rod on a tile: its dots first, then face, rim and edge. Lengths in sub-pixels, dots in pixels."""
    glow[:] = 1.0
    for k in range(dots.shape[0]):
        # the rotation is counter-clockwise with y up; here y is down
        dot_x = x + FINE * (cosine * dots[k, 0] - sine * dots[k, 1])
        dot_y = y - FINE * (sine * dots[k, 0] + cosine * dots[k, 1])
        _multiply_dot(glow, dot_x, dot_y, FINE * dots[k, 2], dots[k, 3])
    shade_from = max(0.0, radius - rim_width) ** 2
    rows, columns = glow.shape
    for row in range(rows):
        for column in range(columns):
            dx, dy = column - x, row - y
            square = dx * dx + dy * dy
            part = blurred_step((radius * radius - square) / (2.0 * radius * EDGE))
            fraction[row, column] = part
            if part > 0.0:
                grey = black + (white - black) * glow[row, column]
                if square > shade_from:
                    distance = math.sqrt(square)
                    darkening = rim_shading * (1.0 + (dx * tilt[0] + dy * tilt[1]) / distance)
                    grey *= 1.0 - min(1.0, darkening) * blurred_step((distance - radius) / rim_width)
                glow[row, column] = part * grey
            else:
                glow[row, column] = 0.0


@njit(cache=True)
def draw_bar(glow, fraction, x, y, along, length, thickness, dots, metal, black):
    """Draw a bar on a tile: `along` is its unit vector from endpoint 0 at (x, y); its body lies to the right."""
    inward_x, inward_y = -along[1], along[0]  # the right hand side, with y down
    glow[:] = 1.0
    for k in range(dots.shape[0]):
        dot_x = x + FINE * (dots[k, 0] * along[0] + dots[k, 1] * inward_x)
        dot_y = y + FINE * (dots[k, 0] * along[1] + dots[k, 1] * inward_y)
        _multiply_dot(glow, dot_x, dot_y, FINE * dots[k, 2], dots[k, 3])
    rows, columns = glow.shape
    for row in range(rows):
        for column in range(columns):
            dx, dy = column - x, row - y
            s = dx * along[0] + dy * along[1]
            q = dx * inward_x + dy * inward_y
            part = blurred_step(q / EDGE) * blurred_step((thickness - q) / EDGE)
            part *= blurred_step(s / EDGE) * blurred_step((length - s) / EDGE)
            fraction[row, column] = part
            glow[row, column] = part * (black + (metal - black) * glow[row, column])


@njit(cache=True)
def collect_light(light, covered, glow, fraction, taps, top, left, columns):
    """Add a tile's sub-pixels, weighted by `taps` about each pixel's centre, to its pixels from (top, left) on."""
    fine_rows, fine_columns = glow.shape
    count = taps.shape[0]
    for row in range((fine_rows - count) // FINE + 1):
        columns[:, :fine_columns] = 0.0
        for k in range(count):
            weight = taps[k]
            for column in range(fine_columns):
                columns[0, column] += weight * glow[FINE * row + k, column]
                columns[1, column] += weight * fraction[FINE * row + k, column]
        for column in range((fine_columns - count) // FINE + 1):
            grey, part = 0.0, 0.0
            for k in range(count):
                grey += taps[k] * columns[0, FINE * column + k]
                part += taps[k] * columns[1, FINE * column + k]
            light[top + row, left + column] += grey
            covered[top + row, left + column] += part


@njit(cache=True)
def add_backing(scene, covered, backing, gap, gap_texture, light):
    """Fill the uncovered pixels with the backing, and apply the uneven light."""
    height, width = scene.shape
    half = 0.5 * max(height, width)
    for row in range(height):
        i = row // BACKING_PITCH
        v = _ease((row - i * BACKING_PITCH) / BACKING_PITCH)
        y = (row - 0.5 * height) / half
        for column in range(width):
            grey = scene[row, column]
            fraction = covered[row, column]
            if fraction > 1.0:
                grey /= fraction
            elif fraction < 1.0:
                j = column // BACKING_PITCH
                u = _ease((column - j * BACKING_PITCH) / BACKING_PITCH)
                above = backing[i, j] + u * (backing[i, j + 1] - backing[i, j])
                below = backing[i + 1, j] + u * (backing[i + 1, j + 1] - backing[i + 1, j])
                grey += (1.0 - fraction) * max(0.0, gap + gap_texture * (above + v * (below - above)))
            x = (column - 0.5 * width) / half
            scene[row, column] = grey * (1.0 + light * (0.6 * x - 0.3 * y + 0.1 * (1.0 - x * x - y * y)))


@njit(cache=True)
def _ease(t):
    return t * t * (3.0 - 2.0 * t)


@njit(cache=True)
def _multiply_dot(unpainted, x, y, radius, strength):
    """Multiply the unpainted fraction by the fraction that this dot leaves unpainted.

    The distance to the dot's edge is approximated by (r² − d²)/2r: it equals r − d to first order at the edge, is
    smooth at the dot's centre and preserves the dot's area.
    """
    square_reach = radius * radius + 2.0 * radius * EDGE
    reach = math.sqrt(square_reach)
    scale = 0.5 / (radius * EDGE)
    rows, columns = unpainted.shape
    for row in range(max(0, math.ceil(y - reach)), min(rows - 1, math.floor(y + reach)) + 1):
        square_y = (row - y) * (row - y)
        for column in range(max(0, math.ceil(x - reach)), min(columns - 1, math.floor(x + reach)) + 1):
            square = square_y + (column - x) * (column - x)
            if square < square_reach:
                unpainted[row, column] *= 1.0 - strength * blurred_step((radius * radius - square) * scale)
