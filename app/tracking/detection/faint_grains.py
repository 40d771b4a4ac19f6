"""Grains whose outlines are seen in small part, and circles on a ground that is as textured as grains are.

Where grains are packed, and the sides of thick discs fill the gaps between them, few edges are left: less of an outline
then suffices, and more overlap of two outlines is allowed. That is safe where grains are plain, since nothing but
their rims has edges, and where their sizes are known from those that were found. In return every circle must be
brighter than the dark beside it by a part of what is usual: the texture of a ground has edges, but it is hardly
brighter. A dark disc is even, and stays where more of its outline is seen.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from ...experiment.pictures.image import Image
from ...solver.bodies.grains import Array
from ...solver.statistics.weighted import weighted_quantile
from ..correlation.noise import image_noise
from .appearance import INSIDE, appearance
from .circles.circle_measurement import CircleMeasurer
from .discs import OVERLAP
from .judge_circles import CLEAN_QUALITY, judge_circles
from .rings import find_circles, radius_steps

CLEAR = 0.55  # fraction of an outline that is seen of a circle that is certain
# Range of the relative light of plain grains, one standard deviation: measured .05 to .14 in discs of photoelastic
# tests and brown rods, .2 and more in painted ones.
PLAIN = 0.17
SIZES, SIZE_MARGIN = (0.05, 0.95), 0.1  # quantiles of the area of those that were found, and relative width beyond them
LEAST_RADIUS = 3.1  # [px]
# A grain is brighter than the dark beside it by this fraction of what is usual: the quantile over the area of circles.
LOW_STEP, USUAL = 0.25, 0.8
LEAST_STEP = 4.0  # standard deviations of the noise: circles in noise alone are brighter by 1.3 to 2.5
UNEVEN = 2.0  # half of the range of most of the light in a circle: less of a low step is texture
RAYS, DEPTHS, BESIDE = 48, (0.3, 0.5, 0.7, 0.8), 2.5  # around a circle; [radii] inside it; [px] outside of it
# Quantiles of the light: of a grain, the half of a plain one and the bright paint of a painted one; of the dark.
PLAIN_LIGHT, PAINTED_LIGHT, DARK, MOST = 0.5, 0.8, 0.1, (0.16, 0.84)


def find_faint_grains(
    image: Image, measurer: CircleMeasurer, table: Array, classes: tuple[float, ...], least: tuple[float, float]
) -> tuple[CircleMeasurer, Array]:
    """Add plain grains of which little is seen, and remove circles that are no brighter than what is beside them.

    Parameters
    ----------
    image : (H, W)
        The photograph [grey].
    measurer : CircleMeasurer
        Of this photograph.
    table : (c, 4)
        x, y, radius [px] and quality of the circles that were found.
    classes : tuple of float
        Known radii [px]; empty: those that were found.
    least : tuple of float
        Least slope along a ring of a candidate, and least quality of a grain that is not plain.

    Returns
    -------
    CircleMeasurer
        That of plain grains of these sizes, where they are plain.
    (d, 4) array
        The table that results.
    """
    if len(table) == 0:
        return measurer, table
    plain = _light_range(measurer.level, table) < PLAIN
    light = PLAIN_LIGHT if plain else PAINTED_LIGHT
    (step, spread), before = _steps(image, table, light), table
    if _usual(step, table) < LEAST_STEP * image_noise(image):
        return measurer, table
    if plain:
        sizes = np.array(sorted(set(classes))) if classes else radius_steps(_range_of_sizes(table))
        # Known sizes allow smaller tiles of local contrast, in which uneven light is even.
        measurer = CircleMeasurer(image, float(sizes.max()))
        measurer.plain = True
        rough = find_circles(image, sizes, min_score=least[0])
        table = judge_circles(measurer, rough, table, bool(classes), CLEAN_QUALITY * least[1], OVERLAP)
        step, spread = _steps(image, table, light)
    added = KDTree(before[:, :2]).query(table[:, :2])[0] > 0.0
    texture = (step < LOW_STEP * _usual(step, table)) & (added | (step <= UNEVEN * spread))
    return measurer, table[~texture | (table[:, 3] > CLEAR)]


def _range_of_sizes(table: Array) -> tuple[float, float]:
    """Return the range of radii [px] about those of most of the visible area."""
    weight = table[:, 3] * table[:, 2] ** 2
    smallest, largest = (weighted_quantile(table[:, 2], weight, part) for part in SIZES)
    return max((1.0 - SIZE_MARGIN) * smallest, LEAST_RADIUS), (1.0 + SIZE_MARGIN) * largest


def _light_range(level: Image, table: Array) -> float:
    """Return the standard deviation of the relative light within circles, the median over their visible area."""
    found = np.expm1(appearance(level, table[:, :3], INSIDE)[:, 1])
    whole = np.isfinite(found)
    weight = table[:, 3] * table[:, 2] ** 2
    return weighted_quantile(found[whole], weight[whole], 0.5) if whole.any() else np.inf


def _usual(step: Array, table: Array) -> float:
    seen = np.isfinite(step)
    return weighted_quantile(step[seen], table[seen, 2] ** 2, USUAL) if seen.any() else 0.0


def _steps(image: Image, table: Array, light: float) -> tuple[Array, Array]:
    """Return by how much circles are brighter than the dark beside them, and how much their light varies.

    light: quantile of the light within a circle. Both (c,) [grey], NaN where the photograph ends.
    """
    radius = table[:, 2]
    inside = np.concatenate([_around(image, table, depth * radius) for depth in DEPTHS], axis=1)
    outside = _around(image, table, radius + BESIDE)
    low, middle, high = _row_quantiles(inside, (MOST[0], light, MOST[1]))
    return middle - _row_quantiles(outside, (DARK,))[0], 0.5 * (high - low)


def _row_quantiles(values: Array, parts: tuple[float, ...]) -> Array:
    """Return quantiles (k, c) of the rows (c, p) without their NaN, the nearest of the values; NaN of nothing."""
    ordered = np.sort(values, axis=1)
    last = np.isfinite(values).sum(axis=1) - 1
    place = np.rint(np.outer(parts, np.maximum(last, 0))).astype(np.intp)
    return ordered[np.arange(len(values)), place]


def _around(image: Image, table: Array, reach: Array) -> Array:
    """Return the grey levels (c, RAYS) at distances `reach` (c,) [px] around circles; NaN beyond the photograph."""
    height, width = image.shape
    angle = np.linspace(0.0, 2.0 * np.pi, RAYS, endpoint=False)
    column = np.rint(table[:, :1] + reach[:, None] * np.cos(angle)).astype(np.intp)
    row = np.rint(table[:, 1:2] + reach[:, None] * np.sin(angle)).astype(np.intp)
    beyond: NDArray[np.bool_] = (column < 0) | (row < 0) | (column >= width) | (row >= height)
    return np.where(beyond, np.nan, image[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)])
