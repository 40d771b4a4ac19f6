"""Paint of rods and bars: random dots of several sizes, drawn once per seed.

A body's dots depend on the seed, its row and its size alone, not on its position or on other bodies. Dots fall
independently of one another (a Boolean model), so n dots of area a per area A leave the fraction exp(−n a/A) unpainted.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..solver.bodies.grains import Array

STRENGTH = (0.85, 1.0)  # weakest and strongest dot, of full black
RIM_DARKNESS = (0.5, 1.5)  # of a rod's rim over the mean: least and greatest
MARK_ENLARGEMENT = 1.6  # size of a bar's marks over that of a rod's dots
STRIP = 256.0  # [px], a bar is painted strip by strip, so that a longer bar keeps its marks
BACKING_PITCH = 6  # [px], grain of the backing's texture

_BACKING, _ROD, _BAR = 0, 1, 2  # second word of a seed: independent streams for each kind of body


@dataclass(frozen=True, slots=True)
class Paint:
    """The dots of several bodies, in the bodies' own frames."""

    dots: Array  # (m, 4): x, y, radius [px] and strength in [0, 1]
    offset: NDArray[np.int64]  # (bodies + 1,): those of body k are offset[k] : offset[k + 1]


@dataclass(frozen=True, slots=True)
class RodPaint:
    """n painted rods."""

    paint: Paint  # x, y counter-clockwise about the rod's centre, y up at rotation 0
    brightness: Array  # (n,) of the end face, about 1
    rim: Array  # (n,) darkness of the rim, about 1
    tilt: Array  # (n, 2) picture's x, y (down): towards the side whose rim is darker; length in [0, 1]


def paint_rods(
    radius: Array, *, seed: int, coverage: float, dot_radius: tuple[float, float], brightness_range: float
) -> RodPaint:
    """Paint n rods of the given radii (n,) [px] with dots of radii between the two given [px]."""
    n = len(radius)
    dots, brightness, rim, tilt = [], np.empty(n), np.empty(n), np.empty((n, 2))
    for k, size in enumerate(radius):
        generator = np.random.default_rng([seed, _ROD, k])
        brightness[k] = 1.0 + brightness_range * generator.uniform(-1.0, 1.0)
        rim[k] = generator.uniform(*RIM_DARKNESS)
        direction, length = generator.uniform(0.0, 2 * math.pi), math.sqrt(generator.uniform())
        tilt[k] = length * math.cos(direction), length * math.sin(direction)
        reach = size + dot_radius[1]  # a dot whose centre is off the face may still touch it
        x, y = generator.uniform(-reach, reach, (2, _dot_count(4 * reach**2, coverage, dot_radius)))
        near = x * x + y * y < reach**2
        dots.append(_draw_dots(generator, x[near], y[near], dot_radius))
    return RodPaint(_gather(dots), brightness, rim, tilt)


def paint_bars(
    length: Array, thickness: float, *, seed: int, coverage: float, dot_radius: tuple[float, float]
) -> Paint:
    """Paint w bars of the given lengths (w,) [px]: x is the distance along the bar from endpoint 0, y the depth."""
    sizes = (dot_radius[0] * MARK_ENLARGEMENT, dot_radius[1] * MARK_ENLARGEMENT)
    low, high = -sizes[1], thickness + sizes[1]
    count = _dot_count(STRIP * (high - low), coverage, sizes)
    bars = []
    for k, extent in enumerate(length):
        strips = []
        for strip in range(-1, math.floor((extent + sizes[1]) / STRIP) + 1):
            generator = np.random.default_rng([seed, _BAR, k, strip + 1])
            along = STRIP * (strip + generator.random(count))
            strips.append(_draw_dots(generator, along, generator.uniform(low, high, count), sizes))
        bars.append(np.concatenate(strips))
    return _gather(bars)


def paint_backing(width: int, height: int, seed: int) -> NDArray[np.float32]:
    """Random values in [−1, 1] on the nodes of a coarse grid over the picture; interpolated where it is exposed."""
    shape = (height // BACKING_PITCH + 2, width // BACKING_PITCH + 2)
    return np.random.default_rng([seed, _BACKING]).random(shape, dtype=np.float32) * np.float32(2) - np.float32(1)


def _dot_count(area: float, coverage: float, dot_radius: tuple[float, float]) -> int:
    low, high = dot_radius
    mean_area = math.pi * (low * low + low * high + high * high) / 3.0  # radii are uniform between the two
    return round(-math.log1p(-coverage) * area / mean_area)


def _draw_dots(generator: np.random.Generator, x: Array, y: Array, dot_radius: tuple[float, float]) -> Array:
    size, strength = generator.uniform(*dot_radius, len(x)), generator.uniform(*STRENGTH, len(x))
    return np.stack([x, y, size, strength], axis=1)


def _gather(dots: list[Array]) -> Paint:
    offset = np.zeros(len(dots) + 1, dtype=np.int64)
    np.cumsum([len(part) for part in dots], out=offset[1:])
    return Paint(np.concatenate(dots) if dots else np.zeros((0, 4)), offset)
