"""Numbers that compiled loops draw: normal ones above a bound or between two, and the logarithm of the normal CDF."""

from __future__ import annotations

import math

from numba import njit

FAR = 0.45  # standard deviations: a bound beyond it is better met by an exponential proposal (Robert 1995)
WIDE = 1.5  # standard deviations: an interval across zero that is wider is better met by normal draws
HALF = math.sqrt(0.5)
LOG_ROOT_TWO_PI = 0.5 * math.log(2.0 * math.pi)


@njit(cache=True, nogil=True)
def log_normal_cdf(x):  # type: ignore[no-untyped-def]
    """Give ln Φ(x), right to 1e-7 however far in the tail."""
    if x > 6.0:
        return 0.0
    if x > -20.0:
        return math.log(0.5 * math.erfc(-HALF * x))
    y = 1.0 / (x * x)
    return -0.5 * x * x - math.log(-x) - LOG_ROOT_TWO_PI + math.log1p(-y * (1.0 - 3.0 * y * (1.0 - 5.0 * y)))


@njit(cache=True, nogil=True)
def draw_above(rng, low):  # type: ignore[no-untyped-def]
    """Draw a standard normal number that is not below `low`."""
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


@njit(cache=True, nogil=True)
def draw_between(rng, low, high):  # type: ignore[no-untyped-def]
    """Draw a standard normal number between low and high."""
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


@njit(cache=True, nogil=True)
def _draw_right(rng, low, high):  # type: ignore[no-untyped-def]
    """Draw between bounds that lie to the right of zero."""
    if (high - low) * (high + low) < 4.0:  # the density falls by less than e² across it
        while True:
            x = low + (high - low) * rng.random()
            if rng.random() <= math.exp(0.5 * (low - x) * (low + x)):
                return x
    x = draw_above(rng, low)
    while x > high:
        x = draw_above(rng, low)
    return x
