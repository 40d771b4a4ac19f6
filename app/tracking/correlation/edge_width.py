"""Width of a photograph's edges, and the copy on which the edges are as sharp as a good lens makes them."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...experiment.pictures.image import Image
from ...solver.bodies.grains import Array

# Widths of the blur that is added twice [px]: the ratio of the slopes that remain shows the width of the edge.
LITTLE, MUCH = 1.0, 2.0
# Variance that differences over two pixels add to an edge's [px²].
DIFFERENCE = 1.0 / 3.0
# Greatest width that the ratio shows well [px]: wider edges are measured on a copy of half the size.
MEASURED = 1.5
# Least height of an edge, as a fraction of the contrast. Paint has lower ones, and noise, whose slopes a blur removes.
HIGH = 0.5
# Quantile of the widths: paint has softer edges than a rim, and may have more of them.
QUANTILE = 0.25
FEWEST_EDGES = 100
LEAST_RATIO = 1.02  # of the squared slopes: of less the edge has no end
# Side and greatest total area of the blocks that are measured, spread over the photograph [px, px²].
BLOCK, AREA = 320, 1_200_000
CONTRAST_PERCENTILES = (3.0, 95.0)

# Greatest width of edges that is detected as it is [px], and the width on the copy otherwise.
SOFT, SHARP = 1.4, 1.0


@dataclass(frozen=True, slots=True)
class SharpCopy:
    """A photograph, or a copy of it that is smaller by a factor where its edges are soft."""

    image: Image
    factors: tuple[float, float]  # along columns and rows; exactly 1 for the photograph itself

    @property
    def factor(self) -> float:
        """Factor of a length."""
        return float(np.sqrt(self.factors[0] * self.factors[1]))

    def to_copy(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Convert places of the photograph to those of the copy [px]."""
        across, down = self.factors
        return (x + 0.5) / across - 0.5, (y + 0.5) / down - 0.5

    def from_copy(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Convert places of the copy to those of the photograph [px]."""
        across, down = self.factors
        return across * (x + 0.5) - 0.5, down * (y + 0.5) - 0.5


def sharpest_copy(image: Image, most: float = np.inf) -> SharpCopy:
    """Return the photograph (H, W), or a smaller copy by a factor of at most `most` where its edges are soft.

    Edges that are blurred by several pixels show no more on the photograph than on a copy where they are one pixel
    wide, and the means of its pixels have less noise.
    """
    width = edge_width(image)
    factor = min(width / SHARP, most)
    if not (width > SOFT and factor > 1.0):
        return SharpCopy(image, (1.0, 1.0))
    rows, columns = (max(round(side / factor), 1) for side in image.shape)
    copy = cv2.resize(image, (columns, rows), interpolation=cv2.INTER_AREA)
    return SharpCopy(np.asarray(copy, np.float32), (image.shape[1] / columns, image.shape[0] / rows))


def edge_width(image: Image) -> float:
    """Estimate the standard deviation of the blur of a photograph's edges [px]; 0 where there are too few.

    Notes
    -----
    Blurred once more by a, an edge of width s keeps the slope A / √(2π v), with v = s² + a² + 1/3: a difference over
    two pixels is a blur as well. The ratio q of the squared slopes for two blurs a < b gives v = (b² − a²) / (q − 1)
    without the height A (Zhuo and Sim 2011). The width is the first quartile over the places where the slope is
    greatest, of edges as high as a rim.
    """
    blocks = _blocks(image)
    factor, width = 1.0, 0.0
    while True:
        found = _widths(blocks)
        if len(found) < FEWEST_EDGES:
            return width
        here = factor * float(np.quantile(found, QUANTILE))
        # Noise makes wide edges narrower, and so do neighbouring edges on a small copy: the greatest is the best.
        width = max(width, here)
        if here <= factor * MEASURED or min(min(block.shape) for block in blocks) < 32:
            return width
        factor *= 2.0
        blocks = [_half(block) for block in blocks]


def _blocks(image: Image) -> list[Image]:
    """Parts of the photograph, evenly spread, of which the area is bounded."""
    counts = [max(round(side / BLOCK), 1) for side in image.shape]
    rows, columns = (
        np.linspace(0, side, count + 1).astype(int) for side, count in zip(image.shape, counts, strict=True)
    )
    parts = [
        image[rows[j] : rows[j + 1], columns[i] : columns[i + 1]] for j in range(counts[0]) for i in range(counts[1])
    ]
    every = int(np.ceil(image.size / AREA))
    return parts[every // 2 :: every] or parts


def _widths(blocks: list[Image]) -> Array:
    """Widths (n,) [px] of the high edges of all blocks."""
    ends = np.array([np.percentile(block, CONTRAST_PERCENTILES) for block in blocks])
    contrast = ends[:, 1] - ends[:, 0]
    # A block of background or of one grain alone has only faint edges.
    contrast = np.maximum(contrast, 0.5 * float(np.percentile(contrast, 90.0)))
    found = []
    for block, full in zip(blocks, contrast, strict=True):
        slope_x, slope_y = _slopes(block, LITTLE)
        little, much = np.hypot(slope_x, slope_y), np.hypot(*_slopes(block, MUCH))
        peak = _greatest_along_slope(slope_x, slope_y, little)
        slope = little[peak].astype(np.float64)
        ratio = (slope / np.maximum(much[peak], 1e-9)) ** 2
        edge = ratio > LEAST_RATIO
        blurred = (MUCH**2 - LITTLE**2) / (ratio[edge] - 1.0)  # variance of the edge with the little blur
        square = np.maximum(blurred - LITTLE**2 - DIFFERENCE, 0.0)
        height = slope[edge] * np.sqrt(2.0 * np.pi * blurred)
        found.append(np.sqrt(square[height > HIGH * float(full)]))
    return np.concatenate(found)


def _half(image: Image) -> Image:
    return np.asarray(cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA), np.float32)


def _slopes(image: Image, blur: float) -> tuple[Image, Image]:
    smooth = cv2.GaussianBlur(image, (0, 0), blur)
    slope_x = cv2.Sobel(smooth, cv2.CV_32F, 1, 0, ksize=3, scale=1.0 / 8.0)
    slope_y = cv2.Sobel(smooth, cv2.CV_32F, 0, 1, ksize=3, scale=1.0 / 8.0)
    return np.asarray(slope_x, np.float32), np.asarray(slope_y, np.float32)


def _greatest_along_slope(slope_x: Image, slope_y: Image, slope: Image) -> np.ndarray:
    """Mark the pixels (H, W) whose slope is the greatest of three along the axis nearer to its direction."""
    peak = np.zeros(slope.shape, np.bool_)
    here = slope[1:-1, 1:-1]
    across = (here >= slope[1:-1, :-2]) & (here > slope[1:-1, 2:])
    down = (here >= slope[:-2, 1:-1]) & (here > slope[2:, 1:-1])
    peak[1:-1, 1:-1] = np.where((np.abs(slope_x) > np.abs(slope_y))[1:-1, 1:-1], across, down)
    return peak
