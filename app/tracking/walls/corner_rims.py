"""Discs in the corners of a frame, found with their radii in a photograph: circles about the places where bars meet."""

from __future__ import annotations

import numpy as np

from ...experiment.pictures.image import Image
from ..detection.detect import refine_grains
from ..detection.rings import find_circles

SMALLEST = 20.0  # [px] of a disc's radius
LARGEST = 0.15  # of a disc's radius, as a fraction of the photograph's shorter side
RATIO = 1.03  # of radii that are tried one after another
LEAST_SLOPE = 0.3  # mean inward slope along a rough circle, as a fraction of a full edge's
TRIED = 6  # rough circles, the most significant ones, that are measured
ROUNDS = 3  # of measuring a circle from the last measurement
CLEAR = 0.6  # fraction from which on no other circle is tried
LEAST_SEEN = 0.4  # fraction of the rim that must be seen: bars and rods hide the rest
BETWEEN_BARS = 0.3  # [radii] between the place where two bars meet and the centre of a disc that they are fixed to
CLICKED = 0.8  # [radii] between a click on a disc and its centre


def find_disc(image: Image, place: tuple[float, float], *, within: float) -> tuple[float, float, float] | None:
    """Find the disc at a place.

    Parameters
    ----------
    image : (H, W) array
        The photograph [grey].
    place : tuple
        x, y [px].
    within : float
        Greatest distance of the disc's centre from the place [radii]: CLICKED or BETWEEN_BARS.

    Returns
    -------
    tuple or None
        x, y and radius [px] of the circle of which most is seen.
    """
    largest = LARGEST * min(image.shape)
    if not largest > SMALLEST:
        return None
    reach = 2.0 * largest
    left, top = (max(int(each - reach), 0) for each in place)
    part = np.ascontiguousarray(image[top : int(place[1] + reach) + 1, left : int(place[0] + reach) + 1])
    if min(part.shape) < 2.0 * SMALLEST:
        return None
    x, y = place[0] - left, place[1] - top
    radii = np.exp(np.arange(np.log(SMALLEST), np.log(largest), np.log(RATIO)))
    rough = find_circles(part, radii, min_score=LEAST_SLOPE)
    near = np.flatnonzero(np.hypot(rough.x - x, rough.y - y) < within * rough.radius)
    best, seen = None, LEAST_SEEN
    for k in near[:TRIED].tolist():
        if seen > CLEAR:
            break
        circle = np.array([[rough.x[k]], [rough.y[k]], [rough.radius[k]]])
        for _ in range(ROUNDS):
            measured = refine_grains(part, circle[0], circle[1], circle[2], fixed_radius=False)
            if not np.isfinite(measured.sigma[0]):
                break
            circle = np.array([measured.x, measured.y, measured.radius])
            away = float(np.hypot(circle[0, 0] - x, circle[1, 0] - y))
            if measured.quality[0] > seen and away < within * circle[2, 0]:
                best, seen = circle[:, 0], float(measured.quality[0])
    return None if best is None else (float(best[0]) + left, float(best[1]) + top, float(best[2]))
