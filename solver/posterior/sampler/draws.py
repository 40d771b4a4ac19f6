"""Truncated normal draws and the tail of the normal CDF, for compiled loops."""

from __future__ import annotations

import math

from numba import njit

FAR = 0.45  # standard deviations: above this bound an exponential proposal is faster (Robert 1995)
WIDE = 1.5  # standard deviations: across zero, wider intervals use normal proposals, others uniform ones
ROOT_TWO_PI = math.sqrt(2.0 * math.pi)
CERTAIN = 6.0  # standard deviations above which the normal CDF is 1 to nine places
# Coefficients of R(t) = u (M0 + M1 u + …), u = 1/(1 + BEND t), fitted at Chebyshev points.
BEND = 0.28
M0, M1, M2, M3, M4, M5 = 0.27999999843, 0.28000050547, 0.25802193254, 0.21465689624, 0.14836212387, 0.11530062203
M6, M7, M8, M9, M10 = -0.0750239454, 0.20547316451, -0.31753842777, 0.18032692722, -0.03626566357


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def mills_ratio(t):  # type: ignore[no-untyped-def]
    """Compute Mills' ratio R(t) = (1 − Φ(t))/φ(t) for t ≥ 0, to a relative error of 1e-8 at any t."""
    u = 1.0 / (1.0 + BEND * t)
    square = u * u
    low = (M0 + M1 * u) + square * ((M2 + M3 * u) + square * (M4 + M5 * u))
    high = (M6 + M7 * u) + square * ((M8 + M9 * u) + square * M10)
    return u * (low + square * square * square * high)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def scaled_cdf(x):  # type: ignore[no-untyped-def]
    """Compute Φ(x)/φ(x) for x ≤ 0 and Φ(x)/φ(0) for x > 0, which neither underflows nor overflows."""
    if x <= 0.0:
        return mills_ratio(-x)
    return ROOT_TWO_PI if x > CERTAIN else ROOT_TWO_PI - mills_ratio(x) * math.exp(-0.5 * x * x)


@njit(cache=True, nogil=True, error_model="numpy")
def draw_above(rng, low):  # type: ignore[no-untyped-def]
    """Draw from the standard normal distribution truncated to [low, ∞)."""
    if low < FAR:
        x = rng.standard_normal()
        while x < low:
            x = rng.standard_normal()
        return x
    rate = 0.5 * (low + math.sqrt(low * low + 4.0))
    while True:
        x = low - math.log(1.0 - rng.random()) / rate
        if rng.random() <= math.exp(-0.5 * (x - rate) ** 2):
            return x


@njit(cache=True, nogil=True, error_model="numpy")
def draw_between(rng, low, high):  # type: ignore[no-untyped-def]
    """Draw from the standard normal distribution truncated to [low, high]."""
    if low > 0.0:
        return _draw_right(rng, low, high)
    if high < 0.0:
        return -_draw_right(rng, -high, -low)
    if high - low > WIDE:
        x = rng.standard_normal()
        while x < low or x > high:
            x = rng.standard_normal()
        return x
    while True:
        x = low + (high - low) * rng.random()
        if rng.random() <= math.exp(-0.5 * x * x):
            return x


@njit(cache=True, nogil=True, error_model="numpy")
def _draw_right(rng, low, high):  # type: ignore[no-untyped-def]
    """Draw between bounds above zero."""
    if (high - low) * (high + low) < 4.0:  # the density falls by less than e² across it
        while True:
            x = low + (high - low) * rng.random()
            if rng.random() <= math.exp(0.5 * (low - x) * (low + x)):
                return x
    x = draw_above(rng, low)
    while x > high:
        x = draw_above(rng, low)
    return x
