"""Noise of a photograph, estimated from that photograph alone."""

from __future__ import annotations

import numpy as np
from numba import njit

from ...experiment.pictures.image import Image

# Norm of the mask (1, −2, 1) along both axes, whose response to a constant, a slope and an edge along an axis is zero
# (Immerkær 1996).
MASK_NORM = 6.0

# Speckle responds to the mask as noise does; this percentile of the tiles has the least of it.
TILE_PERCENTILE = 10.0
TILE = 32

# Saturated pixels and pixels beyond a region are of one grey: their response is zero and shows no noise.
ZERO_FRACTION = 0.2  # fraction of a tile's responses that are zero, above which only the others are averaged
MIN_FRACTION = 0.25  # least fraction of the others, below which a tile is ignored


def image_noise(image: Image) -> float:
    """Estimate the standard deviation of a pixel's noise [grey].

    Notes
    -----
    With r the response of the mask (1, −2, 1) ⊗ (1, −2, 1), σ = sqrt(π/2) ⟨|r|⟩ / 6 (Immerkær 1996), in the tiles of
    the lowest tenth.
    """
    height, width = image.shape
    if height < TILE or width < TILE:
        tile = min(height, width)
        if tile < 3:
            return 0.0
    else:
        tile = TILE
    mean = np.empty((height // tile, width // tile), np.float32)
    mean_tile_responses(np.ascontiguousarray(image), tile, mean, np.empty((2, width), np.float32))
    responses = mean[mean > 0.0]
    if not responses.size:
        return 0.0
    # The mean absolute value of a normal variable is sqrt(2/π) of its standard deviation.
    return float(np.percentile(responses, TILE_PERCENTILE)) / np.sqrt(2.0 / np.pi) / MASK_NORM


@njit(cache=True, nogil=True, error_model="numpy")
def mean_tile_responses(image, tile, mean, workspace):
    """Write the mean absolute response of the mask in every tile, 0 for one of one grey; workspace (2, w).

    The photograph is mirrored at its border.
    """
    height, width = image.shape
    rows, columns = mean.shape
    total, zeros = workspace[0], workspace[1]
    for j in range(rows):
        workspace[:] = 0.0
        for y in range(j * tile, (j + 1) * tile):
            above, here = image[abs(y - 1)], image[y]
            below = image[y + 1 if y + 1 < height else height - 2]
            for x in range(1, width - 1):
                left = above[x - 1] + below[x - 1] - (here[x - 1] + here[x - 1])
                middle = above[x] + below[x] - (here[x] + here[x])
                right = above[x + 1] + below[x + 1] - (here[x + 1] + here[x + 1])
                response = abs(left + right - (middle + middle))
                total[x] += response
                zeros[x] += response == 0.0
            for x in (0, width - 1):
                beside = 1 if x == 0 else width - 2
                outer = above[beside] + below[beside] - (here[beside] + here[beside])
                middle = above[x] + below[x] - (here[x] + here[x])
                response = abs(outer + outer - (middle + middle))
                total[x] += response
                zeros[x] += response == 0.0
        for i in range(columns):
            response, zero_count, count = 0.0, 0.0, float(tile * tile)
            for x in range(i * tile, (i + 1) * tile):
                response += total[x]
                zero_count += zeros[x]
            if zero_count > ZERO_FRACTION * count:
                count = count - zero_count if zero_count < (1.0 - MIN_FRACTION) * count else np.inf
            mean[j, i] = response / count
