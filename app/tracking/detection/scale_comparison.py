"""Whether grains of the known radii are seen at a scale that differs by a factor: a wrong unit, diameters for radii."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...experiment.pictures.image import Image
from ...experiment.plausibility import enclosed_area
from .detect import FAINT, Detection, DetectionSettings, detect_grains

FACTORS = (10.0, 0.1, 2.0, 0.5, 1000.0, 0.001)  # by which a scale or its unit is mistaken
FEW = 4  # grains: fewer are no packing
LEAST_RADIUS = 3.0  # [px] of a grain
LARGEST = 0.25  # of a photograph's shorter side: greatest radius
PACKED = 0.5  # area of grains over the area that they enclose: less is no packing, such as the speckles of a paint
MORE = 2.0  # times that fraction at another scale shows that the other one is right


def packed_fraction(found: Detection) -> float:
    """Return the area of the circles that are seen over the area that they enclose; 0 where they are few."""
    seen = found.quality > FAINT  # contacts hide parts of the outlines
    if np.count_nonzero(seen) < FEW:
        return 0.0
    position, radius = np.stack([found.x, found.y], axis=1)[seen], found.radius[seen]
    return float(np.pi * (radius**2).sum()) / enclosed_area(position, radius)


def find_other_scale(image: Image, classes: Sequence[float], found: Detection | None) -> tuple[float, int] | None:
    """Find a scale at which grains of the known radii fill the picture, while at the given one they do not.

    Parameters
    ----------
    image : (H, W)
        The photograph [grey].
    classes : sequence of float
        Known radii at the given scale [px].
    found : Detection or None
        What was found at that scale; None: the radii are too small or too large to look for.

    Returns
    -------
    tuple of float and int, or None
        Factor by which the given scale is too large, and the number of grains at the right one.
    """
    given = 0.0 if found is None else packed_fraction(found)
    if given >= PACKED:
        return None
    for factor in FACTORS:
        sizes = tuple(radius * factor for radius in classes)
        if min(sizes) < LEAST_RADIUS or max(sizes) > LARGEST * min(image.shape):
            continue
        other = detect_grains(image, DetectionSettings(sizes))
        if packed_fraction(other) >= max(PACKED, MORE * given):
            return factor, int((other.quality > FAINT).sum())
    return None
