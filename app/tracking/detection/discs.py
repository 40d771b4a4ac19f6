"""Bright discs in a photograph that separates cleanly into bright grains and dark gaps.

Pixels brighter than the mean of the local dark and bright levels belong to grains. A grain is the largest disc that
fits into the bright area at its place, a local maximum of the distance to the dark. Texture and paint divide the bright
area, and a background has no shape: discs that hardly overlap then leave much of it uncovered, which shows that they
are not the grains.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ...experiment.pictures.image import Image
from ...solver.bodies.grains import Array
from .rings import Circles, without_overlap

# Distances are measured on a photograph enlarged by this factor, unless it has more pixels than that, to save memory.
ENLARGED = 2
ENLARGED_PIXELS = 12_000_000

# Relative light (0 dark, 1 bright) above which a pixel belongs to a grain.
BRIGHT = 0.5
# Greatest overlap of two discs, as a fraction of the smaller radius: blurred contacts join grains, which widens discs.
OVERLAP = 0.25
# Width of the blurred rim around a grain that has been found [px].
RIM = 0.7


@dataclass(frozen=True, slots=True)
class Discs:
    """The discs of a photograph's bright area."""

    candidates: Circles  # the largest first
    area: float  # [px²] of the bright area that is not narrower than the smallest disc searched for
    covered: float  # fraction of it that the discs cover
    light_range: float  # 5th to 95th percentile of its relative light: 0 is even, 1 full contrast


def find_discs(level: Image, found: Array, smallest: float) -> Discs:
    """Find discs in the bright area of a photograph.

    Parameters
    ----------
    level : (H, W) array
        Relative light: 0 at the local dark, 1 at the local bright level.
    found : (c, 3 or more) array
        x, y, radius, … of discs that are excluded [px].
    smallest : float
        Least radius [px].
    """
    factor = ENLARGED if level.size <= ENLARGED_PIXELS else 1
    if factor > 1:
        level = np.asarray(cv2.resize(level, None, fx=factor, fy=factor, interpolation=cv2.INTER_CUBIC), np.float32)
    bright = (level > BRIGHT).astype(np.uint8)
    _paint_discs(
        bright, _enlarged(found[:, 0], factor), _enlarged(found[:, 1], factor), factor * (found[:, 2] + RIM), 0
    )
    least = factor * smallest
    if not _may_hold_disc(bright, least):
        return Discs(Circles(*np.empty((5, 0))), 0.0, 0.0, np.inf)
    # The distance between the centres of a pixel and the nearest dark one exceeds that to the edge by half a pixel.
    distance = cv2.distanceTransform(bright, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    inner = (distance >= least + 0.5).view(np.uint8)
    highest = cv2.compare(distance, cv2.dilate(distance, np.ones((3, 3), np.uint8)), cv2.CMP_EQ)
    peak = cv2.bitwise_and(highest, inner)
    peaks = np.asarray(cv2.findNonZero(peak) if peak.any() else [], np.int64).reshape(-1, 2)
    column, row = peaks[:, 0], peaks[:, 1]
    radius = distance[row, column].astype(np.float64) - 0.5
    order = np.argsort(-radius, kind="stable")
    column, row, radius = column[order].astype(np.float64), row[order].astype(np.float64), radius[order]
    kept = without_overlap(column, row, radius, allowed=OVERLAP)
    column, row, radius = column[kept], row[kept], radius[kept]
    middle = level[::factor, ::factor][inner[::factor, ::factor] > 0]  # the other pixels were interpolated
    light_range = float(np.ptp(np.percentile(middle, [5.0, 95.0]))) if len(middle) else np.inf
    wide = cv2.dilate(inner, _full_disc(least)) > 0
    area = int(np.count_nonzero(wide))
    _paint_discs(bright, column, row, radius, 2)
    covered = int(np.count_nonzero(wide & (bright == 2)))
    place = [(axis + 0.5) / factor - 0.5 for axis in (column, row)]
    candidates = Circles(place[0], place[1], radius / factor, *np.ones((2, len(radius))))
    return Discs(candidates, area / factor**2, covered / max(area, 1), light_range)


def _may_hold_disc(bright: np.ndarray, radius: float) -> bool:
    """Whether a disc may fit into the bright area: whether the largest square inside such a disc does, which is quick.

    Without a disc, distances to the dark take most of the time of the last pass over a photograph.
    """
    half = int(np.ceil((radius + 0.5) / np.sqrt(2.0))) - 1
    square = np.ones((2 * half + 1, 2 * half + 1), np.uint8)
    return bool(cv2.erode(bright, square).any())


def _full_disc(radius: float) -> np.ndarray:
    """Mask of the pixels within `radius` of the middle one."""
    reach = np.arange(-int(radius), int(radius) + 1)
    return (np.hypot(*np.meshgrid(reach, reach)) <= radius).astype(np.uint8)


def _enlarged(place: Array, factor: int) -> Array:
    return factor * (place + 0.5) - 0.5


def _paint_discs(mask: np.ndarray, x: Array, y: Array, radius: Array, value: int) -> None:
    for one in zip(x, y, radius, strict=True):
        column, row, size = (round(16.0 * float(part)) for part in one)
        cv2.circle(mask, (column, row), max(size, 0), value, -1, cv2.LINE_8, 4)
