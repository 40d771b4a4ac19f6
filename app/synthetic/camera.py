"""How light becomes a pixel: a body is drawn on sub-pixels, blurred, summed over each pixel, tile by tile.

A pixel is the lens's Gaussian blur and the square pixel's mean of what is painted. Both are taken from 3 × 3
sub-pixels, each of which carries a soft edge of its own, so that next to nothing is left for the sub-pixels to alias.
Sub-pixels keep their place in a pixel, so a body that moves by one pixel gives the same grey levels one pixel on.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .speckle_kernels import FINE, SMOOTHING, collect_light

TILE = 192  # [px], the largest square drawn at once: its sub-pixels fit in a processor's cache
TAIL = 4.0  # the blur is cut off at this many standard deviations


class Tile(NamedTuple):
    """A rectangle of pixels, both ends included, and its sub-pixels."""

    top: int
    bottom: int
    left: int
    right: int
    glow: NDArray[np.float32]  # (rows, columns) of sub-pixels: covered share × grey level, to be drawn
    share: NDArray[np.float32]  # the same shape: covered share, to be drawn
    margin: int  # sub-pixels before the centre of the first pixel, in both directions

    def within(self, x: float, y: float) -> tuple[float, float]:
        """A point of the picture [px] in this tile [sub-pixel]."""
        return (x - self.left) * FINE + self.margin, (y - self.top) * FINE + self.margin


class Camera:
    """A picture under way, (height, width): the light collected so far and how much of each pixel is covered."""

    def __init__(self, width: int, height: int, blur: float) -> None:
        self.light = np.zeros((height, width), dtype=np.float32)  # [grey]
        self.covered = np.zeros((height, width), dtype=np.float32)
        self._taps = pixel_response(blur)
        self._glow, self._share = np.empty((2, (FINE * TILE + len(self._taps)) ** 2), dtype=np.float32)
        self._columns = np.empty((2, FINE * TILE + len(self._taps)), dtype=np.float64)

    def tiles(self, low: tuple[float, float], high: tuple[float, float]) -> Iterator[Tile]:
        """Every tile of the picture that a body between two corners (x, y) [px] reaches; draw it, it is then added."""
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
                    self._share[:size].reshape(shape),
                    margin,
                )
                yield tile
                collect_light(self.light, self.covered, tile.glow, tile.share, self._taps, top, left, self._columns)


def pixel_response(blur: float) -> NDArray[np.float64]:
    """Weights (odd,) of the sub-pixels about a pixel's centre, of sum 1: its own three, blurred.

    The Gaussian's variance is blur² [px²] less what the sub-pixels' soft edges and their spacing have done already.
    """
    spread = FINE**2 * (blur**2 + 1 / 12) - (FINE**2 - 1) / 12 - SMOOTHING**2  # [sub-pixel²]
    if spread <= 0:
        return np.full(FINE, 1 / FINE)
    half = math.ceil(TAIL * math.sqrt(spread))
    gauss = np.exp(-0.5 * np.arange(-half, half + 1.0) ** 2 / spread)
    return np.convolve(gauss / gauss.sum(), np.full(FINE, 1 / FINE))
