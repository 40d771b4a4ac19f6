"""The noise of a photograph, from itself alone."""

from __future__ import annotations

import numpy as np
from numba import njit

from ...experiment.photographs import Image

# The mask (1, −2, 1) along both axes, which a constant, a slope and an edge along an axis all leave at zero (Immerkær
# 1996); its norm is 6.
MASK_NORM = 6.0

# Speckle answers the mask as noise does; the calmest tenth of the tiles is where there is the least of it.
CALM_TILES = 10.0
TILE = 32

# An end of the scale, or what is beyond a region, is one grey: pixels there answer nothing, and tell nothing of noise.
FLAT = 0.2  # share of a tile's pixels that answer nothing, above which the others alone count
SEEN = 0.25  # least share of them for a tile to count at all


def image_noise(image: Image) -> float:
    """Standard deviation of a pixel's noise [grey]."""
    height, width = image.shape
    if height < TILE or width < TILE:
        tile = min(height, width)
        if tile < 3:
            return 0.0
    else:
        tile = TILE
    mean = np.empty((height // tile, width // tile), np.float32)
    answer_tiles(np.ascontiguousarray(image), tile, mean, np.empty((2, width), np.float32))
    seen = mean[mean > 0.0]
    if not seen.size:
        return 0.0
    # The mean absolute value of a normal variable is sqrt(2/π) of its standard deviation.
    return float(np.percentile(seen, CALM_TILES)) / np.sqrt(2.0 / np.pi) / MASK_NORM


@njit(cache=True, nogil=True, error_model="numpy")
def answer_tiles(image, tile, mean, room):
    """Write the mean absolute answer of the mask of every tile, 0 for one of one grey; room (2, w): to work in.

    Beyond its border the photograph is mirrored.
    """
    height, width = image.shape
    rows, columns = mean.shape
    total, flat = room[0], room[1]
    for j in range(rows):
        room[:] = 0.0
        for y in range(j * tile, (j + 1) * tile):
            above, here = image[abs(y - 1)], image[y]
            below = image[y + 1 if y + 1 < height else height - 2]
            for x in range(1, width - 1):
                left = above[x - 1] + below[x - 1] - (here[x - 1] + here[x - 1])
                middle = above[x] + below[x] - (here[x] + here[x])
                right = above[x + 1] + below[x + 1] - (here[x + 1] + here[x + 1])
                answer = abs(left + right - (middle + middle))
                total[x] += answer
                flat[x] += answer == 0.0
            for x in (0, width - 1):
                beside = 1 if x == 0 else width - 2
                outer = above[beside] + below[beside] - (here[beside] + here[beside])
                middle = above[x] + below[x] - (here[x] + here[x])
                answer = abs(outer + outer - (middle + middle))
                total[x] += answer
                flat[x] += answer == 0.0
        for i in range(columns):
            answer, silent, count = 0.0, 0.0, float(tile * tile)
            for x in range(i * tile, (i + 1) * tile):
                answer += total[x]
                silent += flat[x]
            if silent > FLAT * count:
                count = count - silent if silent < (1.0 - SEEN) * count else np.inf
            mean[j, i] = answer / count
