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
from numba import njit

from ...experiment.pictures.image import Image
from ...solver.bodies.grains import Array
from .rings import Circles, without_overlap

# Distances are measured on a photograph enlarged by this factor, unless it has more pixels than that, to save memory.
ENLARGED = 2
ENLARGED_PIXELS = 12_000_000

# Distances are measured pixel by pixel where those that may be centres of discs are fewer than this fraction of all:
# in the passes over the bright area that the found discs leave.
FEW_CENTRES = 0.01

FIRST_PLACES = 1 << 16  # highest distances that a first search has room for

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
    # Without a disc, distances to the dark take most of the time of the last pass over a photograph.
    centres = _possible_centres(bright, least)
    if not centres.any():
        return Discs(Circles(*np.empty((5, 0))), 0.0, 0.0, np.inf)
    distance = _distance_to_dark(bright, centres)
    # The distance between the centres of a pixel and the nearest dark one exceeds that to the edge by half a pixel.
    inner = (distance >= least + 0.5).view(np.uint8)
    row, column = _highest(distance, np.float32(least + 0.5))
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


def _possible_centres(bright: np.ndarray, radius: float) -> np.ndarray:
    """Mask of the pixels about which the largest square inside a disc of a radius lies in the bright area.

    It contains the centres of all such discs and is found quickly.
    """
    half = int(np.ceil((radius + 0.5) / np.sqrt(2.0))) - 1
    return cv2.erode(bright, np.ones((2 * half + 1, 2 * half + 1), np.uint8))


def _distance_to_dark(bright: np.ndarray, centres: np.ndarray) -> Image:
    """Distance of every bright pixel from the nearest dark one (H, W) [px]; where centres are few, of these alone."""
    if np.count_nonzero(centres) > FEW_CENTRES * centres.size:
        return np.asarray(cv2.distanceTransform(bright, cv2.DIST_L2, cv2.DIST_MASK_PRECISE), np.float32)
    distance = np.zeros(bright.shape, np.float32)
    measure_distances(bright, centres, np.empty(bright.shape, np.int32), distance)
    return distance


@njit(cache=True, nogil=True)
def measure_distances(bright, centres, vertical, distance):
    """Write the distance (H, W) [px] of the pixels in `centres` from the nearest dark one, infinite without any.

    vertical (H, W) is workspace: distances in every column.
    """
    rows, columns = bright.shape
    far = rows + columns
    for i in range(columns):
        vertical[0, i] = far if bright[0, i] else 0
    for j in range(1, rows):
        for i in range(columns):
            vertical[j, i] = min(vertical[j - 1, i] + 1, far) if bright[j, i] else 0
    for j in range(rows - 2, -1, -1):
        for i in range(columns):
            vertical[j, i] = min(vertical[j, i], vertical[j + 1, i] + 1)
    for j in range(rows):
        for i in range(columns):
            if not centres[j, i]:
                continue
            least = np.int64(vertical[j, i]) ** 2
            step = 1
            while step * step < least and (step <= i or i + step < columns):
                if step <= i:
                    least = min(least, np.int64(vertical[j, i - step]) ** 2 + step * step)
                if i + step < columns:
                    least = min(least, np.int64(vertical[j, i + step]) ** 2 + step * step)
                step += 1
            distance[j, i] = np.sqrt(np.float32(least)) if least < far * far else np.inf


def _highest(distance: Image, least: np.float32) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns, in this order, of the pixels that no neighbour exceeds, with at least a distance."""
    places = np.empty((FIRST_PLACES, 2), np.intp)
    while (count := find_highest(distance, least, places)) > len(places):
        places = np.empty((count, 2), np.intp)
    return places[:count, 0], places[:count, 1]


@njit(cache=True, nogil=True)
def find_highest(distance, least, places):
    """Write row and column of the pixels that no neighbour exceeds, as far as places (n, 2) suffices; count all."""
    rows, columns = distance.shape
    count = 0
    for j in range(rows):
        for i in range(columns):
            here = distance[j, i]
            if here < least or distance[j, max(i - 1, 0)] > here or distance[j, min(i + 1, columns - 1)] > here:
                continue
            highest = True
            for y in (max(j - 1, 0), min(j + 1, rows - 1)):
                for x in range(max(i - 1, 0), min(i + 2, columns)):
                    highest = highest and distance[y, x] <= here
            if highest:
                if count < len(places):
                    places[count, 0], places[count, 1] = j, i
                count += 1
    return count


def _full_disc(radius: float) -> np.ndarray:
    """Mask of the pixels within `radius` of the middle one."""
    reach = np.arange(-int(radius), int(radius) + 1)
    return (np.hypot(*np.meshgrid(reach, reach)) <= radius).astype(np.uint8)


def _enlarged(place: Array, factor: int) -> Array:
    return factor * (place + 0.5) - 0.5


def _paint_discs(mask: np.ndarray, x: Array, y: Array, radius: Array, value: int) -> None:
    table = np.rint(16.0 * np.stack([x, y, np.maximum(radius, 0.0)], axis=1)).astype(np.intp)
    for column, row, size in table.tolist():
        cv2.circle(mask, (column, row), size, value, -1, cv2.LINE_8, 4)
