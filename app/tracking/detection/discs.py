"""Bright discs where a photograph separates cleanly into bright grains and dark gaps.

Pixels brighter than halfway between the dark and the light about them are the grains'; a grain is the largest disc
that fits into the bright at its place, a local maximum of the distance to the dark. Texture and paint break the bright
up, and backing is of no shape: discs that hardly overlap then leave much of it uncovered, which tells that they are
not the grains.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from solver.bodies.grains import Array

from ...experiment.photographs import Image
from .rings import Circles, without_overlap

# Distances are measured on a photograph enlarged by this factor, unless it has more pixels than that: memory.
ENLARGED = 2
ENLARGED_PIXELS = 12_000_000

# Light above this share of the way from the dark to the bright is a grain's.
BRIGHT = 0.5
# Overlap of two discs as a share of the smaller radius: blurred contacts join grains, which widens the discs.
OVERLAP = 0.25
# Pixels about a grain that has been found [px] that may still be its blurred rim.
RIM = 0.7


@dataclass(frozen=True, slots=True)
class Discs:
    """What a photograph's bright consists of."""

    candidates: Circles  # the largest first
    area: float  # [px²] of the bright that is not narrower than the smallest disc looked for
    covered: float  # share of it that the discs cover
    spread: float  # of its light in the middle, between the twentieth parts at both ends: 0 is even, 1 full contrast


def find_discs(level: Image, found: Array, smallest: float) -> Discs:
    """Discs of at least `smallest` [px] radius in the bright of a photograph.

    level (H, W): 0 the local dark, 1 the local light; found: x, y, radius, … (c, 3 or more) [px], left out.
    """
    factor = ENLARGED if level.size <= ENLARGED_PIXELS else 1
    if factor > 1:
        level = np.asarray(cv2.resize(level, None, fx=factor, fy=factor, interpolation=cv2.INTER_CUBIC), np.float32)
    bright = (level > BRIGHT).astype(np.uint8)
    _paint_discs(
        bright, _enlarged(found[:, 0], factor), _enlarged(found[:, 1], factor), factor * (found[:, 2] + RIM), 0
    )
    # The distance from a pixel's centre to that of the nearest dark one is half a pixel more than that to the edge.
    distance = cv2.distanceTransform(bright, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    least = factor * smallest
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
    spread = float(np.ptp(np.percentile(middle, [5.0, 95.0]))) if len(middle) else np.inf
    wide = cv2.dilate(inner, _full_disc(least)) > 0
    area = int(np.count_nonzero(wide))
    _paint_discs(bright, column, row, radius, 2)
    covered = int(np.count_nonzero(wide & (bright == 2)))
    place = [(axis + 0.5) / factor - 0.5 for axis in (column, row)]
    candidates = Circles(place[0], place[1], radius / factor, np.ones(len(radius)))
    return Discs(candidates, area / factor**2, covered / max(area, 1), spread)


def _full_disc(radius: float) -> np.ndarray:
    """The pixels no farther than that from the middle one."""
    reach = np.arange(-int(radius), int(radius) + 1)
    return (np.hypot(*np.meshgrid(reach, reach)) <= radius).astype(np.uint8)


def _enlarged(place: Array, factor: int) -> Array:
    return factor * (place + 0.5) - 0.5


def _paint_discs(mask: np.ndarray, x: Array, y: Array, radius: Array, value: int) -> None:
    for one in zip(x, y, radius, strict=True):
        column, row, size = (round(16.0 * float(part)) for part in one)
        cv2.circle(mask, (column, row), max(size, 0), value, -1, cv2.LINE_8, 4)
