"""Values of cubic and quintic splines between the pixels."""

from __future__ import annotations

import numpy as np
from numba import njit

HALF = np.float32(0.5)
ONE = np.float32(1.0)
SIXTH = np.float32(1.0 / 6.0)
TWO_THIRDS = np.float32(2.0 / 3.0)

# Coefficients of the quintic B-spline's polynomials (Unser, Aldroubi & Eden 1993) in the distance from its middle.
ONE_120TH = np.float32(1.0 / 120.0)
ELEVEN_20THS = np.float32(11.0 / 20.0)
SEVENTEEN_40THS = np.float32(17.0 / 40.0)
QUARTER, TWELFTH = np.float32(0.25), np.float32(1.0 / 12.0)
FIVE_8THS, SEVEN_4THS, FIVE_4THS = np.float32(5.0 / 8.0), np.float32(7.0 / 4.0), np.float32(5.0 / 4.0)
THREE_8THS, ONE_24TH = np.float32(3.0 / 8.0), np.float32(1.0 / 24.0)


@njit(cache=True, nogil=True, inline="always")
def interpolate_cubic(coefficients, ix, iy, tx, ty):
    """Interpolate the cubic spline at (ix + tx, iy + ty), 0 ≤ t < 1."""
    sx = ONE - tx
    ax = sx * sx * sx * SIXTH
    dx = tx * tx * tx * SIXTH
    bx = TWO_THIRDS - tx * tx * (ONE - HALF * tx)
    cx = ONE - ax - bx - dx
    sy = ONE - ty
    ay = sy * sy * sy * SIXTH
    dy = ty * ty * ty * SIXTH
    by = TWO_THIRDS - ty * ty * (ONE - HALF * ty)
    cy = ONE - ay - by - dy
    c = coefficients
    r0 = ax * c[iy - 1, ix - 1] + bx * c[iy - 1, ix] + cx * c[iy - 1, ix + 1] + dx * c[iy - 1, ix + 2]
    r1 = ax * c[iy, ix - 1] + bx * c[iy, ix] + cx * c[iy, ix + 1] + dx * c[iy, ix + 2]
    r2 = ax * c[iy + 1, ix - 1] + bx * c[iy + 1, ix] + cx * c[iy + 1, ix + 1] + dx * c[iy + 1, ix + 2]
    r3 = ax * c[iy + 2, ix - 1] + bx * c[iy + 2, ix] + cx * c[iy + 2, ix + 1] + dx * c[iy + 2, ix + 2]
    return ay * r0 + by * r1 + cy * r2 + dy * r3


@njit(cache=True, nogil=True, inline="always")
def interpolate_quintic(coefficients, ix, iy, tx, ty):
    """Interpolate the quintic spline at (ix + tx, iy + ty), 0 ≤ t < 1.

    At a quarter of a pixel the cubic spline displaces a speckle of two pixels by .003 px towards the half, the quintic
    one by .0007 px.
    """
    sx = ONE - tx
    ux = tx * tx
    vx = sx * sx
    ax = vx * vx * sx * ONE_120TH
    fx = ux * ux * tx * ONE_120TH
    bx = _flank(ONE + tx)
    ex = _flank(ONE + sx)
    cx = ELEVEN_20THS - ux * (HALF - ux * (QUARTER - TWELFTH * tx))
    dx = ELEVEN_20THS - vx * (HALF - vx * (QUARTER - TWELFTH * sx))
    sy = ONE - ty
    uy = ty * ty
    vy = sy * sy
    weights = (
        vy * vy * sy * ONE_120TH,
        _flank(ONE + ty),
        ELEVEN_20THS - uy * (HALF - uy * (QUARTER - TWELFTH * ty)),
        ELEVEN_20THS - vy * (HALF - vy * (QUARTER - TWELFTH * sy)),
        _flank(ONE + sy),
        uy * uy * ty * ONE_120TH,
    )
    c = coefficients
    value = np.float32(0.0)
    for k in range(6):
        row = iy - 2 + k
        value += weights[k] * (
            ax * c[row, ix - 2] + bx * c[row, ix - 1] + cx * c[row, ix]
            + dx * c[row, ix + 1] + ex * c[row, ix + 2] + fx * c[row, ix + 3]
        )  # fmt: skip
    return value


@njit(cache=True, nogil=True, inline="always")
def _flank(x):
    """The quintic B-spline at a distance 1 ≤ x < 2."""
    return SEVENTEEN_40THS + x * (FIVE_8THS - x * (SEVEN_4THS - x * (FIVE_4THS - x * (THREE_8THS - ONE_24TH * x))))
