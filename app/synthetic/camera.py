"""A camera model: a body is drawn on sub-pixels, blurred, and summed over each pixel, tile by tile.

A pixel's value is the mean over the square pixel of the painted scene after the lens's Gaussian blur. Both are
computed from 3 × 3 sub-pixels, each with a soft edge, which leaves almost no aliasing. Sub-pixels keep their place in a
pixel, so a body that moves by one pixel gives the same grey levels one pixel further.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .speckle_kernels import FINE, SMOOTHING, collect_light

TILE = 192  # [px], side of the largest square drawn at once: its sub-pixels fit in a processor's cache
TAIL = 4.0  # [standard deviation], where the blur is cut off


class Tile(NamedTuple):
    """A rectangle of pixels, both ends included, and its sub-pixels."""

    top: int
    bottom: int
    left: int
    right: int
    glow: NDArray[np.float32]  # (rows, columns) of sub-pixels: covered fraction × grey level, to be drawn
    fraction: NDArray[np.float32]  # the same shape: covered fraction, to be drawn
    margin: int  # sub-pixels before the centre of the first pixel, in both directions

    def within(self, x: float, y: float) -> tuple[float, float]:
        """Convert a point of the picture [px] to this tile [sub-pixel]."""
        return (x - self.left) * FINE + self.margin, (y - self.top) * FINE + self.margin


class Camera:
    """The light collected by each pixel (height, width) and the covered fraction of each pixel."""

    def __init__(self, width: int, height: int, blur: float) -> None:
        self.light = np.zeros((height, width), dtype=np.float32)  # [grey]
        self.covered = np.zeros((height, width), dtype=np.float32)
        self._taps = pixel_response(blur)
        self._glow, self._fraction = np.empty((2, (FINE * TILE + len(self._taps)) ** 2), dtype=np.float32)
        self._columns = np.empty((2, FINE * TILE + len(self._taps)), dtype=np.float64)

    def tiles(self, low: tuple[float, float], high: tuple[float, float]) -> Iterator[Tile]:
        """Yield the tiles that a body between two corners (x, y) [px] reaches; each is added after it was drawn."""
        margin = len(self._taps) // 2
        reach = margin / FINE + 1.0
        height, width = self.light.shape
        first_row, last_row = max(0, math.floor(low[1] - reach)), min(height - 1, math.ceil(high[1] + reach))
        first_column, last_column = max(0, math.floor(low[0] - reach)), min(width - 1, math.ceil(high[0] + reach))
        for top in range(first_row, last_row + 1, TILE):
            bottom = min(top + TILE - 1, last_row)
            for left in range(first_column, last_column + 1, TILE):
                right = min(left + TILE - 1, last_column)
                shape = FINE * (bottom - top) + len(self._taps), FINE * (right - left) + len(self._taps)
                size = shape[0] * shape[1]
                tile = Tile(
                    top,
                    bottom,
                    left,
                    right,
                    self._glow[:size].reshape(shape),
                    self._fraction[:size].reshape(shape),
                    margin,
                )
                yield tile
                collect_light(self.light, self.covered, tile.glow, tile.fraction, self._taps, top, left, self._columns)


def pixel_response(blur: float) -> NDArray[np.float64]:
    """Compute the weights (odd,) of the sub-pixels about a pixel's centre, of sum 1: its own three, blurred.

    The Gaussian's variance is blur² [px²] minus the variance of the sub-pixels' soft edges and spacing.
    """
    variance = FINE**2 * (blur**2 + 1 / 12) - (FINE**2 - 1) / 12 - SMOOTHING**2  # [sub-pixel²]
    if variance <= 0:
        return np.full(FINE, 1 / FINE)
    half = math.ceil(TAIL * math.sqrt(variance))
    gauss = np.exp(-0.5 * np.arange(-half, half + 1.0) ** 2 / variance)
    return np.convolve(gauss / gauss.sum(), np.full(FINE, 1 / FINE))
