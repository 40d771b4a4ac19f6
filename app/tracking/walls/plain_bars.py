"""Bars that show nothing by which they could be followed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...experiment.pictures.image import Image
from ...experiment.units import Scale
from ...solver.bodies.grains import Array
from .bar_depth import MAX_BAR_DEPTH, visible_depth
from .wall_tracker import WallTracker


def can_be_followed(images: tuple[Image, Image], endpoints: Array, scale: Scale, radius: float) -> NDArray[np.bool_]:
    """Return which bars of the first photograph are found in the second (w,).

    Parameters
    ----------
    images : two (H, W) arrays
        The photographs [grey].
    endpoints : (w, 2, 2) array
        The bars' faces on the first [m].
    scale : Scale
    radius : float
        Mean radius of the grains [m].
    """
    depth = visible_depth(images[0], endpoints, scale, MAX_BAR_DEPTH * radius)
    tracker = WallTracker(images[0], endpoints, scale, depth)
    found = tracker.follow(images[1], [tracker.first()])
    return np.asarray(np.isfinite(found.endpoints).all(axis=(1, 2)))
