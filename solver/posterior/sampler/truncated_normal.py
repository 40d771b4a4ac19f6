"""The normal distribution's tail, its inverse, and draws above a bound, for loops over lanes in single precision.

A draw is the inverse of the tail at a uniform number: it takes the same time in every lane, and single precision is
enough. The distribution of draws errs by less than 1 % at any place, by .1 % on average where a bound is far in the
tail, and by 1e-4 elsewhere.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .lanes import HALF, ONE, TWO, ZERO, exponential, logarithm

ROOT_TWO_PI = math.sqrt(2.0 * math.pi)
# Coefficients of R(t) = u (M0 + M1 u + …), u = 1/(1 + BEND t), fitted at Chebyshev points.
BEND = np.float32(0.28)
M0, M1, M2, M3, M4, M5, M6, M7, M8, M9, M10 = (
    np.float32(x)
    for x in (
        0.27999999843, 0.28000050547, 0.25802193254, 0.21465689624, 0.14836212387, 0.11530062203, -0.0750239454,
        0.20547316451, -0.31753842777, 0.18032692722, -0.03626566357,
    )
)  # fmt: skip
DENSITY = np.float32(1.0 / ROOT_TWO_PI)  # of the normal distribution at 0
FAR = np.float32(6.0)  # standard deviations: a draw above such a bound nearly follows an exponential distribution
LEAST_TAIL = np.float32(2.0**-24)
LOG_4 = np.float32(math.log(4.0))
# x of a tail p = Q(x) is (1 − 2p) times a function of w = −ln(4 p (1 − p)): a polynomial in w up to JOINT, and in √w
# beyond, down to the tail at FAR times the least uniform number. Both variables are scaled to −1 … 1; fitted at
# Chebyshev points.
JOINT = np.float32(5.0)
W_MIDDLE, W_SCALE = np.float32(2.5), np.float32(0.4)
A0, A1, A2, A3, A4, A5, A6, A7 = (
    np.float32(x)
    for x in (
        2.12331309, 0.872006763, -0.0369106956, -0.027704192, 0.0119992657, -0.000605409302, -0.00109528462,
        0.00029565631,
    )
)  # fmt: skip
ROOT_MIDDLE, ROOT_SCALE = np.float32(4.168033988749895), np.float32(0.5176074497050476)
B0, B1, B2, B3, B4, B5, B6, B7 = (
    np.float32(x)
    for x in (
        5.67017429, 2.75918828, 0.00577274054, -0.0079282947, -0.00102406392, 0.000954241632, 0.0106636213,
        -0.00788904637,
    )
)  # fmt: skip


@njit(cache=True, nogil=True, forceinline=True, error_model="numpy", fastmath={"contract"})
def mills_ratio(t):  # type: ignore[no-untyped-def]
    """Compute Mills' ratio R(t) = (1 − Φ(t))/φ(t) for t ≥ 0, to a relative error of 1e-7 at any t."""
    u = ONE / (ONE + BEND * t)
    square = u * u
    low = (M0 + M1 * u) + square * ((M2 + M3 * u) + square * (M4 + M5 * u))
    high = (M6 + M7 * u) + square * ((M8 + M9 * u) + square * M10)
    return u * (low + square * square * square * high)


@njit(forceinline=True, error_model="numpy", fastmath={"contract"})
def scaled_log_tail(low):  # type: ignore[no-untyped-def]
    """Compute ln Q(low) without the term −low²/2 where low > 0, and with it. Q is the tail, 1 − Φ."""
    half_square = HALF * low * low
    tail = mills_ratio(abs(low)) * DENSITY
    scaled = logarithm(tail if low > ZERO else ONE - tail * exponential(-half_square))
    return scaled, scaled - (half_square if low > ZERO else ZERO)


@njit(forceinline=True, error_model="numpy", fastmath={"contract"})
def normal_of(log_tail):  # type: ignore[no-untyped-def]
    """Compute x with ln Q(x) = log_tail < 0: of the logarithm of a uniform number, a standard normal number."""
    p = exponential(log_tail)
    w = max(-LOG_4 - log_tail - logarithm(max(ONE - p, LEAST_TAIL)), ZERO)
    c = (w - W_MIDDLE) * W_SCALE
    near = A0 + c * (A1 + c * (A2 + c * (A3 + c * (A4 + c * (A5 + c * (A6 + c * A7))))))
    s = min((np.float32(math.sqrt(w)) - ROOT_MIDDLE) * ROOT_SCALE, ONE)
    far = B0 + s * (B1 + s * (B2 + s * (B3 + s * (B4 + s * (B5 + s * (B6 + s * B7))))))
    return (ONE - TWO * p) * (near if w < JOINT else far)


@njit(forceinline=True, error_model="numpy", fastmath={"contract"})
def distance_above(low, log_tail, log_uniform):  # type: ignore[no-untyped-def]
    """Compute x − low ≥ 0, x drawn from the standard normal distribution above low.

    Arguments are ln Q(low) and the logarithm of a uniform number.

    Notes
    -----
    Q(x) = u Q(low). Far in the tail, with e = −ln u and Q(x) ∝ exp(−x²/2 − ln x − 1/x²), x − low solves
    (low + 1/low) d + ½ (1 − 1/low²) d² = e.
    """
    near = normal_of(log_tail + log_uniform) - low
    inverse = ONE / max(low, ONE)
    slope = max(low, ONE) + inverse
    twice = -TWO * log_uniform
    far = twice / (slope + np.float32(math.sqrt(slope * slope + (ONE - inverse * inverse) * twice)))
    return max(far if low > FAR else near, ZERO)


@njit(forceinline=True, error_model="numpy", fastmath={"contract"})
def draw_above(low, log_uniform):  # type: ignore[no-untyped-def]
    """Compute x − low ≥ 0 of a single bound of double precision."""
    bound = np.float32(low)
    _, log_tail = scaled_log_tail(bound)
    return np.float64(distance_above(bound, log_tail, log_uniform))
