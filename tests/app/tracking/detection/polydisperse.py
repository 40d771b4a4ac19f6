"""Synthetic photographs of thousands of nearly touching discs of very different sizes."""

from __future__ import annotations

import cv2
import numpy as np
from rodsight.solver.bodies.grains import Array

FINE = 4  # sub-pixels a side
BITS = 8  # of a sub-pixel that OpenCV draws with
EXPONENT = 1.6  # of the sizes: many small, few large


def lay_discs(
    width: int, height: int, smallest: float, largest: float, most: int, generator: np.random.Generator
) -> tuple[Array, Array, Array]:
    """Lay discs x, y, radius (n,) [px] from the largest to the smallest, each beside others, with `most` attempts."""
    gap_map = np.full((height, width), np.inf, np.float32)  # [px] from every pixel to the next disc
    row, column = np.mgrid[0:height, 0:width].astype(np.float32)
    fraction = generator.random(most)
    ends = largest**-EXPONENT, smallest**-EXPONENT
    circles = []
    for r in np.sort((ends[0] + fraction * (ends[1] - ends[0])) ** (-1.0 / EXPONENT))[::-1]:
        place = generator.integers(0, gap_map.size, 4000)
        gap = gap_map.ravel()[place] - r
        fits = place[(gap >= 0.0) & (gap < 1.0)] if circles else place
        if len(fits) == 0:
            continue
        y, x = (float(part) for part in divmod(int(fits[0]), width))
        circles.append((x, y, float(r)))
        side = int(r + 2.0 * largest)
        part = np.s_[max(int(y) - side, 0) : int(y) + side, max(int(x) - side, 0) : int(x) + side]
        np.minimum(gap_map[part], np.hypot(column[part] - x, row[part] - y) - np.float32(r), out=gap_map[part])
    x, y, radius = np.array(circles).T
    return x, y, radius


def draw_discs(
    width: int, height: int, x: Array, y: Array, radius: Array, *, blur: float, noise: float, noise_seed: int
) -> np.ndarray:
    """The photograph (height, width) float32: white discs on black, grey 20 to 200. blur [px], noise [grey]."""
    fine = np.zeros((height * FINE, width * FINE), np.uint8)
    for one in zip(FINE * (x + 0.5) - 0.5, FINE * (y + 0.5) - 0.5, FINE * radius - 0.5, strict=True):
        a, b, size = (round(float(part) * 2**BITS) for part in one)
        cv2.circle(fine, (a, b), size, 255, -1, cv2.LINE_8, BITS)
    grey = cv2.resize(fine, (width, height), interpolation=cv2.INTER_AREA).astype(np.float32)
    grey = 20.0 + 0.7 * cv2.GaussianBlur(grey, (0, 0), blur)
    grey += np.random.default_rng(noise_seed).normal(0.0, noise, grey.shape)
    return np.clip(np.rint(grey), 0.0, 255.0).astype(np.float32)
