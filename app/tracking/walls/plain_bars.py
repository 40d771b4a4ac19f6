"""What bars show by which they can be followed: a texture, or their edges alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...experiment.pictures.image import Image
from ...experiment.units import Scale
from ...solver.bodies.grains import Array
from .bar_depth import MAX_BAR_DEPTH, visible_depth
from .edge_tracker import EdgeTracker
from .wall_tracker import WallTracker


def can_be_followed(
    images: tuple[Image, Image], endpoints: Array, scale: Scale, radius: float
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which bars (w,) of the first photograph are found in the second by their texture, and by their edge.

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
    texture, edge = WallTracker(images[0], endpoints, scale, depth), EdgeTracker(images[0], endpoints, scale)
    by_texture = texture.follow(images[1], [texture.first()]).endpoints
    by_edge = edge.follow(images[1], [edge.first()]).endpoints
    texture_found, edge_found = (np.asarray(np.isfinite(ends).all(axis=(1, 2))) for ends in (by_texture, by_edge))
    return texture_found, edge_found
