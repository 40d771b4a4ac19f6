"""How discs look inside: their brightness and contrast."""

from __future__ import annotations

import numpy as np

from ...experiment.pictures.image import Image
from ...solver.bodies.grains import Array

INSIDE = 0.8  # of a radius: the part of a disc that is looked at


def appearance(image: Image, discs: Array, part: float) -> Array:
    """Mean grey level and logarithm of the contrast (n, 2) within a part of discs (n, 3); NaN beyond the photograph."""
    found = np.full((len(discs), 2), np.nan)
    for k, (x, y, radius) in enumerate(discs):
        reach = max(part * radius, 1.5)
        top, left = int(np.ceil(y - reach)), int(np.ceil(x - reach))
        bottom, right = int(np.floor(y + reach)) + 1, int(np.floor(x + reach)) + 1
        if top < 0 or left < 0 or bottom > image.shape[0] or right > image.shape[1]:
            continue
        rows, columns = np.ogrid[top:bottom, left:right]
        grey = image[top:bottom, left:right][(rows - y) ** 2 + (columns - x) ** 2 <= reach**2]
        found[k] = grey.mean(), np.log1p(grey.std())
    return found
