"""Discs that detection has missed, found by their rims in the sizes of those that it has found.

Detection knows no sizes and needs a rim that is everywhere brighter or darker than its surroundings. A disc at a wall
shows a double rim, a fringed one has a rim of changing sign. Once the sizes are known, a ring of that radius whose
radial slopes are as strong as those of the discs that were found, in a place where there is none, is a disc.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...experiment.pictures.image import Image
from ...solver.bodies.grains import Array
from ...solver.boundary.size_classes import group_readings
from ..detection.detect import Detection
from .rim_image import RADIUS_SD, RimImage
from .rim_kernels import QUALITY, SIGMA, VIEW

FEWEST = 10  # discs of a size from which its rims are known
REACH = 2.5  # radii beyond the discs that were found, in which further ones are searched for
SPACING, PLACES = 1.0, 3  # radii between the places around which is searched; rings that are kept at each
APART = 0.85  # least distance of two discs over the sum of their radii
# Least strength of a ring over that which nine of ten discs of its size exceed. Of 65 photoelastic discs, 50 of which
# were detected, the others have 0.93 and more, the strongest ring that is none 0.57.
LEAST_STRENGTH = 0.8
WEAK_QUANTILE = 0.1
# Rings of that size about places on discs, but not about their centres, show how strong a ring is without a rim. On
# photoelastic discs nine of ten have less than 0.5 of the usual strength, on painted rods less than 0.72 to 0.78. There
# rings on painted bars have up to 0.86: only a ring like those of the discs themselves is a disc.
BESIDE, DIRECTIONS, PATTERNED, STRONG_QUANTILE = 0.6, 6, 0.6, 0.9
LEAST_STRENGTH_PATTERNED = 0.95
MIN_VIEW, MIN_QUALITY = 0.75, 0.3  # fractions: of the rim in view, and of it with an edge on the circle


def add_missing_discs(image: Image, found: Detection) -> Detection:
    """Add discs of the sizes that were found, with rims as strong as theirs.

    Parameters
    ----------
    image : (H, W)
        The photograph [grey].
    found : Detection
        Discs that were detected in it.

    Returns
    -------
    Detection
        All discs from top to bottom; the given ones where they have no distinct sizes.

    Notes
    -----
    The strength of a ring is the mean of √|∂I/∂r| over its rim, of the smoothed photograph. It is compared with that of
    the discs of the same size, of which the weakest tenth is left out.
    """
    classes = group_readings(found.radius)
    if classes is None:
        return found
    rims = RimImage(image)
    candidates = [np.empty((0, 4))]
    for size in range(int(classes.max()) + 1):
        rows = np.flatnonzero(classes == size)
        if len(rows) >= FEWEST:
            candidates.append(_find_rings(rims, found, rows))
    ring = np.concatenate(candidates)
    ring = ring[np.argsort(-ring[:, 3], kind="stable")]
    chosen: list[Array] = []
    for one in ring:
        if all(np.hypot(*(one[:2] - other[:2])) > APART * (one[2] + other[2]) for other in chosen):
            chosen.append(one)
    if not chosen:
        return found
    x, y, radius, _ = np.array(chosen).T
    measured = rims.measure(np.stack([x, y], axis=1), radius, np.full(len(x), RADIUS_SD))
    good = np.isfinite(measured[:, SIGMA]) & (measured[:, QUALITY] > MIN_QUALITY) & (measured[:, VIEW] > MIN_VIEW)
    columns = [
        np.concatenate([given, new[good]])
        for given, new in (
            (found.x, measured[:, 0]), (found.y, measured[:, 1]), (found.radius, radius),
            (found.sigma, measured[:, SIGMA]), (found.quality, measured[:, QUALITY]),
        )
    ]  # fmt: skip
    order = np.lexsort((columns[0], columns[1]))
    return Detection(*(each[order] for each in columns))


def _find_rings(rims: RimImage, found: Detection, rows: NDArray[np.intp]) -> Array:
    """Find rings x, y, radius [px], relative strength (c, 4) of the size of the discs `rows`, apart from all discs."""
    radius = float(np.median(found.radius[rows]))
    step = float(np.clip(0.025 * radius, 1.0, 2.0))

    def search(x: Array, y: Array, window: float, count: int) -> Array:
        size = np.full(len(x), radius)
        return rims.ring_strength(x, y, size, np.full(len(x), window), step, count)

    own = search(found.x[rows], found.y[rows], 2.0 * step, 1)[:, 0, 2]
    usual = float(np.quantile(own, WEAK_QUANTILE))
    angle = np.arange(DIRECTIONS)[:, None] * (2.0 * np.pi / DIRECTIONS)
    x, y = (
        (found.x[rows] + BESIDE * radius * np.cos(angle)).ravel(),
        (found.y[rows] + BESIDE * radius * np.sin(angle)).ravel(),
    )
    patterned = np.quantile(search(x, y, 2.0 * step, 1)[:, 0, 2], STRONG_QUANTILE) > PATTERNED * usual
    least = LEAST_STRENGTH_PATTERNED if patterned else LEAST_STRENGTH
    reach = REACH * radius
    across = np.arange(found.x.min() - reach, found.x.max() + reach, SPACING * radius)
    down = np.arange(found.y.min() - reach, found.y.max() + reach, SPACING * radius)
    x, y = (each.ravel() for each in np.meshgrid(across, down))
    free = _are_apart(x, y, radius * (1.0 - SPACING), found)
    places = search(x[free], y[free], 0.5 * SPACING * radius, PLACES).reshape(-1, 3)
    strong = places[:, 2] > least * usual
    places = places[strong][_are_apart(places[strong, 0], places[strong, 1], radius, found)]
    return np.column_stack([places[:, :2], np.full(len(places), radius), places[:, 2] / usual])


def _are_apart(x: Array, y: Array, radius: float, found: Detection) -> np.ndarray:
    """Return which circles (c,) of a radius overlap no disc that was found."""
    apart = np.ones(len(x), np.bool_)
    for cx, cy, other in zip(found.x, found.y, found.radius, strict=True):
        apart &= np.hypot(x - cx, y - cy) > APART * (radius + other)
    return apart
