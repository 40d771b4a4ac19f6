"""The loop over grains: the error of every radius together with those of its centre in all frames."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from solver.posterior.sampler.records import CX, CY, DELTA


@njit(cache=True, nogil=True, error_model="numpy")
def factorize_errors(centres, law, room):  # type: ignore[no-untyped-def]
    """The precision of a grain's errors, which follows from the widths of its pairs alone, factorised.

    Of every row in room.fixed: 1/L₀₀, L₁₀, 1/L₁₁ of the Cholesky factor L of ε's precision, and L⁻¹ of its tie to δ;
    in room.precision that of δ once all ε are integrated out.
    """
    start, row, deviation, radius_deviation = centres.start, centres.row, centres.deviation, centres.radius_deviation
    toward, told, fixed = room.toward, room.told, room.fixed
    n, m = len(radius_deviation), len(deviation)
    for g in range(n):
        room.precision[g] = 1.0 / radius_deviation[g] ** 2
    for g in range(m):
        xx = 1.0 / deviation[g] ** 2
        yy, xy, xr, yr, total = xx, 0.0, 0.0, 0.0, 0.0
        for q in range(start[g], start[g + 1]):
            tight, nx, ny = told[row[q], 0], toward[q, 0], toward[q, 1]
            xx += tight * nx * nx
            xy += tight * nx * ny
            yy += tight * ny * ny
            xr += tight * nx
            yr += tight * ny
            total += tight
        l11 = math.sqrt(xx)
        l21 = xy / l11
        l22 = math.sqrt(yy - l21 * l21)
        tx = xr / l11
        ty = (yr - l21 * tx) / l22
        fixed[g, 0], fixed[g, 1], fixed[g, 2], fixed[g, 3], fixed[g, 4] = 1.0 / l11, l21, 1.0 / l22, tx, ty
        room.precision[g % n] += total - tx * tx - ty * ty


@njit(cache=True, nogil=True, error_model="numpy")
def draw_errors(rng, centres, room, state):  # type: ignore[no-untyped-def]
    """Draw the error of every radius together with those of its centre in all frames, from their Gaussian law."""
    body, start, row = state.body, centres.start, centres.row
    toward, other, told, fixed, precision = room.toward, room.other, room.told, room.fixed, room.precision
    n, m = len(precision), len(body)
    mean = np.empty((m // n, 2))  # of every frame: L⁻¹ of what pulls ε
    for first in range(n):
        pull = 0.0
        for k in range(m // n):
            g = first + k * n
            bx, by = 0.0, 0.0
            for q in range(start[g], start[g + 1]):
                c, o, nx, ny = row[q], other[q], toward[q, 0], toward[q, 1]
                rest = told[c, 1]  # height over contact but for what this grain adds, and what it should be
                if o >= 0:
                    rest += nx * body[o, CX] + ny * body[o, CY] - body[o, DELTA]
                rest *= told[c, 0]
                bx += nx * rest
                by += ny * rest
                pull += rest
            ux = bx * fixed[g, 0]
            uy = (by - fixed[g, 1] * ux) * fixed[g, 2]
            pull -= fixed[g, 3] * ux + fixed[g, 4] * uy
            mean[k, 0], mean[k, 1] = ux, uy
        delta = pull / precision[first] + rng.standard_normal() / math.sqrt(precision[first])
        for k in range(m // n):
            g = first + k * n
            u = mean[k, 0] - delta * fixed[g, 3] + rng.standard_normal()
            v = mean[k, 1] - delta * fixed[g, 4] + rng.standard_normal()
            y = v * fixed[g, 2]
            body[g, CX], body[g, CY], body[g, DELTA] = (u - fixed[g, 1] * y) * fixed[g, 0], y, delta
