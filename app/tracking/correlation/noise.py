"""The noise of a photograph, from itself alone."""

from __future__ import annotations

import cv2
import numpy as np

from ...experiment.photographs import Image

# A mask that a constant, a slope and an edge along an axis all leave at zero (Immerkær 1996); its norm is 6.
MASK = np.array([[1.0, -2.0, 1.0], [-2.0, 4.0, -2.0], [1.0, -2.0, 1.0]], dtype=np.float32)
MASK_NORM = 6.0

# Speckle answers the mask as noise does; the calmest tenth of the tiles is where there is the least of it.
CALM_TILES = 10.0
TILE = 32


def image_noise(image: Image) -> float:
    """Standard deviation of a pixel's noise [grey]."""
    answer = np.abs(cv2.filter2D(image, cv2.CV_32F, MASK, borderType=cv2.BORDER_REFLECT_101))
    height, width = (side // TILE * TILE for side in image.shape)
    if height == 0 or width == 0:
        return float(np.median(answer)) / 0.6745 / MASK_NORM
    mean = cv2.resize(answer[:height, :width], (width // TILE, height // TILE), interpolation=cv2.INTER_AREA)
    # The mean absolute value of a normal variable is sqrt(2/π) of its standard deviation.
    return float(np.percentile(mean, CALM_TILES)) / np.sqrt(2.0 / np.pi) / MASK_NORM
