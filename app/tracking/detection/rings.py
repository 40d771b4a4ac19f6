"""Candidate circles of given radii: bright inside, dark outside, with any paint on them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.special import j1

from ...experiment.pictures.image import Image
from ...solver.bodies.grains import Array
from ...solver.parallel import parallel_map
from ..correlation.splines import shrink

# Circles are searched for on shrunk photographs, where the smallest has at least the first radius [px], and each about
# the second.
MIN_COARSE_RADIUS = 10.0
COARSE_RADIUS = 20.0
PEAK_ERROR = 1.5  # greatest error of a circle's centre [px of the shrunk photograph]

CIRCLE_SD = 0.8  # blur of a circle [px of the shrunk photograph]
WAVE_NUMBERS = 2**14  # of the table of a circle's spectrum

SCAN_STEP = 1.06  # ratio of successive radii in the search for circles of unknown radius

# Greatest number of pixels on which several radii are searched for at a time, to save memory.
PARALLEL_PIXELS = 12_000_000

# Greatest radius [px] that sets the size of the tiles of local contrast: uneven light does not scale with the grains.
LARGEST_LOCAL = 80.0


@dataclass(frozen=True, slots=True)
class Circles:
    """Candidate circles, in the order of their significance."""

    x: Array  # (c,) [px]
    y: Array  # (c,) [px]
    radius: Array  # (c,) [px]
    score: Array  # (c,) mean inward slope along the circle, as a fraction of a full edge's
    error: Array  # (c,) [px] greatest error of the centre

    def select(self, rows: NDArray[np.bool_]) -> Circles:
        """Return some of the circles, rows (c,)."""
        return Circles(self.x[rows], self.y[rows], self.radius[rows], self.score[rows], self.error[rows])


def radius_steps(limits: tuple[float, float]) -> Array:
    """Return the radii (k,) [px] at which circles of unknown radius between two limits are searched for."""
    steps = int(np.ceil(np.log(limits[1] / limits[0]) / np.log(SCAN_STEP)))
    return np.geomspace(limits[0], limits[1], steps + 1)


def find_circles(image: Image, radii: Array, *, min_score: float, finest: bool = False) -> Circles:
    """Find the local maxima, over position, of the mean inward slope along circles.

    Slopes are relative to the local contrast and limited to that of a full edge, so that neither uneven light nor a
    single strong edge dominates. The slopes of paint inside a grain have all directions and cancel.

    Parameters
    ----------
    image : (H, W) array
        The photograph [grey].
    radii : (k,) array
        Radii that are tried [px]. Those of circles wider than the photograph find none.
    min_score : float
        Least mean slope, as a fraction of a full edge's.
    finest : bool
        Search on the photograph itself, which takes longer, instead of shrunk copies.
    """
    radii = radii[2.0 * radii < max(image.shape)]
    if len(radii) == 0:
        return Circles(*np.empty((5, 0)))
    least = max(int(radii.min() / MIN_COARSE_RADIUS), 1)
    factors = np.ones(len(radii), np.intp)
    if not finest:
        factors = np.maximum((radii / COARSE_RADIUS).astype(np.intp), least)
    found = []
    for factor in np.unique(factors):
        slopes = _slopes(shrink(image, int(factor)), int(tile_size(float(radii.max())) / factor))
        some = radii[factors == factor]
        circles = _CircleSlopes(*slopes, float(some.max()) / factor)
        searches = [partial(_peaks, circles, float(radius), int(factor), min_score) for radius in some]
        found += parallel_map(searches, None if slopes[0].size < PARALLEL_PIXELS else 1)
    table = np.concatenate(found)
    # A mean over a longer circle is more significant at the same value.
    table = table[np.argsort(-table[:, 3] * np.sqrt(table[:, 2]), kind="stable")]
    return Circles(*table.T)


def _peaks(circles: _CircleSlopes, radius: float, factor: int, min_score: float) -> Array:
    """Return x, y, radius, score, error (c, 5) of the candidates of one radius [px of the photograph]."""
    score = circles.mean(radius / factor)
    peak = (score == cv2.dilate(score, np.ones((5, 5), np.uint8))) & (score > min_score)
    row, column = np.nonzero(peak)
    place = [axis * factor + 0.5 * (factor - 1) for axis in (column, row)]
    table = np.stack([*place, *np.broadcast_arrays(radius, score[peak], PEAK_ERROR * factor)], axis=1)
    return np.asarray(table, np.float64)


def without_overlap(x: Array, y: Array, radius: Array, *, allowed: float) -> np.ndarray:
    """Return the rows (ascending) that remain when each circle, in order, removes the later ones that overlap it.

    allowed: greatest overlap, as a fraction of the smaller radius.
    """
    if len(x) == 0:
        return np.empty(0, np.intp)
    circles = np.column_stack([x, y, radius]).astype(np.float64)
    alive = np.ones(len(x), dtype=np.bool_)
    largest = float(circles[:, 2].max())
    strike_out(circles, allowed, largest, _empty_grid(circles, largest), np.empty(len(x), np.intp), alive)
    return np.flatnonzero(alive)


@njit(cache=True, nogil=True)
def strike_out(circles, allowed, cell, head, following, alive):
    """Clear alive (n,) where a circle overlaps an earlier one that is alive.

    Parameters
    ----------
    circles : (n, 3) array
        x, y, radius [px].
    allowed : float
        Greatest overlap, as a fraction of the smaller radius.
    cell : float
        Side of the squares of a grid [px], no less than the greatest radius.
    head, following : (rows, columns), (n,) array
        Workspace: linked lists of the alive circles of each square, −1 at their ends.
    alive : (n,) array
        True at first.
    """
    x, y, radius = circles[:, 0], circles[:, 1], circles[:, 2]
    left, top = x[0], y[0]
    for k in range(1, len(x)):
        left, top = min(left, x[k]), min(top, y[k])
    for k in range(len(x)):
        column, row = int((x[k] - left) / cell), int((y[k] - top) / cell)
        squares = row - 2, row + 2, column - 2, column + 2
        alive[k] = overlapping(x[k], y[k], radius[k], circles, allowed, head, following, squares) < 0
        if alive[k]:
            following[k] = head[row, column]
            head[row, column] = k


def beside(circles: Array, found: Array, *, allowed: float) -> np.ndarray:
    """Mark the circles (n, 3) that overlap none of the found ones (c, 3) by more than a fraction of a radius."""
    return not_overlapping(circles, found, np.full_like(circles, np.nan), allowed=allowed)


def not_overlapping(circles: Array, found: Array, overlapped: Array, *, allowed: float) -> np.ndarray:
    """Return which circles overlap none of the found ones.

    Parameters
    ----------
    circles : (n, 3) array
        x, y, radius [px].
    found : (c, 3 or more) array
        x, y, radius, … [px].
    overlapped : (n, 3) array
        The found circle that each one overlapped at the last call, NaN at first; updated. While it is still found,
        there is no need to look for another.
    allowed : float
        Greatest overlap, as a fraction of the smaller radius.
    """
    apart = np.ones(len(circles), dtype=np.bool_)
    if len(found) == 0 or len(circles) == 0:
        return apart
    circles = np.ascontiguousarray(circles, np.float64)
    found = np.ascontiguousarray(found[:, :3], np.float64)
    cell = float(found[:, 2].max())
    head, following = _empty_grid(found, cell), np.empty(len(found), np.intp)
    strike_out_beside(circles, found, overlapped, allowed, cell, head, following, apart)
    return apart


def _empty_grid(circles: Array, cell: float) -> np.ndarray:
    """Heads (rows, columns) of the lists of circles in the squares of a grid over all centres, whose side is `cell`."""
    columns, rows = (int(np.ptp(circles[:, axis]) / cell) + 1 for axis in (0, 1))
    return np.full((rows, columns), -1, np.intp)


@njit(cache=True, nogil=True)
def strike_out_beside(circles, found, overlapped, allowed, cell, head, following, apart):
    """Clear apart (n,) where a circle overlaps one of the found ones, see `not_overlapping`.

    head (rows, columns), −1 at first, and following (c,) are workspace: linked lists of the found circles in each
    square of a grid, whose side `cell` is the greatest radius found.
    """
    left, top = found[0, 0], found[0, 1]
    for k in range(1, len(found)):
        left, top = min(left, found[k, 0]), min(top, found[k, 1])
    for k in range(len(found)):
        column, row = int((found[k, 0] - left) / cell), int((found[k, 1] - top) / cell)
        following[k] = head[row, column]
        head[row, column] = k
    for k in range(len(circles)):
        x, y, radius = circles[k]
        other = -1
        if not np.isnan(overlapped[k, 0]):
            # The square of the last one first, which may lie outside the grid by now.
            row, column = (
                int(np.floor((overlapped[k, 1] - top) / cell)),
                int(np.floor((overlapped[k, 0] - left) / cell)),
            )
            other = overlapping(x, y, radius, found, allowed, head, following, (row, row, column, column))
        if other < 0:
            reach = radius + cell
            squares = (
                int(np.floor((y - reach - top) / cell)), int(np.floor((y + reach - top) / cell)),
                int(np.floor((x - reach - left) / cell)), int(np.floor((x + reach - left) / cell)),
            )  # fmt: skip
            other = overlapping(x, y, radius, found, allowed, head, following, squares)
        if other >= 0:
            apart[k] = False
            overlapped[k] = found[other]


@njit(cache=True, nogil=True)
def overlapping(x, y, radius, circles, allowed, head, following, squares):
    """Return a listed circle that overlaps one at x, y, −1: none; squares: first and last row, column of the grid."""
    rows, columns = head.shape
    upper, lower, first, last = squares
    for j in range(max(upper, 0), min(lower + 1, rows)):
        for i in range(max(first, 0), min(last + 1, columns)):
            other = head[j, i]
            while other >= 0:
                size = circles[other, 2]
                distance = np.sqrt((circles[other, 0] - x) ** 2 + (circles[other, 1] - y) ** 2)
                if distance < radius + size - allowed * min(radius, size):
                    return other
                other = following[other]
    return -1


def tile_size(radius: float) -> int:
    """Return the side of the tiles of local contrast [px], for a largest grain of `radius` [px]."""
    return int(4 * min(radius, LARGEST_LOCAL))


def local_contrast(image: Image, tile: int) -> tuple[Image, Image]:
    """Return the dark level and the contrast around every pixel, two (H, W) [grey], from tiles of several grains."""
    height, width = image.shape
    rows, columns = max(round(height / tile), 1), max(round(width / tile), 1)
    dark = np.empty((rows, columns), np.float32)
    bright = np.empty((rows, columns), np.float32)
    for j in range(rows):
        for i in range(columns):
            part = image[
                j * height // rows : (j + 1) * height // rows, i * width // columns : (i + 1) * width // columns
            ]
            dark[j, i], bright[j, i] = np.percentile(part, [3.0, 95.0])
    contrast = bright - dark
    # In tiles of background alone, the faint texture must not be amplified into edges.
    contrast = np.maximum(contrast, max(0.5 * float(np.percentile(contrast, 90.0)), 1.0)).astype(np.float32)
    size = (width, height)
    return (
        np.asarray(cv2.resize(dark, size, interpolation=cv2.INTER_LINEAR), dtype=np.float32),
        np.asarray(cv2.resize(contrast, size, interpolation=cv2.INTER_LINEAR), dtype=np.float32),
    )


def _slopes(image: Image, tile: int) -> tuple[Image, Image]:
    _, contrast = local_contrast(image, tile)
    smooth = cv2.GaussianBlur(image, (0, 0), 1.0) / contrast
    slope_x = cv2.Sobel(smooth, cv2.CV_32F, 1, 0, ksize=3, scale=1.0 / 8.0)
    slope_y = cv2.Sobel(smooth, cv2.CV_32F, 0, 1, ksize=3, scale=1.0 / 8.0)
    steepness = np.hypot(slope_x, slope_y)
    full = max(float(np.percentile(steepness, 90.0)), 1e-6)
    cut = 1.0 / np.maximum(steepness, full)
    return np.asarray(slope_x * cut, dtype=np.float32), np.asarray(slope_y * cut, dtype=np.float32)


class _CircleSlopes:
    """Mean inward slope along the circles of any radius around every pixel, from one transform of the slopes.

    Notes
    -----
    The field of unit normals on a circle of radius r, blurred by σ, has the spectrum −i k/|k| J₁(|k| r) exp(−σ²|k|²/2)
    where its integral over the circle is 1. Its product with the spectrum of the slopes is that of their mean.
    """

    def __init__(self, slope_x: Image, slope_y: Image, largest: float) -> None:
        """Transform the slopes (H, W), continued by those of the border, for radii up to `largest` [px]."""
        self._first = margin = math.ceil(largest + 4.0 * CIRCLE_SD)
        self._shape = slope_x.shape
        rows, columns = (cv2.getOptimalDFTSize(size + 2 * margin) for size in self._shape)
        self._padded = rows, columns
        k_y = 2.0 * np.pi * np.fft.fftfreq(rows).astype(np.float32)[:, None]
        k_x = 2.0 * np.pi * np.fft.rfftfreq(columns).astype(np.float32)[None, :]
        size = np.hypot(k_x, k_y)
        along = self._transform(slope_x) * k_x
        along += self._transform(slope_y) * k_y
        along *= np.complex64(-1j) / np.maximum(size, np.finfo(np.float32).tiny)
        self._along = along
        greatest = float(size.max())
        self._wave_numbers = np.linspace(0.0, greatest, WAVE_NUMBERS)
        self._nearest = np.rint(size * ((WAVE_NUMBERS - 1) / greatest)).astype(np.int32)

    def _transform(self, slope: Image) -> NDArray[np.complex64]:
        above, left = self._first, self._first
        below, right = (whole - size - self._first for whole, size in zip(self._padded, self._shape, strict=True))
        padded = cv2.copyMakeBorder(slope, above, below, left, right, cv2.BORDER_REPLICATE)
        return np.asarray(np.fft.rfft2(padded), np.complex64)

    def mean(self, radius: float) -> Image:
        """Return the mean (H, W) for circles of this radius [px]."""
        wave_numbers = self._wave_numbers
        spectrum = j1(radius * wave_numbers) * np.exp(-0.5 * (CIRCLE_SD * wave_numbers) ** 2)
        product = self._along * spectrum.astype(np.float32)[self._nearest]
        mean = np.fft.irfft2(product, self._padded)
        height, width = self._shape
        inside = mean[self._first : self._first + height, self._first : self._first + width]
        return np.ascontiguousarray(inside, np.float32)
